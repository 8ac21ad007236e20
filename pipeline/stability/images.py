"""Stress tests of models of tactile images (glove): what trained models make of readings that went wrong.

The readings of the test frames go wrong, then become images by the experiment's own functions, so that what its
normalisation hides is hidden. Severity 0 is the score of the stage `evaluate`. Pressure and strain are two areas, each
with its own range, cells and lines; by name:

* noise, offset_drift: in units of the range of all readings of the area in training.
* gain_drift: of what a cell reads above the 5th percentile of its training frames.
* dead: cells (joints) read 0. stuck: they stay at what they read in one of the test frames. Of an area with fewer
  than `severity`, all.
* dead_line: rows or columns of the scanned area read 0; of each matrix of the recorded hand; joints have no lines.
* lost_frames, jitter: within a recording, over all of its frames, whether they become images or not.
* specimen, shift, turn, grip (simulated only): the test sessions in a changed scene, see
  pipeline/scenes/glove_stress.py. An object out of place is the same as a glove that sits wrongly on the hand.

What an unseen session costs is not here: it is the difference between the experiment's splits.

Cells that read 0 in all training frames are not wired; nothing of the above reaches them.
Readings are rounded and clipped to what the device can print. A draw depends on the seed and the perturbation's name
alone, so that all models see the same.
"""

import functools
import json
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline import experiments, tasks
from pipeline.base import paths
from pipeline.base.paths import Workspace
from pipeline.datasets import images, schemas
from pipeline.datasets.seeding import generator
from pipeline.scenes import glove_stress
from pipeline.scoring import classification, metrics
from pipeline.stability import clean_scores, perturbations
from pipeline.tasks import images as tasks_images

IN_TIME = ("lost_frames", "jitter")
READINGS = ("noise", "gain_drift", "offset_drift", "dead", "stuck", "dead_line", *IN_TIME)
SCENES = ("specimen", "shift", "turn", "grip")
AREAS = ("pressure", "strain")
LOW_PERCENTILE = 5
ROUNDING = 2e-3  # of a fraction: on another processor one image in a thousand may fall on the other side


class Area(NamedTuple):
    """What is known of one area of the sensor."""

    readings: np.ndarray  # (frames, cells) of the whole frames table
    wired: np.ndarray  # (cells,) bool: reads something in training
    span: float
    rest: np.ndarray  # (cells,)
    lowest: float  # the device's range
    highest: float
    lines: tuple[tuple[int, int], ...]  # rows, columns of the matrices that the cells fill, one after the other


class Frames(NamedTuple):
    """The frames of an experiment and which of them one split tests on."""

    table: pa.Table
    rows: np.ndarray  # (n,) of the test images in the table, rising
    areas: Mapping[str, Area]


def prepare(workspace: Workspace, values: Mapping, experiment: str) -> dict[str, list]:
    """Return the perturbations that params.yaml asks for, with their severities; InputError for an unknown one."""
    return perturbations.planned(values, experiment, READINGS, SCENES)


def rows(workspace: Workspace, values: Mapping, experiment: str, model: str, report: Callable) -> list[tuple]:
    """Return rows (protocol, condition, seed, perturbation, severity, metric, unit, value, n) of one model.

    A run whose training diverged has NaN for values. Raises InputError for an unknown perturbation in params.yaml,
    and where severity 0 does not have the scores of scores.csv.
    """
    import torch

    torch.set_num_threads(1)
    settings, block = values[experiment], values["stress"][experiment]
    plan = prepare(workspace, values, experiment)
    check = clean_scores.checker(workspace, experiment, ROUNDING)
    rows_of_runs = {}
    for split in dict.fromkeys(map(images.split_name, block["protocols"])):
        protocols = [name for name in block["protocols"] if images.split_name(name) == split]
        for seed in block["seeds"]:
            runs = {protocol: Run(workspace, values, experiment, model, protocol, seed) for protocol in protocols}
            for protocol, run in runs.items():
                check((protocol, run.modality, model, seed), run.clean)
            frames = read(workspace, experiment, settings, next(iter(runs.values())).part)
            for name, severities in plan.items():
                for protocol, run in runs.items():
                    rows_of_runs.setdefault((protocol, seed), []).extend((name, 0, *row) for row in run.clean)
                for severity in severities:
                    pictures = stressed(experiment, settings, frames, name, severity, seed)
                    for protocol, run in runs.items():
                        scores = run.scores(pictures[run.modality])
                        rows_of_runs[protocol, seed] += [(name, severity, *row) for row in scores]
            for _ in runs:
                report()
    return [
        (protocol, images.modality(protocol), seed, *row)
        for protocol in block["protocols"]
        for seed in block["seeds"]
        for row in rows_of_runs[protocol, seed]
    ]


class Run:
    """One trained model and its predictions of the test images as they are."""

    def __init__(self, workspace: Workspace, values: Mapping, experiment: str, model: str, protocol: str, seed: int):
        data = images.read(workspace.dataset(experiment), protocol, seed)
        spec = tasks_images.spec(data)
        self.model, self.failed = tasks.load(workspace, values, experiment, model, protocol, seed, spec)
        self.modality, self.part = images.modality(protocol), data.part
        self.x, self.y = tasks_images.part_of(data, "test")
        self.predicted = self.model.predict(self.x)
        self.clean = self._scores(self.predicted)

    def scores(self, pictures: np.ndarray) -> list:
        """Return the scores of test images (n, SIDE, SIDE) uint8 after a perturbation; predicts the changed."""
        x = pictures.reshape(self.x.shape).astype(np.float32)
        changed = np.flatnonzero((x != self.x).any(axis=(1, 2)))
        predicted = self.predicted.copy()
        if len(changed):
            predicted[changed] = self.model.predict(x[changed])
        return self._scores(predicted)

    def _scores(self, predicted: np.ndarray) -> list:
        return metrics.unless_failed(classification.scores(self.y, predicted), self.failed)


