"""Sensors of one's own keep their results apart, whatever their folders are called, and one process trains on each."""

import os
import subprocess
import sys

import pytest

from tactile.base import paths, processes
from tactile.base.errors import InputError
from tactile.commands import own


def sensor(root, name):
    """Write an empty log of a sensor in data/own."""
    folder = root / "data" / "own" / name
    (folder / "single" / "run0").mkdir(parents=True)
    (folder / "single" / "run0" / "array.log").touch()
    return folder


def test_sensors_of_one_name_in_two_folders_share_nothing(workspace, tmp_path, monkeypatch):
    monkeypatch.setattr(own, "prepare", lambda *given: None)
    for name in ("a/finger", "b/finger"):
        with own.prepared(workspace, sensor(tmp_path, name), [0]) as made:
            assert (made.name, made.workspace.root) == (name, tmp_path / "build" / "own" / name)


def test_a_sensor_in_the_folder_of_another_is_refused(workspace, tmp_path, monkeypatch):
    outer, inner = sensor(tmp_path, "a"), sensor(tmp_path, "a/finger")
    for one, other in ((outer, inner), (inner, outer)):
        with pytest.raises(InputError, match=f"{one}: lies in one folder with {other}, another sensor"):
            own.name_of(workspace, one)
    report = tmp_path / "reports" / "own" / "b" / "finger"
    report.mkdir(parents=True)
    with pytest.raises(InputError, match=f"data/own/b: lies in one folder with {report}"):
        own.name_of(workspace, sensor(tmp_path, "b"))
    sensor(tmp_path, "")
    with pytest.raises(InputError, match="data/own: holds the folders of sensors"):
        own.name_of(workspace, tmp_path / "data" / "own")
    monkeypatch.chdir(sensor(tmp_path, "c"))
    assert own.name_of(workspace, outer.parent / "a" / ".." / "c") == "c"
    assert own.name_of(workspace, tmp_path / "bench" / "finger") == "bench/finger", "any folder of the workspace"


HOLD = """
import sys, time
from pathlib import Path
from tactile.base import processes
with processes.holding(Path(sys.argv[1]), lambda: None):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_second_run_on_a_sensor_is_refused_until_the_first_has_ended(workspace, tmp_path, monkeypatch):
    folder, done = sensor(tmp_path, "finger"), []
    monkeypatch.setattr(own, "prepare", lambda checkout, made, *rest: done.append(made.name))
    lock = tmp_path / "build" / "own" / "finger" / "lock"
    command = [sys.executable, "-c", HOLD, str(lock)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ, cwd=paths.CODE.parent) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(InputError, match="`tactile try .*finger` is already running; wait"):
            own.prepared(workspace, folder, [0]).__enter__()
        assert not done
        other.kill()
    with own.prepared(workspace, folder, [0]):
        assert done == ["finger"]


def test_a_system_without_locks_says_so(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(processes, "fcntl", None)
    with processes.holding(tmp_path / "lock", lambda: None):
        assert f"cannot lock {tmp_path / 'lock'}" in capsys.readouterr().err
