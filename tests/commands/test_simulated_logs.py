"""`tactile simulate` writes logs on which the commands for a sensor of one's own can be tried."""

import argparse
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from builders.project import ROOT

from pipeline.commands import simulate
from tactile.base.errors import InputError
from tactile.base.paths import Workspace


@pytest.mark.slow
def test_the_logs_of_a_sensor_go_the_whole_way(tmp_path, monkeypatch, capsys):
    """Every line that it prints, as it stands there, on fewer presses."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(simulate, "SINGLE", simulate.SINGLE | {"points_per_side": 4, "presses_per_recording": 16})
    monkeypatch.setattr(simulate, "DOUBLE", simulate.DOUBLE | {"presses_per_recording": 2})
    simulate.main(Workspace(tmp_path), argparse.Namespace(folder=Path("bench") / "pad"))
    said = capsys.readouterr().out
    lines = [shlex.split(line, comments=True) for line in said.splitlines() if line.startswith("  tactile ")]
    assert [words[1] for words in lines] == ["check", "sheet", "try", "predict", "live"]
    assert "48 presses of one tip and 2 of two" in said
    *whole, live = ([sys.executable, "-m", "tactile.commands.command_line", *words[1:]] for words in lines)
    for words in whole:
        done = subprocess.run(words, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True)
        assert done.returncode == 0, f"{words}\n{done.stdout}\n{done.stderr}"
    assert "rmse (kPa)" in done.stdout
    assert Path(live[-1]).is_file() and Path(live[4]).is_dir()
    with pytest.raises(InputError, match="bench/pad: is there already"):
        simulate.main(Workspace(tmp_path), argparse.Namespace(folder=Path("bench") / "pad"))
