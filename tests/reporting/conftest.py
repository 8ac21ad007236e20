"""Fixtures of the reports' tests."""

import matplotlib.pyplot as plt
import pytest

from pipeline.reporting.figures import common, glove, speed, strain, style, touch


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made but not drawn: for tests that look at something else."""

    def save(figure, path):
        path.touch()
        plt.close(figure)

    monkeypatch.setattr(style, "save", save)


@pytest.fixture
def unplotted(monkeypatch):
    """Files of figures are made, figures are not: for tests of what a report says."""
    for module in (common, glove, speed, strain, touch):
        for name, function in list(vars(module).items()):
            if getattr(function, "__module__", "") == module.__name__ and "path" in getattr(
                function, "__annotations__", {}
            ):
                monkeypatch.setattr(module, name, lambda path, *_, **__: path.touch())
