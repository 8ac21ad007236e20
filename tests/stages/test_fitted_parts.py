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

from pipeline.stability import loop
from tactile import experiments, models, tasks
from tactile.base import params, provenance
from tactile.base.paths import MODEL_ZERO, Workspace
from tactile.datasets import schemas, series
from tactile.experiments.glove_recorded import CELLS, JOINTS
from tactile.inference import calibration, channels, training
from tactile.inference.describer import Describer
from tactile.learning.spec import Spec
from tactile.learning.trained import Trained
from tactile.own.settings import YARDSTICKS
from tactile.stages import train

RUNS = {"touch": ("press", 0), "strain": ("task_1", 0), "glove": ("session_combined", 0)}
CLOSED = {"touch": ["constant", "linear", "tree"], "strain": ["constant", "ridge"], "glove": ["naive_bayes", "tree"]}
NETWORKS = {
    "touch": ["cnn", "lomp", "lomp_stream"],
    "strain": ["lstm_direct", "lstm_transfer", "lstm_transfer_ridge"],
    "glove": ["resnet3x3"],
}
AREAS = {"pressure": 270, "strain": 135}  # cells of the simulated glove
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
    (protocol, seed), kind = RUNS[experiment], tasks.kind(experiment)
    run = loop.KINDS[kind].Run(workspace, values, experiment, CLOSED[experiment][0], protocol, seed)
    if kind == "images":
        return [np.asarray(part) for area in run.frames.areas.values() for part in (area.wired, area.span, area.rest)]
    known = run.levels.known if kind == "windows" else run.levels
    ends = [run.levels.low, run.levels.high] if kind == "windows" else []
    return [np.asarray(level) for level in (*(known[name] for name in ("span", "rest", "low")), *ends)]


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
        assert card.version == provenance.version()
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


QUICK = {  # protocol, closed forms, columns of readings
    "touch": ("press", ["constant", "linear", "window_ridge"], 9),
    "velostat_recorded": ("repetition", ["constant", "linear", "window_ridge"], 1),
    "strain": ("task_1", ["constant", "ridge"], 4),
    "strain_recorded": ("within_day_xy", ["constant", "press_difference"], 6),
    "glove": ("session_combined", ["naive_bayes", "tree", "window_ridge"], 405),
    "glove_recorded": ("grasp_combined", ["naive_bayes", "tree", "window_ridge"], CELLS + JOINTS),
}
PARTS = np.array(["train", "train", "validation", "test"])


