"""List the variants of a simulated scene: the effect that is left out, and the seed."""

from collections.abc import Mapping

from pipeline.base.errors import InputError

COLUMNS = ("experiment", "effect", "condition", "model", "seed", "metric", "unit", "value")  # of physics.csv
NONE = "none"  # no effect is left out


def variants(values: Mapping, experiment: str) -> list[tuple[str, int]]:
    """Return (effect, seed) of every run of the settings, `none` first; each effect has the same seeds.

    Raises InputError for a single seed, which has no interval.
    """
    seeds = values["physics"][experiment]["seeds"]
    if len(seeds) < 2:
        raise InputError(f"params.yaml, physics.{experiment}.seeds: give two seeds or more; one has no interval")
    effects = [NONE, *values[experiment]["simulate"]["effects"]]
    return [(effect, seed) for effect in effects for seed in seeds]
