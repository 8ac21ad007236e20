"""The command that repeats strain's fit: which value it calls the nearest, and when the recordings cannot tell."""

import argparse
import json
import operator
from functools import reduce

import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.twins import strain as twins
from tactile.base import params
from tactile.base.errors import InputError
from tools import fit_strain


@pytest.fixture
def short(monkeypatch):
    """One finger, 15 minutes of presses, few trees."""
    monkeypatch.setattr(twins, "STRETCH_S", 900.0)
    monkeypatch.setattr(twins, "APART", 2)
    monkeypatch.setattr(twins, "TREES", {"n_estimators": 3, "min_samples_leaf": 2, "random_state": 0})
    return params.load(ROOT / "params.yaml")


def recorded(statistics, spread=0.0):
    """A table as twins.recorded returns it: three stretches, `spread` (relative) apart."""
    rows = [(f"stretch {k}", name, value * (1 + k * spread)) for name, value in statistics.items() for k in (-1, 0, 1)]
    return pd.DataFrame(rows, columns=["recording", "statistic", "value"])


@pytest.mark.slow
def test_the_value_that_the_recordings_were_made_with_is_the_nearest(short):
    values = short
    made_with = {"circuit.noise_v": 1.4, "strand.sensitivity_per_mm": 0.7}
    target = {}
    for setting, factor in made_with.items():
        value = reduce(operator.getitem, setting.split("."), values["strain"]["simulate"])
        statistic = fit_strain.SET_BY[setting]
        target[statistic] = fit_strain.simulated(values, 1, setting, factor * value)[statistic]
    others = {name: 1.0 for name in twins.STATISTICS if name not in target}
    results = {each.setting: each for each in fit_strain.tried(values, recorded(target | others, 0.01), (0.7, 1.4), 1)}
    assert set(results) == set(fit_strain.SET_BY)
    for setting, factor in made_with.items():
        each = results[setting]
        assert each.nearest() == pytest.approx(factor * each.values[0]) and each.told()
    noise = results["circuit.noise_v"].simulated
    assert noise[1] / noise[0] == pytest.approx(0.7, rel=0.05) and noise[2] / noise[0] == pytest.approx(1.4, rel=0.05)
    text = fit_strain.table(list(results.values()))
    (row,) = [line for line in text.splitlines() if "circuit.noise_v" in line]
    assert row.split("|")[5].strip() == "0.00294" and row.split("|")[6].strip() == "yes"
    quiet = results["circuit.noise_v"]._replace(recorded=(noise[0], 0, 1))
    assert "0.0021 (as set)" in fit_strain.table([quiet])


def test_a_wide_recorded_range_allows_all_values():
    each = fit_strain.Tried("circuit.noise_v", [2.0, 1.0, 4.0], [2.1, 1.1, 4.1], (2.0, 1.0, 3.0))
    assert each.told() and each.nearest() == 2.0
    assert not each._replace(recorded=(3.5, 0.0, 4.0)).told()
    assert each._replace(recorded=(3.5, 0.0, 4.0)).nearest() == 4.0


def test_every_setting_is_one_of_the_scene_and_every_statistic_a_twins():
    scene = params.load(ROOT / "params.yaml")["strain"]["simulate"]
    assert all(reduce(operator.getitem, setting.split("."), scene) > 0 for setting in fit_strain.SET_BY)
    assert set(fit_strain.SET_BY.values()) <= set(twins.STATISTICS)


def test_without_recordings_a_sentence_says_so(workspace):
    workspace.ingest_report("strain_recorded").parent.mkdir(parents=True)
    reason = "recordings not downloaded; run `tactile fetch strain_recorded`"
    workspace.ingest_report("strain_recorded").write_text(json.dumps({"run": False, "reason": reason}))
    with pytest.raises(InputError, match="tactile fetch strain_recorded"):
        fit_strain.main(workspace, argparse.Namespace(factors=[0.7], specimens=1))
