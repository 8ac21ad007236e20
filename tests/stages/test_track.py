"""The stage looks through MLflow's store wherever results, settings or store may have changed, and only then."""

from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.stages import track
from pipeline.tracking import mlflow_runs
from tactile.base.paths import Workspace

PARAMS = {"experiments": ["touch"]}
FILES = (
    "params.yaml",
    "params/touch.yaml",
    "evidence/index.csv",
    "data/touch/scores.csv",
    "data/touch/models/cnn/press-0/network.safetensors",
    "mlflow.db",
)


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    for name in FILES:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("first")
    return Workspace(tmp_path)


@pytest.fixture
def tracks(workspace, monkeypatch) -> Callable[[], bool]:
    """Run the stage, and say whether it looked through the store."""
    called = []
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.setattr("sys.argv", ["track"])
    monkeypatch.setattr(track, "load", lambda path: PARAMS)
    monkeypatch.setattr(mlflow_runs, "track", lambda *given: called.append(given))

    def run() -> bool:
        called.clear()
        track.main(workspace)
        return bool(called)

    return run


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("change", [lambda path: path.write_text("other"), Path.unlink])
def test_a_changed_or_removed_file_is_seen_once(workspace, tracks, name, change):
    assert tracks() and not tracks()
    change(workspace.root / name)
    assert tracks() and not tracks()


def test_a_new_model_is_seen(workspace, tracks):
    assert tracks()
    (workspace.models("touch") / "rnn").mkdir()
    assert not tracks()
    (workspace.models("touch") / "rnn" / "fit.json").write_text("{}")
    assert tracks()


def test_a_call_that_failed_is_repeated(workspace, tracks, monkeypatch):
    def fails(*given):
        raise OSError("locked")

    with monkeypatch.context() as broken:
        broken.setattr(mlflow_runs, "track", fails)
        with pytest.raises(OSError, match="locked"):
            track.main(workspace)
    assert tracks() and not tracks()


def test_of_a_server_no_file_tells(tracks, monkeypatch):
    assert tracks() and not tracks()
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:1")
    assert tracks() and tracks()


def test_what_python_keeps_of_imported_code_is_no_change(tracks, monkeypatch, tmp_path):
    """Another process may be writing it: then it has a name of its own for a moment."""
    monkeypatch.setattr(track.paths, "CODE", tmp_path / "tactile")
    assert tracks() and not tracks()
    kept = tmp_path / "pipeline" / "__pycache__" / "new.cpython-311.pyc.140201"
    kept.parent.mkdir(parents=True)
    kept.write_text("half")
    assert not tracks()
    (kept.parents[1] / "new.py").write_text("code")
    assert tracks()
