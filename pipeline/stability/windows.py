"""Stress of models of windows (the array, the recorded taxel): windows with changed readings, or of a changed scene.

Readings. All test windows of a run are changed at once, so that the same elements fail in all conditions. The sensor's
range, the `span` of noise and offset, and what an element reads at rest, for the gain, are those of
`datasets/levels.py`; readings are clipped to the range, counts are rounded. A dead element or line reads the lowest
value of the range. Frames are lost or late within a window, each on its own.

Scenes (touch, where it is simulated). `scenes/touch_stress.py` writes logs to a temporary folder; they go through the
ingest, the windows and the labels of the experiment, once for all models (`simulate_scenes`).

Of a condition named in stress.<experiment>.recordings only the first recordings are changed, and severity 0 is the
score of those; the score of all its clean windows is held against that of `evaluate`.
"""

import functools
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from tqdm import tqdm

from pipeline import scenes
from pipeline.scenes import touch_stress
from pipeline.stability import run
from tactile import experiments
from tactile.base import files, workers
from tactile.base.paths import Workspace
from tactile.base.stress_tests import SCENE, StressTest
from tactile.datasets import levels, schemas
from tactile.datasets.seeding import generator
from tactile.datasets.windowing import windows_of
from tactile.datasets.windows import Dataset, read_dataset
from tactile.tasks import windows as tasks_windows

REPORTED = ("rmse", "location_error", "touches_found")  # as far as the experiment has them
ANEW = "single_anew"  # the condition that has a scene of its own for severity 0


class Case(NamedTuple):
    """One changed scene in one condition, of the specimen that a seed trains on."""

    condition: str
    test: str
    severity: float
    specimen: int


def simulate_scenes(workspace: Workspace, values: Mapping, experiment: str, plan: Mapping[StressTest, list]) -> None:
    """Simulate every changed scene of a plan, in parallel."""
    listed = scene_cases(values, experiment, plan)
    folder = workspace.stress_scenes(experiment)
    files.remove_folder(folder, inside=workspace.experiment_folder(experiment))
    folder.mkdir(parents=True)
    if listed:
        with tqdm(total=len(listed), desc=f"stress {experiment}, scenes", unit="scene") as bar:
            settings = _of_few_presses(values[experiment], values["stress"][experiment].get("recordings", {}))
            tasks = {case: (workspace, settings, experiment, case) for case in listed}
            list(workers.run(simulate, tasks, bar))


def scene_cases(values: Mapping, experiment: str, plan: Mapping[StressTest, list]) -> list[Case]:
    """Return every scene to simulate."""
    found = [
        (condition, test.name, severity)
        for test, severities in plan.items()
        for condition in test.conditions
        for severity in severities
    ]
    if not found:
        return []
    protocols, arrays = values["stress"][experiment]["protocols"], values[experiment]["simulate"]["specimens"]
    trained_on = {seed % arrays for name in protocols for seed in values[experiment]["protocols"][name]["seeds"]}
    anew = [(ANEW, touch_stress.UNCHANGED, 0)] if any(condition == ANEW for condition, *_ in found) else []
    return [Case(*scene, specimen) for specimen in sorted(trained_on) for scene in anew + found]


def _of_few_presses(settings: Mapping, recordings: Mapping[str, int]) -> Mapping:
    """Return the experiment's block with no more double presses to simulate than `recordings` has of that condition."""
    if "double" not in recordings:
        return settings
    scene = settings["simulate"]
    few = scene["double"] | {"recordings": min(recordings["double"], scene["double"]["recordings"])}
    return {**settings, "simulate": scene | {"double": few}}


def simulate(workspace: Workspace, settings: Mapping, experiment: str, case: Case, report: Callable[[], None]) -> None:
    """Write the dataset of one changed scene, from its logs, to the folder of `simulate_scenes`."""
    module = experiments.module(experiment)
    block = touch_stress.changed(settings, case.test, case.severity).settings
    recordings, logs_of = touch_stress.plan(settings, *case)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenes.write_logs(folder, recordings, logs_of)
        paths_of = (folder / recording.condition / recording.name for recording in recordings)
        frames = [module.read_recording(path, block)[0] for path in paths_of]
    windows = windows_of(pa.concat_tables(frames).unify_dictionaries().combine_chunks(), block["window"])
    table = windows.append_column("y", schemas.lists(module.labels(windows, block), pa.float32()))
    schemas.write(_scene_file(workspace, experiment, case), table.schema, [table])
    report()


def _scene_file(workspace: Workspace, experiment: str, case: Case) -> Path:
    name = f"{case.condition}-{case.test}-{case.severity:g}-{case.specimen}.parquet"
    return workspace.stress_scenes(experiment) / name


class Changed(NamedTuple):
    """Windows to predict and score."""

    x: np.ndarray  # (n, frames, elements)
    rows: np.ndarray  # (n,) of `data`
    data: Dataset
    conditions: tuple[str, ...]  # what is scored: windows of these conditions, or of a scene all under its name
    settings: Mapping  # the experiment's block, by which labels are scored


