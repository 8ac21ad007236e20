"""Stress of models of series (strain, strain_recorded): voltages that go wrong after training, or a changed scene.

The model goes through the recording as in the stage `evaluate`; what goes wrong goes wrong at the start of the test
part and lasts. Severity 0 is the score of that stage.

* noise, offset_drift: in units of each channel's range over the training samples.
* gain_drift: of the deviation from the training median (of samples outside presses, where presses are known).
* dead, half: a strand comes loose, and its divider reads the supply.
* stuck, lost_frames, jitter: as in pipeline/stability/perturbations.py; a frame is a sample.
* time: nothing goes wrong, see `time`; severity 0: all samples.
* Scenes (simulated only): a recording of its own from pipeline/scenes/strain_stress.py, all of which counts. Severity 0
  is that recording without a change.

Readings stay between 0 V and what a loose strand reads.
"""

import functools
import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline import experiments, scenes, tasks
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.base.stress_tests import SAMPLES, SCENE, StressTest, stress_test
from pipeline.datasets import schemas, series
from pipeline.datasets.seeding import generator
from pipeline.learning.trained import Trained
from pipeline.logs import alignment, parse
from pipeline.scenes import strain_stress
from pipeline.scoring import metrics
from pipeline.tasks import series as tasks_series

METRICS = ("error", "r2", "press_error")
LOOSE_V = 3.15  # what the board of the recorded sensors reads of a strand that has come loose
WARM_UP = 3000  # samples before the test part from which a model starts if it then predicts the same, to SAME_MM
SAME_MM = 1e-3


@stress_test("series", unit="minutes", acts_on="samples")
def time(minutes: np.ndarray, severity: float, severities: Sequence[float]) -> np.ndarray:
    """Count the samples up to this age since the start of the test part, and above the severity before, (n,) bool."""
    before = max((less for less in severities if less < severity), default=-1.0)
    return (minutes > before) & (minutes <= severity)


class Part(NamedTuple):
    """The test part of one recording, with the samples before it."""

    piece: series.Piece
    first: int  # sample of the test part
    last: int  # the sample after it

    @property
    def record(self) -> series.Record:
        """Return the samples of the test part, n of them."""
        return series.Record(*(column[self.first : self.last] for column in self.piece.record))

    @property
    def minutes(self) -> np.ndarray:
        """Return the age of the samples since the start of the test part, (n,)."""
        time_s = self.piece.time_s[self.first : self.last]
        return (time_s - time_s[0]) / 60


class Levels(NamedTuple):
    """The test parts of a run, and what channels read in training."""

    protocol: str
    parts: list[Part]
    known: Mapping  # in V, by the names of the tests' keywords


def training_levels(pieces: list[series.Piece], settings: Mapping) -> dict:
    """Return range and rest of each channel, and what a loose strand reads; pieces: all recordings of a run."""
    x = np.concatenate([piece.record.x[piece.record.training] for piece in pieces])
    free = np.concatenate([(piece.record.press < 0)[piece.record.training] for piece in pieces])
    loose = settings["simulate"]["circuit"]["supply_v"] if "simulate" in settings else LOOSE_V
    return {"span": np.ptp(x, axis=0), "rest": np.median(x[free], axis=0), "low": loose}


def changed(voltages: np.ndarray, test: StressTest, severity: float, seed: int, known: Mapping) -> np.ndarray:
    """Return the voltages (T, channels) of a test part after a test of readings."""
    found = test.changed(voltages, severity, generator(seed, "stress", test.draw), known)
    return np.clip(found, min(0, voltages.min()), max(known["low"], voltages.max()))


class Changed(NamedTuple):
    """What a model sees of one test part; one of the last three is not None."""

    number: int  # of the part
    voltages: np.ndarray | None = None  # (n, channels) in place of the part's
    counted: np.ndarray | None = None  # (n,) bool: samples that count, nothing else is changed
    scene: series.Record | None = None  # in place of the whole recording


class Run:
    """One trained model and its predictions of the test parts."""

    def __init__(self, trained: Trained, task: series.Task, levels: Levels):
        self.predict, self.failed, self.task, self.parts = trained.model.predict, trained.failed, task, levels.parts
        self.predicted, self.starts = [], []
        for part in self.parts:
            x, first = part.piece.record.x[: part.last], part.first
            predicted, start = self.predict(x)[first:], max(0, first - WARM_UP)
            forgets = np.allclose(self.predict(x[start:])[first - start :], predicted, rtol=0, atol=SAME_MM)
            self.predicted.append(predicted)
            self.starts.append(start if forgets else 0)
        found = zip(self.parts, self.predicted, strict=True)
        self.clean = {part.piece.condition: self.scores(part.record, predicted) for part, predicted in found}

    def scores(self, record: series.Record, predicted: np.ndarray) -> list[metrics.Row]:
        """Return the rows of METRICS that the task has; NaN for a failed run."""
        scored = [row for row in metrics.series(record, predicted, self.task.outputs) if row[0] in METRICS]
        return metrics.unless_failed(scored, self.failed)

    def under(self, changed: Changed) -> list[metrics.Row]:
        """Return the scores of one test part after a change."""
        part, start = self.parts[changed.number], self.starts[changed.number]
        if changed.scene is not None:
            return self.scores(changed.scene, self.predict(changed.scene.x))
        if changed.counted is not None:
            counted = series.Record(*(column[changed.counted] for column in part.record))
            return self.scores(counted, self.predicted[changed.number][changed.counted])
        x = np.concatenate([part.piece.record.x[start : part.first], changed.voltages])
        return self.scores(part.record, self.predict(x)[part.first - start :])


