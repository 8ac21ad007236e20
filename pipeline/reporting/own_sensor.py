"""Write the report of a sensor of your own: what its logs hold, what models score on them, and two figures.

Nothing here is of a paper or of a scene: every number comes from the logs, the settings and the scores.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline import experiments
from pipeline.base import files, paths
from pipeline.base.paths import Workspace
from pipeline.datasets import images, schemas
from pipeline.reporting import sentences
from pipeline.reporting.figures import glove as glove_figures
from pipeline.reporting.figures import own_sensor as own_figures
from pipeline.reporting.figures import strain as strain_figures
from pipeline.reporting.words.labels import experiment_name, model_name, plain
from pipeline.reporting.words.markdown import code, interval, literal, number, table
from pipeline.scoring import classification, metrics
from pipeline.scoring.results import Fit, Scores, read_fit, read_predictions, read_windows

MOST_RECORDINGS = 40  # rows of the table of recordings
FEW_TESTS = 50  # test rows below which a score says little
DRAWN = 3  # models in a figure


class Metric(NamedTuple):
    """How a metric is printed."""

    header: str
    digits: int = 2
    more_is_better: bool = False


METRICS = {  # kind of input -> metric -> how it is printed; the first decides which model is best
    "windows": {
        "rmse": Metric("RMSE of the map (kPa)"),
        "force_rmse": Metric("RMSE of the force (N)"),
        "force_r2": Metric("R2 of the force", 3, True),
        "location_error": Metric("Location error (mm)"),
        "touches_found": Metric("Touches found (share)", 3, True),
    },
    "series": {
        "error": Metric("Error (mm)"),
        "press_error": Metric("Error per press (mm)"),
        **{
            name: Metric(name.replace("r2", "R2").replace("_", ", "), 3, True)
            for name in ("r2", "r2_x", "r2_y", "r2_z")
        },
    },
    "images": {
        "accuracy": Metric("Accuracy (share)", 3, True),
        "macro_precision": Metric("Macro precision (share)", 3, True),
    },
}
PLACE = ("location_error", "touches_found")  # metrics that mean nothing for one element
ROWS = {"windows": "windows", "series": "samples", "images": "images"}
FITTED = {
    "windows": "The map is that of equation 1 of the LoMP paper; twice its integral is the force on the load cell.",
    "series": "The error is the mean distance from the true place.",
    "images": "",
}


def write(workspace: Workspace, target: Path, experiment: str, settings: Mapping) -> None:
    """Write README.md, scores.csv and the figures to `target`; settings: the experiment's block of settings."""
    kind, rows = experiments.module(experiment).KIND, read_windows(workspace, experiment)
    scores = Scores(workspace, experiment, settings)
    name = settings["source"].removeprefix("data/own/")
    report = json.loads(paths.require(workspace.ingest_report(experiment), "tactile own").read_text(encoding="utf-8"))
    fits = [
        read_fit(workspace, experiment, model, protocol, seed)
        for model in settings["models"]
        for protocol, block in settings["protocols"].items()
        for seed in block["seeds"]
    ]
    files.write_text(target / "scores.csv", workspace.scores(experiment).read_text(encoding="utf-8"))
    captions = _figures(workspace, target, experiment, settings, scores, rows)
    lines = [
        f"# {code(name)}: {experiment_name(experiment).lower()}, your own logs\n",
        "Every number is from these logs. A seed draws another split and another start; intervals are 95 % t intervals "
        "over seeds, where there are several. Test data were not used to train, or to choose anything.\n",
        "## Data\n",
        *_recordings(report["recordings"]),
        *_parts(kind, settings, rows),
        "\n## Scores\n",
        FITTED[kind] + "\n",
        *_scores(kind, settings, scores),
        "## Findings\n",
        *_findings(kind, settings, scores, fits),
        "\n## Figures\n",
        *sentences.figure_lines(captions),
    ]
    files.write_text(target / "README.md", "\n".join(lines) + "\n")


def best(kind: str, settings: Mapping, scores: Scores, protocol: str, condition: str) -> list[str]:
    """Return the models by the kind's first metric, the best first; models with a failed run are left out."""
    metric, printed = next(iter(METRICS[kind].items()))
    estimates = {model: scores.estimate(protocol, condition, model, metric) for model in settings["models"]}
    return sentences.usable(estimates, printed.more_is_better)


