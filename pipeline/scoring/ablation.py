"""Read the settings of models with one thing changed."""

from collections.abc import Mapping


def block_of(settings: Mapping, name: str) -> dict:
    """Return the settings of a row's model: its own, and those of the row beside it."""
    row = settings["ablation"][name]
    beside = row.get("beside", "")
    return (dict(settings["ablation"][beside]["settings"]) if beside else {}) | row["settings"]
