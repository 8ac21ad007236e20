"""Models in packages of their own, on one thread."""

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from builders.live_models import KINDS


@pytest.fixture(autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session")
def package(tmp_path_factory) -> Callable[[str], Path]:
    """`package(kind)`: the folder of a model of KINDS, made once."""
    made: dict[str, Path] = {}

    def folder(kind: str) -> Path:
        if kind not in made:
            made[kind] = KINDS[kind](tmp_path_factory.mktemp("packages") / kind)
        return made[kind]

    return folder
