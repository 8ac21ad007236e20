"""Models in packages of their own."""

from collections.abc import Callable
from pathlib import Path

import pytest
from builders.live_models import KINDS


@pytest.fixture(scope="session")
def package(tmp_path_factory) -> Callable[[str], Path]:
    """`package(kind)`: the folder of a model of KINDS, made once."""
    made: dict[str, Path] = {}

    def folder(kind: str) -> Path:
        if kind not in made:
            made[kind] = KINDS[kind](tmp_path_factory.mktemp("packages") / kind)
        return made[kind]

    return folder