def tested(scores: Scores) -> dict[tuple[str, str], list[str]]:
    """Return (protocol, condition) -> metrics that were scored."""
    places: dict[tuple[str, str], list[str]] = {}
    for protocol, condition, metric in scores.measured():
        places.setdefault((protocol, condition), []).append(metric)
    return places


def _recordings(recordings: Mapping[str, Mapping]) -> list[str]:
    """Return the table of recordings: the lines of all their logs, rejected ones, and the rate of the sensor's log."""
    rows = []
    for name, report in list(recordings.items())[:MOST_RECORDINGS]:
        logs = list(report["files"].values())
        lines, rejected = sum(log["lines"] for log in logs), sum(sum(log["rejects"].values()) for log in logs)
        rate = f"{logs[0]['rate_hz']:.1f}" if logs[0]["rate_hz"] else "-"
        share = number(100 * rejected / max(lines, 1))
        rows.append([literal(name), str(report["frames"]), rate, str(lines), share])
    header = ["Recording", "Frames", "Rate (Hz)", "Lines of all logs", "Rejected (%)"]
    more = len(recordings) - len(rows)
    return [table(header, rows)] + ([f"{more} more recordings are not listed.\n"] if more else [])


def _parts(kind: str, settings: Mapping, rows: pa.Table) -> list[str]:
    """Return how many rows train, validate and test in the first run of each protocol."""
    lines = []
    for protocol, block in settings["protocols"].items():
        part = schemas.names(rows[schemas.split_column(protocol, block["seeds"][0])])
        counts = {name: int((part == name).sum()) for name in schemas.PARTS[:3]}
        said = ", ".join(f"{count} {name}" for name, count in counts.items())
        few = f": fewer than {FEW_TESTS} test {ROWS[kind]}, so record more" if counts["test"] < FEW_TESTS else ""
        lines.append(f"- {plain(protocol)}, {ROWS[kind]} of the first seed: {said}{few}.")
    return lines


def _place(protocol: str, condition: str) -> str:
    """Return protocol and condition in words; of a protocol's one condition, the protocol alone says it."""
    named = condition == protocol or protocol.endswith(f"_{condition}")
    return plain(protocol) if named else f"{plain(protocol)}, {condition}"


def _scores(kind: str, settings: Mapping, scores: Scores) -> list[str]:
    """Return a table per protocol and condition: one row per model."""
    text, (first, _) = [], next(iter(METRICS[kind].items()))
    for (protocol, condition), measured in tested(scores).items():
        one_element = kind == "windows" and settings["sensor"]["rows"] * settings["sensor"]["cols"] == 1
        left_out = PLACE if one_element else ()
        printed = {name: m for name, m in METRICS[kind].items() if name in measured and name not in left_out}
        floor = "constant" in settings["models"] and not printed[first].more_is_better
        header = ["Model", *(metric.header for metric in printed.values())]
        header += ["Share of the constant model's error (%)"] if floor else []
        rows = []
        for model in settings["models"]:
            cells = [
                interval(scores.estimate(protocol, condition, model, name), m.digits) for name, m in printed.items()
            ]
            if floor:
                ours, constant = (
                    scores.estimate(protocol, condition, name, first).mean for name in (model, "constant")
                )
                cells.append(number(100 * ours / constant, 0))
            rows.append([model_name(model), *cells])
        where = literal(_place(protocol, condition))
        runs = len(settings["protocols"][protocol]["seeds"])
        text.append(f"### {where[0].upper()}{where[1:]} ({runs} {'run' if runs == 1 else 'runs'})\n")
        text.append(table(header, rows))
    return text


