"""What `dvc metrics` and `dvc plots` show: the numbers of the reports, and nothing else."""

import json

import pandas as pd
import pytest

from pipeline.claims.rules import VERDICTS
from pipeline.stages import metrics

COLUMNS = ["panel", "model", "measure", "error", "p50_ms", "train_s"]


def test_a_panel_has_each_model_with_error_and_times():
    rows = [("single", "cnn", "RMSE (kPa)", 2.0, 0.5, 30.0), ("double", "cnn", "RMSE (kPa)", float("nan"), 0.5, 30.0)]
    times = {"prediction (ms)": 0.5, "training (s)": 30.0}
    assert metrics.of_experiment(pd.DataFrame(rows, columns=COLUMNS)) == {
        "single": {"cnn": {"RMSE (kPa)": 2.0} | times},
        "double": {"cnn": times},  # a failed run has no error
    }


def test_verdicts_are_counted_where_the_claim_counts():
    kinds = {"sentence": "reproduced", "number": "undecided", "count": "reproduced", "calibration": "calibrated"}
    rows = [("simulated", "lomp", kind, verdict) for kind, verdict in kinds.items()]
    counted = metrics.of_claims(pd.DataFrame(rows, columns=["data", "paper", "kind", "verdict"]))
    assert counted == {
        "simulated": {"lomp": {"reproduced": 1, "contradicted": 0, "undecided": 1, "matches": 0, "near": 0, "off": 0}}
    }


@pytest.mark.slow
def test_dvc_shows_metrics_and_plots_of_the_miniature(miniature):
    (shown,) = json.loads(miniature.dvc("metrics", "show", "--json").stdout).values()  # of one revision
    shown = shown["data"]
    table = pd.read_csv(miniature.folder / "reports" / "touch" / "speed" / "table2.csv")
    panels = shown["reports/metrics/touch.json"]["data"]
    assert set(panels) == set(table["panel"])
    (linear,) = table[(table["panel"] == "single touch") & (table["model"] == "linear")]["error"]
    assert panels["single touch"]["linear"]["RMSE (kPa)"] == pytest.approx(linear, rel=1e-5)
    assert shown["reports/metrics/glove_recorded.json"]["data"] == {}  # no recordings
    claims = pd.read_csv(miniature.folder / "reports" / "claims.csv")
    counts = pd.json_normalize(shown["reports/metrics/verdicts.json"]["data"]).to_numpy().sum()
    counted = claims["kind"].isin(metrics.COUNTED) & claims["verdict"].isin(VERDICTS)  # not outside, not calibrated
    assert counts == counted.sum() > 0
    plots = json.loads(miniature.dvc("plots", "show", "--json").stdout)["data"]
    assert "reports/glove/accuracy/figure14_combined.png" in plots
    (curves,) = [plots[name] for name in plots if name.startswith("Learning curves of touch")]
    (speed,) = [plots[name] for name in plots if name.startswith("Speed against accuracy")]
    assert all(plot[0]["content"]["data"]["values"] for plot in (curves, speed))
