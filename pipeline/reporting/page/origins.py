"""Write reports/shards.md: of which shards each split and variant is, with their commits and machines."""

import pandas as pd

from pipeline.reporting import texts
from pipeline.results import shards, shown
from pipeline.results.one_table import Results
from tactile.base.paths import Workspace
from tactile.drawing.labels import experiment_name, model_name

FILE = "shards.md"  # in reports/


def title(experiment: str, protocol: str, variant: str) -> str:
    """Return the heading of what has this split and variant."""
    return " ".join(filter(None, (experiment, protocol, variant)))


def place(experiment: str, protocol: str, variant: str) -> str:
    """Return where its shards are listed, an address from reports/. A heading is addressed as code hosts do."""
    heading = title(experiment, protocol, variant).lower()
    return f"{FILE}#{''.join('-' if x == ' ' else x for x in heading if x.isalnum() or x in '_- ')}"


def document(workspace: Workspace, results: Results) -> str:
    """Return shards.md of the evidence: for each split and variant a line for each set and budget."""
    rows, index = results.table, shards.table(shards.folder(workspace) / "index.csv", shards.INDEX)
    rows = rows[rows[shards.SHARD].notna() & rows["metric"].isin(shown.COMPARED)]
    sections: dict[str, dict[str, list[dict]]] = {}
    for (experiment, protocol, variant), group in rows.groupby(["experiment", "protocol", "variant"]):
        of_set = group.groupby(group[shards.SHARD].str.replace(r"-\d+-", ", ", regex=True))
        lines = [_line(name, each, index) for name, each in of_set]
        sections.setdefault(experiment_name(experiment), {})[title(experiment, protocol, variant)] = lines
    return texts.render("shards", sections=sections)


def _line(name: str, rows: pd.DataFrame, index: pd.DataFrame) -> dict:
    """Return what is said of a set at a budget; rows: of the one table; index: of the shards."""
    origin = shown.origin(index, rows[shards.SHARD])
    return {
        "name": name,
        "seeds": sorted((int(shard.split("-")[-2]), shard) for shard in origin.shards),
        "models": [model_name(model) for model in dict.fromkeys(rows["model"])],
        "origin": origin,
        "core_s": pd.to_numeric(index[index["shard"].isin(origin.shards)]["core_s"]).sum(),
    }
