"""`tactile demo` shows what a trained model does, with nothing but a checkout."""

import json
import os
import subprocess
import sys
import urllib.request

import numpy as np
import pytest
from builders.project import ROOT

from tactile import experiments
from tactile.base import params

SAMPLE = ROOT / "data" / "sample"
DEMO = [sys.executable, "-m", "tactile.commands.command_line", "demo"]


def test_the_sample_is_small_and_its_page_makes_it_again(tmp_path, monkeypatch):
    """The scene may have been mended since: the same presses, at the same places, read within a tenth of the range."""
    assert sum(path.stat().st_size for path in SAMPLE.rglob("*.*")) < 200_000
    code = (SAMPLE / "README.md").read_text().partition("```python\n")[2].partition("```")[0]
    assert '"params.yaml"' in code and '"build/sample"' in code
    monkeypatch.chdir(ROOT)
    exec(code.replace("build/sample", str(tmp_path)), {})
    (again,) = tmp_path.rglob("array.log")
    settings = params.load(ROOT / "params.yaml")["touch"]
    made, kept = (
        experiments.module("touch").read_recording(folder, settings)[0]
        for folder in (again.parent, SAMPLE / "double" / "two_touches")
    )
    reading = [np.array(table["v"].to_pylist()) for table in (made, kept)]
    assert reading[0].shape == reading[1].shape
    assert np.abs(reading[0] - reading[1]).max() < 102


@pytest.mark.slow
def test_the_demo_gives_picture_and_numbers_in_seconds(tmp_path):
    """It takes at most six times the import of torch; three times where LoMP is compiled already, else five times."""
    began = os.times()
    subprocess.run([sys.executable, "-c", "import torch"], check=True)
    before = os.times()
    done = subprocess.run([*DEMO, "--out", str(tmp_path / "out")], cwd=ROOT, capture_output=True, text=True)
    after = os.times()
    assert done.returncode == 0, done.stderr
    spent = [times.children_user + times.children_system for times in (began, before, after)]
    assert spent[2] - spent[1] < 6 * (spent[1] - spent[0])
    pictures = [tmp_path / "out" / f"double-two_touches.{kind}" for kind in ("png", "gif")]
    assert all(path.stat().st_size > 10_000 and str(path) in done.stdout for path in pictures)
    (said,) = json.loads((tmp_path / "out" / "summary.json").read_text())["recordings"]
    assert said["readings"] == 882 and said["rejected_lines"] == {"banner or text": 1}
    assert said["scores"]["rmse (kPa)"] < 9 and said["scores"]["touches_found"] > 0.8
    assert f"rmse (kPa) {said['scores']['rmse (kPa)']:.3g}" in done.stdout


@pytest.mark.slow
def test_the_demo_replays_on_the_live_page():
    process = subprocess.Popen([*DEMO, "--live", "--http-port", "0"], cwd=ROOT, stderr=subprocess.PIPE, text=True)
    try:
        address = next(line.split()[0] for line in process.stderr if line.startswith("http://127.0.0.1"))
        with urllib.request.urlopen(address, timeout=120) as page:
            assert b"<title>" in page.read()
    finally:
        process.terminate()
        said = process.communicate(timeout=120)[1]
    assert "lines rejected" in said