class Series:
    """How models of series are put under stress, see loop.py."""

    rounding = 1e-4  # mm, and relative: other processors sum in another order

    def __init__(self, workspace: Workspace, values: Mapping, experiment: str):
        self.workspace, self.values, self.experiment = workspace, values, experiment
        self.settings, self.module = values[experiment], experiments.module(experiment)

    def group(self, protocol: str) -> str:
        """Return the protocol: each has its own recordings."""
        return protocol

    def levels(self, protocol: str, seed: int) -> Levels:
        """Return the test parts of a run, and what channels read in training."""
        task = self.module.task(protocol, self.settings)
        pieces = series.read(self.workspace.dataset(self.experiment), task, protocol, seed)
        tests = [(piece, np.flatnonzero(piece.part == "test")) for piece in pieces]
        parts = [Part(piece, test[0], test[-1] + 1) for piece, test in tests if len(test)]
        return Levels(protocol, parts, training_levels(pieces, self.settings))

    def run(self, model: str, protocol: str, seed: int, levels: Levels) -> Run:
        """Return a trained model and its predictions of the test parts."""
        spec = tasks_series.spec(self.experiment, self.settings, protocol)
        trained = tasks.load(self.workspace, self.values, self.experiment, model, protocol, seed, spec)
        return Run(trained, self.module.task(protocol, self.settings), levels)

    def unchanged(
        self, run: Run, levels: Levels, test: StressTest, seed: int
    ) -> Iterator[tuple[str, list[metrics.Row]]]:
        """Yield (condition, scores) of severity 0: of the scene without a change, or of the test part as it is."""
        yield from self.scores(run, self.apply(levels, test, 0, seed)) if test.acts_on == SCENE else run.clean.items()

    def apply(self, levels: Levels, test: StressTest, severity: float, seed: int) -> list[Changed]:
        """Return what a model sees after a test; InputError where no sample is as old as it asks."""
        return [self._changed(levels, number, test, severity, seed) for number in range(len(levels.parts))]

    def _changed(self, levels: Levels, number: int, test: StressTest, severity: float, seed: int) -> Changed:
        if test.acts_on == SCENE:
            finger = seed % self.settings["simulate"]["specimens"]
            block = json.dumps(self.settings)
            return Changed(
                number, scene=scene_record(block, self.experiment, levels.protocol, test.name, severity, finger)
            )
        part = levels.parts[number]
        if test.acts_on == SAMPLES:
            minutes, asked = part.minutes, self.values["stress"][self.experiment]["perturbations"][test.name]
            counted = test.function(minutes, severity, asked)
            if not (counted & part.record.counted).any():
                raise InputError(
                    f"params.yaml, stress: no sample of {levels.protocol} is {severity:g} minutes old; its test part "
                    f"lasts {minutes[-1]:.1f} minutes"
                )
            return Changed(number, counted=counted)
        return Changed(number, voltages=changed(part.record.x, test, severity, seed, levels.known))

    def scores(self, run: Run, changed: list[Changed]) -> Iterator[tuple[str, list[metrics.Row]]]:
        """Yield (condition, scores) of every test part."""
        for one in changed:
            yield run.parts[one.number].piece.condition, run.under(one)


@functools.lru_cache(maxsize=512)
def scene_record(block: str, experiment: str, task: str, change: str, severity: float, number: int) -> series.Record:
    """Return the recording of a changed scene, its logs read and resampled as in ingest; `block`: settings as JSON.

    number: of the recording, and so of the finger, that the model was trained on.

    Its clocks agree: to find out how they differ is ingest's task, and its error (up to 0.4 s at a quarter of the rate)
    would be taken for the models'. Kept, because all models of one process see the same recordings.
    """
    settings, module = json.loads(block), experiments.module(experiment)
    new, lines, formats = strain_stress.changed(settings, change, severity), {}, module.formats(settings)
    with tempfile.TemporaryDirectory() as folder:
        for name, (text, _) in strain_stress.logs_of(new, task, number).items():
            path = Path(folder) / name
            scenes.write_log(path, text)
            if name in formats:
                lines[name], _ = parse.read_log(path, formats[name])
    (daq_s, volts), (robot_s, at_mm) = (matrix(lines[name]) for name in formats)
    truth, between = alignment.interpolated(daq_s, robot_s, at_mm)
    frames = module.resampled(task, change, daq_s[between], volts[between], truth[between], new["ingest"])
    asked, n = module.task(task, settings), frames.num_rows
    return series.Record(
        x=schemas.matrix(frames["v"])[:, asked.channels[task]],
        y=schemas.matrix(frames["y_mm"])[:, list(asked.outputs)],
        counted=np.ones(n, dtype=bool),
        training=np.zeros(n, dtype=bool),
        press=frames["press"].to_numpy(),
    )


def matrix(lines: pa.Table) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) and values (n, columns) of a log of the strain experiment."""
    values = [lines[name].to_numpy() for name in lines.column_names if name[0] in "uxyz"]
    return lines["t_s"].to_numpy(), np.column_stack(values)
