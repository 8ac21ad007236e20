"""Write reports/touch: Table I and Table II beside the published numbers, training, figures and findings."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.base import files, paths
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.reporting import experiment, sentences, touch_ablation, touch_captions
from pipeline.reporting.claims import sentences_of
from pipeline.reporting.figures import touch as touch_figures
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, literal, number, table
from pipeline.scoring import ablation, metrics
from pipeline.scoring.published import PRINTED, rmse, time_ms
from pipeline.scoring.results import Estimate, Fit, Scores, read_fit, read_predictions

METRICS = {  # metric: header, digits
    "peak_error": ("Peak error (mean, kPa, lower is better)", 2),
    "location_error": ("Location error (mean, mm, lower is better)", 2),
    "touches_found": ("Touches found (share of windows, higher is better)", 3),
    "force_error": ("Force error (mean, N, lower is better)", 2),
    "force_rmse": ("Force RMSE (N of the load cell, lower is better)", 2),
    "force_r2": ("Force R2 (share of variance, higher is better)", 3),
    "r2": ("R2 (share of variance, higher is better)", 3),
}
UNITS = {
    "rmse": "kPa",
    "peak_error": "kPa",
    "location_error": "mm",
    "touches_found": "1",
    "force_error": "N",
    "force_rmse": "N",
    "force_r2": "1",
    "r2": "1",
}
TABLE_CONDITIONS = ("single", "double")
CONVENTIONAL = ("linear", "poly", "tree")

SCENE = (
    "The film was fitted to recordings (reports/twins); tips, contact, motions and rates are plain numbers, chosen "
    "before any model was trained."
)


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `touch`; see `experiment`."""
    accuracy = target / "accuracy"
    scores, latency, table, protocol, seed = experiment.read(workspace, "touch", settings)
    windows = touch_figures.windows_of(table, settings, protocol, seed)
    present = set(windows.condition)
    known = ("single", "double", "three", "slide", "tape")
    conditions = [name for name in known if name in present] + sorted(present - set(known))
    fits = {
        (model, name): [read_fit(workspace, "touch", model, name, run_seed) for run_seed in block["seeds"]]
        for model in settings["models"]
        for name, block in settings["protocols"].items()
    }
    maps = {
        model: read_predictions(workspace, "touch", model, protocol, seed, table)[windows.rows].reshape(
            windows.truth.shape
        )
        for model in settings["models"]
    }
    frames_path = paths.require(workspace.frames("touch"), "python -m pipeline.stages.ingest touch")
    frames = schemas.read(frames_path, columns=["condition", "v", "force_n", "x_mm", "y_mm"])

    files.write_table(accuracy / "table1.csv", score_table(scores, settings, conditions))
    files.write_text(accuracy / "table1.md", table_one(scores, settings, conditions))
    both = [name for name in TABLE_CONDITIONS if name in conditions]
    ablated = touch_ablation.text(ablation.read(workspace, "touch"), scores, settings, both)
    files.write_text(accuracy / "ablation.md", ablated)

    learned = {model: fits[model, protocol] for model in settings["models"]}
    captions = draw(accuracy, settings, windows, maps, frames, learned)
    last = schemas.matrix(table["x"])[:, -settings["sensor"]["rows"] * settings["sensor"]["cols"] :].astype(float)
    part = schemas.names(table[schemas.split_column(protocol, seed)])
    share = unseen_products(last, part, schemas.names(table["condition"]), settings["sensor"])
    trained = [fit for runs in fits.values() for fit in runs if fit.stop_reason != "closed_form"]
    files.write_text(
        accuracy / "README.md", findings(workspace, scores, settings, conditions, trained, share, captions)
    )

    panels = {f"{name} touch": (protocol, name) for name in TABLE_CONDITIONS if name in conditions}
    end = published_times(latency, settings)
    experiment.write_speed(workspace, target, settings, scores, latency, panels, ("rmse", "RMSE (kPa)"), end=end)


def draw(
    folder: Path,
    settings: Mapping,
    windows: touch_figures.Windows,
    maps: Mapping[str, np.ndarray],
    frames: pa.Table,
    fits: Mapping[str, list[Fit]],
) -> dict[str, str]:
    """Draw the figures of one run, and return name of the file without .png -> caption.

    windows: its test part; maps: model -> (n, map_rows, map_cols) in kPa; fits: model -> one fit per seed.
    """
    present, run = set(windows.condition), (windows, maps, settings)
    curve = touch_figures.characteristic_curve(folder / "figure2b.png", settings)
    captions = {
        "figure2b": touch_captions.characteristic_curve(*curve),
        "figure4": touch_captions.peak_pressure(touch_figures.peak_pressure(folder / "figure4.png", *run)),
    }
    places = touch_figures.press_location(folder / "figure5.png", frames, settings)
    captions["figure5"] = touch_captions.press_location(*places)
    if "double" in present:
        captions["figure6"] = touch_captions.double_touch(*touch_figures.double_touch(folder / "figure6.png", *run))
    medians = touch_figures.error_distribution(folder / "figure7.png", *run)
    captions["figure7"] = touch_captions.error_distribution(medians)
    if present & set(touch_figures.SEVERAL_TOUCHES):
        captions["figure8"] = touch_captions.pressure_maps(touch_figures.pressure_maps(folder / "figure8.png", *run))
    touch_figures.learning_curves(folder / "learning_curves.png", fits, next(iter(settings["protocols"])))
    return captions | {"learning_curves": sentences.learning_caption(fits, "kPa²")}


