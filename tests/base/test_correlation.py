"""Channels that go together otherwise than in training are told, and those of an unchanged sensor are not."""

import itertools

import numpy as np
import pytest

from tactile.base import correlation
from tactile.base.correlation import Correlation

NAMES = [f"u{k}" for k in range(8)]
COLUMNS = [6, 0, 2, 3, 5, 7]  # of the readings, in the order in which a model sees them
MIX = np.random.default_rng(5).normal(size=(2, 6))


def series(n: int, seed: int, mix: np.ndarray = MIX) -> np.ndarray:
    """Return readings (n, 8) of six strands that follow two ways of bending and drift, and of two others."""
    rng = np.random.default_rng(seed)
    bending = np.cumsum(rng.normal(size=(n, 2)), axis=0)
    bending -= np.linspace(0, 1, n)[:, None] * bending[-1]
    drift = np.cumsum(rng.normal(0, 0.05, (n, 6)), axis=0)
    x = rng.normal(0, 3, (n, 8))
    x[:, COLUMNS] = 100 + bending @ mix + drift + rng.normal(0, 0.5, (n, 6))
    return x


@pytest.fixture(scope="module")
def known() -> Correlation:
    found = correlation.of([series(12_000, 0), series(9_000, 1)], COLUMNS)
    assert found is not None and found.columns == COLUMNS and found.lengths[0] == 300
    return Correlation.model_validate_json(found.model_dump_json())


def said(known: Correlation, *parts: np.ndarray) -> list[str]:
    return correlation.sentences(known, parts, NAMES)


def test_an_unchanged_sensor_is_not_told(known):
    told = [bool(said(known, series(n, 100 + seed))) for n in (300, 1000, 4000) for seed in range(20)]
    assert sum(told) <= 1


def test_exchanged_channels_are_told(known):
    told, named = [], []
    for number, (one, other) in enumerate(itertools.combinations(COLUMNS, 2)):
        x = series(4000, 200 + number)
        x[:, [one, other]] = x[:, [other, one]]
        sentences = said(known, x)
        told += ["the channels do not change together as in training" in words for words in sentences]
        pair = [NAMES[k] for k in (one, other)]
        named += [f"with {pair[0]} and {pair[1]} exchanged they would" in words for words in sentences]
    assert len(told) >= 14 and np.mean(told) > 0.9 and np.mean(named) > 0.85
    x = series(4000, 300)
    x[:, [1, 4]] = x[:, [4, 1]]
    assert said(known, x) == [], "columns that the model does not see"


def test_a_channel_of_another_scale_is_told_and_one_that_is_zeroed_anew_is_not(known):
    for k in COLUMNS:
        x = series(4000, 400 + k)
        x[:, k] *= 0.4
        (words,) = [each for each in said(known, x) if "times as much" in each]
        assert words.startswith(f"{NAMES[k]} changes 0.") and 0.3 < float(words.split()[2]) < 0.55
        x = series(4000, 400 + k)
        x[:, k] += 50
        assert said(known, x) == []
    assert said(known, 0.4 * series(4000, 400)) == [], "all channels alike, as of slower motion"


def test_another_sensor_is_told(known):
    assert said(known, series(4000, 1, np.random.default_rng(6).normal(size=(2, 6))))


def test_what_is_too_short_or_has_no_value_tells_nothing(known):
    x = series(4000, 1, np.random.default_rng(6).normal(size=(2, 6)))
    assert said(known, x[:299]) == [] and said(known, x[:0]) == [] and said(known) == []
    assert said(known, *np.split(x, 40)), "parts count together"
    x[5, 0] = np.nan
    assert said(known, x) == []


def test_a_sensor_whose_channels_tell_nothing_keeps_nothing():
    rng = np.random.default_rng(0)
    assert correlation.of([rng.normal(size=(9000, 6))], range(6)) is None, "channels without relation"
    alike = rng.normal(size=(9000, 1)) + rng.normal(0, 0.1, (9000, 6))
    assert correlation.of([np.cumsum(alike, axis=0)], range(6)) is None, "channels that may be exchanged"
    assert correlation.of([series(9000, 0)], COLUMNS[:2]) is None
    assert correlation.of([series(1500, 0)], COLUMNS) is None, "too few readings"
    assert correlation.of([], COLUMNS) is None
    still = series(9000, 0)
    still[:, 2] = 1.0
    assert correlation.of([still], COLUMNS) is None
    assert correlation.sentences(None, [still], NAMES) == []


def test_readings_are_divided_where_one_begins_or_is_left_out():
    x = np.arange(10.0)[:, None]
    begins, without = np.zeros((2, 10), bool)
    begins[4] = without[[0, 7, 8]] = True
    parts = [part[:, 0].tolist() for part in correlation.stretches(x, begins, without)]
    assert parts == [[1, 2, 3], [4, 5, 6], [9]]
    assert [len(part) for part in correlation.stretches(x, ~without & False, ~without | True)] == []
