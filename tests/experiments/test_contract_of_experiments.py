"""Every file of pipeline/experiments provides what the stages ask of it."""

import pytest
from builders.project import ROOT

from pipeline import experiments, tasks
from pipeline.base import params, paths

NAMES = sorted(path.stem for path in paths.EXPERIMENTS.glob("*.py") if path.stem != "__init__")


@pytest.mark.parametrize("name", NAMES)
def test_an_experiment_provides_what_its_kind_needs(name):
    module = experiments.module(name)
    absent = [each for each in (*experiments.EVERY, *experiments.OF_KIND[module.KIND]) if not hasattr(module, each)]
    assert not absent
    assert tasks.of(name).__name__ == f"pipeline.tasks.{module.KIND}"


def test_params_yaml_lists_every_experiment():
    assert sorted(params.load(ROOT / "params.yaml")["experiments"]) == NAMES


def test_the_three_kinds_have_the_same_functions():
    """What the room's docstring names; helpers of one kind may stand beside them."""
    named = "source inputs rows labelled base fit adapted tested stream timed".split()
    modules = [tasks.of(name) for name in ("touch", "strain", "glove")]
    assert all(callable(getattr(module, function, None)) for module in modules for function in named)