def score_table(scores: Scores, settings: Mapping, conditions: Sequence[str]) -> pd.DataFrame:
    """Return table1.csv: one row per protocol, condition, model and metric, in full precision."""
    return experiment.score_table(
        scores,
        product(settings["protocols"], conditions, settings["models"], UNITS),
        UNITS,
        lambda model, condition, metric: rmse(model, condition) if metric == "rmse" else np.nan,
    )


def table_one(scores: Scores, settings: Mapping, conditions: Sequence[str]) -> str:
    """Write table1.md: RMSE beside the published one, then the further metrics, for every protocol."""
    both = [name for name in TABLE_CONDITIONS if name in conditions]
    others = [name for name in conditions if name not in both]
    text = ["# Table I: accuracy\n"]
    text.append(
        f"Ours: mean [95 % t interval] over seeds, {sentences.replicates(settings, 'array')}. "
        "Published: the paper's one number. The models are fitted to single touches only.\n"
    )
    text.append(
        f"The further metrics look at windows with a touch of {metrics.touch_threshold_kpa(settings):.0f} kPa or more; "
        "a window of k touches is compared with the k highest peaks of the whole predicted map. Place and pressure are "
        "those of the peaks; touches are found where the map has as many peaks as touches, each within one element of "
        "its touch; force error is that of the map's integral over its area. Force RMSE and R2 compare this integral, "
        "times one factor per run fitted on the training part, with the force that the load cells measured.\n"
    )
    for protocol, block in settings["protocols"].items():
        n = len(block["seeds"])
        text.append(f"## Split `{protocol}`, {n} {'seed' if n == 1 else 'seeds'}\n")
        text.append(_protocol_note(protocol, n, settings))
        header = ["Model", "Frames it sees"]
        for condition in both:
            header += [f"{condition}: published RMSE (kPa)", f"{condition}: our mean RMSE (kPa), n = {n}"]
        rows = []
        for model in settings["models"]:
            row = [model_name(model), str(touch_ablation.frames_seen(model, settings)) if model != "constant" else "-"]
            for condition in both:
                row.append(number(rmse(model, condition)))
                row.append(interval(scores.estimate(protocol, condition, model, "rmse")))
            rows.append(row)
        text.append("RMSE over all cells and windows (kPa, lower is better):\n")
        text.append(table(header, rows))
        for condition in both:
            text.append(f"Further metrics, {condition} touch:\n")
            text.append(_further(scores, settings, protocol, condition))
        if others:
            text.append("RMSE of the demonstrations, which the paper shows without numbers (kPa, lower is better):\n")
            rows = [
                [
                    model_name(model),
                    *(interval(scores.estimate(protocol, name, model, "rmse")) for name in others),
                ]
                for model in settings["models"]
            ]
            text.append(table(["Model", *map(literal, others)], rows))
    absent = [name for name in TABLE_CONDITIONS if name not in conditions]
    if absent:
        text.append(f"There are no recordings of: {', '.join(absent)} touch.\n")
    return "\n".join(text)


def _further(scores: Scores, settings: Mapping, protocol: str, condition: str) -> str:
    rows = [
        [
            model_name(model),
            *(interval(scores.estimate(protocol, condition, model, name), d) for name, (_, d) in METRICS.items()),
        ]
        for model in settings["models"]
    ]
    return table(["Model", *(header for header, _ in METRICS.values())], rows)


def _protocol_note(protocol: str, n: int, settings: Mapping) -> str:
    window = settings["window"]
    share = f"{100 * window['sliding']['single']:g} % of these windows are used, in stretches that overlap."
    notes = {
        "press": "Use these numbers: no press has windows on two sides of the split. Windows start every "
        f"{window['stride']} frames.",
        "random_window": "The paper's protocol: windows slide frame by frame and are divided at random, so nearly "
        f"every test window holds frames that were trained on, which flatters every model that can remember. {share}",
    }
    note = notes.get(protocol, "")
    return f"{note} One seed has no interval.\n" if n == 1 else f"{note}\n"


