"""A changed test part changes nothing that is fitted: who hands the wrong part to a right function is found here.

Readings and labels of the test rows of a dataset are exchanged for others. Then models are trained, described,
calibrated and put under stress anew, and what was fitted must be the same. The same with the validation part, which
networks stop by and intervals are calibrated on: closed forms, ranges and levels must stay.
"""

import shutil
from collections.abc import Mapping
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest
from builders import made_reports

from pipeline import models, tasks
from pipeline.base import params
from pipeline.base.paths import MODEL_ZERO, Workspace
from pipeline.datasets import schemas
from pipeline.inference import calibration, channels, training
from pipeline.inference.describer import Describer
from pipeline.learning.trained import Trained
from pipeline.stability import loop
from pipeline.stages import train

RUNS = {"touch": ("press", 0), "strain": ("task_1", 0), "glove": ("session_combined", 0)}
CLOSED = {"touch": ["constant", "linear", "tree"], "strain": ["constant", "ridge"], "glove": ["naive_bayes", "tree"]}
NETWORKS = {
    "touch": ["cnn", "lomp", "lomp_stream"],
    "strain": ["lstm_direct", "lstm_transfer", "lstm_transfer_ridge"],
    "glove": ["resnet3x3"],
}
READINGS, LABELS = ("x", "v", "pressure", "strain", "combined"), ("y", "force_n", "label")


