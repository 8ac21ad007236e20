"""Splits of touch and of the recorded taxel: no press and no recording is on two sides."""

import numpy as np
import pyarrow as pa
import pytest
from builders.press_frames import frames, press_force
from builders.project import ROOT

from tactile.base import params
from tactile.base.errors import InputError
from tactile.datasets.windowing import windows_of
from tactile.experiments import touch, velostat_recorded


@pytest.fixture
def settings():
    return params.load(ROOT / "params.yaml")["touch"]


WINDOW = {"frames": 8, "frame_step": 1, "stride": 4, "sliding": {"single": 1.0}, "contact_threshold_n": 0.5}


def test_split_is_eight_one_one_by_press_and_changes_with_the_seed(settings):
    table = windows_of(frames(press_force(40)), WINDOW)
    parts = [touch.split(table, settings, "press", seed) for seed in (0, 0, 1)]
    assert (parts[0] == parts[1]).all() and (parts[0] != parts[2]).any()
    press = table["press"].to_numpy()
    sizes = {name: len(set(press[parts[0] == name])) for name in ("train", "validation", "test")}
    assert sizes == {"train": 32, "validation": 4, "test": 4}
    assert sum(sizes.values()) == len(set(press))
    np.testing.assert_array_equal(parts[0] != "unused", table["apart"].to_numpy())


def overlap(table: pa.Table, part: np.ndarray) -> float:
    """Share of the test windows that have a frame in common with a training window; frames are 0.02 s apart."""
    last = np.round(table["t_s"].to_numpy() * 50).astype(int)
    trained = {frame for end in last[part == "train"] for frame in range(end - 7, end + 1)}
    return np.mean([any(frame in trained for frame in range(end - 7, end + 1)) for end in last[part == "test"]])


@pytest.mark.parametrize(("share", "at_least"), [(1.0, 0.99), (0.25, 0.95)])
def test_random_windows_overlap_and_those_of_presses_never_do(settings, share, at_least):
    table = windows_of(frames(press_force(200)), WINDOW | {"sliding": {"single": share}})
    for seed in (0, 1):
        part = touch.split(table, settings, "random_window", seed)
        assert overlap(table, part) > at_least
        kept = [(part == name).sum() / len(table) for name in ("train", "validation", "test")]
        assert kept == pytest.approx(np.array([0.8, 0.1, 0.1]) * table["sliding"].to_numpy().mean(), abs=0.002)
        assert overlap(table, touch.split(table, settings, "press", seed)) == 0


def test_a_share_of_the_sliding_windows_is_of_whole_stretches_of_all_presses():
    rows = [windows_of(frames(press_force(200)), WINDOW | {"sliding": {"single": s}}) for s in (1.0, 0.25, 0.0)]
    every, quarter, none = (np.round(t["t_s"].to_numpy()[t["sliding"].to_numpy()] * 50).astype(int) for t in rows)
    assert len(every) == 200 * 33 and len(none) == 0 and len(quarter) / len(every) == pytest.approx(0.25, abs=0.01)
    place = np.flatnonzero(np.isin(every, quarter))
    assert set(np.bincount(place // 8)) == {0, 8}
    assert np.bincount(quarter // 40, minlength=200).min() > 0


def windows(conditions: list[str], recordings: list[str]) -> pa.Table:
    """Windows of which each is a press of its own."""
    n = len(conditions)
    return pa.table(
        {
            "condition": pa.array(conditions).dictionary_encode(),
            "recording": pa.array(recordings).dictionary_encode(),
            "press": pa.array(np.arange(n, dtype=np.int32)),
            "apart": pa.array(np.full(n, True)),
            "sliding": pa.array(np.full(n, True)),
        }
    )


@pytest.mark.parametrize("protocol", ["press", "random_window"])
def test_only_single_touches_of_the_seeds_own_array_are_trained_on(settings, protocol):
    conditions = ["single"] * 40 + ["double"] * 20 + ["slide", "three", "tape"] * 10
    part = touch.split(windows(conditions, ["run000"] * 90), settings, protocol, 0)
    assert (part[40:] == "test").all()
    assert [int((part == name).sum()) for name in ("train", "validation", "test")] == [32, 4, 54]
    names = ["specimen0-run000"] * 30 + ["specimen1-run000"] * 30
    both = windows((["single"] * 20 + ["double"] * 10) * 2, names)
    for seed in range(3):
        parts = touch.split(both, settings, protocol, seed).reshape(2, 30)
        used = parts[seed % 2]
        assert (parts[1 - seed % 2] == "unused").all() and (used[20:] == "test").all()
        assert [int((used[:20] == name).sum()) for name in ("train", "validation", "test")] == [16, 2, 2]


def test_recorded_split_tests_on_the_other_repetition():
    windows = pa.table(
        {"recording": ["a/exp1"] * 10 + ["a/exp2"] * 4, "press": np.repeat(np.arange(7), 2).astype(np.int32)}
    )
    part = velostat_recorded.split(windows, {"split": {"validation": 0.2}}, "repetition", 0)
    assert part.tolist() == ["train"] * 8 + ["validation"] * 2 + ["test"] * 4


def test_recorded_split_of_one_recording_leaves_the_others_unused():
    windows = pa.table(
        {
            "condition": pa.array(["a"] * 6 + ["b"] * 6).dictionary_encode(),
            "recording": ["a/exp1"] * 4 + ["a/exp2"] * 2 + ["b/exp1"] * 4 + ["b/exp2"] * 2,
            "press": np.repeat(np.arange(6), 2).astype(np.int32),
        }
    )
    settings = {"split": {"validation": 0.5}}
    part = velostat_recorded.split(windows, settings, "b", 0)
    assert part.tolist() == ["unused"] * 6 + ["train"] * 2 + ["validation"] * 2 + ["test"] * 2
    with pytest.raises(InputError, match="no recording 'c'; there are a, b"):
        velostat_recorded.split(windows, settings, "c", 0)
