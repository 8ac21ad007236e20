"""Write the report of a sensor of your own: what its logs hold, what models score on them, and figures.

Nothing here is of a paper or of a scene: every number comes from the logs, the settings and the scores.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from itertools import count
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from tactile import experiments
from tactile.base import files, foreign, paths
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.drawing import common, coverage, markdown, templates
from tactile.drawing.labels import capitalised, experiment_name, model_name, plain
from tactile.scoring import classification, estimates, metrics
from tactile.scoring.estimates import Estimate, read_predictions, read_windows

MOST_RECORDINGS = 40  # rows of the table of recordings
FEW_TESTS = 50  # test rows below which a score says little
DRAWN = 3  # models in a figure
MAPS = 4  # windows in a figure
ENDS = 4  # places that are drawn of the best and of the worst; all, where there are no more
MOST_POINTS = 2000  # of a cloud of forces
SHOWN_S = 120.0  # of a course
MEASURES = {  # kind of input -> metric -> its heading; of the first, the best models are drawn
    "windows": {
        "rmse": "RMSE of the map (kPa)",
        "force_rmse": "RMSE of the force (N)",
        "force_r2": "R2 of the force",
        "location_error": "Location error (mm)",
        "touches_found": "Touches found (share)",
    },
    "series": {
        "error": "Error (mm)",
        "press_error": "Error per press (mm)",
        "r2": "R2",
        "r2_x": "R2, x",
        "r2_y": "R2, y",
        "r2_z": "R2, z",
    },
    "images": {"accuracy": "Accuracy (share)", "macro_precision": "Macro precision (share)"},
}
PLACE = ("location_error", "touches_found")  # metrics that mean nothing for one element
ROWS = {"windows": "windows", "series": "samples", "images": "images"}
Figure = tuple[str, str, str]  # name of the file without .png, what it shows, of what


class Scores:
    """What the models of one sensor scored, as the page asks for it."""

    def __init__(self, workspace: Workspace, experiment: str, settings: Mapping):
        """Read scores.csv; settings: the experiment's block of settings."""
        self.experiment, self.models = experiment, list(settings["models"])
        table = estimates.read_scores(workspace.scores(experiment), "tactile own")
        self._measured = {
            place: list(dict.fromkeys(rows["metric"]))
            for place, rows in table.groupby(["protocol", "condition"], sort=False)
        }
        self._runs = {
            at: rows.set_index("seed")["value"]
            for at, rows in table.groupby(["protocol", "condition", "model", "metric"], sort=False)
        }

    def scored(self) -> dict[tuple[str, str], list[str]]:
        """Return (protocol, condition) -> the metrics that the models were scored by, in the order of scores.csv."""
        return self._measured

    def runs(self, protocol: str, condition: str, model: str, metric: str) -> pd.Series:
        """Return seed -> value, NaN for a failed run; empty where there is no run."""
        return self._runs.get((protocol, condition, model, metric), pd.Series(dtype=float))

    def estimate(self, protocol: str, condition: str, model: str, metric: str) -> Estimate:
        """Return mean and interval over the seeds of one protocol."""
        return estimates.estimate(self.runs(protocol, condition, model, metric), estimates.scale_of(metric))

    def basis(self, protocol: str) -> str:
        """Return how many runs the numbers of a protocol are of."""
        seeds = {seed for at, runs in self._runs.items() if at[0] == protocol for seed in runs.index}
        return f"{len(seeds)} run{'' if len(seeds) == 1 else 's'}"

    def table(self, columns: Mapping[str, tuple[str, str, str]]) -> str:
        """Return a Markdown table, a model a row; columns: heading -> (protocol, condition, metric)."""
        lines = [["Model", *map(model_name, self.models)]]
        for heading, (protocol, condition, metric) in columns.items():
            values = [self.estimate(protocol, condition, model, metric) for model in self.models]
            most = max(value.runs + value.failed for value in values)
            lines.append([heading, *(markdown.score(value, metric, runs=most) for value in values)])
        header, *rows = zip(*lines, strict=True)
        return markdown.table(header, rows)


