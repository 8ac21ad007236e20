"""Stress tests of models of series (strain): what trained models make of voltages that went wrong after training.

The model goes through the recording as in the stage `evaluate`; what goes wrong goes wrong at the start of the test
part and lasts. Severity 0 is the score of that stage. By name:

* noise, offset_drift: in units of each channel's range over the training samples.
* gain_drift: of the deviation from the training median (of samples outside presses, where presses are known).
* dead: a strand comes loose, and its divider reads the supply. half: as dead, from the middle of the test part on.
* stuck, lost_frames, jitter: as in pipeline/stability/perturbations.py; a frame is a sample.
* time: nothing goes wrong; severity is the age of a sample in minutes since the start of the test part, and counted
  are the samples up to this age and above the severity before. Severity 0: all samples.
* rate, speed, specimen (simulated only): a recording of its own from pipeline/scenes/strain_stress.py, all of which
  counts. Severity 0 is that recording without a change.

Readings stay between 0 V and what a loose strand reads. A draw depends on the seed and the perturbation's name alone,
so that all models see the same.
"""

import functools
import json
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from pipeline import experiments, scenes, tasks
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas, series
from pipeline.datasets.seeding import generator
from pipeline.logs import alignment, parse
from pipeline.scenes import strain_stress
from pipeline.scoring import metrics
from pipeline.stability import clean_scores, perturbations
from pipeline.tasks import series as tasks_series

AS_THEY_ARE = ("stuck", "lost_frames", "jitter")
SCENES = ("rate", "speed", "specimen")
READINGS = ("noise", "gain_drift", "offset_drift", "dead", "half", *AS_THEY_ARE, "time")
METRICS = ("error", "r2", "press_error")
ROUNDING = 1e-4  # mm, and relative: other processors sum in another order
LOOSE_V = 3.15  # what the board of the recorded sensors reads of a strand that has come loose
WARM_UP = 3000  # samples before the test part from which a model starts if it then predicts the same, to SAME_MM
SAME_MM = 1e-3


class Levels(NamedTuple):
    """What channels read in training, in V."""

    span: np.ndarray  # (channels,) range
    rest: np.ndarray  # (channels,) median, outside presses where presses are known
    loose: float  # of a strand without contact


class Run(NamedTuple):
    """One trained model and what its predictions are scored by."""

    predict: Callable[[np.ndarray], np.ndarray]  # (T, channels) V to (T, outputs) mm
    failed: bool  # training diverged
    task: series.Task
    experiment: str
    protocol: str
    seed: int

    def scores(self, record: series.Record, predicted: np.ndarray) -> list[metrics.Row]:
        """Return the rows of METRICS that the task has; NaN for a failed run."""
        scored = [row for row in metrics.series(record, predicted, self.task.outputs) if row[0] in METRICS]
        return metrics.unless_failed(scored, self.failed)


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
    check, rows_of_runs = clean_scores.checker(workspace, experiment, ROUNDING), []
    for protocol in block["protocols"]:
        for seed in settings["protocols"][protocol]["seeds"]:
            run = loaded(workspace, values, experiment, model, protocol, seed)
            pieces = series.read(workspace.dataset(experiment), run.task, protocol, seed)
            seen = levels(pieces, settings)
            for piece in pieces:
                if not (piece.part == "test").any():
                    continue
                for name, severity, scores in stressed(run, piece, seen, plan, settings):
                    if severity == 0 and name not in SCENES:
                        check((protocol, piece.condition, model, seed), scores)
                    rows_of_runs += [(protocol, piece.condition, seed, name, severity, *row) for row in scores]
            report()
    return rows_of_runs


def loaded(workspace: Workspace, values: Mapping, experiment: str, model: str, protocol: str, seed: int) -> Run:
    """Return a run of params.yaml as the stage train left it."""
    task = experiments.module(experiment).task(protocol, values[experiment])
    spec = tasks_series.spec(experiment, values[experiment], protocol)
    run = tasks.load(workspace, values, experiment, model, protocol, seed, spec)
    return Run(run.model.predict, run.failed, task, experiment, protocol, seed)


