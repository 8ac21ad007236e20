"""Stress of models of tactile images (glove, glove_recorded): readings that went wrong, or a changed scene.

The readings of the test frames go wrong, then become images by the experiment's own functions, so that what its
normalisation hides is hidden. Severity 0 is the score of the stage `evaluate`. Pressure and strain are two areas, each
with its own range, cells and lines.

* noise, offset_drift: in units of the range of all readings of the area in training.
* gain_drift: of what a cell reads above the 5th percentile of its training frames.
* dead: cells (joints) read 0. stuck: they stay at what they read in one of the test frames. Of an area with fewer
  cells than the severity, all.
* dead_line: rows or columns of the scanned area read 0; of each matrix of the recorded hand; joints have no lines.
* lost_frames, jitter: within a recording, over all of its frames, whether they become images or not.
* Scenes (simulated only): the test sessions in a changed scene, see pipeline/scenes/glove_stress.py. An object out of
  place is the same as a glove that sits wrongly on the hand.

What an unseen session costs is not here: it is the difference between the experiment's splits.

Cells that read 0 in all training frames are not wired; nothing of the above reaches them.
Readings are rounded and clipped to what the device can print.
"""

import functools
import json
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline.scenes import glove_stress
from pipeline.stability import run
from tactile import experiments
from tactile.base import paths
from tactile.base.paths import Workspace
from tactile.base.stress_tests import FRAMES, SCENE, StressTest
from tactile.datasets import images, levels, schemas
from tactile.datasets.seeding import generator
from tactile.scoring import classification
from tactile.tasks import images as tasks_images

AREAS = ("pressure", "strain")


class Area(NamedTuple):
    """One area of the sensor: its readings, and what they can be."""

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


class Run(run.Run):
    """A model of images."""

    rounding = 2e-3  # of a fraction: on another processor one image in a thousand may fall on the other side

    @staticmethod
    def group(protocol: str) -> str:
        """Return the split: its protocols show the same frames, in several modalities."""
        return images.split_name(protocol)

    def read(self) -> None:
        """Read the images of the run."""
        self.data = images.read(self.workspace.dataset(self.experiment), self.protocol, self.seed)
        self.modality = images.modality(self.protocol)
        self.x, self.y = tasks_images.part_of(self.data, "test")

    def tested(self) -> tuple[np.ndarray, pa.Table]:
        """Return the test images."""
        rows = np.flatnonzero(self.data.part == "test")
        table = schemas.read(self.workspace.dataset(self.experiment), ["condition", "recording"])
        return rows, table.take(pa.array(rows))

    def spec(self):
        """Return the shapes of the task."""
        return tasks_images.spec(self.data)

    def predict_clean(self) -> None:
        """Predict the test images as they are."""
        self.predicted = self.model.predict(self.x)
        self.clean = {self.modality: self.scored(self.predicted)}

    @functools.cached_property
    def frames(self) -> Frames:
        """Return the frames of the images, with their areas as they were in training."""
        return read(self.workspace, self.experiment, self.settings, self.data.part)

    def changed(self, test: StressTest, severity: float) -> dict[str, np.ndarray]:
        """Return the test images after a test: modality -> (n, SIDE, SIDE) uint8."""
        return stressed(self.experiment, self.settings, self.frames, test, severity, self.seed)

    def scores(self, changed: Mapping[str, np.ndarray]) -> run.Scored:
        """Yield the modality and the scores of the model, which predicts what changed."""
        x = changed[self.modality].reshape(self.x.shape).astype(np.float32)
        different = np.flatnonzero((x != self.x).any(axis=(1, 2)))
        predicted = self.predicted.copy()
        if len(different):
            predicted[different] = self.model.predict(x[different])
        yield self.modality, self.scored(predicted)

    def scored(self, predicted: np.ndarray) -> list[run.Row]:
        """Return the scores of predictions (n, classes); NaN for a failed run."""
        rows = self.units.rows if self.units else None
        return self.with_blocks(classification.scores(self.y, predicted), rows, self.y.argmax(axis=1), predicted)