class Run(run.Run):
    """A model of windows."""

    rounding = 1e-4  # relative: other processors sum in another order

    def read(self) -> None:
        """Read the windows, and what readings were in the training part."""
        self.data = dataset(self.workspace.dataset(self.experiment), self.spec())
        self.condition = schemas.names(self.data.rows["condition"])
        part = self.data.part(self.protocol, self.seed)
        self.levels = Levels.seen(self.settings, self.data, part == "train")
        self.test = np.flatnonzero(part == "test")
        self.few = self.test[_in_first_recordings(self.data.rows.take(self.test), self.asked.get("recordings", {}))]

    def tested(self) -> tuple[np.ndarray, pa.Table]:
        """Return the test windows."""
        return self.test, self.data.rows.take(self.test)

    def spec(self):
        """Return the shapes of the task."""
        return tasks_windows.spec(self.settings)

    def predict_clean(self) -> None:
        """Score all test windows, and those that are changed."""
        self.clean = dict(self.scores([self._windows(self.test)]))
        self.of_few = self.clean | (
            dict(self.scores([self._windows(self.few)])) if len(self.few) < len(self.test) else {}
        )

    def unchanged(self, test: StressTest) -> run.Scored:
        """Yield (condition, scores) without the test, where there is something without it."""
        for condition in test.conditions if test.acts_on == SCENE else self.module.STRESSED:
            if condition == ANEW and ANEW not in self.of_few:
                self.of_few |= dict(self.scores([self._scene(ANEW, touch_stress.UNCHANGED, 0)]))
            if condition in self.of_few:
                yield condition, self.of_few[condition]

    def changed(self, test: StressTest, severity: float) -> list[Changed]:
        """Return the windows of a test at one severity."""
        if test.acts_on == SCENE:
            return [self._scene(condition, test.name, severity) for condition in test.conditions]
        windows, rng = self._windows(self.few), generator(self.seed, "stress", test.draw)
        return [windows._replace(x=self.levels.changed(windows.x, test, severity, rng))]

    def _windows(self, rows: np.ndarray) -> Changed:
        """Return windows of the dataset, unchanged."""
        return Changed(self.data.x[rows], rows, self.data, self.module.STRESSED, self.settings)

    def _scene(self, condition: str, name: str, severity: float) -> Changed:
        """Return the windows of a changed scene that `simulate_scenes` made."""
        case = Case(condition, name, severity, self.seed % self.settings["simulate"]["specimens"])
        data = dataset(_scene_file(self.workspace, self.experiment, case), self.spec())
        block = touch_stress.changed(self.settings, name, severity).settings
        return Changed(data.x, np.arange(len(data.x)), data, (condition,), block)

    def scores(self, changed: list[Changed]) -> run.Scored:
        """Yield the scores of REPORTED by condition; NaN for a failed run."""
        for windows in changed:
            predicted = tasks_windows.predict(self.model, windows.x, windows.data, windows.rows)
            for tested in windows.conditions:
                # of a scene all: a copy of part of them is summed in another order, which changes last digits
                chosen = slice(None)
                if windows.data is self.data:
                    chosen = np.full(len(windows.x), tested == "all") | (self.condition[windows.rows] == tested)
                rows = windows.rows[chosen]
                if len(rows):
                    pair = windows.data.y[rows], predicted[chosen]
                    found = tasks_windows.score(self.module, *pair, windows.settings)
                    found = self.with_blocks(found, rows if windows.data is self.data else None, *pair)
                    yield tested, [row for row in found if row[0] in REPORTED]


def dataset(path: Path, spec) -> Dataset:
    """Read a dataset, once for all runs of a process; spec: the shapes of the task."""
    return _read(path, spec.frames, spec.elements, path.stat().st_mtime_ns)


@functools.lru_cache(maxsize=64)
def _read(path: Path, frames: int, elements: int, written_ns: int) -> Dataset:
    return read_dataset(path, frames, elements)


class Levels(NamedTuple):
    """What readings were in the training part of a run."""

    known: Mapping  # by the names of the tests' keywords
    low: float  # readings are clipped to these
    high: float
    whole: bool  # readings are counts

    @classmethod
    def seen(cls, settings: Mapping, data: Dataset, train: np.ndarray) -> "Levels":
        """Return the levels of the training windows; train: (n of data,) bool."""
        of = levels.of_windows(settings, data, train)
        sensor = {key: settings["sensor"][key] for key in ("rows", "cols")}
        return cls({"span": of.span, "rest": of.rest, "low": of.low} | sensor, of.lowest, of.highest, of.whole)

    def changed(self, x: np.ndarray, test: StressTest, severity: float, rng: np.random.Generator) -> np.ndarray:
        """Return windows x (n, frames, elements) after a test of readings."""
        changed = test.changed(x, severity, rng, self.known)
        return np.clip(np.rint(changed) if self.whole else changed, self.low, self.high) if severity else changed


def _in_first_recordings(rows: pa.Table, recordings: Mapping[str, int]) -> np.ndarray:
    """Return which rows are changed, (n,) bool: of a condition in `recordings`, those of its first recordings."""
    condition, names = schemas.names(rows["condition"]), schemas.names(rows["recording"])
    chosen = np.full(len(names), True)
    for name, number in recordings.items():
        of_condition = condition == name
        chosen &= ~of_condition | np.isin(names, np.unique(names[of_condition])[:number])
    return chosen
