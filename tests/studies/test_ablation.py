"""Rows with one thing changed: what they are trained on, what they are compared with, and what is refused."""

import copy

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from builders.project import ROOT

from pipeline.base import params
from pipeline.base.errors import InputError
from pipeline.datasets import schemas
from pipeline.scoring import ablation as scored
from pipeline.studies import ablation

FRAMES, ELEMENTS, CELLS = 8, 25, 400


@pytest.fixture
def values():
    return copy.deepcopy(params.load(ROOT / "params.yaml")) | {"device": "cpu"}


def test_the_committed_rows_can_be_trained(values):
    ablation.check(values["touch"], "touch")
    rows = values["touch"]["ablation"]
    assert scored.block_of(values["touch"], "lomp_alpha_0") == rows["lomp_half"]["settings"] | {"alpha": 0.0}
    tables = values["touch"]["models"]
    assert rows["lomp_half"]["settings"] == tables["lomp"] | {"hidden": 64, "readout": [64, 32]}
    for name, row in rows.items():
        assert row.get("beside") or row["frames"] == 1 or name == "lomp_half"
        if row["frames"] == 1:
            assert row["settings"] == tables[row["of"]], "only the frames differ from the row of Table I"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"of": "lompp"}, "did you mean 'lomp'"),
        ({"beside": "lomp_hald"}, "did you mean 'lomp_half'"),
        ({"frames": 9}, "a window has 8 frames"),
        ({"settings": {"alpha": "none"}}, "alpha"),
        ({"settings": {"alfa": 0.0}}, "did you mean 'alpha'"),
    ],
)
def test_a_row_that_cannot_be_trained_is_one_sentence(values, change, words):
    values["touch"]["ablation"]["lomp_alpha_0"] |= change
    with pytest.raises(InputError, match=words):
        ablation.check(values["touch"], "touch")


def test_a_row_sees_its_frames_and_is_scored_on_the_test_part(workspace, values):
    """Labels follow the frame before the last: the last frame alone cannot tell them."""
    rng = np.random.default_rng(0)
    part = np.repeat(["train", "validation", "test", "unused"], [120, 20, 40, 20])
    x = rng.integers(0, 1000, (200, FRAMES, ELEMENTS)).astype(np.int16)
    y = np.repeat(x[:, -2, :1] / 5.0, CELLS, axis=1) + np.arange(CELLS) % 7
    table = pa.table(
        {
            "condition": pa.array(["single", "double"] * 100).dictionary_encode().cast(schemas.NAME),
            schemas.split_column("press", 0): pa.array(part).dictionary_encode().cast(schemas.NAME),
            "x": schemas.lists(x.reshape(200, -1), pa.int16()),
            "y": schemas.lists(y.astype(np.float32), pa.float32()),
        }
    )
    schemas.write(workspace.dataset("touch"), table.schema, [table])
    tree = {"of": "tree", "settings": {"each": "input", "min_samples_leaf": 1, "max_features": 1.0}}
    values["touch"]["ablation"] = {"one": tree | {"frames": 1}, "two": tree | {"frames": 2}}
    errors = {}
    for name in ("one", "two"):
        rows = ablation.train_run(workspace, values, "touch", name, 0, lambda *numbers: None)
        found = pd.DataFrame(rows, columns=ablation.COLUMNS)
        assert set(found["condition"]) == {"single", "double"} and (found[found.metric == "rmse"].n == 20).all()
        errors[name] = found[found.metric == "rmse"].value.mean()
    assert errors["two"] < errors["one"] / 5
