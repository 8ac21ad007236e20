"""Templates are filled with numbers; a value that is missing stops the report."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from jinja2 import UndefinedError

from pipeline.reporting.report import Report
from tactile.drawing import templates
from tactile.scoring.estimates import estimate


def test_a_template_is_filled(tmp_path):
    (tmp_path / "some.md").write_text(
        "{% if True %}\n# {{ name }}\n{% endif %}\n{{ value | number(1) }}, {{ runs | interval }} \n\n\n\n"
        '{{ table(["a", "b"], [["1", "2"]]) }}'
    )
    text = templates.render(tmp_path, "some", name="<n>", value=2.04, runs=estimate([1.0, np.nan]))
    assert text == "# <n>\n2.0, failed (1 of 2 runs); others 1.00\n\n| a | b |\n| - | : |\n| 1 | 2 |\n"
    with pytest.raises(UndefinedError, match="name"):
        templates.render(tmp_path, "some", value=2.0, runs=estimate([1.0]))


@pytest.mark.parametrize(
    ("shown", "epochs", "said"),
    [
        ("full", {"one": 50, "two": 50}, "2 runs, the full budget of 50 epochs"),
        ("half", {"one": 12, "two": 4, "three": 8}, "2 runs, half of the budget of 4 to 12 epochs"),
        ("full", {}, "2 runs, the full budget"),
        ("look", {"one": 50}, "2 runs, the look of this machine"),
    ],
)
def test_numbers_say_of_how_many_runs_and_epochs_they_are(shown, epochs, said):
    report = Report.__new__(Report)
    rows = pd.DataFrame({"seed": [0, 1, -1, 2, 3], "budget": shown, "variant": ["", "", "", "other", "other"]})
    report.experiment, report.of_look = "glove", shown == "look"
    report.results = SimpleNamespace(shown=lambda *_: shown, rows=lambda **_: rows)
    changed = {f"glove.models.{model}.training.epochs": count for model, count in epochs.items()}
    report._sets = {"session": SimpleNamespace(set={"glove.simulate.specimens": 5} | changed)}
    assert report.basis("session") == said and report.basis("elsewhere") == "2 runs"
