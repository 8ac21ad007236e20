"""Templates are filled with numbers; a value that is missing stops the report."""

import numpy as np
import pytest
from jinja2 import UndefinedError

from pipeline.reporting.words import templates
from pipeline.scoring.results import estimate


def test_a_template_is_filled(tmp_path, monkeypatch):
    (tmp_path / "some.md").write_text(
        "{% if True %}\n# {{ name }}\n{% endif %}\n{{ value | number(1) }}, {{ runs | interval }} \n\n\n\n"
        '{{ table(["a", "b"], [["1", "2"]]) }}'
    )
    monkeypatch.setattr(templates, "FOLDER", tmp_path)
    templates._environment.cache_clear()
    try:
        text = templates.render("some", name="<n>", value=2.04, runs=estimate([1.0, np.nan]))
        assert text == "# <n>\n2.0, failed (1 of 2 runs); others 1.00\n\n| a | b |\n| - | : |\n| 1 | 2 |\n"
        with pytest.raises(UndefinedError, match="name"):
            templates.render("some", value=2.0, runs=estimate([1.0]))
    finally:
        templates._environment.cache_clear()