def read(workspace: Workspace, experiment: str, settings: Mapping, part: np.ndarray) -> Frames:
    """Read the frames table, with its areas as they were in training; part: (images,) of one split."""
    module = experiments.module(experiment)
    path = paths.require(workspace.frames(experiment), f"python -m pipeline.stages.ingest {experiment}")
    table = schemas.read(path)
    chosen = module.chosen(table, settings)
    train = chosen[part == "train"]
    areas = {}
    for name in AREAS:
        readings = schemas.matrix(table[name]).astype(float)
        trained_on = readings[train]
        lowest, highest, lines = device(module, name)
        rest = np.percentile(trained_on, LOW_PERCENTILE, axis=0)
        areas[name] = Area(readings, trained_on.any(axis=0), float(np.ptp(trained_on)), rest, lowest, highest, lines)
    return Frames(table, chosen[part == "test"], areas)


def device(module, area: str) -> tuple[float, float, tuple[tuple[int, int], ...]]:
    """Return the range of an area's readings and its matrices; module: of an experiment on images."""
    if hasattr(module, "MATRICES"):
        if area == "strain":
            return -module.IMPOSSIBLE_DEG, module.IMPOSSIBLE_DEG, ()
        return 0, module.FULL_SCALE, module.MATRICES
    known = images.GLOVE[area]
    return known.lowest, known.highest, ((known.rows, known.cols),)


def stressed(
    experiment: str, settings: Mapping, frames: Frames, name: str, severity: float, seed: int
) -> dict[str, np.ndarray]:
    """Return the test images of one split after a perturbation: modality -> (n, SIDE, SIDE) uint8."""
    if name in SCENES:
        readings = changed_scene(settings, frames, name, severity)
    else:
        readings = {area: perturbed(frames, area, name, severity, seed) for area in AREAS}
    table = frames.table.take(pa.array(frames.rows))
    for area in AREAS:
        kind = table.schema.field(area).type.value_type
        place = table.schema.get_field_index(area)
        table = table.set_column(place, area, schemas.lists(readings[area], kind))
    return experiments.module(experiment).images(table, settings)


def perturbed(frames: Frames, area: str, name: str, severity: float, seed: int) -> np.ndarray:
    """Return readings of one area in the test frames, (n, cells), in the type of the table, after one of READINGS."""
    known = frames.areas[area]
    rng = generator(seed, "stress", name, *([] if name in IN_TIME else [area]))  # one scan: both areas lose a frame
    result = known.readings[frames.rows]
    wired = result[:, known.wired]
    if name in IN_TIME:
        act = getattr(perturbations, name)
        for first, last in recordings(frames.table):
            rows = np.flatnonzero((frames.rows >= first) & (frames.rows < last))
            if len(rows):
                whole = known.readings[first:last][:, known.wired]
                wired[rows] = act(whole, severity, rng)[frames.rows[rows] - first]
        result[:, known.wired] = wired
    elif name == "dead_line":
        start = 0
        for rows, cols in known.lines:
            cells = slice(start, start + rows * cols)
            result[:, cells] = perturbations.dead_line(result[:, cells], severity, rng, rows=rows, cols=cols, low=0.0)
            start += rows * cols
    else:
        needed = {
            "noise": {"span": known.span},
            "offset_drift": {"span": known.span},
            "gain_drift": {"rest": known.rest[known.wired]},
            "dead": {"low": 0.0},
        }
        most = wired.shape[1] if name in ("dead", "stuck") else severity
        act = getattr(perturbations, name)
        result[:, known.wired] = act(wired, min(severity, most), rng, **needed.get(name, {}))
    kind = frames.table.schema.field(area).type.value_type
    result = np.rint(result) if pa.types.is_integer(kind) else result
    return np.clip(result, known.lowest, known.highest).astype(kind.to_pandas_dtype())


def recordings(table: pa.Table) -> Iterator[tuple[int, int]]:
    """Yield the first row and the row after the last of every recording of a frames table."""
    names = np.char.add(np.char.add(schemas.names(table["condition"]), "/"), schemas.names(table["recording"]))
    edges = np.flatnonzero(names[1:] != names[:-1]) + 1
    return zip([0, *edges], [*edges, len(names)], strict=True)


def changed_scene(settings: Mapping, frames: Frames, change: str, severity: float) -> dict[str, np.ndarray]:
    """Return readings of both areas in the test frames, (n, cells) int16, in a changed scene.

    A frame that ingest left out stays left out, and is found by its time.
    """
    known, table = json.dumps(settings), frames.table.take(pa.array(frames.rows))
    objects, names = schemas.names(table["condition"]), schemas.names(table["recording"])
    number = np.rint(table["t_s"].to_numpy() * settings["simulate"]["frame_hz"]).astype(int) - 1
    cells = np.empty((len(number), sum(area.readings.shape[1] for area in frames.areas.values())), np.int16)
    for first, last in recordings(table):
        cells[first:last] = session(known, objects[first], names[first], change, severity)[number[first:last]]
    return dict(zip(AREAS, np.split(cells, [frames.areas["pressure"].readings.shape[1]], axis=1), strict=True))


@functools.cache
def session(block: str, name: str, recording: str, change: str, severity: float) -> np.ndarray:
    """Return glove_stress.session; `block`: `glove` as JSON. Kept, because all models of a process see the same."""
    return glove_stress.session(json.loads(block), name, recording, change, severity).astype(np.int16)
