"""Of frames without a measured force some of each condition are kept, and the maps and readings of a few of these."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from builders import made_reports

from pipeline.results import kept
from tactile import experiments
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.experiments import array_recorded

EXPERIMENT, PROTOCOL = "array_recorded", "fold_0"
TESTED = {"one": 4 * kept.FRAMES + 3, "two": kept.FRAMES, "three": kept.FRAMES, "four_or_more": 2}  # of the test part
SETTINGS = made_reports.settings_of(EXPERIMENT) | {"label": {"map_rows": 20, "map_cols": 20}}
MODELS = [f"model_{number}" for number in range(12)]


def written(workspace, settings, frames=TESTED) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Write a dataset of `frames` a condition, shuffled, and predictions; return conditions, truth and readings."""
    rng = np.random.default_rng(0)
    name = rng.permutation(np.repeat(list(frames), list(frames.values())))
    n, cells = len(name), settings["label"]["map_rows"] * settings["label"]["map_cols"]
    truth = np.where(rng.uniform(size=(n, cells)) < 0.05, rng.uniform(0, 100, (n, cells)), 0).astype(np.float32)
    x = rng.integers(0, 400, (n, settings["sensor"]["rows"] * settings["sensor"]["cols"])).astype(np.float32)
    place = np.full((n, 3), np.nan)
    place[:, 0] = rng.uniform(0, 20, n)
    table = pa.table(
        {
            "condition": pa.array(name.tolist()).dictionary_encode(),
            "recording": pa.array([f"P{row % 2:02d}/1" for row in range(n)]).dictionary_encode(),
            "press": pa.array(np.arange(n, dtype=np.int32)),
            "t_s": pa.array(np.arange(n, dtype=float)),
            "x": schemas.lists(x, pa.float32()),
            **dict.fromkeys(("x_mm", "y_mm"), schemas.lists(place, pa.float32())),
            "y": schemas.lists(truth, pa.float32()),
            schemas.split_column(PROTOCOL, kept.FIRST): pa.array(
                ["train"] * 7 + ["test"] * (n - 7)
            ).dictionary_encode(),
        }
    )
    workspace.experiment_folder(EXPERIMENT).mkdir(parents=True)
    schemas.write(workspace.dataset(EXPERIMENT), table.schema, [table])
    workspace.predictions(EXPERIMENT).mkdir(parents=True)
    for model in settings["models"]:
        predicted = (0.7 * truth + rng.normal(0, 5, truth.shape)).astype(np.float32)[7:]
        rows = schemas.prediction_rows(PROTOCOL, kept.FIRST, np.arange(7, n), predicted)
        schemas.write(workspace.predictions(EXPERIMENT) / f"{model}.parquet", rows.schema, [rows])
    return name, truth, x


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return the kept rows of twelve models, the size of their file, and `written`."""
    workspace = Workspace(tmp_path_factory.mktemp("frames"))
    settings = SETTINGS | {"models": dict.fromkeys(MODELS, {})}
    truth, path = written(workspace, settings), workspace.root / "kept.parquet"
    kept.write(path, kept.table(workspace, EXPERIMENT, settings))
    return kept.read(path, EXPERIMENT).to_pandas(), path.stat().st_size, truth


def frames_of(rows, model):
    return rows[(rows["model"] == model) & (rows["window"] != kept.WHOLE)].sort_values("window")


def test_some_frames_of_each_condition_are_kept_evenly_and_a_few_with_maps(made):
    rows, _, (name, _, _) = made
    label = frames_of(rows, kept.LABEL)
    assert label["window"].is_unique and label["window"].min() >= 7
    assert (label["condition"].astype(str) == name[label["window"]]).all()
    for condition, own in label.groupby(label["condition"].astype(str)):
        there = np.flatnonzero(name == condition)
        there = there[there >= 7]
        assert len(own) == min(kept.FRAMES, len(there)), condition
        at = np.searchsorted(there, own["window"])
        assert at[0] == 0 and at[-1] == len(there) - 1
        assert np.ptp(np.diff(at)) <= 1, "evenly over the test part"
        mapped = np.flatnonzero(own["map"].map(len) > 0)
        assert len(mapped) == min(kept.MAPPED, len(there))
        assert np.ptp(np.diff(mapped)) <= 1 and mapped[0] == 0 and mapped[-1] == len(own) - 1
    assert set(label["condition"].astype(str)) == set(array_recorded.CONDITIONS)


@pytest.mark.parametrize("model", [kept.LABEL, MODELS[0], MODELS[-1]])
def test_numbers_and_maps_are_those_of_the_frame_in_their_row(made, model):
    rows, _, (_, truth, readings) = made
    own, label = frames_of(rows, model), frames_of(rows, kept.LABEL)
    assert list(own["window"]) == list(label["window"])
    shown, right = own["map"].map(len).to_numpy() > 0, truth[own["window"]]
    assert list(shown) == list(label["map"].map(len) > 0)
    maps = np.stack(own["map"][shown]).astype(float)
    exact = right[shown] if model == kept.LABEL else maps
    np.testing.assert_allclose(maps, exact, atol=0.04)  # half precision below 128
    np.testing.assert_allclose(own["peak"][shown], maps.max(axis=1), atol=0.04)
    off = maps - right[shown]
    np.testing.assert_allclose(own["mean_square"][shown], np.square(off).mean(axis=1), rtol=2e-3, atol=1e-3)
    np.testing.assert_allclose(own["mean_absolute"][shown], np.abs(off).mean(axis=1), rtol=2e-3, atol=1e-3)
    assert model == kept.LABEL or 4 < np.sqrt(own["mean_square"]).min() < np.sqrt(own["mean_square"]).max() < 12
    assert (own["at_touches"].map(len) == 0).all() and own["force_n"].isna().all()
    if model == kept.LABEL:
        seen = label["counts"].map(len).to_numpy() > 0
        assert list(seen) == list(shown)
        np.testing.assert_array_equal(np.stack(label["counts"][seen]), readings[label["window"]][seen])


def test_a_file_of_twelve_models_is_small(made):
    assert 100_000 < made[1] < kept.LARGEST


def test_a_condition_of_one_frame_is_kept_once(tmp_path):
    settings = SETTINGS | {"models": {"linear": {}}, "label": {"map_rows": 6, "map_cols": 6}}
    name, _, _ = written(Workspace(tmp_path), settings, {"one": 40, "two": 3})
    rows = kept.table(Workspace(tmp_path), EXPERIMENT, settings).to_pandas()
    label = frames_of(rows, kept.LABEL)
    assert dict(label["condition"].astype(str).value_counts()) == dict(pd.Series(name[7:]).value_counts())
    few = label[label["condition"] == "two"]
    assert (few["map"].map(len) == 36).all() and 0 < len(few) <= 3
    assert experiments.facts(EXPERIMENT).drawn == (PROTOCOL,)
