"""Write the errors that `dvc metrics` shows, a file for each row: reports/metrics/EXPERIMENT/PANEL/MODEL.json.

A file has one number, the model's mean error on the test part, of reports/EXPERIMENT/speed/table2.csv, with its unit as
the key, so that the units are the columns. A run without a finite error has no number. Times, which differ from call to
call, stay in the tables. Usage: python -m pipeline.stages.metrics
"""

import json
import math
import re
from pathlib import Path

import pandas as pd

from tactile.base import arguments, files, foreign, params
from tactile.base.paths import Workspace

DIGITS = 4  # that `dvc metrics show` shows


def of_experiment(table: pd.DataFrame) -> dict[Path, dict[str, float]]:
    """Return PANEL/MODEL.json -> unit -> error; table: table2.csv."""
    numbers = {}
    for row in table.to_dict("records"):
        unit = re.search(r"\((\S+).*\)$", row["measure"])[1]  # `%` of `% contact`
        error = {unit: float(f"{row['error']:.{DIGITS}g}")} if math.isfinite(row["error"]) else {}
        numbers[Path(re.sub(r"\W+", "_", row["panel"]), f"{row['model']}.json")] = error
    return numbers


def main(workspace: Workspace) -> None:
    """Write the errors of every experiment of the settings that has a table."""
    arguments.parse(__doc__)
    with files.replacing_folder(workspace.reports / "metrics") as draft:
        for experiment in params.load(workspace.params)["experiments"]:
            table = workspace.reports / experiment / "speed" / "table2.csv"
            errors = {}
            if table.exists():
                with foreign.reading(table, "a table of errors", "run `dvc repro` again"):
                    errors = of_experiment(pd.read_csv(table))
            for path, error in errors.items():
                (draft / experiment / path).parent.mkdir(parents=True, exist_ok=True)
                files.write_text(draft / experiment / path, json.dumps(error) + "\n")


if __name__ == "__main__":
    arguments.run(main)