def columns_of(experiment: str, table: pa.Table) -> dict[str, pa.Array]:
    """Return what the dataset of a made report lacks, or has in another shape, as its readers and stress want it."""
    rng, n = np.random.default_rng(1), len(table)
    at = np.arange(n)
    if experiment == "touch":  # every third window ends without a touch
        force = schemas.matrix(table["force_n"]) * (at % 3 > 0)[:, None]
        return {"force_n": schemas.lists(force, pa.float32())}
    if experiment == "velostat_recorded":
        names = [name.split("/")[0] for name in table["recording"].to_pylist()]
        of_windows = {"x": schemas.lists(rng.uniform(1e3, 5e4, (n, 2)), pa.float32()), "force_n": table["y"]}
        return of_windows | {"condition": pa.array(names).dictionary_encode(), "press": pa.array(at // 5, pa.int32())}
    if tasks.kind(experiment) == "series":
        days = {"strain_recorded": "day_1", "strain": "task_1"}
        return {
            "condition": pa.array([days[experiment]] * n).dictionary_encode(),
            "press": pa.array(np.where(at % 2, at // 2, -1), pa.int32()),
            "v": schemas.lists(rng.uniform(0.5, 2.5, (n, QUICK[experiment][2])), pa.float32()),
        }
    names = [f"{name}_{name[-2:]}-99" for name in table["recording"].to_pylist()]  # as recorded grasps are called
    return {"recording": pa.array(names).dictionary_encode(), "t_s": pa.array(at * 0.1)}


def made(workspace: Workspace, experiment: str, monkeypatch) -> tuple[dict, np.ndarray]:
    """Write a small dataset, of images with the frames that they are of; return all settings, the part of each row."""
    settings = made_reports.settings_of(experiment)
    protocol, _, channels = QUICK[experiment]
    if tasks.kind(experiment) != "series":
        settings["window"] |= {"frames": 3 if experiment == "glove_recorded" else 2, "stride": 1}
    if experiment == "strain":
        settings["sensor"]["channels"] = channels
    made_reports.write(workspace, experiment, settings)
    monkeypatch.setitem(RUNS, experiment, (protocol, 0))
    monkeypatch.setitem(CLOSED, experiment, QUICK[experiment][1])
    table = pyarrow.parquet.read_table(workspace.dataset(experiment))
    n, split = len(table), schemas.split_column(protocol, 0)
    in_order = tasks.kind(experiment) == "series"
    parts = PARTS[np.arange(n) * 4 // n if in_order else np.random.default_rng(0).integers(0, 4, n)]
    columns = columns_of(experiment, table) | {split: pa.array(parts.tolist()).dictionary_encode()}
    table = table.drop_columns([name for name in columns if name in table.column_names])
    for name, column in columns.items():
        table = table.append_column(name, column)
    pyarrow.parquet.write_table(table, workspace.dataset(experiment))
    if tasks.kind(experiment) == "images":
        cells = {"pressure": CELLS, "strain": JOINTS} if experiment == "glove_recorded" else AREAS
        kind, rng = pa.float32() if experiment == "glove_recorded" else pa.int16(), np.random.default_rng(2)
        frames = table.select(["condition", "recording", "t_s"])
        for name, width in cells.items():
            frames = frames.append_column(name, schemas.lists(rng.integers(0, 150, (n, width)), kind))
        pyarrow.parquet.write_table(frames, workspace.frames(experiment))
    stress = params.load(made_reports.ROOT / "params.yaml")["stress"]
    known = params.load(made_reports.ROOT / "params.yaml")[experiment]["models"]
    settings["models"] = known | YARDSTICKS[tasks.kind(experiment)]
    return {experiment: settings, "stress": stress, "device": "cpu"}, parts


class Card(SimpleNamespace):
    """What ranges and intervals ask of a card."""

    def model_copy(self, update: Mapping) -> "Card":
        """Return the card with other fields."""
        return Card(**vars(self) | update)


def card_of(settings: Mapping, experiment: str) -> Card:
    """Return the card of the last of QUICK's closed forms."""
    (protocol, seed), (_, closed, columns), kind = RUNS[experiment], QUICK[experiment], tasks.kind(experiment)
    spec = tasks.of(experiment).spec
    shapes = {"series": lambda: spec(experiment, settings, protocol), "windows": lambda: spec(settings)}
    shape = shapes[kind]()._asdict() if kind in shapes else dict.fromkeys(Spec._fields, 1)
    least = 1.0 if experiment == "touch" else None
    return Card(
        **dict(experiment=experiment, kind=kind, protocol=protocol, seed=seed, model=closed[-1], weights_sha256=""),
        inputs=SimpleNamespace(columns=columns, chosen=list(range(columns))),
        outputs=SimpleNamespace(touch_kpa=least, force_gain=1.0, names=["x", "y"][: shape["map_cols"]]),
        shapes=SimpleNamespace(model_dump=lambda: shape),
        reading=settings,
    )


def quickly(workspace: Workspace, values: Mapping, experiment: str, monkeypatch) -> dict[str, object]:
    """Return what closed forms that are fitted to a small dataset say and choose, ranges, levels, the force gain."""
    (protocol, seed), path, task = RUNS[experiment], workspace.dataset(experiment), tasks.of(experiment)
    settings, found = values[experiment], {}
    for name in QUICK[experiment][1]:
        build = lambda spec, name=name: models.build(name, spec, settings["models"][name], "test")  # noqa: E731
        fit = task.fit(path, experiment, settings, protocol, seed, build, device="cpu")
        shape = task.stream(path, experiment, settings, protocol, seed)[1].shape[1:]
        given = np.random.default_rng(0).uniform(0, 900, (40, *shape)).astype(np.float32)
        found[name], found[f"{name}: history"] = fit.model.predict(given).tolist(), fit.history
        if name == "window_ridge":
            found["penalty"] = fit.model.estimator[-1].ridge_.alpha
        load = lambda *run, fit=fit: Trained(fit.model, failed=False)  # noqa: E731
        for *_, tests in task.tested(path, experiment, settings, [(protocol, seed)], load):
            rows = [row for *_, scored in tests for row in scored]
            found[f"{name}: force gain"] = {(*row[:2], row[3]) for row in rows if row[1] == "force_gain"}
        monkeypatch.setattr(tasks, "load", load)
    card = card_of(settings, experiment)
    found["ranges"] = training.trained_on(workspace, settings, card)
    workspace.calibration(experiment, card.model, protocol, seed).unlink(missing_ok=True)
    found["intervals"] = calibration.calibrated(workspace, values, card, refit=True).calibration.bounds
    assert any(bound.value is not None for bound in found["intervals"])
    if card.kind == "series":  # what calibrates a solved model saw the training part alone
        pieces = series.read(path, experiments.module(experiment).task(protocol, settings), protocol, seed)
        found["calibrating"] = calibration._without_validation(values, card, pieces).predict(given).tolist()
    found["levels"] = [level.tolist() for level in levels(workspace, values, experiment)]
    assert np.isfinite(np.concatenate([np.ravel(level) for level in found["levels"]])).all()
    return found


@pytest.mark.parametrize("part", ["test", "validation", "train"])
@pytest.mark.parametrize("experiment", QUICK)
def test_what_is_fitted_in_a_moment_does_not_see_a_part_that_it_must_not(experiment, part, workspace, monkeypatch):
    """As above, at once: closed forms on a made dataset. Another training part changes them."""
    values, parts = made(workspace, experiment, monkeypatch)
    before = quickly(workspace, values, experiment, monkeypatch)
    rows = np.flatnonzero(parts == part)
    for path in [workspace.dataset(experiment)] + [workspace.frames(experiment)] * ("glove" in experiment):
        table = pyarrow.parquet.read_table(path)
        changed = exchange(table, rows)
        assert not changed.equals(table)
        pyarrow.parquet.write_table(changed, path)
    after = quickly(workspace, values, experiment, monkeypatch)
    moved, closed = {name for name in after if after[name] != before[name]}, QUICK[experiment][1]
    histories = {f"{name}: history" for name in closed}
    if part == "test":
        assert not moved
    elif part == "validation":  # solved models of series are fitted to both parts, as in the paper
        assert "intervals" in moved and histories & moved
        assert moved <= {"intervals"} | histories | (set(closed) if "strain" in experiment else set())
    else:
        assert moved >= {closed[-1], "ranges", "levels", "intervals"} | ({"calibrating"} & after.keys())