def findings(
    workspace: Workspace,
    scores: Scores,
    settings: Mapping,
    conditions: Sequence[str],
    trained: Sequence[Fit],
    share: Mapping[str, float],
    captions: Mapping[str, str],
) -> str:
    """Write README.md: what the numbers say, in sentences that are computed from them.

    share: condition -> share of test windows, see `unseen_products`; captions: of the figures, name of the file without
    .png -> text.
    """
    protocol = next(iter(settings["protocols"]))
    seeds = settings["protocols"][protocol]["seeds"]
    errors = {
        condition: {model: scores.estimate(protocol, condition, model, "rmse") for model in settings["models"]}
        for condition in TABLE_CONDITIONS
        if condition in conditions
    }
    lines = [
        "# LoMP (touch): results\n",
        f"RMSE in kPa on test data, `{protocol}` split, mean over {len(seeds)} seeds [95 % t interval]. "
        "[Table I](table1.md), [what messages and frames are worth](ablation.md), "
        "[speed](../speed/table2.md).\n",
        "## Findings\n",
    ]
    for condition in TABLE_CONDITIONS:
        if condition in errors:
            lines += best_sentences(condition, errors[condition])
        else:
            lines.append(f"- There are no recordings of {condition} touch.")
    if "double" in errors and "lomp" in settings["models"]:
        lines.append(double_sentence(errors["double"]))
        lines += sentences_of(workspace, "touch", settings)("lomp-best-double")
    if {"lomp", "lomp_stream"} <= set(settings["models"]):
        lines.append(stream_sentence(errors))
    if "constant" in settings["models"]:
        lines += [floor_sentence(condition, by_model) for condition, by_model in errors.items()]
    if "double" in errors:
        lines.append(
            f"- In {100 * share['double']:.0f} % of double-touch windows (single-touch test windows: "
            f"{100 * share['single']:.0f} %) two elements that are not neighbours respond together as they never "
            "did in training: a model that multiplies elements, like the polynomial of the whole array, "
            "has weights there that no training window determined."
        )
    lines += optimism_sentences(scores, settings, protocol)
    lines.append(sentences.yardstick(scores, settings, SCENE, other_ratios(settings)))
    lines.append(f"- {sentences.stops(trained)}")
    lines.append("\n## Figures\n")
    lines += sentences.figure_lines(captions)
    lines.append(f"\nFigures 4 and 6 to 8 show the run `{protocol}`, seed {seeds[0]}.")
    lines += sentences.differences_section(experiment.experiment_differences(workspace, "touch", settings))
    return "\n".join(lines) + "\n"


def unseen_products(counts: np.ndarray, part: np.ndarray, condition: np.ndarray, sensor: Mapping) -> dict[str, float]:
    """Return the share of test windows, by condition, with a product of two far elements outside its training range.

    counts: (n, elements) of the last frame; part, condition: (n,). The products are of values standardised on the
    training part; far elements are not neighbours, not even over a corner.
    """
    train = part == "train"
    spread = np.maximum(counts[train].std(axis=0), 1)
    scaled = (counts - counts[train].mean(axis=0)) / spread
    row, col = np.divmod(np.arange(sensor["rows"] * sensor["cols"]), sensor["cols"])
    away = np.maximum(np.abs(row[:, None] - row), np.abs(col[:, None] - col))
    first, second = np.nonzero(np.triu(away > 1))
    products = scaled[:, first] * scaled[:, second]
    low, high = products[train].min(axis=0, initial=np.inf), products[train].max(axis=0, initial=-np.inf)
    outside = ((products < low) | (products > high)).any(axis=1)
    return {name: float(outside[(condition == name) & (part == "test")].mean()) for name in np.unique(condition)}


def best_sentences(condition: str, errors: Mapping[str, Estimate]) -> list[str]:
    """Return which model is best; LoMP beside it."""
    order = sentences.usable(errors)
    if not order:
        return [f"- {condition.capitalize()} touch: every model has a failed run."]
    best = order[0]
    close = [model_name(m) for m in order[1:] if sentences.overlap(errors[best], errors[m])]
    lines = [
        f"- {condition.capitalize()} touch: {model_name(best)} is best with {interval(errors[best])} kPa"
        + (f"; the interval overlaps that of {', '.join(close)}." if close else ".")
    ]
    if failed := [model_name(m) for m, error in errors.items() if error.failed]:
        lines.append(f"- {condition.capitalize()} touch: runs failed for {', '.join(failed)}.")
    if condition == "single" and "lomp" in order:
        ratio = errors["lomp"].mean / errors[best].mean
        paper = {model: rmse(model, "single") for model in PRINTED["lomp"]}
        lowest = min(paper, key=paper.get)
        lines.append(
            f"- Single touch: LoMP has {interval(errors['lomp'])} kPa, {ratio:.2f} times the best model's "
            f"RMSE; in the paper {paper['lomp'] / paper[lowest]:.2f} times (best: {model_name(lowest)})."
        )
    return lines


