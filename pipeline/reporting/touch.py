"""What reports/touch says: Table I and Table II beside the published numbers, training, and findings."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.reporting import sentences
from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import interval, literal, number, size, table
from pipeline.scoring.results import Estimate, Fit, Scores, published

# Models as the paper prints them; a model that is not listed has no published number.
PRINTED = {
    "linear": "Linear Regression",
    "poly": "Polynomial Regression",
    "tree": "Decision Tree Regression",
    "rbf": "RBF-Net",
    "cnn": "CNN",
    "vgg": "VGG-16",
    "convlstm": "ConvLSTM",
    "rnn": "RNN",
    "lomp": "LoMP",
}
METRICS = {  # metric: header, digits
    "peak_error": ("Peak error (mean, kPa, lower is better)", 2),
    "location_error": ("Location error (mean, mm, lower is better)", 2),
    "touches_found": ("Touches found (share of windows, higher is better)", 3),
    "r2": ("R2 (share of variance, higher is better)", 3),
}
UNITS = {"rmse": "kPa", "peak_error": "kPa", "location_error": "mm", "touches_found": "1", "r2": "1"}
TABLE_CONDITIONS = ("single", "double")


def published_value(model: str, condition: str) -> float:
    """The paper's number for a model of ours, NaN if it has none."""
    return published().get((PRINTED.get(model, ""), condition), np.nan)


def score_table(scores: Scores, settings: Mapping, conditions: Sequence[str]) -> pd.DataFrame:
    """table1.csv: a row for every protocol, condition, model and metric, in full precision."""
    rows = []
    for protocol in settings["protocols"]:
        for condition in conditions:
            for model in settings["models"]:
                for metric, unit in UNITS.items():
                    found = scores.estimate(protocol, condition, model, metric)
                    paper = published_value(model, f"{condition} touch") if metric == "rmse" else np.nan
                    rows.append((protocol, condition, model, metric, unit, paper, *found))
    names = [
        "protocol",
        "condition",
        "model",
        "metric",
        "unit",
        "published",
        "mean",
        "low",
        "high",
        "runs",
        "failed",
    ]
    return pd.DataFrame(rows, columns=names)


def table_one(scores: Scores, settings: Mapping, conditions: Sequence[str]) -> str:
    """table1.md: RMSE beside the published one, then the further metrics, for every protocol."""
    both = [name for name in TABLE_CONDITIONS if name in conditions]
    others = [name for name in conditions if name not in both]
    text = ["# Table I: accuracy\n"]
    text.append(
        "Ours: mean [95 % t interval] over seeds, each of which draws another split and another start. "
        "Published: the paper's one number. The models are fitted to single touches only.\n"
    )
    for protocol, block in settings["protocols"].items():
        n = len(block["seeds"])
        text.append(f"## Split `{protocol}`, {n} {'seed' if n == 1 else 'seeds'}\n")
        text.append(_protocol_note(protocol, n))
        header = ["Model"]
        for condition in both:
            header += [f"{condition}: published RMSE (kPa)", f"{condition}: our mean RMSE (kPa), n = {n}"]
        rows = []
        for model in settings["models"]:
            row = [model_name(model)]
            for condition in both:
                row.append(number(published_value(model, f"{condition} touch")))
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


def _protocol_note(protocol: str, n: int) -> str:
    notes = {
        "press": "No press has windows on two sides of the split. These are the numbers to believe.",
        "random_window": "As the paper seems to have done it: windows of one press fall on all sides, which "
        "flatters every model that can remember.",
    }
    note = notes.get(protocol, "")
    return f"{note} One seed has no interval.\n" if n == 1 else f"{note}\n"


def training(fits: Mapping[tuple[str, str], list[Fit]], settings: Mapping) -> str:
    """training.md: how every fit ended; fits: (model, protocol) -> a fit a seed."""
    trained = [fit for runs in fits.values() for fit in runs if fit.stop_reason != "closed_form"]
    rows = []
    for (model, protocol), runs in fits.items():
        epochs, best, reasons = ("-", "-", "closed form")
        if any(fit.stop_reason != "closed_form" for fit in runs):
            epochs = ", ".join(str(fit.epochs) for fit in runs)
            best = ", ".join(str(fit.best_epoch) for fit in runs)
            reasons = ", ".join(fit.stop_reason for fit in runs)
        sizes = sorted({fit.parameters for fit in runs})
        shown = size(sizes[0]) if len(sizes) == 1 else f"{size(sizes[0])} to {size(sizes[-1])}"
        rows.append([model_name(model), protocol, shown, epochs, best, reasons])
    limits = ", ".join(
        f"{model_name(model)} {block['training']['max_epochs']}"
        for model, block in settings["models"].items()
        if isinstance(block, Mapping) and "training" in block
    )
    return "\n".join(
        [
            "# Training\n",
            sentences.stops(trained) + "\n",
            f"Most epochs allowed: {limits or 'no model is trained in epochs'}. The weights of the best "
            "epoch (lowest validation loss) are kept. Lists are in the order of the seeds.\n",
            table(["Model", "Split", "Parameters", "Epochs run", "Best epoch", "Stopped by"], rows),
        ]
    )