def exchange(table: pa.Table, rows: np.ndarray) -> pa.Table:
    """Give rows (n,) the readings and labels of other rows of them, and readings 1.3 times as large."""
    for number, name in enumerate(table.column_names):
        if name in READINGS + LABELS:
            values = schemas.matrix(table[name]) if name != "label" else table[name].to_numpy()
            values = values.copy()
            changed = np.roll(values[rows], len(rows) // 2, axis=0) * (1.3 if name in READINGS else 1)
            values[rows] = np.clip(changed, None, 255 if values.dtype == np.uint8 else None).astype(values.dtype)
            kind = table.schema.field(name).type
            column = schemas.lists(values, kind.value_type) if name != "label" else pa.array(values, kind)
            table = table.set_column(number, table.schema.field(name), column)
    return table


def change(workspace: Workspace, experiment: str, part: str) -> None:
    """Change a part of an experiment's dataset, and the frames that its images were made of."""
    path, run = workspace.dataset(experiment), RUNS[experiment]
    table = pyarrow.parquet.read_table(path)
    rows = np.flatnonzero(schemas.names(table[schemas.split_column(*run)]) == part)
    changed = exchange(table, rows)
    assert len(rows) > 3 and not changed.equals(table)
    pyarrow.parquet.write_table(changed, path)
    if experiment == "glove":
        frames = pyarrow.parquet.read_table(workspace.frames(experiment))
        own = {(table["condition"][k].as_py(), table["recording"][k].as_py()) for k in rows.tolist()}
        names = zip(schemas.names(frames["condition"]), schemas.names(frames["recording"]), strict=True)
        frames = exchange(frames, np.flatnonzero([name in own for name in names]))
        pyarrow.parquet.write_table(frames, workspace.frames(experiment))


def levels(workspace: Workspace, values: Mapping, experiment: str) -> list[np.ndarray]:
    """Return what a stress test takes from the training part of a run: rest, range and levels of the readings."""
    protocol, seed = RUNS[experiment]
    run = loop.KINDS[tasks.kind(experiment)].Run(workspace, values, experiment, CLOSED[experiment][0], protocol, seed)
    if experiment == "glove":
        return [np.asarray(part) for area in run.frames.areas.values() for part in (area.wired, area.span, area.rest)]
    known = run.levels.known if experiment == "touch" else run.levels
    return [np.asarray(known[name]) for name in ("span", "rest", "low")]


def fitted(workspace: Workspace, values: Mapping, experiment: str, names: list[str]) -> dict[str, object]:
    """Train models of one run anew; return all that is fitted to it."""
    protocol, seed = RUNS[experiment]
    found: dict[str, object] = {}
    base = tasks.of(experiment).base(experiment, values[experiment], protocol)
    for name in ([MODEL_ZERO] if base else []) + names:
        of = base if name == MODEL_ZERO else protocol
        folder = workspace.run_folder(experiment, name, of, seed)
        shutil.rmtree(folder, ignore_errors=True)
        folder.parent.mkdir(parents=True, exist_ok=True)
        train.train_run(workspace, values, experiment, name, of, seed, folder, lambda *numbers: None)
        for path in sorted(folder.iterdir()):
            if path.name in ("network.safetensors", "estimator.skops", "history.csv"):
                found[f"{name}: {path.name}"] = path.read_bytes()
    describer = Describer(workspace, values, experiment)
    for name in names:
        card = describer.card(name, protocol, seed, "")
        found[f"{name}: ranges"] = card.trained_on
        found[f"{name}: correlation"] = channels.trained(workspace, values[experiment], card)
        calibrated = calibration.calibrated(workspace, values, card, refit=True).calibration
        found[f"{name}: intervals"] = calibrated and calibrated.bounds
        runs = [(protocol, seed)]
        load = lambda *run, name=name: tasks.load(workspace, values, experiment, name, *run)  # noqa: E731
        for _, _, tests in tasks.of(experiment).tested(
            workspace.dataset(experiment), experiment, values[experiment], runs, load
        ):
            rows = [row for *_, scored in tests for row in scored]
            found[f"{name}: force gain"] = {(*row[:2], row[3]) for row in rows if row[1] == "force_gain"}
            found[f"{name}: scores"] = rows
    found["levels"] = [level.tolist() for level in levels(workspace, values, experiment)]
    return found


@pytest.fixture(scope="module")
def as_it_was(miniature, tmp_path_factory):
    """Experiment -> a workspace of its own with its data, and all that is fitted to them."""
    found = {}

    def of(experiment: str) -> tuple[Workspace, dict]:
        if experiment not in found:
            place = Workspace(tmp_path_factory.mktemp(experiment))
            for name in ("params", "params.yaml", f"data/{experiment}"):
                source = miniature.folder / name
                copy = shutil.copytree if source.is_dir() else shutil.copy
                (place.root / name).parent.mkdir(parents=True, exist_ok=True)
                copy(source, place.root / name)
            values = params.load(place.params)
            found[experiment] = place, fitted(place, values, experiment, CLOSED[experiment] + NETWORKS[experiment])
        return found[experiment]

    return of


@pytest.mark.parametrize("part", ["test", "validation"])
@pytest.mark.parametrize("experiment", RUNS)
def test_what_is_fitted_does_not_see_a_part_that_it_must_not(experiment, part, as_it_was, tmp_path):
    place, before = as_it_was(experiment)
    shutil.copytree(place.root, tmp_path / "changed")
    workspace = Workspace(tmp_path / "changed")
    change(workspace, experiment, part)
    names = CLOSED[experiment] + (NETWORKS[experiment] if part == "test" else [])
    after = fitted(workspace, params.load(workspace.params), experiment, names)
    moved = {name for name in after if after[name] != before[name]}
    may_move = {name for name in after if name.endswith(": scores")}
    if part == "validation":
        may_move |= {name for name in after if name.endswith((": intervals", ": history.csv"))}
        if experiment == "strain":  # solved models of series are fitted to both parts, as in the paper
            may_move |= {name for name in after if name.endswith((".safetensors", ".skops"))}
    assert sorted(moved - may_move) == [] and moved & may_move


QUICK = {"touch": ["constant", "linear"], "strain": ["constant", "ridge"], "glove": ["naive_bayes", "tree"]}
CHANNELS = {"touch": 9, "strain": 4}


def quickly(workspace: Workspace, settings: Mapping, experiment: str) -> dict[str, object]:
    """Return what closed forms that are fitted to a small dataset say, the ranges of their training, the force gain."""
    (protocol, seed), path, task = RUNS[experiment], workspace.dataset(experiment), tasks.of(experiment)
    found = {}
    for name in QUICK[experiment]:
        block = params.load(made_reports.ROOT / "params.yaml")[experiment]["models"][name]
        build = lambda spec, name=name, block=block: models.build(name, spec, block, "test")  # noqa: E731
        model = task.fit(path, experiment, settings, protocol, seed, build, device="cpu").model
        shape = task.stream(path, experiment, settings, protocol, seed)[1].shape[1:]
        given = np.random.default_rng(0).uniform(0, 900, (40, *shape)).astype(np.float32)
        found[name] = model.predict(given).tolist()
        load = lambda *run, model=model: Trained(model, failed=False)  # noqa: E731
        for *_, tests in task.tested(path, experiment, settings, [(protocol, seed)], load):
            rows = [row for *_, scored in tests for row in scored]
            found[f"{name}: force gain"] = {(*row[:2], row[3]) for row in rows if row[1] == "force_gain"}
    if columns := CHANNELS.get(experiment):
        inputs = SimpleNamespace(columns=columns, chosen=list(range(columns)))
        card = dict(experiment=experiment, kind=tasks.kind(experiment), protocol=protocol, seed=seed, inputs=inputs)
        found["ranges"] = training.trained_on(workspace, settings, SimpleNamespace(**card))
    return found


@pytest.mark.parametrize("part", ["test", "train"])
@pytest.mark.parametrize("experiment", RUNS)
def test_what_is_fitted_in_a_moment_does_not_see_the_test_part(experiment, part, workspace, monkeypatch):
    """As above, at once: closed forms on a made dataset. Another training part changes them."""
    settings = made_reports.settings_of(experiment)
    settings["sensor"]["channels"] = CHANNELS["strain"]
    made_reports.write(workspace, experiment, settings)
    monkeypatch.setitem(RUNS, experiment, (next(iter(settings["protocols"])), 0))
    path, split = workspace.dataset(experiment), schemas.split_column(*RUNS[experiment])
    table = pyarrow.parquet.read_table(path)
    parts = np.array(["train", "train", "validation", "test"])[np.random.default_rng(0).integers(0, 4, len(table))]
    if experiment == "strain":  # in the order of time
        parts = np.array(["train", "train", "validation", "test"])[np.arange(len(table)) * 4 // len(table)]
    column = pa.array(parts.tolist()).dictionary_encode()
    table = table.set_column(table.column_names.index(split), split, column)
    pyarrow.parquet.write_table(table, path)
    before = quickly(workspace, settings, experiment)
    pyarrow.parquet.write_table(exchange(table, np.flatnonzero(parts == part)), path)
    after = quickly(workspace, settings, experiment)
    changed = {name for name in after if after[name] != before[name]}
    assert not changed if part == "test" else changed >= {QUICK[experiment][-1]} | ({"ranges"} & after.keys())
