"""Read the tables of the studies, which are computed by `tactile evidence`: evidence/studies/."""

from collections.abc import Sequence

import pandas as pd

from pipeline.base.paths import Workspace
from pipeline.scoring.results import read_csv

MADE_BY = "tactile evidence"


def read(workspace: Workspace, experiment: str, table: str, columns: Sequence[str]) -> pd.DataFrame:
    """Return a table of a study, of all seeds that were computed; without a row where none was.

    columns: what it has at least; InputError where a file lacks one.
    """
    parts = [read_csv(path, columns, MADE_BY) for path in workspace.study(experiment, table)]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(columns))
