"""Charts and tables of speed against accuracy: the right fronts, every model named, no failure drawn as a result."""

import numpy as np
import pandas as pd
import pytest

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.reporting import speed as speed_report
from pipeline.reporting.figures import speed as speed_figures
from pipeline.reporting.figures import style
from pipeline.reporting.words import labels
from pipeline.reporting.words.labels import FRONTS, SPREAD
from pipeline.scoring import results

TIMES = {"constant": 0.007, "linear": 0.22, "poly": 0.38, "tree": 0.083, "rbf": 0.33, "cnn": 0.24, "vgg": 1.7}
TIMES |= {"convlstm": 0.8, "rnn": 0.334, "lomp": 2.8}


def test_the_front_of_a_hand_made_example():
    points = {
        (1.0, 9.0): True,  # the fastest
        (2.0, 9.0): False,  # as good, but slower
        (2.0, 5.0): True,
        (3.0, 6.0): False,
        (4.0, 1.0): True,  # the best
        (4.0, 2.0): False,  # as fast, but worse
        (np.nan, 0.5): False,
        (0.5, np.nan): False,  # failed: neither on the front nor in anybody's way
    }
    time, error = np.array(list(points)).T
    time = np.column_stack([time, time])
    assert speed_report.pareto(time, error).tolist() == list(points.values())
    order = np.arange(len(points))[::-1]
    assert speed_report.pareto(time[order], error[order]).tolist() == list(points.values())[::-1]


def test_equal_points_are_on_the_front_together():
    assert front_of([1, 1, 2, 2], [3, 3, 2, 3]) == [True, True, True, False]
    assert front_of([1, 1], [np.nan, np.nan]) == [False, False]


def front_of(times, errors):
    return speed_report.pareto([(time, time) for time in times], errors).tolist()


def test_times_that_overlap_are_equal():
    overlapping, apart = [(1.0, 1.3), (1.2, 1.5)], [(1.0, 1.1), (1.2, 1.5)]
    assert speed_report.pareto(overlapping, [3.0, 2.0]).tolist() == [False, True]  # as fast, and better
    assert speed_report.pareto(apart, [3.0, 2.0]).tolist() == [True, True]
    assert speed_report.pareto(overlapping, [2.0, 2.0]).tolist() == [True, True]
    assert speed_report.pareto(apart, [2.0, 2.0]).tolist() == [True, False]


@pytest.fixture
def measured(tmp_path, monkeypatch):
    """(settings, scores, latency) of three models, two conditions with a split each; `bad` has one failed run."""
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    settings = {
        "models": {"constant": {}, "tree": {}, "cnn": {}},
        "protocols": {"session_strain": {"seeds": [0, 1]}, "session_pressure": {"seeds": [0, 1]}},
        "latency": {"batches": [1, 256], "threads": 1, "calls": 7, "rounds": 1},
    }
    right = {"constant": (0.1, 0.1), "tree": (0.5, 0.7), "cnn": (0.9, np.nan)}
    rows = [
        ("glove", protocol, protocol.split("_")[1], model, seed, "accuracy", "1", values[seed], 9)
        for protocol in settings["protocols"]
        for model, values in right.items()
        for seed in (0, 1)
    ]
    names = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
    for path in (paths.latency("glove"), paths.training_times("glove", "any")):
        path.parent.mkdir(parents=True)
    pd.DataFrame(rows, columns=names).to_csv(paths.scores("glove"), index=False)
    for place, model in enumerate(right):
        taken = [("session_strain", 0, 1.0 + place), ("session_strain", 1, 3.0 + place)]
        taken += [("session_pressure", seed, 10.0 + place) for seed in (0, 1)]
        times = pd.DataFrame(taken, columns=["protocol", "seed", "train_s"])
        times.to_csv(paths.training_times("glove", model), index=False)
    latency = {
        (model, batch): {"threads": 1, "p50_ms": (1 + place) * batch / 2, "p95_ms": 9.0 * batch, "params": 10**place}
        | {"p50_low_ms": (0.9 + place) * batch / 2, "p50_high_ms": (1.1 + place) * batch / 2}
        | {"macs": np.nan, "size_bytes": 77}
        for place, model in enumerate(right)
        for batch in (1, 256)
    }
    return settings, results.Scores("glove", settings), latency


