"""Stress of the experiments on windows, array and recorded taxel: perturbed windows, trained models, new errors.

Perturbed readings. All test windows of a run are perturbed at once, so that the same elements fail in all conditions,
and the draw is the same for every model. The sensor's range, the `span` of noise and offset, is the ADC's (touch) or
what was read in training (the recorded taxel, whose readings have no unit); readings are clipped to it, counts are
rounded. What an element reads at rest, for the gain, is its median over the training windows that end without a touch.
A dead element or line reads the lowest value of the range. Frames are lost or late within a window, each on its own.

Perturbed scenes (touch, where it is simulated). `scenes/touch_stress.py` writes logs to a temporary folder; they go
through the ingest, the windows and the labels of the experiment. `prepare` does that once for all models.

Of a condition named in stress.<experiment>.recordings only the first recordings are perturbed, and severity 0 is the
score of those; the score of all its clean windows is held against that of `evaluate`.
"""

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from tqdm import tqdm

from pipeline import experiments, scenes, tasks
from pipeline.base import files, params, workers
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.datasets.seeding import generator
from pipeline.datasets.windowing import windows_of
from pipeline.datasets.windows import Dataset
from pipeline.learning.trained import Trained
from pipeline.scenes import touch_stress
from pipeline.scoring import metrics
from pipeline.stability import clean_scores, perturbations
from pipeline.tasks import windows as tasks_windows

READINGS = ("noise", "gain_drift", "offset_drift", "dead", "stuck", "dead_line", "lost_frames", "jitter")
REPORTED = ("rmse", "location_error", "touches_found")  # as far as the experiment has them
UNCHANGED = "unchanged"
ROUNDING = 1e-4  # relative: other processors sum in another order


class Case(NamedTuple):
    """One perturbed scene in one condition, of the specimen that a seed trains on."""

    condition: str
    perturbation: str
    severity: float
    specimen: int


def prepare(workspace: Workspace, values: Mapping, experiment: str) -> None:
    """Simulate every perturbed scene that params.yaml asks for, in parallel; check the names in its block first."""
    listed = scene_cases(values, experiment)
    folder = workspace.stress_scenes(experiment)
    files.remove_folder(folder, inside=workspace.experiment_folder(experiment))
    folder.mkdir(parents=True)
    if listed:
        with tqdm(total=len(listed), desc=f"stress {experiment}, scenes", unit="scene") as bar:
            settings = _of_few_presses(values[experiment], values["stress"][experiment].get("recordings", {}))
            tasks = {case: (workspace, settings, experiment, case) for case in listed}
            list(workers.run(simulate, tasks, bar))


def scene_cases(values: Mapping, experiment: str) -> list[Case]:
    """Return every scene to simulate, none without a simulator; InputError for an unknown perturbation."""
    asked = values["stress"][experiment]["perturbations"]
    known = touch_stress.VARIATIONS | touch_stress.LAYOUTS if "simulate" in values[experiment] else {}
    params.check_known(asked, (*READINGS, *known), f"stress.{experiment}.perturbations")
    if values[experiment].get("source") != "simulated":
        return []
    protocols, arrays = values["stress"][experiment]["protocols"], values[experiment]["simulate"]["specimens"]
    trained_on = {seed % arrays for name in protocols for seed in values[experiment]["protocols"][name]["seeds"]}
    scenes_of_each = [
        (condition, name, severity)
        for name, severities in asked.items()
        for condition in known.get(name, ())
        for severity in severities
    ]
    anew = [("single_anew", UNCHANGED, 0)] if any(scene[0] == "single_anew" for scene in scenes_of_each) else []
    return [Case(*scene, specimen) for specimen in sorted(trained_on) for scene in anew + scenes_of_each]


def _of_few_presses(settings: Mapping, recordings: Mapping[str, int]) -> Mapping:
    """Return the experiment's block with no more double presses to simulate than `recordings` has of that condition."""
    if "double" not in recordings:
        return settings
    scene = settings["simulate"]
    few = scene["double"] | {"recordings": min(recordings["double"], scene["double"]["recordings"])}
    return {**settings, "simulate": scene | {"double": few}}


