"""A target of one's own: what is read, which group a window is in, and that a tested group tells nothing before."""

import itertools

import numpy as np
import pytest
from builders import free_targets
from builders.project import ROOT

from tactile.base import params
from tactile.base.errors import InputError
from tactile.learning.window_statistics import PENALTIES
from tactile.own import settings as own_settings
from tactile.sheet.estimates import Estimate, cannot_tell
from tactile.targets import features, models, read, validate
from tactile.targets.validate import CHOSEN, COVERAGE, RMSE

TREES = 5
VALUES = params.load(ROOT / "params.yaml")
SENSORS = {"strain": {"channels": 2}, "glove": {"areas": {"pressure": {"rows": 2, "cols": 2}}, "scale": "range"}}


def data(experiment, folder, limit=0.02):
    """Return the recordings of a folder as `tactile try` reads them; limit: share of lines that may be rejected."""
    settings = VALUES[experiment] | {"sensor": VALUES[experiment]["sensor"] | SENSORS[experiment]}
    settings["ingest"] = settings["ingest"] | {"max_reject_fraction": limit}
    return read.own(experiment, folder, settings, own_settings.asked(folder))


def results_of(found, length_s=2.0, most=240):
    windows = features.windows(found, length_s, most)
    return windows, validate.test_groups(windows, found.target.kind, found.target.unit, found.by, TREES)


def score(result, model, metric):
    return validate.over_tests(result, model, metric)


def test_an_angle_is_told_on_people_who_did_not_train(tmp_path):
    found = data("strain", free_targets.angles(tmp_path / "joint"))
    assert [each.name for each in found.series][:3] == ["bend/anna_0", "bend/anna_1", "bend/ben_0"]
    one = found.series[0]
    assert one.press.tolist() == [-1] * 3 + [0] * (len(one.press) - 7) + [-1] * 4, "arm.log knows no angle at the ends"
    assert one.truth[20] == pytest.approx(45 * np.sin(2 * np.pi * 2 / 3.1) + 5 * np.sin(2 * np.pi * 2 / 0.9), abs=1.5)
    windows, result = results_of(found)
    assert windows.groups == ["anna", "ben", "cleo"]
    assert all(words.startswith("A 90 % interval is off: on held-out persons it held ") for words in result.warnings)
    assert not any(name in ("ridge", "extra trees") for name in result.chosen.values()), "each person has another rest"
    best, level, floor = (score(result, name, RMSE) for name in (CHOSEN, "extra trees", "constant"))
    assert best.mean < 6 < 10 < level.mean < floor.mean == pytest.approx(32, abs=1)
    assert best.low < best.mean < best.high
    assert score(result, CHOSEN, COVERAGE).mean > 0.86


def test_a_tested_group_tells_nothing_before_its_test(tmp_path):
    """Another truth of it changes its scores, and nothing that was chosen or predicted for it."""
    found = data("strain", free_targets.angles(tmp_path / "joint", people=("anna", "ben", "cleo")))
    windows, result = results_of(found, most=150)
    other = windows.y.copy()
    other[windows.group == 0] = 7.0
    again = validate.test_groups(windows._replace(y=other), "continuous", "deg", "person", TREES)
    assert again.chosen["anna"] == result.chosen["anna"]
    wide = [r.scores.set_index(["test", "model", "metric"])["value"] for r in (result, again)]
    name = ("anna", CHOSEN, validate.HALF_WIDTH)
    assert wide[0][name] == wide[1][name] and wide[0]["anna", CHOSEN, RMSE] != wide[1]["anna", CHOSEN, RMSE]


