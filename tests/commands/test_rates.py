"""The search of learning rates: the same for every network, on validation windows alone."""

import argparse
import math

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from pipeline.base.errors import InputError
from pipeline.commands import rates
from pipeline.datasets import schemas
from pipeline.tasks import windows

NAN = float("nan")


def nothing(*numbers) -> None:
    """In place of a progress bar."""


def test_only_the_rate_of_the_recipe_is_replaced_and_the_test_part_is_not_read(workspace, values, write_dataset):
    write_dataset("test")
    trained = [rates.train_run(workspace, values, "touch", "cnn", rate, 5, nothing) for rate in (1e-5, 1e-2)]
    rows = [dict(zip(rates.COLUMNS, row, strict=True)) for row in trained]
    for row in rows:
        assert (row["model"], row["seed"], row["epochs"], row["batch_size"]) == ("cnn", 5, 3, 32)
    assert rows[1]["rmse_kpa"] < rows[0]["rmse_kpa"] < 1000
    write_dataset("nowhere")
    assert rates.train_run(workspace, values, "touch", "cnn", 1e-2, 5, nothing)[:7] == trained[1][:7]
    write_dataset("validation")
    assert rates.train_run(workspace, values, "touch", "cnn", 1e-2, 5, nothing)[6] > 1e5


def test_a_stream_is_trained_as_one(workspace, values, monkeypatch):
    fitted = []
    monkeypatch.setattr(
        windows, "fit", lambda *place, **how: fitted.append((place, how)) or (_ for _ in ()).throw(KeyError)
    )
    with pytest.raises(KeyError):
        rates.train_run(workspace, values, "touch", "lomp_stream", 0.5, 4, nothing)
    ((path, experiment, settings, protocol, seed, build), how), *_ = fitted
    assert (path, experiment, protocol, seed) == (workspace.dataset("touch"), "touch", "press", 4)
    assert settings is values["touch"] and how == {"device": "cpu", "progress": nothing, "base": None}
    regressor = build(windows.spec(settings))
    assert regressor.streams and regressor.training.learning_rate == 0.5
    assert regressor.training.epochs == settings["models"]["lomp_stream"]["training"]["epochs"]


def test_the_command_trains_the_grid_at_the_first_seed_and_the_two_best_at_all(workspace, values, write_dataset):
    write_dataset("nowhere")
    values["touch"]["models"] = {"constant": {}, "cnn": values["touch"]["models"]["cnn"]}
    rates.main(workspace, argparse.Namespace(experiment="touch"))
    table = pd.read_csv(workspace.reports / "rates" / "touch.csv")
    assert tuple(table.columns) == rates.COLUMNS and set(table["model"]) == {"cnn"}
    grid = table[table.seed == 4].set_index("learning_rate")["rmse_kpa"]
    places = [rates.place_of(tried) for tried in grid.index]
    assert places == list(range(places[0], places[-1] + 1)) and set(range(-10, -6)) <= set(places)  # 2e-3 is -8
    assert rates.beyond(dict(zip(places, grid, strict=True))) is None
    best = set(grid.nsmallest(2).index)
    for seed in (5, 6):
        assert set(table[table.seed == seed]["learning_rate"]) == best
    assert len(table) == len(grid) + 4
    assert (workspace.reports / "rates" / "touch.md").read_text().startswith("# Learning rates")


def made_up(workspace, values, monkeypatch, rmse):
    """Rows of the search over cnn and lomp with errors `rmse(model, rate, seed)` in place of trainings."""

    def train_run(workspace, values, experiment, model, rate, seed, report):
        return (model, rate, seed, 64, 3, 2, rmse(model, rate, seed), 2.0)

    monkeypatch.setattr(rates, "train_run", train_run)
    for model, rate in (("cnn", 2e-3), ("lomp", 1e-2)):
        values["touch"]["models"][model]["training"]["learning_rate"] = rate
    return rates.search(workspace, values, "touch", ["cnn", "lomp"])