def _findings(kind: str, settings: Mapping, scores: Scores, fits: Sequence[Fit]) -> list[str]:
    """Return which model is best where, which is no better than the constant one, and how the trainings ended."""
    lines, (metric, printed) = [], next(iter(METRICS[kind].items()))
    for protocol, condition in tested(scores):
        order = best(kind, settings, scores, protocol, condition)
        where = literal(_place(protocol, condition))
        if not order:
            lines.append(f"- {where}: every model has a failed run.")
            continue
        errors = {model: scores.estimate(protocol, condition, model, metric) for model in order}
        close = [model_name(m) for m in order[1:] if sentences.overlap(errors[order[0]], errors[m])]
        text = (
            f"- {where}: {model_name(order[0])} is best, {printed.header} {interval(errors[order[0]], printed.digits)}"
        )
        text += f"; the interval overlaps that of {', '.join(close)}" if close else ""
        if "constant" in order and (worse := order[order.index("constant") + 1 :]):
            text += f"; no better than a constant: {', '.join(map(model_name, worse))}"
        lines.append(text + ".")
    trained = [fit for fit in fits if fit.stop_reason != "closed_form"]
    return [*lines, f"- {sentences.stops(trained)}"] if trained else lines


def _figures(
    workspace: Workspace, target: Path, experiment: str, settings: Mapping, scores: Scores, rows: pa.Table
) -> dict[str, str]:
    """Draw the figures of the first run; return name of the file without .png -> caption."""
    kind = experiments.module(experiment).KIND
    captions = {}
    for protocol, condition in tested(scores):
        seed = settings["protocols"][protocol]["seeds"][0]
        order = [model for model in best(kind, settings, scores, protocol, condition) if model != "constant"][:DRAWN]
        if not order:
            continue
        part = schemas.names(rows[schemas.split_column(protocol, seed)])
        conditions = schemas.names(rows["condition"]) if kind != "images" else np.full(len(part), condition)
        chosen = np.flatnonzero((part == "test") & (conditions == condition))
        guesses = {
            model: read_predictions(workspace, experiment, model, protocol, seed, rows)[chosen] for model in order
        }
        where = _place(protocol, condition)
        title, name = f"{where}, seed {seed}", _file_name(len(captions), kind)
        if kind == "windows":
            truth = schemas.matrix(rows["y"])[chosen]
            contact, force = metrics.in_contact(truth, settings), {}
            for model, maps in guesses.items():
                gain = scores.runs(protocol, condition, model, "force_gain")[0]
                force[model] = gain * metrics.integral_n(metrics.as_maps(maps[contact], settings), settings["sensor"])
            load_cell_n = np.nansum(schemas.matrix(rows["force_n"])[chosen[contact]], axis=1)
            r2 = own_figures.forces(target / f"{name}.png", title, load_cell_n, force)
            captions[name] = f"Predicted force over that on the load cell, R2: {_values(r2, '', 3)} ({literal(title)})."
            name = _file_name(len(captions), kind)
            counts = schemas.matrix(rows["x"])[chosen][:, -settings["sensor"]["rows"] * settings["sensor"]["cols"] :]
            errors = own_figures.maps(target / f"{name}.png", title, counts, truth, guesses, settings)
            captions[name] = f"Maps of windows pressed hard: RMSE {_values(errors, 'kPa')} ({literal(title)})."
        elif kind == "series":
            truth, time_s = schemas.matrix(rows["y"])[chosen], rows["t_s"].to_numpy()[chosen]
            outputs = [
                k for k in range(truth.shape[1]) if all(np.isfinite(guess[:, k]).all() for guess in guesses.values())
            ]
            nothing = np.empty((len(chosen), 0))
            errors = strain_figures.performance(target / f"{name}.png", title, time_s, nothing, truth, guesses, outputs)
            captions[name] = f"True and predicted place: mean distance {_values(errors, 'mm')} ({literal(title)})."
        else:
            objects = images.classes(rows)
            truth = np.eye(len(objects))[rows["label"].to_numpy()[chosen]]
            counts = classification.confusion(truth, guesses[order[0]])
            glove_figures.confusion_matrix(target / f"{name}.png", counts, objects, f"{model_name(order[0])}: {title}")
            right = 100 * np.trace(counts) / counts.sum()
            captions[name] = (
                f"What {model_name(order[0])} takes each object for: {right:.0f} % right ({literal(title)})."
            )
    return captions


def _values(by_model: Mapping[str, float], unit: str, digits: int = 2) -> str:
    """Return `CNN 2.10 kPa, RNN 3.40 kPa`."""
    each = (f"{model_name(model)} {number(value, digits)} {unit}".strip() for model, value in by_model.items())
    return ", ".join(each)


def _file_name(place: int, kind: str) -> str:
    """Return the name of the next figure, without .png."""
    return f"{ROWS[kind]}_{place + 1}"