def levels(pieces: list[series.Piece], settings: Mapping) -> Levels:
    """Return the levels in the training samples of all recordings of a run; settings: the experiment's block."""
    x = np.concatenate([piece.record.x[piece.record.training] for piece in pieces])
    free = np.concatenate([(piece.record.press < 0)[piece.record.training] for piece in pieces])
    loose = settings["simulate"]["circuit"]["supply_v"] if "simulate" in settings else LOOSE_V
    return Levels(np.ptp(x, axis=0), np.median(x[free], axis=0), loose)


def stressed(
    run: Run, piece: series.Piece, seen: Levels, plan: Mapping[str, list], settings: Mapping
) -> Iterator[tuple[str, float, list[metrics.Row]]]:
    """Yield (perturbation, severity, scores) of one recording, severity 0 first."""
    record, test = piece.record, np.flatnonzero(piece.part == "test")
    first, last = test[0], test[-1] + 1
    test_record = series.Record(*(column[first:last] for column in record))
    predicted = run.predict(record.x[:last])[first:]
    clean = run.scores(test_record, predicted)
    start = max(0, first - WARM_UP)
    if not np.allclose(run.predict(record.x[start:last])[first - start :], predicted, rtol=0, atol=SAME_MM):
        start = 0
    minutes = (piece.time_s[first:last] - piece.time_s[first]) / 60
    for name, severities in plan.items():
        if name in SCENES:
            for severity in (0, *severities):
                number = run.seed % settings["simulate"]["specimens"]
                new = scene_record(json.dumps(settings), run.experiment, run.protocol, name, severity, number)
                yield name, severity, run.scores(new, run.predict(new.x))
            continue
        yield name, 0, clean
        before = -1.0
        for severity in severities:
            if name == "time":
                young = (minutes > before) & (minutes <= severity)
                before = severity
                if not (young & test_record.counted).any():
                    raise InputError(
                        f"params.yaml, stress: no sample of {run.protocol} is {severity:g} minutes old; its test part "
                        f"lasts {minutes[-1]:.1f} minutes"
                    )
                yield (
                    name,
                    severity,
                    run.scores(series.Record(*(column[young] for column in test_record)), predicted[young]),
                )
                continue
            worse = perturbed(name, test_record.x, severity, run.seed, seen)
            guess = run.predict(np.concatenate([record.x[start:first], worse]))[first - start :]
            yield name, severity, run.scores(test_record, guess)


def perturbed(name: str, voltages: np.ndarray, severity: float, seed: int, seen: Levels) -> np.ndarray:
    """Return the voltages (T, channels) of a test part after one of READINGS but `time`."""
    rng = generator(seed, "stress", "dead" if name == "half" else name)
    if name == "half":
        middle = len(voltages) // 2
        late = perturbations.dead(voltages[middle:], severity, rng, low=seen.loose)
        return np.concatenate([voltages[:middle], late])
    levels = {
        "noise": {"span": seen.span},
        "offset_drift": {"span": seen.span},
        "gain_drift": {"rest": seen.rest},
        "dead": {"low": seen.loose},
    }
    changed = getattr(perturbations, name)(voltages, severity, rng, **levels.get(name, {}))
    return np.clip(changed, min(0, voltages.min()), max(seen.loose, voltages.max()))


@functools.lru_cache(maxsize=512)
def scene_record(block: str, experiment: str, task: str, change: str, severity: float, number: int) -> series.Record:
    """Return the recording of a changed scene, its logs read and resampled as in ingest; `block`: settings as JSON.

    number: of the recording, and so of the finger, that the model was trained on.

    Its clocks agree: to find out how they differ is ingest's task, and its error (up to 0.4 s at a quarter of the rate)
    would be taken for the models'. Kept, because all models of one process see the same recordings.
    """
    settings, module = json.loads(block), experiments.module(experiment)
    changed, lines, formats = strain_stress.changed(settings, change, severity), {}, module.formats(settings)
    with tempfile.TemporaryDirectory() as folder:
        for name, (text, _) in strain_stress.logs_of(changed, task, number).items():
            path = Path(folder) / name
            scenes.write_log(path, text)
            if name in formats:
                lines[name], _ = parse.read_log(path, formats[name])
    (daq_s, volts), (robot_s, place) = (matrix(lines[name]) for name in formats)
    truth, known = alignment.interpolated(daq_s, robot_s, place)
    frames = module.resampled(task, change, daq_s[known], volts[known], truth[known], changed["ingest"])
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
