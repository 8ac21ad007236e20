"""Captions state what a figure shows: they follow the numbers that are drawn, with forms for ties and failed runs."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.base import params
from pipeline.reporting import (
    glove_captions,
    material,
    physics,
    sentences,
    sizes,
    speed,
    stability,
    strain_captions,
    touch_captions,
    twins,
)
from pipeline.reporting.page import answers, hypertext
from pipeline.reporting.verdicts.physics import CHANGES, EQUIVALENT, FAILED, UNKNOWN, Change, Judgement
from pipeline.reporting.verdicts.sizes import JUDGED
from pipeline.reporting.verdicts.stability import FAILURES
from pipeline.reporting.words import labels
from pipeline.scoring import glove_results
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


def fit(losses: list[float], best_epoch: int) -> SimpleNamespace:
    history = pd.DataFrame({"epoch": range(1, len(losses) + 1), "validation_loss": losses})
    return SimpleNamespace(history=history, best_epoch=best_epoch, epochs=len(losses))


def test_learning_curves_say_the_lowest_loss_and_how_often_training_ended_with_it():
    fits = {"lomp": [fit([9.0, 4.0], 2)], "cnn": [fit([7.0, 3.0, 5.0], 2)], "linear": [fit([1.0], 1)]}
    text = sentences.learning_caption(fits, "kPa²")
    assert text.startswith("CNN has the smallest validation loss, 3.00 kPa²; LoMP is next, 4.00 kPa².")
    assert text.endswith("The last epoch was the best, and kept, in 1 of 2 runs.")
    assert sentences.learning_caption({"linear": fits["linear"]}, "kPa²") == "No model is trained in epochs."


def test_touch_captions_follow_what_is_drawn():
    peaks = touch_captions.peak_pressure({"lomp": (1.2, 0.8), "cnn": (1.5, 1.1), "rnn": (np.nan, np.nan)})
    assert "LoMP has the smallest L1 loss, 1.20 kPa" in peaks and "runs failed for RNN" in peaks
    assert "The mean peak is 0.80 to 1.10 times the label's, too low for 1 of 2 models" in peaks
    places = touch_captions.press_location({"+0.0 mm": 500.0, "+3.0 mm": 300.0}, 40.0, 3.0)
    assert "500 counts at +0.0 mm" in places and "300 at +3.0 mm" in places and "3 mm apart" in places
    assert "too few press locations" in touch_captions.press_location({}, np.nan, np.nan).lower()
    assert "lower on unloading" in touch_captions.characteristic_curve(9e3, 90.0, 200.0, 150.0)
    assert "25 % higher on unloading" in touch_captions.characteristic_curve(9e3, 90.0, 200.0, 250.0)
    maps = touch_captions.pressure_maps({"one touch": {"cnn": 2.0, "lomp": 3.0}, "two touches": {"lomp": 4.0}})
    assert maps.startswith(
        "One touch: CNN has the smallest RMSE, 2.0 kPa; LoMP is next, 3.0 kPa. Two touches: the RMSE"
    )
    assert "4 presses: LoMP has the smallest" in touch_captions.double_touch({"lomp": 1.0, "cnn": 2.0}, 4)


def study(rows: list[tuple], columns: list[str]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=["protocol", *columns, "seed", "value"])


def test_strain_captions_follow_the_studies():
    rows = [("task_1", "lstm_direct", 100, seed, 2.0 + 0.1 * seed) for seed in (0, 1)]
    rows += [("task_1", "lstm_transfer", 100, seed, 1.0 + 0.1 * seed) for seed in (0, 1)]
    rows += [("task_1", model, 900, 0, error) for model, error in (("lstm_direct", 0.5), ("lstm_transfer", 0.9))]
    text = strain_captions.samples(study(rows, ["model", "samples"]))
    assert text.startswith(
        "Task 1: transfer is ahead at 100 samples, direct training at 900; the two intervals overlap at"
    )

    rows = [("task_1", "latent of model-0", "true drift", seed, 0.1) for seed in (0, 1)]
    rows += [("task_1", "raw voltages", "true drift", seed, 0.9) for seed in (0, 1)]
    text = strain_captions.decoding(study(rows, ["input", "target"]))
    assert text == "Task 1, true drift: R2 0.10 from the latent space of model-0, 0.90 from the raw voltages."

    rows = [
        ("task_1", units, seed, error + 0.2 * seed)
        for units, error in ((5, 9.0), (20, 1.05), (50, 1.0))
        for seed in (0, 1)
    ]
    text = strain_captions.capacity(study(rows, ["units"]))
    assert text == (
        "Task 1: 50 units have the smallest mean error, 1.100 mm; 20 are the fewest within one standard error of it, "
        "1.150 mm."
    )

    rows = [
        ("task_2", n, model, 0, n * error)
        for n in (2, 6)
        for model, error in (("lstm_direct", 2.0), ("lstm_transfer", 3.0))
    ]
    assert "is 1.50 with 2, 1.50 with 6 strands" in strain_captions.strands(study(rows, ["strands", "model"]))

    by_time = {"task_1": {"ridge": np.array([[1.0, 2.0]]), "esn": np.array([[3.0, 1.5]])}}
    text = strain_captions.error_over_time(by_time)
    assert "grows for 1 of 2 models; at the end Echo state network has the smallest error, 1.50 mm" in text
    assert "18.0 to 20.0 mV" in strain_captions.drifting(np.array([18.0, 20.0]), np.array([5.0, 7.0]), 20.0, 150)
    assert "changes by 0.200 (median of 3 states; 0.900 at most)" in strain_captions.latent_space(
        np.array([0.1, 0.2, 0.9]), np.array([0.3, 0.3, 0.3])
    )


def test_a_confusion_matrix_says_the_most_confused_pair_and_escapes_its_names():
    counts = np.array([[[6, 4, 0], [0, 10, 0], [0, 0, 10]]])
    text = glove_captions.confusion_matrix(counts, ["cup_1", "cup_2", "pen"], "pressure", "SP-ResNet")
    assert text.startswith("Pressure: SP-ResNet classifies 86.7 % of the images correctly.")
    assert "most confused are `cup_1` and `cup_2`: 20.0 % of their images" in text.lower()
    perfect = glove_captions.confusion_matrix(np.array([10 * np.eye(3, dtype=int)]), ["a", "b", "c"], "strain", "CNN")
    assert perfect == "Strain: CNN classifies 100.0 % of the images correctly, and confuses no pair of objects."
    assert "every run of CNN failed" in glove_captions.confusion_matrix(np.zeros((0, 3, 3)), [], "strain", "CNN")


def test_glove_captions_follow_what_is_drawn():
    rows = [("mean", "sp_resnet", 0, n, "macro_precision", value) for n, value in ((1, 0.5), (3, 0.7))]
    rows += [("mean", "resnet3x3", 0, n, "macro_precision", value) for n, value in ((1, 0.9), (3, 0.6))]
    table = pd.DataFrame(rows, columns=["form", "model", "seed", "frames", "metric", "value"])
    text = glove_captions.precision_by_frames({"pressure": table})
    assert "Pressure, 3 input frames, mean prediction of a one-frame network: SP-ResNet has the highest" in text
    assert "70.0 %; ResNet_3x3 is next, 60.0 %" in text and "answer" not in text
    sequences = {"empty_hand": np.full((4, 3), 0.1), "bottle": np.full((4, 3), 0.3)}
    assert "`bottle` presses the palm hardest" in glove_captions.tactile_sequences(sequences, 2)
    assert set(labels.FORMS) == set(glove_results.FORMS), "every form has words"


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


def test_the_fit_of_the_film_has_captions():
    recordings = {"pike1_a": {"places": [0.99, 0.98]}, "pike1_b": {"places": [0.97, 0.9]}, "other": {"places": [0, 0]}}
    text = material.captions({"recordings": recordings, "fitted_on": ["pike1_a", "pike1_b"]})["fit"]
    assert "is 0.900 (`pike1_b`) to 0.980 (`pike1_a`)" in text


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
