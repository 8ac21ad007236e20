"""Reports of the stability tests: they say where a model fails, and nothing that stress.csv does not say."""

import json

import numpy as np
import pandas as pd
import pytest

from pipeline.base import params, paths
from pipeline.base.errors import InputError
from pipeline.reporting.verdicts import stability as stability_verdicts
from pipeline.reporting.verdicts.stability import FAILED, HOLDS, level
from pipeline.scoring.results import Estimate
from pipeline.stages import collect, render_stability

MODELS = {"constant": {}, "linear": {}, "lomp": {}}
LEVELS = {"noise": [0, 0.1, 0.2], "press_speed": [0, -1, 1], "distance": [48, 12]}
# model -> error at the levels of each perturbation; constant has 10 everywhere
ERRORS = {
    "constant": {name: [10.0] * len(levels) for name, levels in LEVELS.items()},
    "linear": {"noise": [3, 5, 7], "press_speed": [3, 3, 11], "distance": [3, 4]},
    "lomp": {"noise": [2, 3, 3.9], "press_speed": [2, 5, 2], "distance": [2, 3]},
}


def errors(values: list[float], levels: list[float]) -> dict[float, Estimate]:
    return dict(zip(levels, (level([value]) for value in values), strict=True))


USABLE = 4.0


def test_a_model_fails_above_what_is_usable():
    found = stability_verdicts.verdict(errors([2, 3.9, 4.1, 9], [0, 1, 2, 3]), errors([10] * 4, [0, 1, 2, 3]), USABLE)
    assert found[:4] == (2, 2, 2, 4.1) and found.reason == "not usable"
    bad = stability_verdicts.verdict(errors([5, 6], [0, 1]), errors([10, 10], [0, 1]), USABLE)
    assert (bad.severity, bad.step) == (0, 0)


def test_a_model_fails_where_a_constant_is_better():
    found = stability_verdicts.verdict(errors([2, 3.5], [0, 1]), errors([3, 3], [0, 1]), USABLE)
    assert (found.severity, found.reason) == (1, "worse than constant")


def test_a_model_that_stays_below_both_holds():
    found = stability_verdicts.verdict(errors([2, 4], [0, 1]), errors([10, 10], [0, 1]), USABLE)
    assert found.reason == HOLDS and np.isnan(found.severity)
    assert stability_verdicts.verdict(errors([2, 4.1], [0, 1]), None, USABLE).severity == 1  # without `constant`


def test_the_relative_error_leaves_the_clean_one_out():
    own, floor = errors([1, 4, 6], [0, 1, 2]), errors([10, 10, 20], [0, 1, 2])
    assert stability_verdicts.relative(own, floor) == pytest.approx((0.4 + 0.3) / 2)
    assert np.isnan(stability_verdicts.relative(own, None))


def test_models_are_ranked_by_their_relative_error_over_all_perturbations():
    rows = [("good", 0.2), ("good", 0.4), ("poor", 0.9), ("poor", 0.1), ("failed", np.nan), ("failed", 0.1)]
    judged = pd.DataFrame(rows, columns=["model", "relative"])
    assert stability_verdicts.ranking(judged).to_dict() == pytest.approx({"good": 0.3, "poor": 0.5})


def test_a_failed_training_is_no_holding_model():
    own = {0: level([2, np.nan]), 1: level([2, np.nan])}
    assert stability_verdicts.verdict(own, None, USABLE).reason == FAILED


def test_severities_are_walked_outwards_from_0_or_as_listed():
    assert stability_verdicts.walked([0, 2, -1, 1, -2]) == [0, -1, 1, -2, 2]
    assert stability_verdicts.walked([48, 12, 24]) == [48, 12, 24]