def findings(
    scores: Scores,
    settings: Mapping,
    conditions: Sequence[str],
    trained: Sequence[Fit],
    differences: Sequence[tuple[str, str]],
    unseen: Mapping[str, float],
) -> str:
    """README.md: what the numbers say, in sentences that are computed from them; unseen: see unseen_products."""
    protocol = next(iter(settings["protocols"]))
    seeds = len(settings["protocols"][protocol]["seeds"])
    by_condition = {
        condition: {m: scores.estimate(protocol, condition, m, "rmse") for m in settings["models"]}
        for condition in conditions
    }
    lines = [
        "# LoMP (touch): results\n",
        f"RMSE in kPa on test data, `{protocol}` split, mean over {seeds} seeds [95 % t interval]. "
        "[Table I](table1.md), [training](training.md), [speed](../speed/table2.md).\n",
        "## Findings\n",
    ]
    for condition in TABLE_CONDITIONS:
        if condition in by_condition:
            lines += best_sentences(condition, by_condition[condition])
        else:
            lines.append(f"- There are no recordings of {condition} touch.")
    if "double" in by_condition and "lomp" in by_condition["double"]:
        lines.append(double_sentence(by_condition["double"]))
    streamed = {name: by_condition[name] for name in TABLE_CONDITIONS if name in by_condition}
    if all({"lomp", "lomp_stream"} <= set(own) for own in streamed.values()):
        lines.append(stream_sentence(streamed))
    if "constant" in settings["models"]:
        lines += [floor_sentence(name, found) for name, found in by_condition.items() if name in TABLE_CONDITIONS]
    if "double" in unseen:
        lines.append(
            f"- In {100 * unseen['double']:.0f} % of double-touch windows (single-touch test windows: "
            f"{100 * unseen['single']:.0f} %) two elements that are not neighbours respond together as they never "
            "did in training: a model that multiplies elements, like the polynomial, has weights there that no "
            "training window determined."
        )
    lines += optimism_sentences(scores, settings, protocol)
    chosen = settings["yardstick"]
    what = f"{chosen['condition']} touch, {chosen['metric']}"
    lines.append(sentences.yardstick(scores, settings, (protocol, chosen["condition"]), what, "kPa"))
    lines.append(f"- {sentences.stops(trained)}")
    lines.append("\n## Figures\n")
    captions = {
        "figure2b": "characteristic curve of the fitted film",
        "figure4": "peak pressure over single-touch test windows",
        "figure5": "counts and pressure for press locations within one element (3 mm apart at the default "
        "grid; the paper says 2.875 mm, a quarter of the element instead of the pitch)",
        "figure6": "double touch over time",
        "figure7": "error with one touch" + (" and with two" if "double" in conditions else ""),
        "figure8": "pressure maps",
        "learning_curves": "loss over epochs",
    }
    absent = {"figure6"} if "double" not in conditions else set()
    absent |= {"figure8"} if list(conditions) == ["single"] else set()
    lines += [f"- [{name}.png]({name}.png): {text}" for name, text in captions.items() if name not in absent]
    lines.append(
        f"\nFigures 4 and 6 to 8 show the run `{protocol}`, seed {settings['protocols'][protocol]['seeds'][0]}."
    )
    lines += sentences.differences_section(differences)
    return "\n".join(lines) + "\n"