PANELS = {"strain": ("session_strain", "strain"), "pressure": ("session_pressure", "pressure")}
WRONG = ("accuracy", "Images classified incorrectly (%)")


def test_table_holds_what_was_measured(measured):
    settings, scores, latency = measured
    found = speed_report.speed_table(scores, settings, latency, PANELS, WRONG).set_index(["panel", "model"])
    tree = found.loc["strain", "tree"]
    assert tree["error"] == pytest.approx(40) and tree["low"] < 40 < tree["high"]
    assert tree["predictions_per_s"] == pytest.approx(1000) and tree["p50_ms"] == 1.0
    assert tree["train_s"] == 3.0 and found.loc["pressure", "tree"]["train_s"] == 11.0  # of the panel's own runs
    # The one good run of `cnn` has the fewest errors of all; that does not put it on a front.
    assert found.loc["strain", "cnn"]["error"] == pytest.approx(10) and found.loc["strain", "cnn"]["failed"] == 1
    assert found["speed_front"].to_numpy().reshape(2, 3).tolist() == [[1, 1, 0]] * 2
    # On strain the seeds' training times of the constant, 1 and 3 s, and of the tree, 2 and 4 s, overlap.
    assert found["training_front"].to_numpy().reshape(2, 3).tolist() == [[0, 1, 0], [1, 1, 0]]


@pytest.mark.parametrize(
    ("spoilt", "words"), [("time", "tree has no p50_ms"), ("training", "tree has no train_s .* session_pressure")]
)
def test_a_model_without_a_time_is_named(measured, spoilt, words):
    settings, scores, latency = measured
    if spoilt == "time":
        latency["tree", 1]["p50_ms"] = 0.0
    else:
        path = paths.training_times("glove", "tree")
        times = pd.read_csv(path)
        times[times["protocol"] != "session_pressure"].to_csv(path, index=False)
    with pytest.raises(InputError, match=words):
        speed_report.speed_table(scores, settings, latency, PANELS, WRONG)


def drawable(panels):
    """A table as `speed_table` makes it; panels: title -> model -> (ms, error, low, high, runs, failed, parameters)."""
    names = ["panel", "model", "p50_ms", "error", "low", "high", "runs", "failed", "params"]
    rows = [(panel, model, *values) for panel, models in panels.items() for model, values in models.items()]
    table = pd.DataFrame(rows, columns=names).assign(measure="RMSE (kPa)", batch=1)
    table["train_s"] = 10 * table["p50_ms"]
    for time, (low, high) in SPREAD.items():
        table[low], table[high] = 0.99 * table[time], 1.01 * table[time]
    for time, column in FRONTS.items():
        table[column] = 0
        for _, own in table.groupby("panel"):
            on = speed_report.pareto(own[SPREAD[time]], own["error"].where(own["failed"] == 0))
            table.loc[own.index, column] = on.astype(int)
    return table


def drawn(table, tmp_path, monkeypatch, time="p50_ms"):
    """The finished figure, before it is closed."""
    saved = []
    monkeypatch.setattr(style, "save", lambda figure, path: saved.append(figure))
    speed_figures.chart(tmp_path / "x.png", table, time)
    key, whole = saved[0].legends[0].get_window_extent(), saved[0].bbox
    assert whole.x0 <= key.x0 and key.x1 <= whole.x1 and whole.y0 <= key.y0
    return saved[0]


def crowded(spread):
    """Ten models, nine of which lie within `spread` of each other in time and error."""
    rng = np.random.default_rng(3)
    near = {}
    for place, model in enumerate(TIMES):
        time, error = (0.2, 10.0) * np.exp(spread * rng.normal(size=2)) if place else (0.007, 11.0)
        near[model] = (time, error, 0.97 * error, 1.03 * error, 3, 0, 10 ** (place * 0.8))
    return near


