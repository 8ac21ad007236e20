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
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline import scenes
from pipeline.scenes import strain_stress
from pipeline.stability import run
from tactile import experiments
from tactile.base.errors import InputError
from tactile.base.stress_tests import SAMPLES, SCENE, StressTest, stress_test
from tactile.datasets import levels, schemas, series
from tactile.datasets.seeding import generator
from tactile.logs import alignment, parse
from tactile.scoring import metrics
from tactile.tasks import series as tasks_series

METRICS = ("error", "r2", "press_error")
WARM_UP = 3000  # samples before the test part from which a model starts if it then predicts the same, to SAME_MM
SAME_MM = 1e-3


@stress_test("series", unit="minutes", acts_on="samples")
def time(minutes: np.ndarray, severity: float, severities: Sequence[float]) -> np.ndarray:
    """Count the samples up to this age since the start of the test part, and above the severity before, (n,) bool."""
    before = max((less for less in severities if less < severity), default=-1.0)
    return (minutes > before) & (minutes <= severity)


def training_levels(pieces: list[series.Piece], settings: Mapping) -> dict:
    """Return range and rest of each channel, and what a loose strand reads; pieces: all recordings of a run."""
    return levels.of_series([piece.record for piece in pieces], settings)._asdict()


class Changed(NamedTuple):
    """What a model sees of the test part, or in its place."""

    record: series.Record  # what is scored, n samples
    counted: np.ndarray | None = (
        None  # (samples of the test part,) bool: those of the record; their voltages are as before
    )
    scene: bool = False  # the record is a recording of its own


class Run(run.Run):
    """A model of series and the one recording with a test part."""

    rounding = 1e-4  # mm, and relative: other processors sum in another order

    def read(self) -> None:
        """Read the test part, and what channels read in training."""
        self.task = self.module.task(self.protocol, self.settings)
        pieces = series.read(self.workspace.dataset(self.experiment), self.task, self.protocol, self.seed)
        self.levels = training_levels(pieces, self.settings)
        (self.piece,) = (piece for piece in pieces if (piece.part == "test").any())

    def tested(self) -> tuple[np.ndarray, pa.Table]:
        """Return the test samples."""
        test = np.flatnonzero(self.piece.part == "test")
        rows = self.piece.rows[test[0] : test[-1] + 1]
        table = schemas.read(self.workspace.dataset(self.experiment), ["condition", "recording", "press"])
        return rows, table.take(pa.array(rows))

    def spec(self):
        """Return the shapes of the task."""
        return tasks_series.spec(self.experiment, self.settings, self.protocol)

    def predict_clean(self) -> None:
        """Predict the test part, and find where a model may start that then predicts the same."""
        test = np.flatnonzero(self.piece.part == "test")
        first, last = test[0], test[-1] + 1
        x, self.test = self.piece.record.x[:last], series.Record(*(column[first:last] for column in self.piece.record))
        self.predicted, start = self.model.predict(x)[first:], max(0, first - WARM_UP)
        forgets = np.allclose(self.model.predict(x[start:])[first - start :], self.predicted, rtol=0, atol=SAME_MM)
        self.before = x[start if forgets else 0 : first]
        self.minutes = (self.piece.time_s[first:last] - self.piece.time_s[first]) / 60
        self.rows = self.piece.rows[first:last]
        self.clean = {self.piece.condition: self.scored(self.test, self.predicted, self.rows)}

    def scored(self, record: series.Record, predicted: np.ndarray, rows: np.ndarray | None) -> list[run.Row]:
        """Return the rows of METRICS that the task has; rows: see `with_blocks`."""
        found = [row for row in metrics.series(record, predicted, self.task.outputs) if row[0] in METRICS]
        pair = (column[record.counted] for column in (record.y, predicted))
        return self.with_blocks(found, None if rows is None else rows[record.counted], *pair)

    def unchanged(self, test: StressTest) -> run.Scored:
        """Return the scores of severity 0, of a scene those of the recording without a change."""
        return self.scores(self.changed(test, 0)) if test.acts_on == SCENE else self.clean.items()

    def changed(self, test: StressTest, severity: float) -> Changed:
        """Return the test part after a test; InputError where no sample is as old as it asks."""
        if test.acts_on == SCENE:
            which = test.name, severity, self.seed % self.settings["simulate"]["specimens"]
            return Changed(scene_record(json.dumps(self.settings), self.experiment, self.protocol, *which), scene=True)
        if test.acts_on == SAMPLES:
            counted = test.function(self.minutes, severity, self.asked["perturbations"][test.name])
            if not (counted & self.test.counted).any():
                raise InputError(
                    f"params.yaml, stress: no sample of {self.protocol} is {severity:g} minutes old; its test part "
                    f"lasts {self.minutes[-1]:.1f} minutes"
                )
            return Changed(series.Record(*(column[counted] for column in self.test)), counted)
        return Changed(self.test._replace(x=changed(self.test.x, test, severity, self.seed, self.levels)))

    def scores(self, changed: Changed) -> run.Scored:
        """Yield the condition and the scores of the model."""
        rows = self.rows
        if changed.scene:
            predicted, rows = self.model.predict(changed.record.x), None
        elif changed.counted is not None:
            predicted, rows = self.predicted[changed.counted], rows[changed.counted]
        else:
            predicted = self.model.predict(np.concatenate([self.before, changed.record.x]))[len(self.before) :]
        yield self.piece.condition, self.scored(changed.record, predicted, rows)


def changed(voltages: np.ndarray, test: StressTest, severity: float, seed: int, levels: Mapping) -> np.ndarray:
    """Return the voltages (T, channels) of a test part after a test of readings."""
    found = test.changed(voltages, severity, generator(seed, "stress", test.draw), levels)
    return np.clip(found, min(0, voltages.min()), max(levels["low"], voltages.max()))


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