def write(workspace: Workspace, target: Path, experiment: str, settings: Mapping) -> None:
    """Write README.md, scores.csv and the figures to `target`; settings: the experiment's block of settings."""
    kind, rows = experiments.module(experiment).KIND, read_windows(workspace, experiment)
    report = Scores(workspace, experiment, settings)
    path = paths.require(workspace.ingest_report(experiment), "tactile own")
    with foreign.reading(path, "a report of ingest", "run the command again"):
        ingested = json.loads(path.read_text(encoding="utf-8"))
    files.write_text(target / "scores.csv", workspace.scores(experiment).read_text(encoding="utf-8"))
    unknown = PLACE if kind == "windows" and settings["sensor"]["rows"] * settings["sensor"]["cols"] == 1 else ()
    places = {}
    for place, measured in report.scored().items():
        shown = {heading: name for name, heading in MEASURES[kind].items() if name in measured and name not in unknown}
        places[place] = _place_name(*place), {heading: (*place, metric) for heading, metric in shown.items()}
    parts = {
        plain(protocol): schemas.names(rows[schemas.split_column(protocol, block["seeds"][0])])
        for protocol, block in settings["protocols"].items()
    }
    shown = {place: places[place][0] for place in ends(report, list(places), next(iter(MEASURES[kind])))}
    covered = None
    if workspace.coverage(experiment).exists():
        table = coverage.read(workspace, experiment)
        covered = coverage.HEADER, list(coverage.rows(table, _place_name)), coverage.untold(table, _place_name)
    figures = list(draw(workspace, target, report, settings, rows, shown))
    page = templates.render(
        templates.TEXTS,
        "own_sensor",
        r=report,
        name=settings["source"].removeprefix("data/own/"),
        experiment=experiment_name(experiment).lower(),
        kind=kind,
        rows=ROWS[kind],
        few=FEW_TESTS,
        recordings=list(recordings(ingested["recordings"])),
        more=max(0, len(ingested["recordings"]) - MOST_RECORDINGS),
        parts={name: {part: int((of == part).sum()) for part in schemas.PARTS[:3]} for name, of in parts.items()},
        places=places,
        coverage=covered,
        figures=figures,
        undrawn=len(places) - len(shown),
        ends=ENDS,
    )
    files.write_text(target / "README.md", page)


def _place_name(protocol: str, condition: str) -> str:
    """Return protocol and condition in the words of the logs, whose areas `combined` may be any."""
    named = condition == protocol or protocol.endswith(f"_{condition}")
    return capitalised(plain(protocol) if named else f"{plain(protocol)}, {condition}")


def recordings(reports: Mapping[str, Mapping]) -> Iterator[tuple[str, int, float, int, float]]:
    """Yield name, frames, rate of the sensor's log (Hz), lines of all logs, and rejected ones (%) of recordings."""
    for name, report in list(reports.items())[:MOST_RECORDINGS]:
        logs = list(report["files"].values())
        lines, rejected = sum(log["lines"] for log in logs), sum(sum(log["rejects"].values()) for log in logs)
        yield name, report["frames"], logs[0]["rate_hz"] or np.nan, lines, 100 * rejected / max(lines, 1)


def best(report: Scores, protocol: str, condition: str, metric: str) -> list[str]:
    """Return the models without a failed run but the constant one, the best first, DRAWN of them."""
    values = {model: report.estimate(protocol, condition, model, metric) for model in report.models}
    good = [model for model, value in values.items() if value.runs and not value.failed and model != "constant"]
    return sorted(good, key=lambda model: values[model].mean, reverse=metric in MEASURES["images"])[:DRAWN]


def ends(report: Scores, places: list[tuple[str, str]], metric: str) -> list[tuple[str, str]]:
    """Return the places to draw, in their order: all, or of many those with the ENDS best and ENDS worst scores.

    The score of a place (protocol, condition) is that of its best model; a place that no model was scored on has none.
    """
    models = {place: best(report, *place, metric) for place in places}
    scores = {place: report.estimate(*place, names[0], metric).mean for place, names in models.items() if names}
    ranked = sorted(scores, key=scores.get, reverse=metric in MEASURES["images"])
    chosen = {*ranked[:ENDS], *ranked[-ENDS:]}
    return [place for place in places if place in chosen]