def test_the_grid_goes_on_beyond_its_ends_until_the_lowest_error_is_inside(workspace, values, monkeypatch):
    lowest_at = {"cnn": 1e-4, "lomp": 1e-1}

    def rmse(model, rate, seed):
        if rate > 0.3:
            return NAN
        far = math.log(rate / lowest_at[model])
        return 5 + max(far, -2 * far) + seed / 100

    rows = made_up(workspace, values, monkeypatch, rmse)
    tried = {model: [row[1] for row in rows if row[0] == model and row[2] == 4] for model in lowest_at}
    assert tried["cnn"] == [5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3, 5e-3]
    assert tried["lomp"] == [2e-3, 5e-3, 1e-2, 2e-2, 5e-2, 1e-1, 2e-1]
    again = {(row[0], row[1]) for row in rows if row[2] in (5, 6)}
    assert again == {("cnn", 1e-4), ("cnn", 2e-4), ("lomp", 1e-1), ("lomp", 2e-1)}
    assert len(rows) == 14 + 8


def test_the_mean_over_the_seeds_decides_and_what_diverged_is_named(workspace, values, monkeypatch, tmp_path):
    levels = {5e-4: 6.0, 1e-3: 5.0, 2e-3: 4.0, 5e-3: NAN, 2e-2: 9.0, 1e-2: 8.0}

    def rmse(model, rate, seed):
        if model == "lomp":
            return NAN
        return levels[rate] + (3 if (rate, seed) == (2e-3, 6) else 0)  # mean 5 + 0, against 4 + 1

    rows = made_up(workspace, values, monkeypatch, lambda *run: rmse(*run) + 0.1 * (run[1:] == (2e-3, 5)))
    rates.write(values, "touch", rows, tmp_path)
    text = (tmp_path / "touch.md").read_text()
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    cnn, lomp = lines[2:4]
    assert cnn == ["CNN", "6.00", "5.00", "4.00", "diverged", "-", "-", "0.001: 5.00; 0.002: 5.03", "0.001", "0.002"]
    assert lomp == ["LoMP", "-", "-", "diverged", "diverged", "diverged", "diverged", "-", "none", "0.01"]


def test_a_training_that_diverges_has_no_error(workspace, values, write_dataset):
    write_dataset("nowhere")
    values["touch"]["models"]["cnn"]["training"] |= {"epochs": 2}
    table = schemas.read(workspace.dataset("touch"))
    y = schemas.matrix(table["y"]).copy()
    y[130] = np.inf  # of the validation part
    table = table.set_column(table.schema.get_field_index("y"), "y", schemas.lists(y, pa.float32()))
    schemas.write(workspace.dataset("touch"), table.schema, [table])
    row = rates.train_run(workspace, values, "touch", "cnn", 1e-3, 4, nothing)
    assert math.isnan(row[6]) and row[4:6] == (1, 0)


def test_every_network_is_searched(workspace, values):
    networks = {name for name, block in values["touch"]["models"].items() if "training" in block}
    assert networks == set(rates.NETWORKS)
    values["touch"]["models"] = {"constant": {}}
    with pytest.raises(InputError, match="no network to train"):
        rates.main(workspace, argparse.Namespace(experiment="touch"))


def test_places_of_the_grid():
    assert [rates.rate(place) for place in (-10, -9, -8, -7, -6, 0)] == [5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 1.0]
    assert [rates.place_of(rates.rate(place)) for place in range(-20, 4)] == list(range(-20, 4))
    assert [rates.rate(rates.place_of(rate)) for rate in (3e-3, 3.3e-3, 8e-3, 9.9e-3)] == [2e-3, 5e-3, 1e-2, 1e-2]
    assert rates.beyond({-8: 1.0, -7: 2.0, -6: 3.0}) == -9
    assert rates.beyond({-8: 3.0, -7: 2.0, -6: 1.0}) == -5
    assert rates.beyond({-8: 3.0, -7: 2.0, -6: NAN}) is None  # what diverged is beyond the best
    assert rates.beyond({-8: 3.0, -7: 1.0, -6: 2.0}) is None
    assert rates.beyond({-8: NAN, -7: NAN}) is None
    assert rates.two_lowest({1: 3.0, 2: NAN, 3: 1.0, 4: 2.0}) == [3, 4] and rates.two_lowest({1: NAN}) == []
