"""Models that stand in one chart can be told apart, and nothing is cut off."""

import matplotlib.pyplot as plt
import pytest
from builders import own_logs
from builders.project import ROOT

from tactile.base import params
from tactile.drawing import style

VALUES = params.load(ROOT / "params.yaml")


@pytest.mark.parametrize("experiment", VALUES["experiments"])
def test_no_two_models_of_an_experiment_look_alike(experiment):
    styles = [style.model_style(model) for model in VALUES[experiment]["models"]]
    for part in ("label", "color", "marker"):
        found = [getattr(one, part) for one in styles]
        assert len(set(found)) == len(found), f"{experiment}: a {part} twice in {found}"


@pytest.mark.parametrize("title", ["", "A title that is a good deal wider than the one panel that stands below it"])
def test_a_figure_is_as_wide_as_its_title(title, tmp_path):
    figure, _ = plt.subplots(figsize=(3, 3))
    figure.suptitle(title)
    style.save(figure, tmp_path / "figure.png")
    width = plt.imread(tmp_path / "figure.png").shape[1]
    assert width == 3 * style.DPI if not title else width > 4.5 * style.DPI


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Glyph")  # the font has no Chinese letters
@pytest.mark.parametrize("name", [*own_logs.NAMES, "$x^2$", r"a\$b$", r"$\frac{1}{2}$"], ids=ascii)
def test_a_name_is_drawn_as_it_is(name, tmp_path):
    for path, text, formula in (("name.png", style.literal(name), True), ("wanted.png", name, False)):
        figure, ax = plt.subplots(figsize=(3, 2))
        ax.set_title(text, parse_math=formula)
        style.save(figure, tmp_path / path)
    assert (tmp_path / "name.png").read_bytes() == (tmp_path / "wanted.png").read_bytes()