def double_sentence(errors: Mapping[str, Estimate]) -> str:
    """Return LoMP's error on double touch beside that of the next of the paper's models."""
    lomp = errors["lomp"]
    if lomp.failed:
        return f"- Double touch: LoMP {interval(lomp)}."
    ours = f"- Double touch: LoMP has {interval(lomp)} kPa"
    others = [model for model in sentences.usable(errors) if model in PRINTED["lomp"] and model != "lomp"]
    if not others:
        return f"{ours}; no other model of the paper is without a failed run."
    best = others[0]
    paper = {model: rmse(model, "double") for model in PRINTED["lomp"]}
    runner_up = min((model for model in paper if model != "lomp"), key=paper.get)
    return (
        f"{ours}, the best other model of the paper, {model_name(best)}, {interval(errors[best])} kPa, "
        f"{errors[best].mean / lomp.mean:.2f} times as much; in the paper {paper[runner_up] / paper['lomp']:.2f} times "
        f"({model_name(runner_up)})."
    )


def stream_sentence(errors: Mapping[str, Mapping[str, Estimate]]) -> str:
    """Return what LoMP loses where it sees one frame at a time; errors: condition -> model -> error."""
    parts = []
    for condition, by_model in errors.items():
        stream, windows = by_model["lomp_stream"], by_model["lomp"]
        times = f" ({stream.mean / windows.mean:.2f} times LoMP's)" if not (stream.failed or windows.failed) else ""
        parts.append(f"{condition} touch {interval(stream)} kPa{times}")
    return (
        f"- LoMP streaming (half the width, one frame at a time, its state kept during a press) has {'; '.join(parts)}."
    )


def floor_sentence(condition: str, errors: Mapping[str, Estimate]) -> str:
    """Return which models are no better than the mean map of the training data."""
    floor = errors["constant"].mean
    worse = [model_name(m) for m, error in errors.items() if m != "constant" and not error.mean < floor]
    text = f"- {condition.capitalize()} touch: a constant map has {number(floor)} kPa; "
    return text + (f"no better than that: {', '.join(worse)}." if worse else "every model is better.")


def other_ratios(settings: Mapping) -> dict[str, tuple[Mapping, float]]:
    """Return the ratios of other regressions to the yardstick's, as `sentences.yardstick` takes them."""
    chosen = settings["yardstick"]
    over, condition = chosen["over"], chosen["condition"]
    return {
        f"{model_name(model)} over {model_name(over)}": (
            chosen | {"model": model},
            rmse(model, condition) / rmse(over, condition),
        )
        for model in CONVENTIONAL
        if model not in (over, chosen["model"])
    }


def optimism_sentences(scores: Scores, settings: Mapping, protocol: str) -> list[str]:
    """Return how much lower the single-touch RMSE looks where test windows overlap with those trained on."""
    lines = []
    for other in settings["protocols"]:
        if other == protocol:
            continue
        ratios = {}
        for model in settings["models"]:
            ours, theirs = (scores.estimate(name, "single", model, "rmse") for name in (protocol, other))
            if model != "constant" and not ours.failed and not theirs.failed and theirs.mean > 0:
                ratios[model] = ours.mean / theirs.mean
        if ratios:
            least, most = min(ratios, key=ratios.get), max(ratios, key=ratios.get)
            lines.append(
                f"- Single touch: the RMSE of the `{protocol}` split is {ratios[least]:.2f} "
                f"({model_name(least)}) to {ratios[most]:.2f} ({model_name(most)}) times that of "
                f"the `{other}` split, whose test windows overlap with those trained on."
            )
    return lines


def published_times(latency: Mapping[tuple[str, int], Mapping], settings: Mapping) -> str:
    """Write Table II: the published times beside ours, both also as multiples of the linear model's."""
    batch = settings["latency"]["batches"][0]
    paper = {m: time_ms(m) for m in settings["models"]}
    ours = {m: latency[m, batch]["p50_ms"] for m in paper}
    rows = [
        [
            model_name(model),
            number(value),
            f"{ours[model]:.3f}",
            number(value / time_ms("linear")),
            number(ours[model] / ours.get("linear", np.nan)),
        ]
        for model, value in paper.items()
        if not np.isnan(value)
    ]
    header = ["Model", "published, GTX 1070 (ms)", f"ours, batch {batch} (ms)"]
    return "\n".join(
        [
            "\n## Table II of the paper: time of a prediction\n",
            "The published times were taken on a GPU and do not compare with ours in absolute terms, so each is also "
            "given as a multiple of the linear model's.\n",
            table([*header, "published / linear", "ours / linear"], rows),
        ]
    )
