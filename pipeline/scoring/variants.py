"""List the variants of a simulated scene: the effects that are left out, one by one."""

from collections.abc import Mapping

COLUMNS = ("experiment", "effect", "condition", "model", "seed", "metric", "unit", "value")  # of physics.csv
NONE = "none"  # no effect is left out


def effects(values: Mapping, experiment: str) -> list[str]:
    """Return the effect that each variant of a seed leaves out, `none` first; values: all settings."""
    return [NONE, *values[experiment]["simulate"]["effects"]]
