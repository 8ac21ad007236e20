"""The model of a target reading by reading, beside what it predicts of the whole log."""

import numpy as np
import pytest
from builders.live_models import COLS, ROWS, target

from tactile.inference import intervals
from tactile.live import target_stream
from tactile.targets import features, kept
from tactile.targets.read import Readings

CLASSES = ("ball", "cup", "plate")


def log(n=160, silence=None):
    """Readings of the array for some seconds, and which of them no training has seen; a silence before one of them."""
    rng = np.random.default_rng(1)
    time = 5 + 0.05 * np.arange(n)
    if silence:
        time[silence:] += 1.5
    reading = rng.uniform(0, 1000, (n, ROWS * COLS))
    reading[n // 2] = 5000
    return Readings(time, np.zeros(n, int), reading.astype(np.float32), None)


@pytest.mark.parametrize("silence", [None, 100])
@pytest.mark.parametrize("classes", [(), CLASSES])
@pytest.mark.parametrize("model", ["extra trees", "extra trees above the start", "extra trees without level"])
def test_readings_one_by_one_are_predicted_as_the_log(model, classes, silence, tmp_path):
    saved, seen = kept.load(target(tmp_path / "model", classes, model)), log(silence=silence)
    whole, live = kept.predict(saved, seen), target_stream.Stream(saved)
    values, outside = [], []
    for t_s, reading in zip(seen.time_s, seen.reading, strict=True):
        values.append(live.step(reading, False, t_s))
        outside.append(live.stepped_outside)
    values, told = np.array(values), seen.time_s > seen.time_s[0] + (features.START_S if "start" in model else -1)
    assert np.isnan(values[~told]).all() and told.sum() > 100
    assert np.allclose(values[told], whole.guess[told], atol=1e-3)
    assert outside == whole.outside.tolist() and 0 < sum(outside) < len(outside)
    told_of = intervals.columns(values[told], np.array(outside)[told], live.card)
    if classes:
        names = [sorted(each) if each else each for each in told_of["set"]]
        expected = [sorted(np.array(classes)[one].tolist()) for one in whole.sets[told]]
        assert names == [None if out else one for out, one in zip(whole.outside[told], expected, strict=True)]
    else:
        assert np.allclose(told_of["angle_low_deg"], whole.low[told], atol=1e-3, equal_nan=True)


def test_a_device_that_begins_anew_begins_a_recording(tmp_path):
    saved, seen = kept.load(target(tmp_path / "model", (), "extra trees above the start")), log(60)
    live, first = target_stream.Stream(saved), target_stream.Stream(saved)
    for t_s, reading in zip(seen.time_s, seen.reading, strict=True):
        live.step(reading + 300, False, t_s + 50.0)
    for t_s, reading in zip(seen.time_s, seen.reading, strict=True):
        again, anew = live.step(reading, False, t_s), first.step(reading, False, t_s)
        assert np.array_equal(again, anew, equal_nan=True)
    assert np.isfinite(again).all()


def test_values_come_in_the_order_of_the_training(tmp_path):
    saved = kept.load(target(tmp_path / "model"))
    live, turned = target_stream.Stream(saved), list(range(ROWS * COLS))[::-1]
    assert live.order(live.card.reading) == list(range(ROWS * COLS))
    other = live.card.reading | {"sensor": live.card.reading["sensor"] | {"order": turned}}
    assert live.order(other) == turned


def test_a_number_may_have_any_unit(tmp_path):
    saved = kept.load(target(tmp_path / "model"))
    card = saved.card.model_copy(update={"target": saved.card.target.model_copy(update={"unit": "probability"})})
    live = target_stream.Stream(saved._replace(card=card))
    assert live.card.says == "numbers" and live.card.heading == "angle in probability"
    assert intervals.names(live.card) == ["angle_low_probability", "angle_high_probability", "outside_training"]