@pytest.mark.slow
@pytest.mark.parametrize(("spread", "time"), [(0.0, "p50_ms"), (0.1, "p50_ms"), (1.0, "train_s")])
def test_every_model_is_named_and_no_name_covers_another(tmp_path, monkeypatch, spread, time):
    as_printed = {m: (t, 5 + 0.1 * k, 4.5, 5.8, 3, 0, 10**k) for k, (m, t) in enumerate(TIMES.items())}
    figure = drawn(drawable({"single": crowded(spread), "double": as_printed}), tmp_path, monkeypatch, time)
    for ax in figure.axes:
        boxes = {" ".join(text.get_text().split()): text.get_window_extent() for text in ax.texts}
        assert set(boxes) == {labels.model_name(model) for model in TIMES}
        inside, names = ax.get_window_extent(), list(boxes)
        for k, one in enumerate(names):
            for other in names[k + 1 :]:
                assert not boxes[one].overlaps(boxes[other]), (one, other)
            assert inside.x0 <= boxes[one].x0 and boxes[one].x1 <= inside.x1, one
            assert inside.y0 <= boxes[one].y0 and boxes[one].y1 <= inside.y1, one


def test_a_failed_model_is_marked_at_the_top_and_an_outlier_stays_on_the_chart(tmp_path, monkeypatch):
    models = {
        "constant": (0.007, 15.7, 15.6, 15.8, 3, 0, 400),
        "poly": (0.38, 132.0, -40.0, 300.0, 3, 0, 140400),
        "lomp": (2.8, np.nan, np.nan, np.nan, 0, 3, 2_741_712),
        "rnn": (0.33, 1.0, np.nan, np.nan, 1, 2, 263056),
        "cnn": (0.24, 0.0, 0.0, 0.0, 3, 0, 636208),
    }
    figure = drawn(drawable({"double": models}), tmp_path, monkeypatch)
    (ax,) = figure.axes
    names = {" ".join(text.get_text().split()): text.get_window_extent() for text in ax.texts}
    assert set(names) == {
        "Constant (mean)",
        "Polynomial",
        "LoMP: failed (3 of 3 runs)",
        "RNN: failed (2 of 3 runs)",
        "CNN: 0",  # has no place on a logarithmic axis
    }
    low, high = ax.get_ylim()
    assert 0 < low < 15.6 / 3 and 132 < high  # an interval that reaches below zero does not set the axis
    top = ax.get_window_extent().y1
    for text in ("LoMP: failed (3 of 3 runs)", "RNN: failed (2 of 3 runs)"):
        assert names[text].y1 > top - 120
    # The error of the one good run of `rnn` is drawn nowhere: its mark is at the top edge.
    marks = {float(mark.get_offsets()[0][0]): mark for mark in ax.collections}
    assert set(marks) == {time for time, *_ in models.values()}
    for time in (2.8, 0.33):
        _, height = marks[time].get_offset_transform().transform(marks[time].get_offsets()[0])
        assert top - 30 < height < top
    assert {text.get_text() for text in figure.legends[0].get_texts()} >= {"failed", "on the front", "dominated"}


def test_models_without_an_interval_are_named_apart(tmp_path, monkeypatch):
    """Runs of a closed form on the same data are equal: three at the same place, as recorded strain has them."""
    at = (0.024, 6.0, np.nan, np.nan, 3, 0, 10_000)
    models = {
        "lstm_direct": at,
        "lstm_transfer": at,
        "lstm_transfer_ridge": at,
        "press_difference": (3.0, 3.4, *at[2:]),
    }
    (ax,) = drawn(drawable({"within day xy": models}), tmp_path, monkeypatch).axes
    frame, boxes = ax.get_window_extent(), [text.get_window_extent() for text in ax.texts]
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 for box in boxes)
    assert not any(one.overlaps(other) for k, one in enumerate(boxes) for other in boxes[:k])