def simulate(workspace: Workspace, settings: Mapping, experiment: str, case: Case, report: Callable[[], None]) -> None:
    """Logs, frames, windows and labels of one perturbed scene, as a dataset in the folder of `prepare`."""
    module = experiments.module(experiment)
    varied = touch_stress.varied(settings, case.perturbation, case.severity)
    recordings, logs_of = touch_stress.plan(settings, *case)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenes.write_logs(folder, recordings, logs_of)
        paths_of = (folder / recording.condition / recording.name for recording in recordings)
        frames = [module.read_recording(path, varied)[0] for path in paths_of]
    windows = windows_of(pa.concat_tables(frames).unify_dictionaries().combine_chunks(), varied["window"])
    table = windows.append_column("y", schemas.lists(module.labels(windows, varied), pa.float32()))
    schemas.write(_scene_file(workspace, experiment, case), table.schema, [table])
    report()


def rows(workspace: Workspace, values: Mapping, experiment: str, model: str, report: Callable[[], None]) -> list[tuple]:
    """Return one model's rows: (protocol, condition, seed, perturbation, severity, metric, unit, value, n).

    Severity 0 stands before every perturbation that has an unperturbed version. The scores of all clean windows are
    those of `evaluate`, or InputError is raised. A run that failed in training keeps its rows, with NaN as value.
    `prepare` ran before.
    """
    import torch

    torch.set_num_threads(1)
    settings, stress = values[experiment], values["stress"][experiment]
    spec = tasks_windows.spec(settings)
    data = tasks_windows.read(workspace.dataset(experiment), settings)
    perturbed_scenes = {
        case: tasks_windows.read(_scene_file(workspace, experiment, case), settings)
        for case in scene_cases(values, experiment)
    }
    check, rows_of_runs = clean_scores.checker(workspace, experiment, ROUNDING), []
    for protocol in stress["protocols"]:
        for seed in settings["protocols"][protocol]["seeds"]:
            run = tasks.load(workspace, values, experiment, model, protocol, seed, spec)
            test = np.flatnonzero(data.part(protocol, seed) == "test")
            few = test[_in_first_recordings(data.rows.take(test), stress.get("recordings", {}))]
            whole = _readings_rows(experiment, values, data, (protocol, seed), run, test, {})
            rows_of_run = _readings_rows(experiment, values, data, (protocol, seed), run, few, stress["perturbations"])
            rows_of_run += _scene_rows(experiment, settings, seed, perturbed_scenes, run)
            for condition in experiments.module(experiment).STRESSED:
                clean = [row[3:] for row in whole if row[:2] == (condition, UNCHANGED)]
                check((protocol, condition, model, seed), clean)
            rows_of_runs += [(protocol, condition, seed, *rest) for condition, *rest in with_clean(rows_of_run)]
            report()
    return rows_of_runs


def perturber(settings: Mapping, data: Dataset, train: np.ndarray) -> Callable:
    """Return `change(x, perturbation, severity, rng)` of windows x (n, frames, elements); train: (n of data,) bool."""
    readings, highest_count = data.x[train], settings["ingest"].get("highest_count")
    if highest_count:
        low, high = 0.0, float(highest_count)
    else:
        low, high = float(readings.min()), float(readings.max())
    force_n = np.nansum(schemas.matrix(data.rows["force_n"]), axis=1)[train]
    untouched = readings[force_n < settings["window"]["contact_threshold_n"]]
    rest = np.median(untouched if len(untouched) else readings, axis=(0, 1))
    sensor = settings["sensor"]
    needed = {
        "noise": {"span": high - low},
        "offset_drift": {"span": high - low},
        "gain_drift": {"rest": rest},
        "dead": {"low": low},
        "dead_line": {"low": low, "rows": sensor["rows"], "cols": sensor["cols"]},
    }

    def change(x: np.ndarray, perturbation: str, severity: float, rng: np.random.Generator) -> np.ndarray:
        changed = getattr(perturbations, perturbation)(x, severity, rng, **needed.get(perturbation, {}))
        if severity == 0:
            return changed
        return np.clip(np.rint(changed) if highest_count else changed, low, high)

    return change