def unseen_products(counts: np.ndarray, part: np.ndarray, condition: np.ndarray, sensor: Mapping) -> dict[str, float]:
    """Share of the test windows of each condition with a product of two far elements outside its training range.

    counts: (n, elements) of the last frame; part, condition: (n,). The products are of values standardised on
    the training part; far elements are not neighbours, not even over a corner.
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


def _usable(found: Mapping[str, Estimate]) -> list[str]:
    """Models without a failed run, the lowest mean first."""
    return sorted((m for m, e in found.items() if e.runs and not e.failed), key=lambda m: found[m].mean)


def _overlap(better: Estimate, worse: Estimate) -> bool:
    """Whether the intervals of two models overlap; without intervals (one run) nothing is known: False."""
    return better.runs > 1 and worse.runs > 1 and better.high >= worse.low


def best_sentences(condition: str, found: Mapping[str, Estimate]) -> list[str]:
    """Which model is best; LoMP beside it."""
    order = _usable(found)
    if not order:
        return [f"- {condition.capitalize()} touch: every model has a failed run."]
    best = order[0]
    close = [model_name(m) for m in order[1:] if _overlap(found[best], found[m])]
    lines = [
        f"- {condition.capitalize()} touch: {model_name(best)} is best with {interval(found[best])} kPa"
        + (f"; the interval overlaps that of {', '.join(close)}." if close else ".")
    ]
    if failed := [model_name(m) for m, e in found.items() if e.failed]:
        lines.append(f"- {condition.capitalize()} touch: runs failed for {', '.join(failed)}.")
    if condition == "single" and "lomp" in order:
        ratio = found["lomp"].mean / found[best].mean
        paper = {m: published_value(m, "single touch") for m in PRINTED}
        lowest = min(paper, key=lambda m: paper[m])
        lines.append(
            f"- Single touch: LoMP has {interval(found['lomp'])} kPa, {ratio:.2f} times the best model's "
            f"RMSE; in the paper {paper['lomp'] / paper[lowest]:.2f} times (best: {model_name(lowest)})."
        )
    return lines


def double_sentence(found: Mapping[str, Estimate]) -> str:
    """Whether double touch comes out in LoMP's favour among the paper's models, plainly."""
    order = [model for model in _usable(found) if model in PRINTED]
    lomp = found["lomp"]
    if lomp.failed:
        return f"- Double touch does NOT come out in LoMP's favour: LoMP {interval(lomp)}."
    better = [m for m in order if m != "lomp" and found[m].mean <= lomp.mean]
    ours = f"{interval(lomp)} kPa"
    if better:
        named = ", ".join(f"{model_name(m)} ({interval(found[m])})" for m in better)
        return f"- Double touch does NOT come out in LoMP's favour here: LoMP has {ours}; as good or better: {named}."
    others = [m for m in order if m != "lomp"]
    if not others:
        return f"- Double touch: LoMP has {ours}; no other model is without a failed run."
    second = others[0]
    paper = {m: published_value(m, "double touch") for m in PRINTED}
    runner_up = min((m for m in paper if m != "lomp"), key=lambda m: paper[m])
    apart = " The two intervals overlap, so this is not certain." if _overlap(lomp, found[second]) else ""
    return (
        f"- Double touch comes out in LoMP's favour: LoMP has {ours}, the next model, {model_name(second)}, "
        f"{found[second].mean / lomp.mean:.2f} times as much; in the paper "
        f"{paper[runner_up] / paper['lomp']:.2f} times ({model_name(runner_up)}).{apart}"
    )


def stream_sentence(found: Mapping[str, Mapping[str, Estimate]]) -> str:
    """What LoMP loses where it sees a frame at a time; found: condition -> model -> error."""
    parts = []
    for condition, own in found.items():
        stream, windows = own["lomp_stream"], own["lomp"]
        times = f" ({stream.mean / windows.mean:.2f} times LoMP's)" if not (stream.failed or windows.failed) else ""
        parts.append(f"{condition} touch {interval(stream)} kPa{times}")
    return f"- A frame at a time, its state carried through a press, LoMP of half the width has: {'; '.join(parts)}."


def floor_sentence(condition: str, found: Mapping[str, Estimate]) -> str:
    """Which models are no better than the mean map of the training data."""
    floor = found["constant"].mean
    worse = [model_name(m) for m, e in found.items() if m != "constant" and not e.mean < floor]
    text = f"- {condition.capitalize()} touch: a constant map has {number(floor)} kPa; "
    return text + (f"no better than that: {', '.join(worse)}." if worse else "every model is better.")


def optimism_sentences(scores: Scores, settings: Mapping, protocol: str) -> list[str]:
    """How much lower the single-touch RMSE looks when windows of one press are on both sides."""
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
                f"the `{other}` split."
            )
    return lines


def published_times(latency: Mapping[tuple[str, int], Mapping], settings: Mapping) -> str:
    """Table II: the published times beside ours, both also as multiples of the linear model's."""
    batch, condition = settings["latency"]["batches"][0], "single touch (GTX 1070)"
    paper = {m: published_value(m, condition) for m in settings["models"]}
    ours = {m: latency[m, batch]["p50_ms"] for m in paper}
    rows = [
        [
            model_name(model),
            number(value),
            f"{ours[model]:.3f}",
            number(value / published_value("linear", condition)),
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
