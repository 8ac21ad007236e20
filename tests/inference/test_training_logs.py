"""A card keeps which logs are in the split of its run, and in which parts, whatever stage reads them."""

import copy
import shutil

from builders import live_models, own_logs
from builders.project import ROOT, run_stage

from tactile.base import files, params
from tactile.inference import consistent, training_logs
from tactile.stages import dataset, ingest, window

ALL = ["train", "validation", "test"]


def made(workspace, monkeypatch, experiment: str, sensor, changed) -> dict:
    """Ingest the logs in data/own/sensor and make their dataset; return the settings of the experiment."""
    values = copy.deepcopy(params.load(ROOT / "params.yaml"))
    values[experiment] |= {"sensor": sensor, "source": "data/own/sensor"}
    for block, keys in changed.items():
        values[experiment][block] |= keys
    monkeypatch.setenv("WORKERS", "1")
    monkeypatch.setattr(params, "load", lambda _: values)
    for stage in (ingest, *([window] if experiment == "touch" else []), dataset):
        run_stage(monkeypatch, workspace, stage, experiment)
    return values[experiment]


def known(workspace, settings, card, **changed) -> dict[str, list[str]] | None:
    """Return recording -> parts of a card's logs, whose digests are those of the files."""
    card = card.model_copy(update=changed)
    digests = training_logs.digests(workspace, settings, card.experiment)
    found = training_logs.added(workspace, settings, card, digests).logs
    if found is None:
        return None
    name = {"strain": "daq.log", "touch": "array.log"}[card.experiment]
    for log in found:
        assert log.sha256 == files.content_sha256(workspace.root / "data" / "own" / "sensor" / log.name / name)
    return {log.name: log.parts for log in found}


def test_a_model_that_starts_from_another_was_trained_on_the_logs_of_both(workspace, monkeypatch, tmp_path):
    folder = workspace.root / "data" / "own" / "sensor"
    own_logs.strain(folder, 4, 12.0, seconds=90.0)
    settings = made(workspace, monkeypatch, "strain", {"channels": 4}, {"ingest": {"rate_hz": 12}})
    card = consistent.read(live_models.series(tmp_path / "model"))
    first, second = (f"{task}/{own_logs.NAMES[number]}" for number, task in enumerate(("task_0", "task_1")))
    given = workspace, settings, card
    assert known(*given, protocol="task_1") == {second: ALL}
    assert known(*given, protocol="task_1", model="lstm_transfer") == {first: ALL[:2], second: ALL}
    assert known(*given, protocol="task_0", model="lstm_transfer") == {first: ALL}
    assert known(*given, protocol="task_1", model="model_zero") == {second: ALL}
    # Other logs than ingest read tell nothing, and neither do logs that are gone.
    shutil.copytree(folder / first, folder / "task_0" / "later")
    assert known(*given, protocol="task_1") is None
    shutil.rmtree(folder)
    assert known(*given, protocol="task_1") is None
    workspace.ingest_report("strain").unlink()
    assert training_logs.digests(workspace, settings, "strain") is None


def test_another_condition_is_of_the_test_part_alone(workspace, monkeypatch, tmp_path):
    own_logs.touch(workspace.root / "data" / "own" / "sensor", 2, 3, 50.0, seconds=40.0)
    sensor = {"rows": 2, "cols": 3, "pitch_mm": 10.0, "element_mm": 9.0}
    settings = made(workspace, monkeypatch, "touch", sensor, {"label": {"map_rows": 8, "map_cols": 12}})
    card = consistent.read(live_models.linear(tmp_path / "model"))
    found = known(workspace, settings, card)
    assert found.pop("double/day 2, double") == ["test"]
    assert set(found) == {"single/day1_0", "single/day1_1"} and all("train" in parts for parts in found.values())
    workspace.dataset("touch").unlink()
    assert known(workspace, settings, card) is None
