"""Captions state what a figure shows: they follow the numbers that are drawn, with forms for ties and failed runs."""

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.base import params
from pipeline.reporting import physics, sentences, sizes, speed, stability, twins
from pipeline.reporting.page import answers, hypertext
from pipeline.reporting.verdicts.physics import CHANGES, EQUIVALENT, FAILED, UNKNOWN, Change, Judgement
from pipeline.reporting.verdicts.sizes import JUDGED
from pipeline.reporting.verdicts.stability import FAILURES
from pipeline.reporting.words import labels
from pipeline.scoring.results import Estimate


def measured(mean: float, half: float = np.nan, runs: int = 3, failed: int = 0) -> Estimate:
    return Estimate(mean, mean - half, mean + half, runs, failed)


def test_a_caption_names_the_best_model_with_its_number_and_unit_and_the_next_one():
    errors = {"rnn": measured(5.5, 0.2), "lomp": measured(4.7, 0.2), "cnn": measured(9.0, 0.2)}
    text = sentences.best(errors, "error of double touches", "kPa", 1)
    assert text == "LoMP has the smallest error of double touches, 4.7 kPa; RNN is next, 5.5 kPa"
    errors["rnn"] = measured(4.0, 0.1)
    assert sentences.best(errors, "error", "kPa", 1).startswith("RNN has the smallest error, 4.0 kPa; LoMP is next")
    shares = sentences.best(errors, "precision", "%", 0, more_is_better=True)
    assert shares.startswith("CNN has the highest precision, 9 %; LoMP is next, 5 %")


def test_models_that_the_intervals_do_not_tell_apart_are_named_or_counted():
    errors = {"lomp": measured(4.7, 0.5), "rnn": measured(5.5, 0.5), "cnn": measured(9.0, 0.5)}
    assert sentences.best(errors, "error", "kPa").endswith("RNN is next, 5.50 kPa, and their intervals overlap")
    errors["cnn"] = measured(5.6, 0.5)
    assert sentences.best(errors, "error", "kPa").endswith("the intervals of RNN and CNN overlap with that of LoMP")
    errors |= {"vgg": measured(5.6, 0.5), "tree": measured(5.6, 0.5)}
    assert "the intervals of 4 models overlap" in sentences.best(errors, "error", "kPa")
    alone = {model: measured(error.mean) for model, error in errors.items()}
    assert "overlap" not in sentences.best(alone, "error", "kPa"), "one run has no interval"


def test_equal_values_share_the_first_place():
    errors = {"lomp": measured(4.701), "rnn": measured(4.699), "cnn": measured(6.0)}
    text = sentences.best(errors, "error", "kPa")
    assert text == "RNN and LoMP have the smallest error, 4.70 kPa; CNN is next, 6.00 kPa"
    comma = {"lstm_direct": measured(1.0), "lstm_transfer": measured(1.0)}
    assert sentences.best(comma, "error", "mm").startswith("LSTM, direct / LSTM, transfer (Adam) have the smallest")


def test_failed_runs_and_a_single_model_have_a_form_of_their_own():
    errors = {"lomp": measured(4.7), "rnn": measured(1.0, failed=1)}
    assert sentences.best(errors, "error", "kPa") == "the error of LoMP is 4.70 kPa; runs failed for RNN"
    broken = sentences.one_run({"lomp": np.nan})
    assert sentences.best(broken, "error", "kPa") == "no model has error in all runs; runs failed for LoMP"
    assert "none of the models" in sentences.best({}, "error", "kPa")
    assert sentences.caption("lower case", "", "a second part") == "Lower case. A second part."


def judged(verdicts: dict[str, list[str]]) -> pd.DataFrame:
    """Rows of FAILURES of one condition; verdicts: model -> one per perturbation."""
    rows = [
        dict.fromkeys(FAILURES, np.nan)
        | {"experiment": "touch", "protocol": "press", "condition": "single", "perturbation": f"p{k}"}
        | {"model": model, "verdict": verdict, "relative": 0.2 * (place + 1)}
        for place, (model, of_model) in enumerate(verdicts.items())
        for k, verdict in enumerate(of_model)
    ]
    return pd.DataFrame(rows)


def test_stability_captions_rank_by_error_and_count_what_is_withstood():
    rows = judged({"lomp": ["holds", "holds"], "cnn": ["holds", "not usable"], "tree": ["not usable"] * 2})
    text = stability.heat_map_caption(rows, "Touch: single touches")
    assert text.startswith(
        "Touch, single touches: LoMP has the smallest mean error under 2 perturbations, 0.20 times the"
    )
    text = stability.curves_caption(rows, "Touch: single touches")
    assert text == (
        "Touch, single touches: LoMP stays usable up to the last severity under 2 of 2 perturbations, the most; "
        "Decision tree under 0, the fewest."
    )
    none = stability.curves_caption(judged({"tree": ["not usable"], "cnn": ["worse than constant"]}), "Touch: a")
    assert "no model stays usable up to the last severity of any perturbation (1)" in none
    same = stability.curves_caption(judged({"tree": ["holds"], "cnn": ["holds"]}), "Touch: a")
    assert "all 2 models stay usable up to the last severity under 1 of 1" in same
    assert "failed in training" in stability.curves_caption(judged({"tree": ["failed in training"]}), "Touch: a")


