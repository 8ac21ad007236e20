"""The variants of a simulated scene: which effect is left out, and with which seed."""

from collections.abc import Mapping

from pipeline.errors import InputError

COLUMNS = ("experiment", "effect", "condition", "model", "seed", "metric", "unit", "value")  # of physics.csv
NONE = "none"  # no effect is left out
TOGETHER = "together"  # the effects of physics.<experiment>.together are left out at once


def variants(values: Mapping, experiment: str) -> list[tuple[str, int]]:
    """(effect, seed) of every run of params.yaml, `none` first.

    Raises InputError for seeds that cannot be compared and for an unknown effect in `together`.
    """
    chosen = values["physics"][experiment]
    floor, fewer = chosen["floor_seeds"], chosen["effect_seeds"]
    if len(floor) < 2 or not set(fewer) <= set(floor):
        raise InputError(
            f"params.yaml, physics.{experiment}: floor_seeds must be two or more, with all of effect_seeds among them"
        )
    effects = list(values[experiment]["simulate"]["effects"])
    if strange := [name for name in chosen["together"] if name not in effects]:
        raise InputError(
            f"params.yaml, physics.{experiment}.together: there is no effect '{strange[0]}'; "
            f"known: {', '.join(effects)}"
        )
    if chosen["together"]:
        effects.append(TOGETHER)
    return [(NONE, seed) for seed in floor] + [(effect, seed) for effect in effects for seed in fewer]