def made_windows(kind, seed=0):
    """30 windows of each of four persons, whose number, class or event is in the slope of noisy readings."""
    rng, n = np.random.default_rng(seed), 120
    x, at = rng.normal(size=(n, 6, 4)).astype(np.float32), np.arange(n)
    seen = x[:, 2, 0] + 0.5 * x[:, 1, 1] + rng.normal(size=n)
    label = np.digitize(seen, [-0.5, 0.5]) if kind == "class" else (seen > 0.3).astype(int)
    y = seen[:, None] if kind == "continuous" else np.eye(3 if kind == "class" else 2)[label]
    names = {"continuous": [], "class": ["a", "b", "c"], "event": ["none", "slip"]}[kind]
    start = rng.normal(0, 0.3, size=(8, 4)).astype(np.float32)[at // 15]
    return features.Windows(
        x, y, names, at // 30, ["anna", "ben", "cleo", "dora"], at // 15, at // 2, 1, start, 0.1 * at
    )


def all_fitted(windows, kind, monkeypatch):
    """Return for each test what its models say of fixed readings, their penalty, and what chose them; and the tests."""
    probe, found, fitted = np.random.default_rng(9).normal(size=(50, 6, 4)), [], validate.fitted

    def noted(row, *rest):
        estimator, held_out = fitted(row, *rest)
        penalty = getattr(estimator[-1], "alpha", None) if hasattr(estimator, "steps") else None
        said = estimator.predict(features.columns(probe, probe[:, 4], row.view))
        found.append((row.name, penalty, np.asarray(said).tolist(), held_out.tolist()))
        return estimator, held_out

    with monkeypatch.context() as patch:
        patch.setattr(validate, "fitted", noted)
        tested = validate.test_groups(windows, kind, "", "person", 2)
    rows = len(models.rows(kind, 2))
    return [found[first : first + rows] for first in range(0, len(found), rows)], tested


@pytest.mark.parametrize("kind", ["continuous", "class", "event"])
def test_readings_and_truth_of_a_tested_group_move_no_fit_and_no_choice(kind, monkeypatch):
    windows = made_windows(kind)
    before, tested = all_fitted(windows, kind, monkeypatch)
    assert len(before) == 4 and {row for row, *_ in before[0]} == {row.name for row in models.rows(kind, 2)}
    x, y = windows.x.copy(), windows.y.copy()
    x[:30], y[:30] = 3 * x[29::-1] + 1, np.roll(y[:30], 1, axis=1) if windows.classes else y[29::-1] - 7
    after, again = all_fitted(windows._replace(x=x, y=y), kind, monkeypatch)
    assert before[0] == after[0] and tested.chosen["anna"] == again.chosen["anna"]
    assert all(a != b for rows in zip(before[1:], after[1:], strict=True) for a, b in zip(*rows, strict=True))
    rows = [
        each.scores[(each.scores["test"] == "anna")].set_index(["model", "metric"])["value"] for each in (tested, again)
    ]
    assert not rows[0].equals(rows[1])
    if kind == "continuous":
        assert rows[0][CHOSEN, validate.HALF_WIDTH] == rows[1][CHOSEN, validate.HALF_WIDTH]


def test_the_penalty_and_the_interval_of_the_kept_model_are_those_of_parts_left_out():
    """By hand: ridge regression on three persons says what the fourth is, and the least error of all four counts."""
    windows = made_windows("continuous")
    y, said = windows.y, {}
    for view, penalty, person in itertools.product(features.VIEWS, PENALTIES, range(4)):
        x, there = windows.columns(view), windows.group == person
        mean, spread = x[~there].mean(axis=0), x[~there].std(axis=0)
        design, middle = (x[~there] - mean) / spread, y[~there].mean()
        slope = np.linalg.solve(design.T @ design + penalty * np.eye(x.shape[1]), design.T @ (y[~there] - middle))
        said.setdefault((view, penalty), np.empty_like(y))[there] = (x[there] - mean) / spread @ slope + middle
    view, penalty = min(said, key=lambda one: np.square(said[one] - y).mean())
    assert PENALTIES[0] < penalty < PENALTIES[-1], "neither end, which a fault would choose, too"
    final = validate.final(windows, "continuous", 2)
    assert final.row.name.startswith("ridge") and final.row.view == view and final.estimator[-1].alpha == penalty
    wide = validate.calibrated(y, said[view, penalty], windows.unit, "continuous")
    assert final.bound == pytest.approx(wide, rel=1e-4) and final.units == 60


def test_votes_are_better_than_their_frames_and_two_days_have_no_interval(tmp_path):
    windows, result = results_of(data("glove", free_targets.objects(tmp_path / "mat")), length_s=0.2)
    assert windows.classes == ["ball", "cup", "plate"] and windows.groups == ["day0", "day1"]
    votes, frames = (score(result, "extra trees", f"right {name}") for name in ("votes", "windows"))
    assert votes.mean > frames.mean + 0.05 > 0.6 and votes.mean > 0.9
    assert np.isnan(votes.low) and votes.runs == 2
    counts = result.scores[result.scores["metric"] == "right votes"]["n"]
    assert set(counts) == {18}, "a vote of each recording"


def test_events_are_found_as_stretches(tmp_path):
    found = data("glove", free_targets.slips(tmp_path / "hold"))
    _, result = results_of(found, length_s=found.target.window_s, most=1200)
    assert score(result, CHOSEN, "recall of events").mean > 0.9 < score(result, CHOSEN, "precision of events").mean
    windows = features.windows(found, 0.3, 100)
    rows = np.arange(8)
    happens, said = [0, 1, 1, 0, 0, 0, 1, 0], [1, 0, 1, 0, 1, 0, 0, 0]
    windows = windows._replace(y=np.eye(2)[happens], recording=np.zeros(8, int))
    scores = {name: value for name, _, value, _ in validate.scored(windows, rows, np.eye(2)[said], "event", "")}
    assert scores["recall of events"] == pytest.approx(1 / 2) and scores["precision of events"] == pytest.approx(1 / 3)
    assert scores["recall of windows"] == pytest.approx(1 / 3) and scores["F1 of events"] == pytest.approx(0.4)
    for kind in ("event", "class"):
        perfect = validate.scored(windows._replace(unit=rows), rows, windows.y, kind, "")
        assert {value for _, _, value, _ in perfect} == {1.0}


@pytest.mark.parametrize(
    ("split", "people", "words", "within"),
    [
        (
            {"by": "time"},
            ("anna", "ben"),
            "The test shares its recordings with the training",
            "within the same recordings: no interval for another recording.",
        ),
        (
            free_targets.PERSON,
            ("anna",),
            "There is one person only, 'anna', so the test shares it with the training",
            "within one person: no interval for another person.",
        ),
    ],
)
def test_a_test_that_shares_a_group_with_training_says_so(tmp_path, split, people, words, within):
    found = data("strain", free_targets.angles(tmp_path / "joint", people, 80.0, split))
    windows, result = results_of(found, most=200)
    assert [words in warning for warning in result.warnings].count(True) == 1 and len(result.chosen) >= 4
    assert f"In each test, a 90 % interval is calibrated {within}" in result.warnings
    assert np.isnan(score(result, CHOSEN, RMSE).low) == (people == ("anna",)), "no interval of one person"
    if split["by"] == "time":
        one = found.series[0]
        assert len(np.unique(one.group)) == read.PARTS and (one.segment[1:] > one.segment[:-1]).sum() == 4


@pytest.mark.parametrize("people", [("anna", "ben"), ("anna", "ben", "cleo")])
def test_of_two_groups_one_calibrates_each_test(people, tmp_path):
    """Ben's strands are noisy, so that intervals of the others' errors are too narrow for him."""
    found = data("strain", free_targets.angles(tmp_path / "joint", people, 80.0))
    rng = np.random.default_rng(0)
    for each in found.series[2:4]:
        each.reading[:] += rng.normal(0, 0.2, each.reading.shape)
    _, result = results_of(found, most=200)
    coverage = result.scores[result.scores["metric"] == COVERAGE].set_index("test")["value"]
    lowest = coverage.idxmin()
    assert coverage[lowest] < 0.7 and coverage.nunique() > 1
    off = f"A 90 % interval is off: on held-out persons it held {100 * coverage[lowest]:.3g} % ({lowest})."
    within = "In each test, a 90 % interval is calibrated within one person: no interval for another person."
    assert off in result.warnings and (within in result.warnings) == (len(people) == 2)


@pytest.mark.parametrize(
    ("coverage", "words"),
    [
        ({"a": 0.86, "b": 0.94}, ""),
        ({}, ""),
        ({"a": 0.99, "b": 0.69, "c": 0.8}, "on held-out persons it held 69 % (b)"),
        ({"a": 0.9, "b": 0.99}, "on held-out persons it held 99 % (b)"),
        ({"a": 0.8595}, "on held-out persons it held 86 % (a)"),
    ],
)
def test_the_lowest_coverage_stands_beside_an_interval(coverage, words):
    assert validate.held(coverage, "person") == words
    assert validate.held(coverage, "time") == words.replace("persons", "parts")


def test_a_class_of_one_group_alone_is_named(tmp_path):
    folder = free_targets.objects(tmp_path / "mat")
    (folder / "plate" / "day0_0").rename(folder / "plate" / "night9_0")
    (folder / "settings.yaml").write_text((folder / "settings.yaml").read_text().replace("(day.)", "/(day|night)"))
    for path in [*folder.glob("ball/*"), *folder.glob("cup/*")]:
        path.rename(path.with_name(path.name.replace("day", "night")))
    _, result = results_of(data("glove", folder), most=200)
    assert any(warning.startswith("'ball, cup' is in no group but 'night'") for warning in result.warnings)


def test_windows_hold_what_their_names_say_and_end_with_their_segment():
    rng = np.random.default_rng(0)
    time = np.arange(40) / 10
    time[30:] += 5.0  # a silence
    reading = rng.normal(0, 1, (40, 3))
    segment = np.repeat([0, 1], [15, 25])
    ends = np.array([14, 16, 29, 30, 39])
    found = features.statistics(time, segment, reading, ends, 1.0)
    for row, (first, end) in zip(found, [(4, 14), (15, 16), (19, 29), (30, 30), (30, 39)], strict=True):
        part = reading[first : end + 1]
        slope = np.polyfit(time[first : end + 1], part, 1)[0] if end > first else np.zeros(3)
        wanted = part[-1], part.mean(axis=0), slope, part.std(axis=0), part.min(axis=0), part.max(axis=0)
        assert row == pytest.approx(np.array(wanted), abs=1e-5)
    again = features.statistics(time, segment, reading + 9, ends, 1.0)
    starts = [features.start(time, each) for each in (reading, reading + 9)]
    assert starts[0] == pytest.approx(np.median(reading[:21], axis=0))
    for view in features.VIEWS:
        seen, higher = (features.columns(*each, view) for each in zip((found, again), starts, strict=True))
        assert np.abs(seen - higher).max() == pytest.approx(9 if view == features.LEVEL else 0, abs=1e-4), view
    above = features.columns(found, starts[0], features.ABOVE_START).reshape(found.shape)
    assert above[:, 0] == pytest.approx(found[:, 0] - starts[0]) and (above[:, 2:4] == found[:, 2:4]).all()


def test_windows_are_drawn_from_all_phases_of_what_repeats():
    truth = np.tile(np.arange(20.0), 100)
    n = len(truth)
    one = read.Series("a", np.full(n, "g"), np.arange(n) / 10, np.zeros(n), truth[:, None], truth, np.zeros(n, int))
    target = read.Target(name="x", kind="continuous", unit="mm", file="a.log", column=2)
    windows = features.windows(read.Data(target, "day", [one]), 1.0, 100)
    assert len(windows.y) == 100 and windows.every == 20 and len(np.unique(windows.y)) == 20


def test_slow_creep_asks_for_long_windows():
    def told(value):
        return Estimate(value, "%", 10)

    lengths = [features.window_s(told(5.0), told(later))[0] for later in (5.0, 12.5, -12.5, 90.0)]
    assert lengths == [2.0, 5.0, 5.0, 10.0]
    for unknown in (None, cannot_tell("%", "no press is held")):
        length, reason = features.window_s(told(5.0), unknown)
        assert length == 2.0 and "cannot tell the creep" in reason


def say(**changed):
    """Return settings of `angles` with other values; None leaves a key out."""
    target = {key: value for key, value in {**free_targets.ANGLE, **changed}.items() if value is not None}
    return {"target": target}


WRONG = {
    "no split": ({"split": None}, "key 'split' is missing"),
    "no pattern": ({"split": {"by": "day"}}, "`by: day` needs a `pattern`"),
    "no brackets": ({"split": {"by": "day", "pattern": "day"}}, "has 0 pairs of brackets"),
    "finds nothing": ({"split": {"by": "day", "pattern": "day(.)"}}, "finds no day in the path 'bend/anna_0'"),
    "a typing error": (say(kinds="class"), "unknown key 'kinds'; did you mean 'kind'"),
    "no unit": (say(unit=None), "a continuous target has a `unit`"),
    "two sources": (say(folder=1), "give one of both"),
    "no number": (say(file=None, column=None, folder=1), "the folder 'bend' names no number for the target 'angle'"),
    "no such log": (say(file="cam.log"), "cam.log: log not found"),
    "no such column": (say(column="angle"), "no line names the column angle"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_is_one_sentence(tmp_path, case):
    changed, words = WRONG[case]
    folder = free_targets.angles(tmp_path / "joint", people=("anna",), seconds=3.0)
    asked = {"target": free_targets.ANGLE, "split": free_targets.PERSON} | changed
    asked = {key: value for key, value in asked.items() if value}
    free_targets.settings(folder, free_targets.STRAIN, asked.get("target"), asked.get("split"))
    if "split" not in asked:
        (folder / "settings.yaml").write_text((folder / "settings.yaml").read_text().replace("split: null\n", ""))
    with pytest.raises(InputError) as caught:
        data("strain", folder)
    assert words in str(caught.value)


@pytest.mark.parametrize("column", [3, "touched"])
def test_classes_are_words_of_a_column(tmp_path, column):
    """A word holds until the next line; numbers among them are what they are, however they are written."""
    folder = free_targets.angles(tmp_path / "joint", people=("anna",), seconds=3.0)
    target = {"name": "object", "kind": "class", "file": "seen.log", "column": column}
    free_targets.settings(folder, free_targets.STRAIN, target, free_targets.PERSON)
    lines = ["t_s,u,touched", "0.0,0,none", "1.0,4,red cup", "1.2,4,", "2.0,2,3.0", "2.5,1,3", "2.95,0,none"]
    for run in range(2):
        (folder / "bend" / f"anna_{run}" / "seen.log").write_text("\n".join(lines) + "\n")
    one = data("strain", folder, limit=0.2).series[0]
    assert one.truth[one.press >= 0].tolist() == ["none"] * 10 + ["red cup"] * 10 + ["3"] * 10
    assert np.unique(one.press[one.press >= 0], return_counts=True)[1].tolist() == [10, 10, 10]


def test_no_angle_is_made_up_where_its_log_is_silent(tmp_path):
    folder = free_targets.angles(tmp_path / "joint", people=("anna",), seconds=12.0)
    arm = folder / "bend" / "anna_0" / "arm.log"
    lines = [line for line in arm.read_text().splitlines() if not 4 < float(line.split(",")[0]) < 8]
    arm.write_text("\n".join(lines) + "\n")
    found = data("strain", folder)
    one = found.series[0]
    within = one.time_s[(one.press < 0) & (one.time_s > 1) & (one.time_s < 11)]
    assert len(within) > 35 and 3.8 < within[0] < 4.2 and 7.8 < within[-1] < 8.2
    (said,) = read.said(found)
    left_out = sum((each.press < 0).sum() for each in found.series)
    assert said.endswith(f" deg; {left_out} more are left out, as arm.log tells nothing there")


@pytest.mark.parametrize(("most", "said"), [(2, "2 classes, of 20 (b) to 30 readings"), (3, "a 30, b 20")])
def test_many_classes_are_counted_and_few_are_named(most, said, tmp_path, monkeypatch):
    folder = free_targets.angles(tmp_path / "joint", people=("anna",), seconds=5.0)
    free_targets.settings(
        folder, free_targets.STRAIN, {"name": "object", "kind": "class", "folder": 1}, free_targets.PERSON
    )
    found = data("strain", folder)
    truth = np.repeat(["a", "b"], [30, 20])
    one = found.series[0]._replace(truth=truth, press=np.zeros(50, int), group=np.full(50, "anna"))
    monkeypatch.setattr(read, "MOST_NAMED", most - 1)
    assert [*read.said(found._replace(series=[one]))] == [f"anna: 1 recording, 50 readings; object: {said}"]


def test_of_many_groups_the_first_have_a_line(tmp_path, monkeypatch):
    folder = free_targets.angles(tmp_path / "joint", people=("anna", "ben", "cleo"), seconds=3.0)
    found = data("strain", folder)
    said = [*read.said(found)]
    assert [line.partition(":")[0] for line in said] == ["anna", "ben", "cleo"]
    monkeypatch.setattr(read, "MOST_NAMED", 2)
    assert [*read.said(found)] == [*said[:2], "and 1 more groups"]


NAMES = {"200g": 200, "weight-100g": 100, "-5N": -5, "load_-5": -5, "1,5N": 1.5, "2.25 mm": 2.25, ".5N": 0.5, "x 7": 7}


@pytest.mark.parametrize("name", NAMES)
def test_the_number_in_the_name_of_a_folder(name, tmp_path):
    target = read.Target(name="load", kind="continuous", unit="N", folder=1)
    assert read.number_in(name, tmp_path, target) == NAMES[name]
    for several in (f"tip5_{name}", "1,500g", "10-20"):
        with pytest.raises(InputError, match=f"the folder '{several}' names 2 numbers .* for the target 'load'"):
            read.number_in(several, tmp_path, target)


def test_what_makes_no_target_is_said(tmp_path):
    target = {"name": "load", "kind": "continuous", "unit": "g", "folder": 1}
    folder = free_targets.angles(tmp_path / "joint", ("anna", "ben"), 3.0, target=target)
    (folder / "bend").rename(folder / "tip5")
    assert [*read.lacking(data("strain", folder), folder)] == [
        f"{folder}: the target 'load' is 5.0 throughout, by <1> of the paths; record the other case, too"
    ]
    found = data("strain", free_targets.angles(tmp_path / "bend", ("anna", "ben"), 3.0))
    assert not [*read.lacking(found, folder)]
    found.series[-1].press[:] = -1
    assert not [*read.lacking(found, folder)], "the other recording of ben counts"
    found.series[-2].press[:] = -1
    assert [*read.lacking(found, folder)][0] == (
        f"{folder}/bend/ben_0: no reading of the person 'ben' counts, for want of a press or of a truth; record it "
        "again, or remove it"
    )


@pytest.mark.parametrize("fault", ["", "a spike", "a first line too near", "a pause of the load cell"])
def test_presses_vote_whatever_single_lines_say(tmp_path, fault):
    """Three presses of 20 N, of 1 s each, 3 s apart; the load cell prints 10 lines a second."""
    run = tmp_path / "foam" / "run"
    run.mkdir(parents=True)
    at = np.round(np.arange(0, 10, 0.01) * 1e6).astype(int)
    force = np.where((at / 1e6 % 3 > 1) & (at / 1e6 % 3 < 2), 20.0, 0.0)
    cell = [f"{t},{f:.2f}" for t, f in zip(at[::10], force[::10], strict=True)]
    if fault == "a spike":
        cell[6] = f"{at[60]},400.00"
    if fault == "a first line too near":
        at[0] = at[1] - 100
    if fault == "a pause of the load cell":
        cell = [line for line in cell if not 42 <= int(line.split(",")[0]) / 1e5 <= 48]  # within the second press
    (run / "array.log").write_text("".join(f"{t},{30 + 20 * f:.0f}\n" for t, f in zip(at, force, strict=True)))
    (run / "load_cell.log").write_text("\n".join(cell) + "\n")
    settings = VALUES["touch"] | {"sensor": VALUES["touch"]["sensor"] | {"rows": 1, "cols": 1}}
    settings["ingest"] = settings["ingest"] | {"clock": "shared"}
    asked = own_settings.Asked.model_validate(
        {"target": {"name": "material", "kind": "class", "folder": 1}, "split": {"by": "recording"}}
    )
    (one,) = read.own("touch", tmp_path, settings, asked).series
    held = np.isin(one.press, np.unique(one.press)[1:])
    assert (force[held] > 0).mean() > 0.9 and held.sum() == pytest.approx(205 if "pause" in fault else 285, abs=5)
    assert len(np.unique(one.press)) == 4 + ("pause" in fault), "nobody knows whether one went on"
    (run / "array.log").write_text("0,30\n")
    (run / "load_cell.log").write_text("0,0.1\n")
    (one,) = read.own("touch", tmp_path, settings, asked).series
    assert one.press.tolist() == [-1]


@pytest.mark.parametrize("log", ["daq.log", "arm.log"])
def test_a_truth_in_another_unit_of_time_is_refused(log, tmp_path):
    folder = free_targets.angles(tmp_path / "joint", people=("anna",), seconds=30.0)
    path = folder / "bend" / "anna_0" / log
    rows = [line.partition(",") for line in path.read_text().splitlines()]
    path.write_text("".join(f"{1000 * float(at):.0f},{rest}\n" for at, _, rest in rows))
    words = {"daq.log": "lasts 29.2 s, daq.log 29900 s", "arm.log": "lasts 29200 s, daq.log 29.9 s"}[log]
    with pytest.raises(InputError, match=f"arm.log: {words}; are the times of both in s"):
        data("strain", folder)


def test_codes_that_differ_in_their_last_digit_are_two_classes(tmp_path):
    folder = free_targets.angles(tmp_path / "joint", people=("anna",), seconds=3.0)
    target = {"name": "part", "kind": "class", "file": "seen.log", "column": 2}
    free_targets.settings(folder, free_targets.STRAIN, target, free_targets.PERSON)
    for run in range(2):
        seen = folder / "bend" / f"anna_{run}" / "seen.log"
        seen.write_text("0.0,4006381333931\n1.5,4006381333948\n2.9,4006381333931\n")
    one = data("strain", folder).series[0]
    assert np.unique(one.truth).tolist() == ["4006381333931", "4006381333948"]


def test_a_log_of_another_clock_is_refused(tmp_path):
    folder = free_targets.angles(tmp_path / "joint", people=("anna",), seconds=3.0)
    arm = folder / "bend" / "anna_0" / "arm.log"
    arm.write_text("".join(f"{float(line.split(',')[0]) + 900},1.0,0\n" for line in arm.read_text().splitlines()))
    with pytest.raises(InputError, match="lasts from 900.3 to .*; stamp both by one clock, in one unit"):
        data("strain", folder)


def test_settings_of_a_target_are_of_no_experiment(workspace, tmp_path):
    folder = free_targets.angles(tmp_path / "joint", people=("anna",), seconds=3.0)
    assert own_settings.of_logs(workspace, "strain", folder)["strain"]["sensor"]["channels"] == 2
    assert own_settings.asked(tmp_path) is None
    assert "target" not in params.load(workspace.params)
