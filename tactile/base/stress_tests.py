"""Register stress tests: each is one function, whose decorator says what it acts on and in which unit.

Those of readings stand in pipeline/stability, those of a scene in pipeline/scenes/<experiment>_stress.py. Severities
are settings, `stress.<experiment>.perturbations`; settings/stress.py reads there which names may be listed.
"""

import inspect
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from tactile.base import params
from tactile.base.errors import InputError

READINGS, FRAMES, SAMPLES, SCENE = "readings", "frames", "samples", "scene"


class StressTest(NamedTuple):
    """A registered function and what its decorator says."""

    name: str
    function: Callable
    unit: str  # of the severity, in words
    acts_on: str
    draw: str  # tests of one draw fail the same elements
    conditions: tuple[str, ...]

    def changed(self, readings: np.ndarray, severity: float, rng: np.random.Generator, levels: Mapping) -> np.ndarray:
        """Return the readings after the test; levels: what readings were in training, by the names of its keywords."""
        return self.function(readings, severity, rng, **{name: levels[name] for name in self.needs})

    @property
    def needs(self) -> list[str]:
        """Return the names of the levels that the function takes, its keyword-only parameters."""
        parameters = inspect.signature(self.function).parameters.values()
        return [each.name for each in parameters if each.kind is each.KEYWORD_ONLY]


REGISTERED: dict[str, dict[str, StressTest]] = {}  # kind of input, or experiment of a scene -> name -> test


def stress_test(
    *of: str, unit: str, acts_on: str = READINGS, draw: str = "", conditions: tuple[str, ...] = ()
) -> Callable[[Callable], Callable]:
    """Register the decorated function as a stress test of its name; all arguments are written out, as literals.

    of: kinds of input (tactile/tasks) whose readings it changes, or the experiment whose scene; unit: of the
    severity; it ends in `, number` where severities are numbers of other sensors, which have no order.
    acts_on: `readings` of elements; `frames`, their order in time; `samples`, which of a series count; or the `scene`.
    draw: name of the test whose random numbers it takes; conditions: those of touch that are simulated anew.
    """

    def register(function: Callable) -> Callable:
        name = function.__name__
        for one in of:
            REGISTERED.setdefault(one, {})[name] = StressTest(name, function, unit, acts_on, draw or name, conditions)
        return function

    return register


def of_scene(experiment: str, name: str) -> Callable:
    """Return the function of a test of a scene; raise InputError for an unknown one."""
    if name not in (known := REGISTERED[experiment]):
        raise InputError(f"{experiment} scene: no change '{name}'; there are {', '.join(known)}")
    return known[name].function


def planned(values: Mapping, experiment: str, kind: str) -> dict[StressTest, list[float]]:
    """Return test -> rising severities of params.yaml; tests of the scene only where data are simulated.

    Recordings have no scene. Raises InputError for an unknown name.
    """
    settings, asked = values[experiment], values["stress"][experiment]["perturbations"]
    known = REGISTERED[kind] | (REGISTERED.get(experiment, {}) if "simulate" in settings else {})
    params.check_known(asked, known, f"stress.{experiment}.perturbations")
    simulated = settings.get("source") == "simulated"
    tests = {known[name]: sorted(severities) for name, severities in asked.items()}
    return {test: severities for test, severities in tests.items() if simulated or test.acts_on != SCENE}
