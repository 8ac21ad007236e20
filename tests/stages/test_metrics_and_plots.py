"""What `dvc metrics` and `dvc plots` show: the errors of the reports, and pictures that need no network."""

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import yaml
from builders.project import ROOT

from pipeline.stages import metrics


def test_a_row_has_the_error_alone_with_its_unit():
    rows = [
        ("single touch", "cnn", "RMSE (kPa)", 2.00004, 0.5),
        ("double touch", "cnn", "RMSE (kPa)", float("nan"), 0.5),
    ]
    assert metrics.of_experiment(pd.DataFrame(rows, columns=["panel", "model", "measure", "error", "p50_ms"])) == {
        Path("single_touch/cnn.json"): {"kPa": 2.0},
        Path("double_touch/cnn.json"): {},  # a failed run has no error
    }


@pytest.mark.slow
def test_dvc_shows_models_as_rows_no_wider_than_a_screen():
    shown = dvc("metrics", "show", "--md")
    header, _, *rows = [line.split("|")[1:-1] for line in shown.strip().splitlines()]
    assert {name.strip() for name in header} == {"Path", "kPa", "N", "mm", "%"}
    assert max(map(len, shown.splitlines())) <= 120
    table = pd.read_csv(ROOT / "reports" / "touch" / "speed" / "table2.csv")
    paths = [row[0].strip() for row in rows]
    assert f"reports/metrics/touch/two_touches/{table['model'].iloc[-1]}.json" in paths
    assert len(paths) == len(list((ROOT / "reports" / "metrics").rglob("*.json")))


@pytest.mark.slow
def test_dvc_plots_need_no_network(tmp_path):
    """Of a clone as it is: every picture is there, and the page asks for nothing else."""
    dvc("plots", "show", "--out", str(tmp_path))
    page = (tmp_path / "index.html").read_text()
    assert "http" not in page
    listed = yaml.safe_load((ROOT / "dvc.yaml").read_text())["plots"]
    assert all((ROOT / path).is_file() for path in listed)
    assert page.count("<img") == len(listed) == len(list((tmp_path / "static").iterdir()))


def dvc(*words: str) -> str:
    """Return what DVC prints in this checkout."""
    environment = os.environ | {"DVC_NO_ANALYTICS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "dvc", *words], cwd=ROOT, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0 and "failed" not in done.stderr, done.stderr
    return done.stdout
