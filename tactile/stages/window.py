"""Cut frames into windows, the inputs of the models.

Usage: python -m tactile.stages.window EXPERIMENT
"""

import numpy as np

from tactile import experiments
from tactile.base import arguments, params, paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.datasets.windowing import windows_of


def main(workspace: Workspace) -> None:
    """Window the experiment named on the command line."""
    values = params.load(workspace.params)
    experiment = arguments.parse(__doc__, experiment=values["experiments"]).experiment
    if experiments.module(experiment).KIND != "windows":
        raise InputError(
            f"{experiment}: its models see no windows; run `python -m tactile.stages.dataset {experiment}`"
        )
    frames = schemas.read(paths.require(workspace.frames(experiment), f"python -m tactile.stages.ingest {experiment}"))
    windows = windows_of(frames, values[experiment]["window"])
    schemas.write(workspace.windows(experiment), windows.schema, [windows])
    presses = len(np.unique(windows["press"].to_numpy()))
    print(f"{experiment}: {frames.num_rows} frames, {presses} presses, {windows.num_rows} windows")


if __name__ == "__main__":
    arguments.run(main)
