"""Reports of the stability tests: they say where a model fails, and nothing that stress.csv does not say."""

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.base import files, params
from pipeline.base.errors import InputError
from pipeline.claims import stability as stability_verdicts
from pipeline.claims.stability import FAILED, HOLDS, level
from pipeline.reporting import studies
from pipeline.reporting.figures import style
from pipeline.reporting.words import labels
from pipeline.scoring.results import Estimate

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
def stress(workspace, monkeypatch) -> pd.DataFrame:
    """reports/stress.csv of a trained `touch` with ERRORS; of velostat_recorded there is nothing."""
    values = params.load(ROOT / "params.yaml")
    values["experiments"] = ["touch", "velostat_recorded"]
    values["touch"] |= {"models": MODELS, "protocols": {"press": {"seeds": [0, 1]}}}
    values["stress"]["touch"] |= {"protocols": ["press"], "usable": {"press": 5.5}}
    monkeypatch.setattr(params, "load", lambda _: values)
    for name, report in (("touch", '{"run": true}'), ("velostat_recorded", '{"run": false, "reason": "no logs"}')):
        workspace.experiment_folder(name).mkdir(parents=True)
        workspace.ingest_report(name).write_text(report)
    rows = [
        (
            "touch",
            "press",
            "several" if name == "distance" else "single",
            model,
            seed,
            name,
            at,
            "rmse",
            error + seed / 100,
        )
        for model, own in ERRORS.items()
        for name, levels in LEVELS.items()
        for seed in (0, 1)
        for at, error in zip(levels, own[name], strict=True)
    ]
    columns = ["experiment", "protocol", "condition", "model", "seed", "perturbation", "severity", "metric", "value"]
    workspace.reports.mkdir()
    return pd.DataFrame(rows, columns=columns)


def written(workspace, table: pd.DataFrame) -> dict[str, bytes]:
    """Render the report of a table of stress tests; return its files."""
    table.to_csv(workspace.reports / "stress.csv", index=False)
    with files.replacing_folder(workspace.reports / "stability") as draft:
        studies.stability(workspace, draft, params.load(workspace.params))
    return {path.name: path.read_bytes() for path in (workspace.reports / "stability").iterdir()}


def test_the_report_says_where_each_model_fails(workspace, stress, undrawn):
    found = written(workspace, stress)
    table = pd.read_csv(workspace.reports / "stability" / "failures.csv").set_index(["perturbation", "model"])
    assert table.loc[("noise", "linear"), "fails_at"] == 0.2 and table.loc[("noise", "lomp"), "verdict"] == HOLDS
    assert table.loc[("press_speed", "linear"), "verdict"] == "worse than constant"
    assert table.loc[("noise", "linear"), "relative"] == pytest.approx(0.6, abs=0.001)
    assert "constant" not in table.index.get_level_values("model")
    text = found["README.md"].decode()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    assert ["LoMP", "0.35", "holds", "holds"] in rows and ["Linear", "0.65", "0.2", "1*"] in rows
    assert rows.index(["LoMP", "0.35", "holds", "holds"]) < rows.index(["Linear", "0.65", "0.2", "1*"])
    assert "## Recorded Velostat taxel: not run\n\nNo logs." in text
    heat_maps = {"touch_press_single_heat_map.png", "touch_press_several_heat_map.png"}
    assert set(found) == {"README.md", "failures.csv", "touch_press_single.png", "touch_press_double.png"} | heat_maps
    assert all(name in text for name in found if name not in ("README.md", "touch_press_double.png"))


def test_a_failed_run_is_named(workspace, stress, monkeypatch):
    legends = []
    monkeypatch.setattr(style, "save", lambda figure, path: legends.extend(own.get_texts() for own in figure.legends))
    stress.loc[(stress.model == "linear") & (stress.seed == 1), "value"] = np.nan
    text = written(workspace, stress)["README.md"].decode()
    assert all(line.endswith("failed |") for line in text.splitlines() if line.startswith("| Linear"))
    for legend in legends:
        names = [text.get_text() for text in legend]
        assert "Linear: failed (1 of 2 runs)" in names and "LoMP" in names
    assert legends


def test_a_missing_or_repeated_run_is_refused(workspace, stress):
    lost = stress.index[(stress.model == "lomp") & (stress.severity == 0.1)][:1]
    with pytest.raises(InputError, match="no row for .*perturbation noise, severity 0.1, model lomp, seed 0; run"):
        written(workspace, stress.drop(index=lost))
    with pytest.raises(InputError, match="two rows for protocol press, condition several, perturbation distance"):
        written(workspace, pd.concat([stress, stress.tail(1)]))


def test_every_perturbation_and_effect_of_params_has_words():
    values = params.load(ROOT / "params.yaml")
    stressed = {name for block in values["stress"].values() for name in block["perturbations"]}
    effects = {name for key in values["physics"] for name in values[key]["simulate"]["effects"]}
    assert stressed <= set(labels.PERTURBATIONS) and effects <= set(labels.EFFECTS)
