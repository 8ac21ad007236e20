"""Charts and tables of speed against accuracy: the right fronts, every model named, no failure drawn as a result."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pipeline.base.errors import InputError
from pipeline.reporting import speed as speed_report
from pipeline.reporting.figures import speed as speed_figures
from pipeline.reporting.figures import style
from pipeline.reporting.report import Report
from pipeline.scoring import shards
from pipeline.scoring.one_table import Results


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
        | {"macs": np.nan, "size_bytes": 77}
        for place, model in enumerate(right)
        for batch in (1, 256)
    }
    return settings, Report(workspace, "glove", settings), latency


PANELS = {"strain": ("session_strain", "strain"), "pressure": ("session_pressure", "pressure")}
WRONG = ("accuracy", "Images classified incorrectly (%)")


def test_table_holds_what_was_measured(workspace, measured):
    settings, report, latency = measured
    found = speed_report.speed_table(workspace, report, settings, latency, PANELS, WRONG).set_index(["panel", "model"])
    tree = found.loc["strain", "tree"]
    assert tree["error"] == pytest.approx(40) and tree["low"] < 40 < tree["high"]
    assert tree["predictions_per_s"] == pytest.approx(1000) and tree["p50_ms"] == 1.0
    assert tree["train_s"] == 3.0 and found.loc["pressure", "tree"]["train_s"] == 11.0  # of the panel's own runs
    # The good runs of `cnn` have the fewest errors of all; that does not put it on a front.
    assert found.loc["strain", "cnn"]["error"] == pytest.approx(10) and found.loc["strain", "cnn"]["failed"] == 1
    assert found["speed_front"].to_numpy().reshape(2, 3).tolist() == [[1, 1, 0]] * 2
    # On strain the seeds' training times of the constant, 1 and 3 s, and of the tree, 2 and 4 s, overlap.
    assert found["training_front"].to_numpy().reshape(2, 3).tolist() == [[0, 1, 0], [1, 1, 0]]


def test_times_of_the_evidence_are_of_the_budget_of_the_errors(workspace, measured):
    settings, report, latency = measured
    place = {"experiment": "glove", "protocol": "session_strain", "model": "tree", "variant": ""}
    of_budgets = {"half": (0.5, 20.0), "full": (0.6, 40.0)}
    rows = [
        place | {"condition": condition, "metric": metric, "seed": seed, "budget": budget, "unit": "", "value": value}
        for budget, (right, seconds) in of_budgets.items()
        for seed in (0, 1, 2)
        for condition, metric, value in (("strain", "accuracy", right), ("session_strain", "train_s", seconds + seed))
    ]
    report.results = Results(pd.concat([report.results.table, pd.DataFrame(rows)], ignore_index=True))
    index_of(workspace, {f"set-{seed}-{budget}": "core" for budget in of_budgets for seed in (0, 1, 2)})
    found = speed_report.speed_table(workspace, report, settings, latency, PANELS, WRONG).set_index(["panel", "model"])
    tree, cnn = found.loc["strain", "tree"], found.loc["strain", "cnn"]
    assert (tree["budget"], tree["train_s"], tree["train_low_s"], tree["train_high_s"]) == ("full", 41.0, 40.0, 42.0)
    assert (tree["half_error"], tree["half_train_s"]) == (pytest.approx(50), 21.0) and tree["error"] == pytest.approx(
        40
    )
    assert cnn["budget"] == "look" and np.isnan(cnn["half_train_s"])  # no shard has it
    assert found.loc["pressure", "tree"]["budget"] == "look"


def test_text_says_failed_and_names_the_fronts(workspace, measured):
    settings, report, latency = measured
    text = speed_report.speed_text(
        speed_report.speed_table(workspace, report, settings, latency, PANELS, WRONG), 7, "", "A note."
    )
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    (cnn,) = [row for row in rows if row[0] == "CNN"]
    assert cnn[1] == cnn[2] == "failed (1 of 3 runs); others 10.00" and cnn[-2:] == ["no", "no"]
    (tree,) = [row for row in rows if row[0] == "Decision tree"]
    assert tree[3:8] == ["1.000 [0.950, 1.050]", "9.000", "1,000", "3.0", "11.0"]
    assert tree[9] == "-" and tree[-1] == "all"
    assert rows[0][6:8] == ["Training, session strain (s)", "Training, session pressure (s)"] and "A note." in text


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
        speed_report.speed_table(workspace, report, settings, latency, PANELS, WRONG)


def test_a_failed_model_is_at_the_top_and_an_error_of_zero_on_the_chart(workspace, measured, monkeypatch, tmp_path):
    settings, report, latency = measured
    table = speed_report.speed_table(workspace, report, settings, latency, PANELS, WRONG)
    table.loc[table["model"] == "constant", ["error", "low", "high"]] = 0.0
    saved = []
    monkeypatch.setattr(style, "save", lambda figure, path: saved.append(figure))
    for time in ("p50_ms", "train_s"):
        speed_figures.chart(tmp_path / "x.png", table, time)
    for figure in saved:
        names = {text.get_text() for text in figure.legends[0].get_texts()}
        assert {"CNN", "Decision tree", "Constant (mean)"} < names
        for ax in figure.axes:
            marks = {
                line.get_markeredgecolor(): line
                for line in ax.lines
                if line.get_marker() in "xs" and len(line.get_xdata()) == 1
            }
            low, high = ax.get_ylim()
            assert marks[style.GREEN].get_ydata()[0] == speed_figures.TOP, "share of the axis"
            assert low < marks[style.GREY].get_ydata()[0] < 40 < high, "of zero there is no logarithm"


def index_of(workspace, machines: dict[str, str]) -> None:
    """Index and times of shards, SET-SEED-BUDGET -> machine, that trained a tree on bending."""
    folder = shards.folder(workspace)
    folder.mkdir()
    index = [
        {"shard": shard, "experiment": "glove", "budget": shard.rsplit("-", 1)[1], "machine": machine}
        for shard, machine in machines.items()
    ]
    run = {"model": "tree", "protocol": "session_strain", "epochs": 4, "train_s": 1}
    times = [run | {"shard": shard, "seed": shard.split("-")[1]} for shard in machines]
    pd.DataFrame(index, columns=shards.INDEX).to_csv(folder / "index.csv", index=False)
    pd.DataFrame(times, columns=shards.TIMES).to_csv(folder / "times.csv", index=False)


def test_training_times_of_the_evidence_are_of_one_machine_and_of_no_variant(workspace):
    """Seconds of a core and of a card are no spread of one time; the machine that did the most trainings counts."""
    index_of(workspace, {"set-0-full": "card", "set-1-full": "core", "set-2-full": "core", "longer-0-full": "core"})
    results = SimpleNamespace(runs=lambda *where, budget: pd.Series({0: 0.5, 1: 20.0, 2: 21.0}))
    report = SimpleNamespace(workspace=workspace, experiment="glove", results=results, _variants={"longer"})
    assert Report.training_times(report, "session_strain", "tree", "full") == [20.0, 21.0]
    assert Report.training_times(report, "session_strain", "tree", "half") == []
