"""A dataset in memory: all of it, or what one run uses."""

import numpy as np
import pyarrow as pa
import pytest

from tactile.base.errors import InputError
from tactile.datasets import schemas
from tactile.datasets.windows import read_dataset


@pytest.fixture
def path(tmp_path):
    """A dataset of 8 windows, two streams of four, of which the run press-1 uses some."""
    parts = ["unused", "train", "train", "test", "unused", "unused", "validation", "train"]
    table = pa.table(
        {
            "previous": pa.array([-1, 0, 1, 2, -1, 4, 5, 6], pa.int32()),
            "split_press_1": pa.array(parts).dictionary_encode(),
            "x": schemas.lists(np.arange(32).reshape(8, 4), pa.int16()),
            "y": schemas.lists(np.arange(16.0).reshape(8, 2), pa.float32()),
        }
    )
    schemas.write(tmp_path / "dataset.parquet", table.schema, [table])
    return tmp_path / "dataset.parquet"


def test_a_run_is_read_without_the_windows_that_it_does_not_use(path):
    every, own = read_dataset(path, 2, 2), read_dataset(path, 2, 2, ("press", 1))
    used = every.part("press", 1) != "unused"
    assert used.sum() == 5 and own.x.shape == (5, 2, 2)
    np.testing.assert_array_equal(own.x, every.x[used])
    np.testing.assert_array_equal(own.y, every.y[used])
    for name in ("train", "validation", "test"):
        whole, part = (data.windows(data.part("press", 1) == name, streams=True) for data in (every, own))
        for expected, found in zip(whole, part, strict=True):
            np.testing.assert_array_equal(found, expected)


def test_a_window_whose_predecessor_is_unused_starts_from_zero(path):
    own = read_dataset(path, 2, 2, ("press", 1))
    assert own.rows["previous"].to_pylist() == [-1, 0, 1, -1, 3]


def test_of_windows_the_last_frames_are_read_and_then_none_follows_on_another(path):
    whole, last = read_dataset(path, 2, 2), read_dataset(path, 1, 2)
    np.testing.assert_array_equal(last.x, whole.x[:, 1:])
    np.testing.assert_array_equal(last.y, whole.y)
    assert set(last.rows["previous"].to_pylist()) == {-1} != set(whole.rows["previous"].to_pylist())
    assert last.rows.drop_columns("previous").equals(whole.rows.drop_columns("previous"))
    with pytest.raises(InputError, match="its windows have 2 frames, and the setting window.frames asks for 3"):
        read_dataset(path, 3, 2)


def test_a_run_that_the_dataset_does_not_have_is_one_sentence(path):
    with pytest.raises(InputError, match="dataset.parquet: .*split_press_7"):
        read_dataset(path, 2, 2, ("press", 7))
