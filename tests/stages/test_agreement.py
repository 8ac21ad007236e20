"""Agreement with the committed results: every verdict can be had, and a failed run is no agreement."""

import numpy as np
import pandas as pd
import pytest

from pipeline.base import params, paths
from pipeline.stages import agreement


def scores(values, models=("linear", "cnn")) -> pd.DataFrame:
    """Two models, three seeds; `values`: (model, seed) -> value where it is not 10 + seed."""
    rows = [
        ("touch", "press", "single", model, "rmse", seed, values.get((model, seed), 10.0 + seed))
        for model in models
        for seed in range(3)
    ]
    return pd.DataFrame(rows, columns=[*agreement.KEY, "value"])


SETTINGS = {("touch", "linear"): "abc", ("touch", "cnn"): "abc"}
COMMITTED = agreement.fingerprint(scores({}), SETTINGS)


def verdict(value: float) -> str:
    found = agreement.compare(COMMITTED, scores({("cnn", 1): value}))
    return found.set_index(["model", "seed"])["verdict"]["cnn", 1]


def test_the_tolerance_is_the_spread_of_the_seeds_or_two_percent():
    assert COMMITTED["tolerance"].tolist() == [1.0] * 6
    close = agreement.fingerprint(scores({("cnn", k): 10.0 for k in range(3)}), SETTINGS)
    assert close["tolerance"].tolist()[3:] == pytest.approx([0.2] * 3)


def test_every_verdict_can_be_had():
    assert verdict(11.0) == "to the bit"
    assert verdict(11.0 + 1e-7) == "to six digits"
    assert verdict(11.9) == verdict(10.1) == "within tolerance"
    assert verdict(12.1) == verdict(np.nan) == "beyond"
    one = agreement.compare(COMMITTED, scores({}, models=("cnn", "rnn")))["verdict"].value_counts()
    assert one.to_dict() == {"to the bit": 3, "only here": 3, "only committed": 3}
    failed = agreement.fingerprint(scores({("cnn", 0): np.nan}), SETTINGS)
    assert set(agreement.compare(failed, scores({("cnn", 0): np.nan}))["verdict"]) == {"to the bit"}


def test_the_report_names_what_differs_and_what_was_not_compared():
    more = SETTINGS | {("glove", "tree"): "x"}
    text, sentence = agreement.report(COMMITTED, scores({("cnn", 1): 15.0}), more)
    assert sentence == "5 of 6 numbers agree, 5 of them to the bit."
    assert "touch press single cnn rmse 1" in text and "|        11 |   15 |" in text
    assert "glove: no scores here" in text
    text, sentence = agreement.report(COMMITTED, scores({}), SETTINGS | {("touch", "cnn"): "other"})
    assert sentence.startswith("3 of 3") and "touch, cnn: its settings in params.yaml are not those" in text
    text, sentence = agreement.report(COMMITTED, scores({}), dict.fromkeys(SETTINGS, "other"))
    assert sentence.startswith("0 of 0") and "touch, linear: its settings" in text


def test_a_new_model_is_not_compared_and_a_lost_one_does_not_agree():
    new = SETTINGS | {("touch", "rnn"): "abc"}
    text, sentence = agreement.report(COMMITTED, scores({}, models=("linear", "cnn", "rnn")), new)
    assert sentence == "6 of 6 numbers agree, 6 of them to the bit."
    assert "touch, rnn: no scores in the fingerprint." in text
    _, sentence = agreement.report(COMMITTED, scores({}, models=("linear",)), SETTINGS)
    assert sentence == "3 of 6 numbers agree, 3 of them to the bit."


def test_accepted_scores_agree_to_the_bit(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(paths, "REPORTS", tmp_path)
    monkeypatch.setattr(agreement, "FINGERPRINT", tmp_path / "fingerprint.csv")
    touch = {"latency": {}, "models": {"linear": {}, "cnn": {}}}
    monkeypatch.setattr(params, "load", lambda: {"experiments": ["touch"], "touch": touch})
    scores({("cnn", 0): 1 / 3, ("cnn", 1): np.nan}).to_csv(tmp_path / "scores.csv", index=False, na_rep="nan")
    for arguments in (["accept"], []):
        monkeypatch.setattr("sys.argv", ["agreement", *arguments])
        agreement.main()
    assert capsys.readouterr().out == "6 of 6 numbers agree, 6 of them to the bit.\n"


def test_a_digest_is_of_what_a_model_depends_on():
    def digest(calls=1, split=0, cnn=1, rnn=1) -> str:
        block = {"latency": {"calls": calls}, "split": split, "models": {"cnn": {"x": cnn}, "rnn": {"x": rnn}}}
        return agreement.digests({"experiments": ["touch"], "touch": block})["touch", "cnn"]

    assert digest() == digest(calls=2) == digest(rnn=2)
    assert len({digest(), digest(split=1), digest(cnn=2)}) == 3
