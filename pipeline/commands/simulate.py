"""Write the raw logs of a simulated array to FOLDER, to try the commands for a sensor of one's own on.

They are as its devices would print them in half an hour: an array of Velostat that no pretrained model knows, the load
cells and the machine that presses it. The commands that lead from there to a model at work are printed.

Examples:

    tactile simulate my_array
"""

import argparse
from pathlib import Path

from pipeline import scenes
from pipeline.scenes import touch
from tactile.base import params, paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import own

# Enough presses for a model to learn from, few enough for the whole way in two minutes.
SINGLE = {"points_per_side": 8, "depths": 3, "repetitions": 1, "presses_per_recording": 48}
DOUBLE = {"recordings": 1, "presses_per_recording": 12}
ARRAY = 9  # number of its film: none that a pretrained model knows
WAY = """\
{folder}: {recordings} recordings of a simulated array, {presses} presses of one tip and {double} of two
the whole way of a sensor, from its logs to a model at work:
  tactile check {folder}    # what is understood of the logs, and what to fix first
  tactile sheet {folder}    # what the sensor is worth, before any model
  tactile try {folder}      # models of its own, and what they score; with `pip install 'tactile-reproduction[train]'`
  tactile predict {model} {folder}/double
  tactile live {model} --replay {log}"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the folder to the parser of this command."""
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a new folder")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Write the logs, and print what to do with them. Raises InputError where there is something in their place."""
    folder, name = given.folder, own.name_of(workspace, given.folder)
    if folder.exists():
        raise InputError(f"{folder}: is there already; name another folder")
    settings = params.load(paths.BROUGHT / "params.yaml")["touch"]
    settings["simulate"] |= {"specimen": ARRAY, "single": SINGLE, "double": DOUBLE}
    recordings, logs_of = touch.plan(settings)
    recordings = [each for each in recordings if each.condition in ("single", "double")]
    scenes.write_logs(folder, recordings, logs_of)
    trained = Path("build", "own", name, own.TRAINED, "lomp")
    presses = SINGLE["points_per_side"] ** 2 * SINGLE["depths"]
    said = {"presses": presses, "double": DOUBLE["presses_per_recording"], "model": trained}
    log = folder / "double" / recordings[-1].name / "array.log"
    print(WAY.format(folder=folder, recordings=len(recordings), log=log, **said))
