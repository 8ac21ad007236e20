"""Check that a table of runs has exactly one row per run that params.yaml asks for."""

from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from pipeline.base.errors import InputError


def check(table: pd.DataFrame, path: Path, key: list[str], wanted: Iterable[tuple], made_by: str) -> None:
    """Raise InputError that names the first repeated or missing row; key: the columns whose values `wanted` lists.

    A row that `wanted` lacks is no error: params.yaml may have shrunk since the command `made_by` wrote `path`.
    """
    present = set(table[key].itertuples(index=False, name=None))
    repeated = table[key][table.duplicated(key)].itertuples(index=False, name=None)
    missing = (run for run in wanted if run not in present)
    for problem, runs in (("two rows", repeated), ("no row", missing)):
        if (run := next(runs, None)) is not None:
            words = ", ".join(f"{name} {value}" for name, value in zip(key, run, strict=True))
            raise InputError(f"{path}: {problem} for {words}; run `{made_by}` again")