def with_clean(rows: list[tuple]) -> list[tuple]:
    """Return rows (condition, perturbation, severity, ...), rows of `unchanged` copied before every perturbation."""
    clean = [row for row in rows if row[1] == UNCHANGED]
    groups = dict.fromkeys(row[1] for row in rows if row[1] != UNCHANGED)
    result = []
    for name in groups:
        perturbed = [row for row in rows if row[1] == name]
        conditions = {row[0] for row in perturbed}
        result += [(row[0], name, 0, *row[3:]) for row in clean if row[0] in conditions] + perturbed
    return result


def _in_first_recordings(rows: pa.Table, recordings: Mapping[str, int]) -> np.ndarray:
    """Return which rows are perturbed, (n,) bool: of a condition in `recordings`, those of its first recordings."""
    condition, names = schemas.names(rows["condition"]), schemas.names(rows["recording"])
    chosen = np.full(len(names), True)
    for name, number in recordings.items():
        of_condition = condition == name
        chosen &= ~of_condition | np.isin(names, np.unique(names[of_condition])[:number])
    return chosen


def _readings_rows(
    experiment: str,
    values: Mapping,
    data: Dataset,
    run: tuple[str, int],
    trained: Trained,
    rows: np.ndarray,
    asked: Mapping,
) -> list[tuple]:
    """Return (condition, perturbation, severity, metric, unit, value, n) of the windows `rows`, clean and perturbed.

    run: protocol and seed; rows: (n,) row numbers of test windows; asked: perturbation -> severities.
    """
    settings, (protocol, seed) = values[experiment], run
    module = experiments.module(experiment)
    x, condition = data.x[rows], schemas.names(data.rows["condition"])[rows]
    change = perturber(settings, data, data.part(protocol, seed) == "train")
    wanted = [(UNCHANGED, 0), *((name, severity) for name in asked if name in READINGS for severity in asked[name])]
    scored = []
    for name, severity in wanted:
        changed = x if name == UNCHANGED else change(x, name, severity, generator(seed, "stress", name))
        predicted = tasks_windows.predict(trained.model, changed, data, rows)
        for tested in module.STRESSED:
            chosen = np.full(len(rows), True) if tested == "all" else condition == tested
            if chosen.any():
                scores = tasks_windows.score(module, data.y[rows[chosen]], predicted[chosen], settings)
                scores = metrics.unless_failed(scores, trained.failed)
                scored += [(tested, name, severity, *row) for row in scores if row[0] in REPORTED]
    return scored


def _scene_rows(
    experiment: str, settings: Mapping, seed: int, perturbed_scenes: Mapping[Case, Dataset], trained: Trained
) -> list[tuple]:
    """Return rows as `_readings_rows`, of the perturbed scenes of the seed's specimen."""
    rows, module = [], experiments.module(experiment)
    for case, data in perturbed_scenes.items():
        if case.specimen != seed % settings["simulate"]["specimens"]:
            continue
        varied = touch_stress.varied(settings, case.perturbation, case.severity)
        predicted = tasks_windows.predict(trained.model, data.x, data, np.arange(len(data.x)))
        scores = tasks_windows.score(module, data.y, predicted, varied)
        rows += [(*case[:3], *row) for row in metrics.unless_failed(scores, trained.failed) if row[0] in REPORTED]
    return rows


def _scene_file(workspace: Workspace, experiment: str, case: Case) -> Path:
    name = f"{case.condition}-{case.perturbation}-{case.severity:g}-{case.specimen}.parquet"
    return workspace.stress_scenes(experiment) / name
