"""Splits of touch and of the recorded taxel: no press and no recording is on two sides."""

import numpy as np
import pyarrow as pa
import pytest
from builders.press_frames import frames, press_force

from pipeline.base import params
from pipeline.base.errors import InputError
from pipeline.datasets.windowing import windows_of
from pipeline.experiments import touch, velostat_recorded


@pytest.fixture
def settings():
    return params.load()["touch"]


def test_split_is_eight_one_one_by_press_and_changes_with_the_seed(settings):
    table = windows_of(frames(press_force(40)), {"frames": 8, "frame_step": 1, "stride": 4, "contact_threshold_n": 0.5})
    parts = [touch.split(table, settings, "press", seed) for seed in (0, 0, 1)]
    assert (parts[0] == parts[1]).all() and (parts[0] != parts[2]).any()
    press = table["press"].to_numpy()
    sizes = {name: len(set(press[parts[0] == name])) for name in ("train", "validation", "test")}
    assert sizes == {"train": 32, "validation": 4, "test": 4}
    assert sum(sizes.values()) == len(set(press))


@pytest.mark.parametrize("protocol", ["press", "random_window"])
def test_only_single_touches_are_trained_on(settings, protocol):
    conditions = ["single"] * 40 + ["double"] * 20 + ["slide", "three", "tape"] * 10
    windows = pa.table(
        {
            "condition": pa.array(conditions).dictionary_encode(),
            "press": pa.array(np.arange(len(conditions), dtype=np.int32)),
        }
    )
    part = touch.split(windows, settings, protocol, 0)
    assert (part[40:] == "test").all()
    assert [int((part == name).sum()) for name in ("train", "validation", "test")] == [32, 4, 54]


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