def read(workspace: Workspace, experiment: str, settings: Mapping, part: np.ndarray) -> Frames:
    """Read the frames table, with its areas as they were in training; part: (images,) of one split."""
    module = experiments.module(experiment)
    path = paths.require(workspace.frames(experiment), f"python -m tactile.stages.ingest {experiment}")
    table = schemas.read(path)
    chosen = module.chosen(table, settings)
    train = chosen[part == "train"]
    areas = {}
    for name in AREAS:
        readings = schemas.matrix(table[name]).astype(float)
        lowest, highest, lines = tasks_images.device(module, name)
        of = levels.of_area(
            readings[train], lowest, highest, pa.types.is_integer(table.schema.field(name).type.value_type)
        )
        areas[name] = Area(readings, of.wired, of.span, of.rest, lowest, highest, lines)
    return Frames(table, chosen[part == "test"], areas)


def stressed(
    experiment: str, settings: Mapping, frames: Frames, test: StressTest, severity: float, seed: int
) -> dict[str, np.ndarray]:
    """Return the test images of one split after a perturbation: modality -> (n, SIDE, SIDE) uint8."""
    if test.acts_on == SCENE:
        readings = changed_scene(settings, frames, test.name, severity)
    else:
        readings = {area: perturbed(frames, area, test, severity, seed) for area in AREAS}
    table = frames.table.take(pa.array(frames.rows))
    for area in AREAS:
        column = schemas.lists(readings[area], table.schema.field(area).type.value_type)
        table = table.set_column(table.schema.get_field_index(area), area, column)
    return experiments.module(experiment).images(table, settings)


def perturbed(frames: Frames, area: str, test: StressTest, severity: float, seed: int) -> np.ndarray:
    """Return readings of one area in the test frames, (n, cells), in the type of the table, after a test of them."""
    seen, in_time = frames.areas[area], test.acts_on == FRAMES
    rng = generator(seed, "stress", test.draw, *([] if in_time else [area]))  # one scan: both areas lose a frame
    result = seen.readings[frames.rows]
    wired = result[:, seen.wired]
    levels = {"span": seen.span, "rest": seen.rest[seen.wired], "low": 0.0}
    if in_time:
        for first, last in recordings(frames.table):
            rows = np.flatnonzero((frames.rows >= first) & (frames.rows < last))
            if len(rows):
                whole = seen.readings[first:last][:, seen.wired]
                wired[rows] = test.changed(whole, severity, rng, levels)[frames.rows[rows] - first]
        result[:, seen.wired] = wired
    elif "rows" in test.needs:
        start = 0
        for rows, cols in seen.lines:
            cells = slice(start, start + rows * cols)
            result[:, cells] = test.changed(result[:, cells], severity, rng, levels | {"rows": rows, "cols": cols})
            start += rows * cols
    else:
        most = wired.shape[1] if test.unit == "number of elements" else severity
        result[:, seen.wired] = test.changed(wired, min(severity, most), rng, levels)
    kind = frames.table.schema.field(area).type.value_type
    result = np.rint(result) if pa.types.is_integer(kind) else result
    return np.clip(result, seen.lowest, seen.highest).astype(kind.to_pandas_dtype())


def recordings(table: pa.Table) -> Iterator[tuple[int, int]]:
    """Yield the first row and the row after the last of every recording of a frames table."""
    names = np.char.add(np.char.add(schemas.names(table["condition"]), "/"), schemas.names(table["recording"]))
    edges = np.flatnonzero(names[1:] != names[:-1]) + 1
    return zip([0, *edges], [*edges, len(names)], strict=True)


def changed_scene(settings: Mapping, frames: Frames, change: str, severity: float) -> dict[str, np.ndarray]:
    """Return readings of both areas in the test frames, (n, cells) int16, in a changed scene.

    A frame that ingest left out stays left out, and is found by its time.
    """
    block, table = json.dumps(settings), frames.table.take(pa.array(frames.rows))
    objects, names = schemas.names(table["condition"]), schemas.names(table["recording"])
    number = np.rint(table["t_s"].to_numpy() * settings["simulate"]["frame_hz"]).astype(int) - 1
    cells = np.empty((len(number), sum(area.readings.shape[1] for area in frames.areas.values())), np.int16)
    for first, last in recordings(table):
        cells[first:last] = session(block, objects[first], names[first], change, severity)[number[first:last]]
    return dict(zip(AREAS, np.split(cells, [frames.areas["pressure"].readings.shape[1]], axis=1), strict=True))


@functools.cache
def session(block: str, name: str, recording: str, change: str, severity: float) -> np.ndarray:
    """Return glove_stress.session; `block`: `glove` as JSON. Kept, because all models of a process see the same."""
    return glove_stress.session(json.loads(block), name, recording, change, severity).astype(np.int16)
