"""What the strain reports say must follow from the numbers, whatever they are."""

import numpy as np
import pandas as pd
import pytest

from pipeline.base import paths
from pipeline.reporting import strain as strain_report
from pipeline.reporting import strain_recorded as strain_recorded_report
from pipeline.scoring import published, results, strain_results

MODELS = {"constant": {}, "press_difference": {}, "lstm_direct": {}, "lstm_highpass": {}}


@pytest.fixture
def root(tmp_path, monkeypatch):
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    return tmp_path


def write_scores(experiment, rows):
    columns = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
    paths.scores(experiment).parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows, columns=columns).to_csv(paths.scores(experiment), index=False)


def recorded(highpass):
    """Scores of two protocols; `highpass`: R2 of the high-pass LSTM in x."""
    levels = {"constant": 0.0, "press_difference": 0.93, "lstm_direct": -0.5, "lstm_highpass": highpass}
    rows = []
    for protocol, day in (("within_day_xy", "day_1"), ("across_days_xy", "day_2")):
        for model, level in levels.items():
            for metric in ("error", "r2_x", "r2_y", "press_r2_x", "press_r2_y"):
                rows.append(("strain_recorded", protocol, day, model, 0, metric, "1", level, 10))
    return rows


@pytest.mark.parametrize(
    ("level", "words"),
    [(0.95, ["above 0.90 in both", "above 0.85 in both"]), (0.87, ["0.030 below 0.90", "above 0.85 in both"])],
)
def test_the_best_model_is_held_against_the_target_and_called_exploratory_where_it_was_chosen(root, level, words):
    settings = {"protocols": {p: {"seeds": [0]} for p in ("within_day_xy", "across_days_xy")}, "models": MODELS}
    write_scores("strain_recorded", recorded(level))
    scores = results.Scores("strain_recorded", settings)
    tested = {"within_day_xy": "day_1", "across_days_xy": "day_2"}
    text = strain_recorded_report.findings(scores, settings, tested, {"figure": "What it shows."})
    assert "- [figure.png](figure.png): What it shows." in text
    verdicts = [line for line in text.splitlines() if "raw voltages" in line]
    assert len(verdicts) == 2 and all(word in line for word, line in zip(words, verdicts, strict=True))
    assert all("LSTM on high-passed voltages" in line for line in verdicts)  # never the hand-made yardstick
    assert "reached" not in text and [("exploratory" in line) for line in verdicts] == [False, True]
    table = strain_recorded_report.score_text(scores, settings, tested)
    assert table.count("voltages (exploratory)") == 1  # on the day it was chosen on
    assert table.count("Extra trees") == 2 and f"{level:.3f}" in table


def study(direct, transfer):
    """samples.csv with the same error for both seeds; direct, transfer: samples -> error."""
    rows = [
        ("task_1", model, n, seed, "error", "mm", value)
        for model, values in {"lstm_direct": direct, "lstm_transfer": transfer}.items()
        for n, value in values.items()
        for seed in (0, 1)
    ]
    return pd.DataFrame(rows, columns=["protocol", "model", "samples", "seed", "metric", "unit", "value"])


@pytest.mark.parametrize(
    ("direct", "words"),
    [
        ({100: 9.0, 1000: 2.0, 10000: 1.0}, "transfer is ahead at 100 samples, direct training at 1,000 / 10,000"),
        ({100: 9.0, 1000: 8.0, 10000: 7.0}, "do not cross up to 10,000"),
        ({100: 1.0, 1000: 1.0, 10000: 1.0}, "task 1: direct training is ahead at every size (100"),
        ({100: 1.0, 1000: 9.0, 10000: 2.0}, "transfer is ahead at 1,000 samples, direct training at 100 / 10,000"),
    ],
)
def test_where_the_curves_cross(direct, words):
    (line,) = strain_report.samples_sentences(study(direct, {100: 4.0, 1000: 3.0, 10000: 2.5}))
    assert words in line


def test_drift_is_said_of_the_latent_space_and_of_the_voltages():
    rows = [
        ("task_1", name, "true drift", seed, "r2", "1", value)
        for name, values in (("raw voltages, 10 samples", (0.2, 0.2)), ("latent of model-0", (0.6, 0.62)))
        for seed, value in enumerate(values)
    ]
    drift = pd.DataFrame(rows, columns=["protocol", "input", "target", "seed", "metric", "unit", "value"])
    (line,) = strain_report.drift_sentences(drift)
    words = (
        "true drift can be read from model-0's latent space with R2 0.61 [0.46, 0.72], from the raw voltages with 0.20"
    )
    assert words in line


def test_smallest_capacity():
    errors = {5: [2.0, 2.1], 20: [1.03, 1.05], 50: [1.0, 1.06]}
    rows = [
        ("task_1", units, 1, seed, "error", "mm", value)
        for units, pair in errors.items()
        for seed, value in enumerate(pair)
    ]
    capacity = pd.DataFrame(rows, columns=["protocol", "units", "params", "seed", "metric", "unit", "value"])
    (line,) = strain_report.capacity_sentences(capacity)
    assert "50 units are the best, 1.030 mm; 20 are the fewest within one standard error of that, 1.040 mm" in line
    (line,) = strain_report.capacity_sentences(capacity[capacity["units"] < 50])
    assert "20 units are the best, 1.040 mm. The paper" in line


def test_error_is_over_the_outputs_that_were_asked_for():
    truth = np.array([[3.0, 4.0, 7.0]])
    assert strain_results.mean_error(truth, np.array([[0.0, 0.0, np.nan]])) == pytest.approx(5.0)
    assert strain_results.mean_error(truth, np.array([[np.nan, np.nan, 5.0]])) == pytest.approx(2.0)


def test_published_table_is_read():
    assert published.latent("lstm_direct", "task_1", "parameters") == 11450
    assert published.latent("lstm_transfer", "task_2", "test error") == 26
    assert np.isnan(published.latent("ridge", "task_2", "test error"))