def draw(
    workspace: Workspace,
    folder: Path,
    report: Scores,
    settings: Mapping,
    rows: pa.Table,
    places: Mapping[tuple[str, str], str],
) -> Iterator[Figure]:
    """Draw the predictions of the first run of every place, and yield the figures; places: with their names."""
    experiment = report.experiment
    kind, numbers = experiments.module(experiment).KIND, count(1)
    for (protocol, condition), place in places.items():
        models = best(report, protocol, condition, next(iter(MEASURES[kind])))
        seed = settings["protocols"][protocol]["seeds"][0]
        tested = schemas.names(rows[schemas.split_column(protocol, seed)]) == "test"
        chosen = np.flatnonzero(tested & (kind == "images" or schemas.names(rows["condition"]) == condition))
        if not models or not len(chosen):
            continue
        guesses = {
            model: read_predictions(workspace, experiment, model, protocol, seed, rows)[chosen] for model in models
        }
        title = f"{place}, seed {seed}"
        for what, drawn in DRAW[kind](report, settings, rows.take(chosen), guesses, (protocol, condition), title):
            name = f"{ROWS[kind]}_{next(numbers)}"
            drawn(folder / f"{name}.png")
            yield name, what, title


Drawing = Iterator[tuple[str, Callable[[Path], None]]]  # what a figure shows, and what draws it to a file


def draw_windows(
    report: Scores, settings: Mapping, rows: pa.Table, guesses: Mapping, place: tuple[str, str], title: str
) -> Drawing:
    """Yield the cloud of forces and the maps of windows pressed hard; guesses: model -> (n, cells) in kPa."""
    sensor, truth = settings["sensor"], metrics.as_maps(schemas.matrix(rows["y"]), settings)
    contact = np.flatnonzero(metrics.in_contact(schemas.matrix(rows["y"]), settings))
    shown = contact[:: -(-len(contact) // MOST_POINTS) or 1]
    load_cell_n, clouds = np.nansum(schemas.matrix(rows["force_n"])[shown], axis=1), []
    maps = {model: metrics.as_maps(guess, settings) for model, guess in guesses.items()}
    for model, values in maps.items():
        factor = report.runs(*place, model, "force_gain").iloc[0]
        clouds.append(common.Cloud("", load_cell_n, factor * metrics.integral_n(values[shown], sensor), model))
    yield "force", lambda path: common.agreement(path, title, {"": clouds}, "N")
    order = np.argsort(truth.max(axis=(1, 2)), kind="stable")
    hard = order[np.linspace(len(order) // 2, len(order) - 1, min(MAPS, len(order))).astype(int)]
    windows = [f"window {k + 1}" for k in range(len(hard))]
    counts = schemas.matrix(rows["x"])[hard, -sensor["rows"] * sensor["cols"] :]
    hardest = {model: values[hard] for model, values in maps.items()}
    of = common.pressures(truth[hard])
    chosen = "Windows pressed hard"
    yield "maps", lambda path: common.maps(path, chosen, title, windows, counts, truth[hard], hardest, sensor, of)


def draw_series(
    report: Scores, settings: Mapping, rows: pa.Table, guesses: Mapping, place: tuple[str, str], title: str
) -> Drawing:
    """Yield true and predicted places over time; guesses: model -> (n, 3) in mm, NaN where not asked."""
    truth, time_s = schemas.matrix(rows["y"]), rows["t_s"].to_numpy() - rows["t_s"][0].as_py()
    shown = time_s <= SHOWN_S
    outputs = [k for k in range(truth.shape[1]) if all(np.isfinite(guess[:, k]).all() for guess in guesses.values())]
    panels = [
        common.Course(f"{'xyz'[k]} (mm)", time_s[shown], truth[shown, k], {m: g[shown, k] for m, g in guesses.items()})
        for k in outputs
    ]
    if panels:
        yield "place", lambda path: common.courses(path, title, panels, "Time since the start of the test part (s)")


def draw_images(
    report: Scores, settings: Mapping, rows: pa.Table, guesses: Mapping, place: tuple[str, str], title: str
) -> Drawing:
    """Yield what the best model takes each object for; guesses: model -> (n, classes)."""
    model, guess = next(iter(guesses.items()))
    # The dictionary of the column has all objects of the dataset, of whichever rows these are.
    objects = sorted(rows["condition"].combine_chunks().dictionary.to_pylist())
    counts = classification.confusion(np.eye(len(objects))[rows["label"].to_numpy()], guess)
    heading = f"{model_name(model)}: {title}"
    yield "objects", lambda path: common.confusion_matrix(path, counts, objects, heading)


DRAW = {"windows": draw_windows, "series": draw_series, "images": draw_images}