@pytest.fixture
def root(tmp_path, monkeypatch):
    """A project with a trained `touch`, whose stress.csv is ERRORS, and no other experiment."""
    values = params.load()
    values["experiments"] = ["touch", "velostat_recorded"]
    values["touch"] |= {"models": MODELS, "protocols": {"press": {"seeds": [0, 1]}}}
    values["stress"]["touch"] |= {"protocols": ["press"], "usable": {"press": 5.5}}
    text = json.dumps(values)
    monkeypatch.setattr(params, "load", lambda: json.loads(text))
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    monkeypatch.setattr(paths, "REPORTS", tmp_path / "reports")
    for experiment, report in (
        ("touch", '{"run": true}'),
        ("velostat_recorded", '{"run": false, "reason": "no logs"}'),
    ):
        paths.experiment_folder(experiment).mkdir(parents=True)
        paths.ingest_report(experiment).write_text(report)
    scores, rows = [], []
    for model, own in ERRORS.items():
        for seed in (0, 1):
            folder = paths.run_folder("touch", model, "press", seed)
            folder.mkdir(parents=True)
            reason = "diverged" if (model, seed) == ("linear", 1) else "closed_form"
            fit = {
                "stop_reason": reason,
                "best_epoch": 1,
                "epochs": 1,
                "parameters": 1,
                "macs": 1,
                "precision": None,
                "settings": {},
            }
            (folder / "fit.json").write_text(json.dumps(fit))
            (folder / "history.csv").write_text("epoch,train_loss,validation_loss\n1,1,1\n")
            worse = 12 if (model, seed) == ("lomp", 0) else own["noise"][0]
            scores.append(("touch", "press", "single", model, seed, "rmse", "kPa", worse, 5))
            for name, levels in LEVELS.items():
                condition = "several" if name == "distance" else "single"
                for severity, error in zip(levels, own[name], strict=True):
                    key = ("touch", "press", condition, model, seed, name, severity)
                    rows.append((*key, "rmse", "kPa", error + 0.01 * seed, 5))
    columns = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
    pd.DataFrame(scores, columns=columns).to_csv(paths.scores("touch"), index=False)
    columns[5:5] = ["perturbation", "severity"]
    pd.DataFrame(rows, columns=columns).to_csv(paths.stress("touch"), index=False)
    pd.DataFrame([], columns=columns).to_csv(paths.stress("velostat_recorded"), index=False)
    monkeypatch.setattr("sys.argv", ["render_stability"])
    return tmp_path


@pytest.mark.slow
def test_the_report_says_who_fails_where(root):
    render_stability.main()
    folder = paths.REPORTS / "stability"
    table = pd.read_csv(folder / "failures.csv").set_index(["perturbation", "model"])
    assert table.loc[("noise", "linear"), "fails_at"] == 0.2 and table.loc[("noise", "lomp"), "verdict"] == HOLDS
    assert table.loc[("press_speed", "linear"), "verdict"] == "worse than constant"
    assert table.loc[("press_speed", "lomp"), "verdict"] == HOLDS
    assert table.loc[("noise", "linear"), "relative"] == pytest.approx(0.6, abs=0.001)
    assert "constant" not in table.index.get_level_values("model")
    text = (folder / "README.md").read_text()
    assert "## Touch: single touches\n" in text and "## Recorded Velostat taxel: not run\n\nNo logs." in text
    assert "1 of 6 runs diverged" in text and "1 of 6 clean scores are worse than the constant model's" in text
    pictures = {path.name for path in folder.glob("*.png")}
    heat_maps = {"touch_press_single_heat_map.png", "touch_press_several_heat_map.png"}
    assert pictures == {"touch_press_single.png", "touch_press_double.png"} | heat_maps
    assert all(name in text for name in pictures)


def test_a_missing_row_is_refused(root):
    table = pd.read_csv(paths.stress("touch"))
    table.drop(index=table[(table.model == "lomp") & (table.severity == 0.1)].index[:1]).to_csv(
        paths.stress("touch"), index=False
    )
    with pytest.raises(InputError, match="no row for .*perturbation noise, severity 0.1, model lomp, seed 0; run"):
        render_stability.main()


def test_a_repeated_row_is_refused(root):
    table = pd.read_csv(paths.stress("touch"))
    pd.concat([table, table.tail(1)]).to_csv(paths.stress("touch"), index=False)
    with pytest.raises(InputError, match="two rows for protocol press, condition several, perturbation distance"):
        render_stability.main()


def test_stress_of_all_experiments_is_one_file_with_the_agreed_columns(root):
    target = paths.REPORTS / "stress.csv"
    collect.collect({name: paths.stress(name) for name in ("touch", "velostat_recorded")}, target, collect.STRESS)
    found = pd.read_csv(target)
    first = ["experiment", "model", "seed", "perturbation", "severity", "metric", "unit", "value"]
    assert list(found.columns) == [*first, "protocol", "condition", "n"]
    assert found.value.sum() == pytest.approx(pd.read_csv(paths.stress("touch")).value.sum())