def test_a_physics_caption_names_the_largest_change_that_is_no_chance():
    far, wide = Change("single", "rnn", 1.0, 0.65, 0.5, 0.8), Change("double", "lomp", 1.0, 0.9, -0.2, 3.0)
    judgements = [Judgement("creep", [wide], [], UNKNOWN), Judgement("load_sharing", [far], [], CHANGES)]
    text = physics.figure_caption(judgements)
    assert text == (
        "Leaving out sharing of the load among elements changes an error most: +65 % [+50 %, +80 %] for RNN, single "
        "touch. Verdicts on 2 effects: changes errors 1, cannot be told 1."
    )
    assert physics.figure_caption(judgements[:1]).startswith("No effect that is left out changes an error")
    failed = Judgement("noise", [Change("single", "rnn", 1.0, *[np.nan] * 3)], [], FAILED)
    assert "on 2 effects: equivalent 1, failed 1." in physics.figure_caption(
        [failed, Judgement("a", [], [], EQUIVALENT)]
    )


def test_a_caption_of_sizes_names_the_smallest_that_is_enough():
    row = {"experiment": "touch", "condition": "single", "family": "lomp", "metric": "rmse", "unit": "kPa", "runs": 2}
    rows = [row | {"size": 64, "value": 5.0, "chosen": 1}, row | {"size": 128, "value": 4.9, "chosen": 0}]
    rows = pd.DataFrame(rows, columns=JUDGED)
    assert (
        sizes.figure_caption(rows)
        == "LoMP, single touch: the smallest size that is enough is 64 (hidden units), error 5.00 kPa."
    )
    assert sizes.figure_caption(rows.assign(chosen=[0, 1])).endswith("error 4.90 kPa, the largest tried.")
    assert "every size has a failed run" in sizes.figure_caption(rows.assign(chosen=0))
    no_interval = pd.Series({"excess": 0.5, "excess_low": np.nan, "excess_high": np.nan})
    assert sizes.excess_text(no_interval) == "+50.0 %"


def test_a_caption_of_twins_names_what_lies_farthest_outside():
    columns = ["statistic", "unit", "recorded", "recorded_low", "recorded_high", "simulated", "inside"]
    rows = [("creep_press", "log", 1.0, 0.0, 2.0, 5.0, False), ("noise", "mV", 1.0, 0.5, 1.5, 1.6, False)]
    rows.append(("shift", "1", 1.0, 0.5, 1.5, 1.0, True))
    table = pd.DataFrame(rows, columns=columns).astype({"inside": "boolean"})
    text = twins.figure_caption(table)
    assert text == (
        "1 of 3 simulated values lie in the recorded range. Farthest outside is creep press: 5 simulated, 0 to 2 "
        "recorded (log of the reading)."
    )
    assert twins.figure_caption(table[2:]) == "1 of 1 simulated values lie in the recorded range."


def test_a_speed_caption_names_the_most_accurate_and_the_fastest_model():
    rows = [("constant", 30.0, 0.01, 0), ("linear", 9.0, 0.02, 0), ("lomp", 5.0, 12.0, 0), ("rnn", 1.0, 0.001, 1)]
    table = pd.DataFrame(rows, columns=["model", "error", "p50_ms", "failed"])
    table = table.assign(panel="single touch", measure="RMSE (kPa)", low=np.nan, high=np.nan, runs=1)
    text = speed.chart_caption(table, "p50_ms")
    assert text.startswith("Single touch: LoMP has the smallest RMSE, 5.00 kPa; Linear is next, 9.00 kPa")
    assert text.endswith("Linear is fastest, 0.02 ms with 9.00 kPa; LoMP takes 12.0 ms.") and "failed for RNN" in text
    assert "fastest" not in speed.chart_caption(table[3:], "p50_ms")


def test_the_chart_of_printed_errors_counts_those_in_the_band():
    rows = [{"ours": value} for value in (1.0, 1.1, 2.0, 0.5, None)]
    text = answers.compared_caption(rows)
    assert text == "Of 4 errors, ours lie in the band for 2, above it for 1 and below it for 1."


@pytest.mark.parametrize("line", ["- [a.png](a.png): LoMP is best.", "![a](a.png) LoMP is best."])
def test_the_page_reads_a_figure_and_its_caption(line):
    assert hypertext.captions(f"Text\n\n{line}\n\n[a](b.png)") == {"a.png": "LoMP is best."}


def test_every_perturbation_and_effect_of_params_has_words():
    values = params.load(ROOT / "params.yaml")
    stressed = {name for block in values["stress"].values() for name in block["perturbations"]}
    assert stressed <= set(labels.PERTURBATIONS) and stressed <= set(stability.SEVERITIES)
    effects = {name for key in values["physics"] for name in values[key]["simulate"]["effects"]}
    assert effects <= set(labels.EFFECTS)
    assert set(values["experiments"]) <= set(labels.EXPERIMENTS)
    assert labels.condition_name("mine", "session_left", "left") == "session left", "words for what nobody named"
