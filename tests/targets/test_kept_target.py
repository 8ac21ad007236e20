"""What is kept of a target, not its estimate alone: the interval and the margins of the model that predicts later."""

import numpy as np
import pyarrow as pa
import pytest
from builders.project import ROOT
from sklearn.dummy import DummyRegressor

from tactile import experiments
from tactile.base import cards, params, provenance
from tactile.commands import targets
from tactile.settings.targets import Target
from tactile.targets import kept, models
from tactile.targets.models import Row
from tactile.targets.read import Data, Readings, Series

PEOPLE, PRESSES, HELD = ("anna", "ben", "cleo", "dora"), 20, 5  # readings of a press that count; as many do not
MEANS = {"anna": 0.0, "ben": 4.0, "cleo": -3.0, "dora": 9.0}  # deg; the readings tell nothing of it
SETTINGS = params.load(ROOT / "params.yaml")
MARGINS = {"strain": (0.15, 0.1), "touch": (0.15, 0.5), "glove": (0.15, 0.1)}  # shares: of a column, of the mean


def recorded(elements: int, classes: bool = False) -> Data:
    """Return a recording of each person: uniform readings of 0 to 1; of 5 to 6 where no press counts."""
    series = []
    for number, person in enumerate(PEOPLE):
        rng, n = np.random.default_rng(number), 2 * HELD * PRESSES
        press = np.where(np.arange(n) % (2 * HELD) < HELD, np.arange(n) // (2 * HELD), -1)
        truth = MEANS[person] + rng.normal(0, 2, PRESSES)[np.arange(n) // (2 * HELD)] + rng.normal(0, 0.3, n)
        truth = np.where(truth > -1.5, "right", "left") if classes else truth
        reading = rng.uniform(0, 1, (n, elements)) + 5 * (press < 0)[:, None]
        each = np.full(n, person), 0.1 * np.arange(n), np.zeros(n, int), reading, truth, press
        series.append(Series(f"bend/{person}", *each))
    kind = {"kind": "class", "folder": 1} if classes else {"kind": "continuous", "unit": "deg", "folder": 1}
    return Data(Target(name="angle", **kind), "person", series)


def saved(folder, data: Data, experiment: str = "strain") -> kept.Kept:
    """Return the model that `own` keeps of recordings, as it is read again."""
    block = SETTINGS[experiment] | {"sensor": {"channels": data.series[0].reading.shape[1]}}
    for each in data.series:
        (folder / "logs" / each.name).mkdir(parents=True)
        (folder / "logs" / each.name / experiments.log_name(experiment)).write_text(each.name)
    effort = targets.Effort(4000, 5)
    made = targets.section("joint", data, [], effort)
    (folder / "model").mkdir()
    targets.keep(folder / "model", experiment, folder / "logs", block, data, made, effort)
    return kept.load(folder / "model")


@pytest.fixture
def two_rows(monkeypatch):
    """The table of models has two: the mean, and one that errs more, whose interval is another."""
    largest = lambda x, y: [DummyRegressor(strategy="quantile", quantile=1.0).fit(x, y)]  # noqa: E731
    rows = [Row("constant", "level", models.constant), Row("ridge", "level", largest)]
    monkeypatch.setattr(models, "rows", lambda *given: rows)


def log(reading: np.ndarray) -> Readings:
    n = len(reading)
    return Readings(0.1 * np.arange(n), np.zeros(n, int), reading, pa.table({"reason": pa.array([], pa.string())}))


def test_the_interval_of_a_kept_model_is_that_of_people_who_did_not_train(two_rows, tmp_path):
    """By hand: the mean of the other people errs so much in 90 % of 81 presses, all of them alike in weight."""
    data = recorded(2)
    model = saved(tmp_path, data)
    truth = {each.name: each.truth[each.press >= 0] for each in data.series}
    others = {name: np.mean([of.mean() for other, of in truth.items() if other != name]) for name in truth}
    errors = np.sort(np.concatenate([np.abs(of - others[name]) for name, of in truth.items()]))
    units = len(PEOPLE) * PRESSES
    half = errors[int(np.ceil(0.9 * (units + 1) * HELD)) - 1]
    card = model.card
    assert (card.model, card.units, card.groups) == ("constant", units, list(PEOPLE))
    assert card.version == provenance.version()
    assert card.bound == pytest.approx(half) and half > 5
    said = kept.predict(model, log(np.random.default_rng(9).uniform(0.1, 0.9, (30, 2))))
    np.testing.assert_allclose(said.guess[:, 0], np.mean(np.concatenate([*truth.values()])))
    np.testing.assert_allclose(said.high - said.guess[:, 0], half)
    np.testing.assert_allclose(said.guess[:, 0] - said.low, half)
    assert f"angle: 90 % interval, +- {half:.3g} deg" in kept.interval(card)


def shifted(offset: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a truth (n,) that is held for 8 s at a time, and readings (n, 2) of it that begin with any offset."""
    rng = np.random.default_rng(seed)
    truth = np.repeat(np.concatenate([[0.0], rng.uniform(0, 10, 14)]), 80)
    return truth, offset + np.outer(truth, [0.1, -0.05]) + rng.normal(0, 0.01, (len(truth), 2))


def test_a_sensor_that_each_session_begins_elsewhere_is_read_above_its_start(tmp_path):
    """Its level is the session's and is held for longer than a window, which loses it with the window's mean."""
    series = []
    for number, (person, offset) in enumerate(zip(PEOPLE, (0.0, 3.0, -2.0, 7.0), strict=True)):
        truth, reading = shifted(offset, number)
        n = len(truth)
        each = np.full(n, person), 0.1 * np.arange(n), np.zeros(n, int), reading, truth, np.zeros(n, int)
        series.append(Series(f"bend/{person}", *each))
    data = Data(Target(name="angle", kind="continuous", unit="deg", folder=1), "person", series)
    model = saved(tmp_path, data)
    assert model.card.view == "above the start" and model.card.model.endswith(" above the start")
    truth, reading = shifted(11.0, 9)
    said = kept.predict(model, log(reading))
    missed = np.abs(said.guess[:, 0] - truth)[80:]
    assert np.median(missed) < 0.3 and np.percentile(missed, 95) < 3, "and but a moment after each step right"
    assert model.card.scores["RMSE"] < 1.5


@pytest.mark.parametrize(("level", "view"), [(True, "level"), (False, "without level")])
def test_a_card_of_version_0_2_is_read(two_rows, tmp_path, level, view):
    saved(tmp_path, recorded(2))
    path = tmp_path / "model" / kept.CARD
    earlier = path.read_text().replace('"view": "level"', f'"level": {str(level).lower()}')
    path.write_text(cards.sealed(earlier, path.name))
    assert kept.read_card(tmp_path / "model").view == view


def test_a_set_of_a_kept_model_is_that_of_people_who_did_not_train(two_rows, tmp_path):
    """By hand: the shares of classes among the other people are the scores, a press weighs as much as any other."""
    data = recorded(2, classes=True)
    model = saved(tmp_path, data)
    truth = np.array([each.truth[each.press >= 0] == "right" for each in data.series])
    right = np.array([np.delete(truth, k, axis=0).mean() for k in range(len(PEOPLE))])[:, None]
    scores = np.sort(np.where(truth, right, 1 - right).ravel())[::-1]  # of the true class, the likeliest first
    units = np.unique(np.concatenate([each.press[each.press >= 0] + 100 * k for k, each in enumerate(data.series)]))
    bound = scores[int(np.ceil(0.9 * (len(units) + 1) * HELD)) - 1]
    assert model.card.model == "constant" and model.card.units == len(units)
    assert model.card.bound == pytest.approx(bound)
    said = kept.predict(model, log(np.full((3, 2), 0.5)))
    share = truth.mean()
    np.testing.assert_allclose(said.guess, [[1 - share, share]] * 3)
    assert said.sets.tolist() == [[1 - share >= bound, share >= bound]] * 3


def test_the_margins_of_a_kept_model_are_of_the_readings_that_count(tmp_path):
    """Of each column and of the mean: just within them there is an interval, just beyond them there is none."""
    data = recorded(2)
    model = saved(tmp_path, data)
    counted = np.concatenate([each.reading[each.press >= 0] for each in data.series])
    low, high = counted.min(axis=0), counted.max(axis=0)
    margin, mean = MARGINS["strain"][0] * np.ptp(counted, axis=0).max(), counted.mean(axis=1)
    of_mean = MARGINS["strain"][1] * np.ptp(mean)
    middle = np.full(2, 0.5)
    for column, (end, out) in enumerate(((high[0] + margin, 1), (low[1] - margin, -1))):
        for beyond in (-1e-3, 1e-3):
            reading = middle.copy()
            reading[column] = end + out * beyond
            said = kept.predict(model, log(np.vstack([middle, reading])))
            assert said.outside.tolist() == [False, beyond > 0]
            assert np.isnan(said.low).tolist() == np.isnan(said.high).tolist() == [False, beyond > 0]
    for beyond in (-1e-3, 1e-3):
        said = kept.predict(model, log(np.vstack([middle, np.full(2, mean.max() + of_mean + beyond)])))
        assert said.outside.tolist() == [False, beyond > 0]


@pytest.mark.parametrize("experiment", MARGINS)
def test_the_margins_of_a_card_are_shares_of_the_training(experiment):
    """Of an array the mean may move by half its range, as touches add up."""
    areas = {"areas": {"pressure": {"rows": 2, "cols": 2}, "strain": {"rows": 1, "cols": 2}}}
    data = recorded(6)
    for each in data.series:
        each.reading[:, 4:] *= 3
    found = kept.trained_on(data, experiment, SETTINGS[experiment] | {"sensor": areas})
    counted = np.concatenate([each.reading[each.press >= 0] for each in data.series])
    parts = [counted[:, :4], counted[:, 4:]] if experiment == "glove" else [counted]
    share, of_mean = MARGINS[experiment]
    assert [each.margin for each in found] == pytest.approx([share * np.ptp(x, axis=0).max() for x in parts])
    assert [each.mean_margin for each in found] == pytest.approx([of_mean * np.ptp(x.mean(axis=1)) for x in parts])
    assert np.concatenate([each.high for each in found]) == pytest.approx(counted.max(axis=0))
    assert np.concatenate([each.low for each in found]) == pytest.approx(counted.min(axis=0))


def test_a_reading_outside_takes_the_interval_of_its_window_alone(tmp_path):
    """A window lasts two seconds: those that end within two seconds hold the reading, later ones do not."""
    model = saved(tmp_path, recorded(2))
    reading = np.full((60, 2), 0.5)
    reading[10] = 3.0
    said = kept.predict(model, log(reading))
    assert model.card.window_s == 2.0
    assert said.outside[10:30].all() and not said.outside[:10].any() and not said.outside[32:].any()
    np.testing.assert_array_equal(np.isnan(said.low), said.outside)
