"""The search of learning rates: the same for every network, on validation windows alone."""

import copy

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from pipeline.base import params
from pipeline.commands import rates
from pipeline.datasets import schemas
from pipeline.datasets.windows import Dataset

SMALL = {"channels": [4], "hidden": [16]}


@pytest.fixture
def values():
    values = copy.deepcopy(params.load()) | {"device": "cpu"}
    values["touch"]["models"]["cnn"] |= SMALL
    return values


def made(wrong: str) -> Dataset:
    """Labels follow the windows; those of the part `wrong` are noise."""
    rng = np.random.default_rng(0)
    part = np.repeat(["train", "validation", "test"], [256, 64, 64])
    x = rng.uniform(0, 1000, (384, 8, 25)).astype(np.float32)
    y = np.repeat(x[:, -1, :1] / 5, 400, axis=1)
    y[part == wrong] += rng.uniform(0, 1e6, (int((part == wrong).sum()), 400))
    column = pa.array(part).dictionary_encode().cast(schemas.NAME)
    return Dataset(x, y, pa.table({schemas.split_column("press", 0): column}))


def test_rates_get_the_same_number_of_updates_and_do_not_read_the_test_part(values):
    searched = [rates.search(values, "touch", "cnn", rate, 40, made("test")) for rate in (1e-5, 3e-3)]
    rows = [dict(zip(rates.COLUMNS, row, strict=True)) for row in searched]
    assert [row["updates"] for row in rows] == [40, 40] and [row["epochs"] for row in rows] == [10, 10]
    assert rows[1]["rmse_kpa"] < rows[0]["rmse_kpa"] < 1000
    same = rates.search(values, "touch", "cnn", 3e-3, 40, made("nowhere"))
    assert same[:7] == searched[1][:7]


def test_a_rate_that_diverges_is_said_and_the_lowest_named(values, tmp_path):
    levels = {1e-3: 5.0, 1e-2: 4.0, 1e-1: float("nan")}
    rows = [(model, rate, 64, 100, 5, 5, rmse, 2.0) for model in ("cnn", "lomp") for rate, rmse in levels.items()]
    rates.write(values, "touch", rows, tmp_path)
    text = (tmp_path / "touch.md").read_text()
    set_to = values["touch"]["models"]["cnn"]["training"]["learning_rate"]
    line = next(line for line in text.splitlines() if line.startswith("| CNN"))
    assert [cell.strip() for cell in line.split("|")[2:-1]] == ["5.00", "4.00", "diverged", "0.01", f"{set_to:g}"]
    assert "100 updates" in text and "12 s in all" in text
    assert list(pd.read_csv(tmp_path / "touch.csv").columns) == list(rates.COLUMNS)


def test_every_network_of_table_one_is_searched(values):
    networks = {name for name, block in values["touch"]["models"].items() if "training" in block}
    assert networks - {"lomp_stream"} == set(rates.NETWORKS)


def test_the_grid_goes_on_where_the_lowest_error_is_at_its_end():
    assert [rates.rate(place) for place in (-9, -8, -7, -4, -3)] == [3e-5, 1e-4, 3e-4, 1e-2, 3e-2]
    nan = float("nan")
    assert rates.beyond({-8: 1.0, -7: 2.0, -6: 3.0}) == -9
    assert rates.beyond({-8: 3.0, -7: 2.0, -6: 1.0}) == -5
    assert rates.beyond({-8: 3.0, -7: 2.0, -6: nan}) is None  # what diverged is beyond the best
    assert rates.beyond({-8: 3.0, -7: 1.0, -6: 2.0}) is None
    assert rates.beyond({-8: nan, -7: nan}) is None
