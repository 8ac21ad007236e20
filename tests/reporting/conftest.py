"""Fixtures of the reports' tests."""

import matplotlib.pyplot as plt
import pytest

from pipeline.reporting.figures import style


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made but not drawn: for tests that look at something else."""

    def save(figure, path):
        path.touch()
        plt.close(figure)

    monkeypatch.setattr(style, "save", save)
