"""Keep the committed results on recordings where this machine has no recordings.

A stage that writes a table of several experiments takes their rows from the file that it replaces: its output has
`persist` in dvc.yaml, so that DVC leaves the file until then.
"""

from collections.abc import Collection
from pathlib import Path

import pandas as pd

from pipeline.base import foreign


def kept_rows(path: Path, experiments: Collection[str], text: bool = False) -> pd.DataFrame:
    """Return the rows of a table that are of these experiments, and say so; none where there is no such file.

    Numbers are read to the last digit; text: everything is left as text.
    """
    if not path.is_file():
        return pd.DataFrame(columns=["experiment"])
    how = {"dtype": str, "keep_default_na": False} if text else {}
    with foreign.reading(path, "a CSV table", "get it again from git, or delete it"):
        table = pd.read_csv(path, **how)
        table["experiment"]  # KeyError where it is another table
    rows = table[table["experiment"].isin(experiments)]
    if len(rows):
        say_kept(path.name, rows["experiment"].unique())
    return rows


def say_kept(place: str, names: Collection[str]) -> None:
    """Print which results in a file or folder are not of this machine."""
    print(f"{place}: kept from the committed results: {', '.join(names)}; `tactile fetch` gets the recordings")
