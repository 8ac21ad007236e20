"""Settings and a dataset on which a network of touch trains in a second."""

import copy
import functools
import sys
from collections.abc import Callable

import numpy as np
import pyarrow as pa
import pytest
from builders.project import ROOT

from tactile.base import params
from tactile.commands import command_line
from tactile.datasets import schemas

SMALL = {"channels": [4], "hidden": [16]}


@pytest.fixture
def values(monkeypatch):
    """params.yaml with a small CNN of few epochs and three seeds, in this process."""
    monkeypatch.setenv("WORKERS", "1")
    values = copy.deepcopy(params.load(ROOT / "params.yaml")) | {"device": "cpu"}
    monkeypatch.setattr(params, "load", lambda _: values)
    cnn = values["touch"]["models"]["cnn"]
    cnn |= SMALL | {"training": cnn["training"] | {"epochs": 3, "batch_size": 32}}
    values["touch"]["protocols"] = {"press": {"seeds": [4, 5, 6]}, "random_window": {"seeds": [0]}}
    return values


def write_small_dataset(workspace, wrong: str) -> None:
    """Labels follow the windows; those of the part `wrong` are noise."""
    rng = np.random.default_rng(0)
    part = np.repeat(["train", "validation", "test"], [128, 32, 32])
    x = rng.uniform(0, 1000, (192, 8, 25)).astype(np.float32)
    y = np.repeat(x[:, -1, :1] / 5, 400, axis=1)
    y[part == wrong] += rng.uniform(0, 1e6, (int((part == wrong).sum()), 400)).astype(np.float32)
    names = pa.array(part).dictionary_encode().cast(schemas.NAME)
    columns = {schemas.split_column("press", seed): names for seed in (4, 5, 6)}
    columns |= {"x": schemas.lists(x.reshape(192, -1), pa.float32()), "y": schemas.lists(y, pa.float32())}
    table = pa.table(columns)
    schemas.write(workspace.dataset("touch"), table.schema, [table])


@pytest.fixture
def called(workspace, monkeypatch, capsys) -> Callable[..., str]:
    """`called("sheet", folder)`: what a command of `tactile` prints."""

    def call(*words) -> str:
        monkeypatch.setattr(sys, "argv", ["tactile", *map(str, words), "--root", str(workspace.root)])
        command_line.main()
        return capsys.readouterr().out

    return call


@pytest.fixture
def write_dataset(workspace):
    """What writes the dataset, in the workspace of the test."""
    return functools.partial(write_small_dataset, workspace)
