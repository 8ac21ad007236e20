"""A verdict on a network whose training had not ended stands only where a longer training would not change it."""

import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.base import params
from pipeline.claims import entries, evidence, judge, longer
from pipeline.claims.rules import NOT_TESTABLE, REPRODUCED
from pipeline.scoring import claim_inputs

VALUES = params.load(ROOT / "params.yaml")
SEEDS = (0, 1, 2)


@pytest.mark.parametrize(
    ("errors", "scale", "longer_error", "verdict"),
    [
        ({"cnn": 2.0, "lomp": 1.2}, "paper", {"cnn": 0.9, "lomp": 0.8}, REPRODUCED),  # also where CNN alone falls
        ({"cnn": 2.0, "lomp": 1.2}, "laptop", {"cnn": 0.9, "lomp": 0.8}, NOT_TESTABLE),
        ({"cnn": 2.0, "lomp": 1.7}, "paper", {"cnn": 0.9, "lomp": 0.8}, NOT_TESTABLE),  # CNN would be ahead
        ({"cnn": 1.7, "lomp": 1.9}, "paper", {"cnn": 0.9, "lomp": 0.8}, NOT_TESTABLE),  # LoMP would be ahead
        ({"cnn": 2.0, "lomp": 1.2}, "laptop", {"cnn": 0.995, "lomp": 1.1}, REPRODUCED),  # they have ended
    ],
)
def test_a_network_that_still_improves_has_a_verdict_only_where_that_would_not_change_it(
    workspace, monkeypatch, errors, scale, longer_error, verdict
):
    monkeypatch.setattr(params, "scale_of", lambda scales, experiment, settings: scale)
    claim = next(entries._claims(
        {"paper": "lomp", "simulated": {"experiment": "touch", "metric": "rmse", "unit": "", "protocol": "press"}},
        [{"id": "a", "text": "A.", "source": "I", "above": "single.cnn - single.lomp"}],
    ))  # fmt: skip
    rows = [
        {"experiment": "touch", "protocol": "press", "condition": "single", "model": model, "metric": "rmse"}
        | {"seed": seed, "value": level * (0.99 + 0.01 * seed)}
        for model, level in errors.items()
        for seed in SEEDS
    ]
    results = pd.DataFrame(rows).reindex(columns=claim_inputs.COLUMNS).assign(whole=True)
    epochs = {model: VALUES["touch"]["models"][model]["training"]["epochs"] for model in errors}
    trained = [("press", model, 0, epochs[model], 1.0, 99, longer_error[model], 9.0) for model in errors]
    known = {"touch": pd.DataFrame(trained, columns=longer.COLUMNS)}
    assert judge.judged(claim, evidence.Evidence(workspace, results, VALUES, known)).verdict == verdict
    if scale == "paper" and verdict == REPRODUCED:  # what a longer training would predict is not known
        of_predictions = results.assign(whole=False)
        assert judge.judged(claim, evidence.Evidence(workspace, of_predictions, VALUES, known)).verdict == NOT_TESTABLE


def test_errors_of_a_longer_training():
    values = pd.Series([0.5, 0.9])
    assert longer.with_errors(values, "rmse", 0.8).tolist() == pytest.approx([0.4, 0.72])
    assert longer.with_errors(values, "accuracy", 0.8).tolist() == pytest.approx([0.6, 0.92])
    assert longer.with_errors(values, "r2", 0.8).tolist() == pytest.approx([0.68, 0.936])
