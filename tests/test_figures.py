"""Models that stand in one chart can be told apart."""

import pytest

from pipeline import figures, params

VALUES = params.load()


@pytest.mark.parametrize("experiment", VALUES["experiments"])
def test_no_two_models_of_an_experiment_look_alike(experiment):
    styles = [figures.style(model) for model in VALUES[experiment]["models"]]
    for part in ("label", "color", "marker"):
        found = [getattr(one, part) for one in styles]
        assert len(set(found)) == len(found), f"{experiment}: a {part} twice in {found}"
