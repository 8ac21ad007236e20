"""Charts and tables of speed against accuracy: the right fronts, every model named, no failure drawn as a result."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from pipeline.reporting import speed as speed_report
from pipeline.reporting.figures import speed as speed_figures
from pipeline.reporting.page import charts
from pipeline.reporting.report import Report
from pipeline.results import shards, times
from pipeline.results.claim_inputs import COLUMNS
from pipeline.results.one_table import Results
from tactile.base.errors import InputError
from tactile.base.files import sha256, write_table
from tactile.drawing import style
from tactile.drawing.labels import MACHINES


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
def measured(workspace):
    """(settings, scores, latency) of three models, two conditions with a split each; `bad` has one failed run."""
    settings = {
        "models": {"constant": {}, "tree": {}, "cnn": {}},
        "protocols": dict.fromkeys(("session_strain", "session_pressure"), {"seeds": [0, 1, 2]}),
        "latency": {"batches": [1, 256], "threads": 1, "calls": 7, "rounds": 1},
    }
    right = {"constant": (0.1, 0.1, 0.1), "tree": (0.5, 0.7, 0.6), "cnn": (0.9, np.nan, 0.9)}
    rows = [
        ("glove", protocol, protocol.split("_")[1], model, seed, "accuracy", "1", values[seed], 9)
        for protocol in settings["protocols"]
        for model, values in right.items()
        for seed in (0, 1, 2)
    ]
    names = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
    for path in (workspace.latency("glove"), workspace.training_times("glove", "any")):
        path.parent.mkdir(parents=True)
    pd.DataFrame(rows, columns=names).to_csv(workspace.scores("glove"), index=False)
    for place, model in enumerate(right):
        taken = [("session_strain", seed, 1.0 + seed + place) for seed in (0, 1, 2)]
        taken += [("session_pressure", seed, 10.0 + place) for seed in (0, 1, 2)]
        times = pd.DataFrame(taken, columns=["protocol", "seed", "train_s"])
        times.to_csv(workspace.training_times("glove", model), index=False)
    latency = {
        (model, batch): {"threads": 1, "p50_ms": (1 + place) * batch / 2, "p95_ms": 9.0 * batch, "params": 10**place}
        | {"p50_low_ms": (0.9 + place) * batch / 2, "p50_high_ms": (1.1 + place) * batch / 2}
        | {"macs": np.nan, "size_bytes": 77, "batch": batch, "calls": 7, "machine": "core"}
        for place, model in enumerate(right)
        for batch in (1, 256)
    }
    return settings, Report(workspace, "glove", settings, look=True), latency


PANELS = {"strain": ("session_strain", "strain"), "pressure": ("session_pressure", "pressure")}
WRONG = ("accuracy", "Images classified incorrectly (%)")


def test_table_holds_what_was_measured(workspace, measured):
    settings, report, latency = measured
    found = speed_report.speed_table(report, settings, latency, PANELS, WRONG).set_index(["panel", "model"])
    tree = found.loc["strain", "tree"]
    assert tree["error"] == pytest.approx(40) and tree["low"] < 40 < tree["high"]
    assert tree["predictions_per_s"] == pytest.approx(1000) and tree["p50_ms"] == 1.0
    assert tree["train_s"] == 3.0 and found.loc["pressure", "tree"]["train_s"] == 11.0  # of the panel's own runs
    # The good runs of `cnn` have the fewest errors of all; that does not put it on a front.
    assert found.loc["strain", "cnn"]["error"] == pytest.approx(10) and found.loc["strain", "cnn"]["failed"] == 1
    assert found["speed_front"].to_numpy().reshape(2, 3).tolist() == [[1, 1, 0]] * 2
    # On strain the seeds' training times of the constant, 1 and 3 s, and of the tree, 2 and 4 s, overlap.
    assert found["training_front"].to_numpy().reshape(2, 3).tolist() == [[0, 1, 0], [1, 1, 0]]


@pytest.fixture
def computed(workspace, measured):
    """(settings, report, latency): of shards of a tree on bending, at half and at all of four epochs, by `write_index`.

    One of the full ones ran on a busy core, and took three times as long.
    """
    settings, _, latency = measured
    rows = [
        {"experiment": "glove", "protocol": "session_strain", "condition": "strain", "model": "tree", "seed": seed}
        | {"metric": "accuracy", "unit": "1", "budget": budget, "value": right, "n": 9}
        for budget, right in {"half": 0.5, "full": 0.6}.items()
        for seed in (0, 1, 2)
    ]
    taken = {("set", seed, "full"): ("core", 4, 4.0 * (10 + seed)) for seed in (0, 1, 2)}
    taken |= {("set", seed, "half"): ("core", 2, 2.0 * (10 + seed)) for seed in (0, 1)}
    taken |= {("set", 2, "half"): ("core", 2, 2.0 * 36), ("set", 3, "full"): ("core, card", 4, 0.1)}
    taken |= {("longer", 0, "full"): ("core", 50, 5000.0)}
    write_index(workspace, taken, pd.DataFrame(rows))
    return settings, Report(workspace, "glove", settings), latency


def test_a_training_of_the_evidence_takes_its_epochs_times_the_seconds_of_one(workspace, computed):
    """Of one machine, of no variant, at the budget of the errors; half of it never takes longer, whatever the load."""
    settings, report, latency = computed
    found = speed_report.speed_table(report, settings, latency, PANELS, WRONG).set_index(["panel", "model"])
    tree = found.loc["strain", "tree"]
    per_epoch = [10, 11, 12, 10, 11, 36]
    assert (tree["budget"], tree["training_machine"]) == ("full", "core")
    assert (tree["train_s"], tree["train_low_s"], tree["train_high_s"]) == (4 * np.median(per_epoch), 40.0, 144.0)
    assert tree["half_train_s"] == tree["train_s"] / 2 and tree["half_error"] == pytest.approx(50)
    assert tree["error"] == pytest.approx(40)
    cnn = found.loc["strain", "cnn"]
    assert np.isnan(cnn["train_s"]) and np.isnan(cnn["half_train_s"]) and not cnn["training_front"]  # no shard has it
    assert set(found.loc["pressure"]["budget"]) == {""}
    text = speed_report.speed_text(found.reset_index(), "")
    assert "Times of training were measured on core: " in text and "not timed" in text


def test_half_is_drawn_where_it_was_scored(workspace, computed):
    settings, report, latency = computed
    table = report.results.table
    report.results = Results(table[table["budget"] != "half"])
    found = speed_report.speed_table(report, settings, latency, PANELS, WRONG).set_index(["panel", "model"])
    assert found.loc["strain", "tree"]["train_s"] == 44.0 and np.isnan(found.loc["strain", "tree"]["half_train_s"])


@pytest.mark.parametrize("time", ["p50_ms", "train_s"])
def test_a_chart_of_two_machines_is_refused(measured, time, tmp_path):
    settings, report, latency = measured
    table = speed_report.speed_table(report, settings, latency, PANELS, WRONG)
    table.loc[table["model"] == "cnn", MACHINES[time]] = "a card"
    with pytest.raises(InputError, match="times of 2 machines, which do not compare: .*; a card"):
        speed_figures.chart(tmp_path / "x.png", table, time, "Glove")
    with pytest.raises(InputError, match="times of 2 machines"):
        speed_report.speed_text(table, "")
    with pytest.raises(InputError, match="times of 2 machines"):
        charts.data(table, "Glove")
    table.loc[table["model"] == "cnn", [time, MACHINES[time]]] = [np.nan, ""]  # not timed is no machine
    speed_figures.chart(tmp_path / "x.png", table, time, "Glove")
    assert {row["model"] for row in charts.data(table, "Glove")["rows"] if row["axis"] == time} == {"constant", "tree"}


def test_text_says_failed_and_names_the_fronts(workspace, measured):
    settings, report, latency = measured
    text = speed_report.speed_text(speed_report.speed_table(report, settings, latency, PANELS, WRONG), "A note.")
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    (cnn,) = [row for row in rows if row[0] == "CNN"]
    assert cnn[1] == cnn[2] == "failed (1 of 3 runs); others 10.00" and cnn[-2:] == ["no", "no"]
    (tree,) = [row for row in rows if row[0] == "Decision tree"]
    assert tree[3:8] == ["1.000 [0.950, 1.050]", "9.000", "1,000", "3.0", "11.0"]
    assert tree[9] == "-" and tree[-1] == "all"
    assert rows[0][6:8] == ["Training, session, bending (s)", "Training, session, pressure (s)"] and "A note." in text


@pytest.mark.parametrize(
    ("spoilt", "words"), [("time", "tree has no p50_ms"), ("training", "tree has no train_s .* session_pressure")]
)
def test_a_model_without_a_time_is_named(workspace, measured, spoilt, words):
    settings, report, latency = measured
    if spoilt == "time":
        latency["tree", 1]["p50_ms"] = 0.0
    else:
        path = workspace.training_times("glove", "tree")
        times = pd.read_csv(path)
        times[times["protocol"] != "session_pressure"].to_csv(path, index=False)
    with pytest.raises(InputError, match=words):
        speed_report.speed_table(report, settings, latency, PANELS, WRONG)


def test_a_failed_model_is_at_the_top_and_an_error_of_zero_on_the_chart(workspace, measured, monkeypatch, tmp_path):
    settings, report, latency = measured
    table = speed_report.speed_table(report, settings, latency, PANELS, WRONG)
    table.loc[table["model"] == "tree", ["error", "low", "high"]] = 0.0
    saved = []
    monkeypatch.setattr(style, "save", lambda figure, path: saved.append(figure))
    for time in ("p50_ms", "train_s"):
        speed_figures.chart(tmp_path / "x.png", table, time, "Glove")
    for figure in saved:
        for ax in figure.axes:
            assert {text.get_text() for text in ax.texts} == {"CNN", "Decision tree", "Constant (mean): 90, above"}
            marks = {
                line.get_markeredgecolor(): line
                for line in ax.lines
                if line.get_marker() in "xs" and len(line.get_xdata()) == 1
            }
            low, high = ax.get_ylim()
            assert marks[style.GREEN].get_ydata()[0] == speed_figures.TOP, "share of the axis"
            assert low < marks[style.BLACK].get_ydata()[0] < high, "of zero there is no logarithm"


def test_names_lie_on_the_chart_and_neither_on_each_other_nor_on_a_mark(monkeypatch, tmp_path):
    """Four models at one place and one at either end; the constant is a line of the legend."""
    close, saved = {model: (1.0, 10.0) for model in ("lomp", "cnn", "rnn", "rbf")}, []
    places = close | {"linear": (0.01, 30.0), "poly_array": (30.0, 5.0), "constant": (0.001, 25.0)}
    rows = [
        {"panel": "one touch", "model": model, "p50_ms": at, "p50_low_ms": at, "p50_high_ms": at, "error": error}
        | {"low": np.nan, "high": np.nan, "runs": 1, "failed": 0, "machine": "core", "measure": "RMSE (kPa)"}
        | {"speed_front": 0, "half_error": np.nan, "half_train_s": np.nan}
        for model, (at, error) in places.items()
    ]
    monkeypatch.setattr(style, "save", lambda figure, path: saved.append(figure))
    speed_figures.chart(tmp_path / "x.png", pd.DataFrame(rows), "p50_ms", "Touch")
    (ax,) = saved[0].axes
    assert "Constant (mean)" in [text.get_text() for text in saved[0].legends[0].get_texts()]
    assert {text.get_text() for text in ax.texts} == {style.model_style(model).label for model in places} - {
        "Constant (mean)"
    }
    saved[0].draw_without_rendering()
    boxes = [Text.get_window_extent(text) for text in ax.texts]  # that of an annotation has its line, too
    for k, box in enumerate(boxes):
        inside = Bbox.intersection(box, ax.get_window_extent())
        assert inside.width == pytest.approx(box.width) and inside.height == pytest.approx(box.height)
        assert not any(box.overlaps(other) for other in boxes[:k])
        assert not any(box.contains(*ax.transData.transform(places[model])) for model in ("lomp", "linear"))


def write_index(workspace, taken: dict, rows: pd.DataFrame) -> None:
    """The evidence: (set, seed, budget) of a tree on bending -> machine, epochs, seconds; rows: of the first shard."""
    folder = shards.folder(workspace)
    folder.mkdir()
    index, times = [], []
    for (of, seed, budget), (machine, epochs, seconds) in taken.items():
        shard = f"{of}-{seed}-{budget}"
        kept = shards.result_file(workspace, shard)
        own = rows if of == "set" else pd.DataFrame([{"experiment": "glove", "model": "tree", "variant": of}])
        write_table(kept, own.reindex(columns=COLUMNS), "nan")
        rows = rows[:0]
        line = {"shard": shard, "experiment": "glove", "seed": seed, "budget": budget, "machine": machine}
        index.append(line | {"sha256": sha256(kept)})
        run = {"shard": shard, "model": "tree", "protocol": "session_strain", "seed": seed}
        times.append(run | {"epochs": epochs, "train_s": seconds})
    pd.DataFrame(index, columns=shards.INDEX).to_csv(folder / "index.csv", index=False)
    pd.DataFrame(times, columns=shards.TIMES).to_csv(folder / "times.csv", index=False)
    each = {"experiment": "glove", "data": "some", "protocols": ["session_strain"], "seeds": 4, "minutes": 1}
    (folder / "shards.yaml").write_text(json.dumps({"set": each, "longer": each | {"variant": "longer"}}))


def test_the_machine_of_the_times_is_that_of_most_full_trainings(workspace):
    taken = {("set", 0, "full"): ("core, card", 4, 1.0), ("set", 1, "full"): ("core", 4, 9.0)}
    taken |= {("set", seed, "half"): ("core, card", 2, 1.0) for seed in (0, 1, 2)}
    write_index(workspace, taken, pd.DataFrame())
    assert times.trainings(workspace, "glove", ["session_strain"]).machine == "core"  # as many: the processor's
    shutil.rmtree(shards.folder(workspace))
    write_index(workspace, taken | {("set", 2, "full"): ("core, card", 4, 1.0)}, pd.DataFrame())
    found = times.trainings(workspace, "glove", ["session_strain"])
    assert found.machine == "core, card"
    assert found.seconds("session_strain", "tree", "full") == [1.0, 2.0, 2.0, 2.0, 1.0]
    assert found.seconds("session_strain", "cnn", "full") == found.seconds("session_pressure", "tree", "full") == []
    rows = shards.read(workspace)
    assert rows["value"].tolist() == [1.0] * 5, "the one table, too, has the seconds of one machine"


def test_times_of_predictions_are_those_that_the_index_tells_of(workspace):
    path = shards.study_file(workspace, "glove", times.LATENCY, 0)
    row = {"experiment": "glove", "model": "tree", "batch": 1, "threads": 1, "p50_ms": 0.5, "calls": 60}
    write_table(path, pd.DataFrame([row], columns=times.COLUMNS))
    with pytest.raises(InputError, match="latency-0.csv: not a file that .* tells of; run `tactile evidence latency_"):
        times.predictions(workspace, "glove")
    index = shards.folder(workspace) / "index.csv"
    line = {"shard": "latency_glove-0-full", "sha256": sha256(path), "machine": "core"}
    shards.upsert(index, shards.INDEX, "latency_glove-0-full", [line])
    assert times.predictions(workspace, "glove")[["p50_ms", "machine"]].values.tolist() == [[0.5, "core"]]
    assert len(times.predictions(workspace, "touch")) == 0
    other = shards.study_file(workspace, "glove", times.LATENCY, 1)
    write_table(other, pd.DataFrame([row | {"p50_ms": 0.7}], columns=times.COLUMNS))
    line = {"shard": "latency_glove-1-full", "sha256": sha256(other), "machine": "other"}
    shards.upsert(index, shards.INDEX, "latency_glove-1-full", [line])
    with pytest.raises(InputError, match="times of 2 machines, which do not compare: core; other"):
        times.predictions(workspace, "glove")


def test_nothing_that_is_drawn_leaves_the_axes(measured, monkeypatch, tmp_path):
    """Whiskers of time and small marks, too; and no panel is half empty."""
    settings, report, latency = measured
    table = speed_report.speed_table(report, settings, latency, PANELS, WRONG)
    table["train_low_s"], table["train_high_s"] = table["train_s"] / 30, table["train_s"] * 30
    table["half_train_s"], table["half_error"] = table["train_s"] / 50, table["error"] * 4
    table["low"], table["high"] = table["error"] / 100, table["error"] * 1.2
    saved = []
    monkeypatch.setattr(style, "save", lambda figure, path: saved.append(figure))
    speed_figures.chart(tmp_path / "x.png", table, "train_s", "Glove")
    (figure,) = saved
    assert figure.get_suptitle().startswith("Glove: error with 95 % interval over the seeds against training time")
    for ax in figure.axes:
        (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
        marks = [line for line in ax.lines if line.get_transform() == ax.transData]
        marks = [line for line in marks if line.get_drawstyle() == "default"]  # the front goes on to the edges
        x, y = np.concatenate([line.get_xydata() for line in marks]).T
        assert left < x.min() < x.max() < right and bottom <= y.min() < y.max() < top
        assert np.log(y.max() / y.min()) > 0.8 * np.log(top / bottom), "filled"


def test_a_title_promises_no_interval_where_there_is_none(measured, monkeypatch, tmp_path):
    settings, report, latency = measured
    table = speed_report.speed_table(report, settings, latency, PANELS, WRONG)
    table["low"] = table["high"] = np.nan
    table["runs"], table["failed"] = 1, 0
    saved = []
    monkeypatch.setattr(style, "save", lambda figure, path: saved.append(figure))
    speed_figures.chart(tmp_path / "x.png", table, "p50_ms", "Glove")
    assert "interval" not in saved[0].get_suptitle() and "measured on core" in saved[0].get_suptitle()
    assert [ax.get_title() for ax in saved[0].axes] == ["strain, 1 seed", "pressure, 1 seed"]
    assert not any("failed" in text.get_text() for text in saved[0].legends[0].get_texts())
