"""Predict a sample recording with a pretrained model: a picture and numbers, with nothing to prepare.

Two tips press a 5 x 5 array of Velostat for 18 s (data/sample, simulated). LoMP, which was fitted to single touches
alone, turns every reading into a map of pressure, which is scored against the load cells. OUT gets what `tactile
predict` writes: a picture, an animation, the predictions and a summary. With --live, the recording is replayed again
and again on the page of `tactile live`, until Ctrl-C. With --logs, FOLDER gets the raw logs of another simulated array,
as its devices would print them in half an hour, and the commands that take an array of one's own from there to a model
at work are printed.

Examples:

    tactile demo
    tactile demo --live
    tactile demo --logs my_array
"""

import argparse
from pathlib import Path

from pipeline import scenes
from pipeline.base import params, paths
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.commands import live, predict

SAMPLE, LOG = Path("data", "sample"), Path("double", "two_touches", "array.log")
MODEL = Path("pretrained", "touch", "lomp_stream")
BROUGHT = "git checkout data/sample pretrained"
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
    """Add the place of the results, whether to replay and where to write logs to the parser of this command."""
    parser.add_argument("--out", type=Path, default=Path("predictions", "demo"), help="a folder (default %(default)s)")
    other = parser.add_mutually_exclusive_group()
    other.add_argument("--live", action="store_true", help="replay the recording on the live page instead")
    other.add_argument("--logs", type=Path, metavar="FOLDER", help="write raw logs to try all commands on instead")
    parser.add_argument(
        "--http-port", default=str(live.PORT), metavar="N", help="port of the page (default %(default)s; 0: any)"
    )


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Predict the sample, or replay it, or write logs; InputError where there is something in their place."""
    if given.logs:
        write_logs(workspace, given.logs, params.load(paths.BROUGHT / "params.yaml")["touch"])
        return
    model = str(paths.require(workspace.brought(MODEL), BROUGHT))
    sample = paths.require(workspace.brought(SAMPLE) / LOG, BROUGHT)
    if given.live:
        words = [model, "--replay", str(sample), "--loop", "--http-port", given.http_port]
        live.main(workspace, parsed(live, words))
        return
    predict.main(workspace, parsed(predict, [model, str(workspace.brought(SAMPLE)), "--out", str(given.out)]))
    print(f"picture: {given.out / 'double-two_touches.png'}; animation: {given.out / 'double-two_touches.gif'}")
    print("the same on the live page: `tactile demo --live`; on your own log: `tactile predict touch/lomp_stream LOG`")


def write_logs(workspace: Workspace, folder: Path, settings: dict) -> None:
    """Write the logs of a simulated array to a new folder, and print what to do with them; settings: block `touch`."""
    from pipeline.commands import own  # imports that the other two need not wait for
    from pipeline.scenes import touch

    name = own.name_of(workspace, folder)
    if folder.exists():
        raise InputError(f"{folder}: is there already; name another folder")
    settings["simulate"] |= {"specimen": ARRAY, "single": SINGLE, "double": DOUBLE}
    recordings, logs_of = touch.plan(settings)
    recordings = [each for each in recordings if each.condition in ("single", "double")]
    scenes.write_logs(folder, recordings, logs_of)
    trained = Path("build", "own", name, own.TRAINED, "lomp")
    presses = SINGLE["points_per_side"] ** 2 * SINGLE["depths"]
    said = {"presses": presses, "double": DOUBLE["presses_per_recording"], "model": trained}
    log = folder / "double" / recordings[-1].name / "array.log"
    print(WAY.format(folder=folder, recordings=len(recordings), log=log, **said))


def parsed(command, words: list[str]) -> argparse.Namespace:
    """Return the arguments of another command, as if these words had followed its name."""
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return parser.parse_args(words)
