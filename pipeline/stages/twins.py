"""Compute the same model-free statistics of recordings and of the scene that stands for them: twins.csv.

Usage: python -m pipeline.stages.twins touch|array_recorded|strain|glove
"""

import pandas as pd

from pipeline.twins import array_recorded, glove, strain, touch
from tactile.base import arguments, files, params
from tactile.base.availability import why_not_run
from tactile.base.paths import Workspace
from tactile.experiments import facts

MODULES = {  # named as experiments that have the fact `twin`
    module.__name__.rpartition(".")[2]: module for module in (touch, array_recorded, strain, glove)
}
COLUMNS = ["statistic", "unit", "source", "recording", "value", "meaning", "note"]


def statistics(workspace: Workspace, values: dict, experiment: str) -> pd.DataFrame:
    """Return the rows of twins.csv; those of recordings that are absent, or of a scene not simulated, are left out."""
    module, twin, tables = MODULES[experiment], facts(experiment).twin, []
    if why_not_run(workspace, twin.experiment) is None:
        tables.append(module.recorded(workspace, values).assign(source="recorded"))
    if values[twin.scene or experiment]["source"] == "simulated":
        tables.append(module.simulated(workspace, values).assign(source="simulated"))
    table = pd.concat([pd.DataFrame(columns=COLUMNS), *tables])
    for column, meaning in (("unit", 0), ("meaning", 1)):
        table[column] = [module.STATISTICS[name][meaning] for name in table["statistic"]]
    table["note"] = [module.NOTES.get(name, "") for name in table["statistic"]]
    return table[COLUMNS]


def main(workspace: Workspace) -> None:
    """Write twins.csv of the experiment named on the command line."""
    values = params.load(workspace.params)
    experiment = arguments.parse(__doc__, experiment=list(MODULES)).experiment
    table = statistics(workspace, values, experiment)
    files.write_table(workspace.twins(experiment), table)
    print(f"{experiment}: {table['statistic'].nunique()} statistics of {table['recording'].nunique()} recordings")


if __name__ == "__main__":
    arguments.run(main)
