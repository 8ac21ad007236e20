"""The simulate stage: the written logs depend on nothing but the settings."""

import copy

import pytest
from builders.project import ROOT

from pipeline.scenes import touch
from pipeline.stages import simulate
from tactile.base import params
from tactile.base.paths import Workspace


@pytest.fixture
def settings():
    """The smallest scene of three kinds of recordings, one of them with a reset."""
    block = copy.deepcopy(dict(params.load(ROOT / "params.yaml")["touch"]))
    scene = block["simulate"] = dict(block["simulate"])
    scene["single"] = scene["single"] | {
        "points_per_side": 2,
        "depths": 2,
        "repetitions": 1,
        "presses_per_recording": 4,
    }
    scene["double"] = scene["double"] | {"recordings": 1, "presses_per_recording": 2}
    scene["faults"] = scene["faults"] | {"resets": 1}
    return block


def written(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_the_number_of_processes_changes_no_byte(settings, tmp_path, monkeypatch):
    logs = []
    for processes in ("1", "2"):
        workspace = Workspace(tmp_path / processes)
        monkeypatch.setenv("WORKERS", processes)
        simulate.simulate(workspace, "touch", settings)
        logs.append(written(workspace.logs("touch")))
    assert logs[0] == logs[1]
    recordings, _ = touch.plan(settings)
    assert {path.parent.as_posix() for path in logs[0]} == {f"{each.condition}/{each.name}" for each in recordings} | {
        "."
    }


def test_the_faults_are_listed_in_the_order_of_the_plan(workspace, settings, monkeypatch):
    """Also where the recordings are done in another order."""
    run_tasks = simulate.workers.run
    monkeypatch.setenv("WORKERS", "1")
    monkeypatch.setattr(
        simulate.workers, "run", lambda *arguments, **named: reversed(list(run_tasks(*arguments, **named)))
    )
    simulate.simulate(workspace, "touch", settings)
    rows = (workspace.logs("touch") / "faults.csv").read_text().splitlines()[1:]
    names = list(dict.fromkeys(tuple(row.split(",")[:2]) for row in rows))
    planned = [(each.condition, each.name) for each in touch.plan(settings)[0]]
    assert len(names) > 1
    assert names == [name for name in planned if name in names]
