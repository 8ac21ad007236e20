"""Fixtures of the reports' tests."""

import pytest
from builders import made_reports


@pytest.fixture
def unplotted(monkeypatch):
    """Files of figures are made, figures are not: for tests of what a report says."""
    made_reports.unplot(monkeypatch)
