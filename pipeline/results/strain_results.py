"""Read the studies of the latent space.

Those of the number of samples, of strands, of units and of the task that transfer starts from are variants.
"""

import pandas as pd

from pipeline.results import studies
from tactile.base.paths import Workspace
from tactile.scoring.estimates import read_csv

LATENT = "latent of model-0"  # an input of the decoders, in drift.csv
STUDIES = {  # table -> the columns that say what differs between its rows, beside the seed
    "samples": ["protocol", "model", "samples"],
    "drift": ["protocol", "input", "target"],
    "capacity": ["protocol", "units", "params", "macs"],
    "strands": ["protocol", "strands", "model"],
    "bases": ["protocol", "base", "model"],
}


def read_study(workspace: Workspace, rows: pd.DataFrame, name: str) -> pd.DataFrame:
    """Return a study of STUDIES as its table in the report has it, without a row where it was not computed.

    rows: of the one table.
    """
    if name == "drift":
        return studies.read(workspace, "strain", name, ["protocol", "seed", "value"])
    if name == "capacity":
        table = studies.ladders(rows, "strain").rename(columns={"condition": "protocol", "size": "units"})
    else:
        column = {"bases": "base"}.get(name, name)
        table = studies.rungs(rows[rows["metric"] == "error"], "strain", column)
        table = table if column == "base" else table.astype({column: int})
    table = table[[*STUDIES[name], "seed", "metric", "unit", "value"]]
    return table.sort_values(["seed", *STUDIES[name]], key=lambda values: values.astype(str), ignore_index=True)


def read_latents(workspace: Workspace) -> pd.DataFrame:
    """Read t_s and the states of the first model-0 on task 2; without a row where they were not computed."""
    first = workspace.study("strain", "latents")[:1]
    return read_csv(first[0], ["t_s"], studies.MADE_BY) if first else pd.DataFrame(columns=["t_s"])
