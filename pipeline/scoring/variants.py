"""List the variants of a simulated scene: the effect that is left out, and the seed."""

from collections.abc import Mapping

from pipeline.base.errors import InputError

COLUMNS = ("experiment", "effect", "condition", "model", "seed", "metric", "unit", "value")  # of physics.csv
NONE = "none"  # no effect is left out
DEFAULT = "default"  # the scene as params.yaml has it: all effects that are off there are left out at once


def variants(values: Mapping, experiment: str) -> list[tuple[str, int]]:
    """Return (effect, seed) of every run of params.yaml, `none` first; `default` last, if an effect is off by default.

    Raises InputError for seeds that cannot be compared.
    """
    chosen = values["physics"][experiment]
    floor, fewer = chosen["floor_seeds"], chosen["effect_seeds"]
    if len(floor) < 2 or not set(fewer) <= set(floor):
        raise InputError(
            f"params.yaml, physics.{experiment}: floor_seeds must be two or more, with all of effect_seeds among them"
        )
    switches = values[experiment]["simulate"]["effects"]
    effects = [*switches, *([] if all(switches.values()) else [DEFAULT])]
    return [(NONE, seed) for seed in floor] + [(effect, seed) for effect in effects for seed in fewer]
