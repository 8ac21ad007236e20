"""Predict a sample recording with a pretrained model: a picture and numbers, with nothing to prepare.

Two tips press a 5 x 5 array of Velostat for 18 s (data/sample, simulated). LoMP, which was fitted to single touches
alone, turns every reading into a map of pressure, which is scored against the load cells. OUT gets what `tactile
predict` writes: a picture, an animation, the predictions and a summary. With --live, the recording is replayed again
and again on the page of `tactile live`, until Ctrl-C.

Examples:

    tactile demo
    tactile demo --live
"""

import argparse
from pathlib import Path

from tactile.base import paths
from tactile.base.paths import Workspace
from tactile.commands import live, predict

SAMPLE, LOG = Path("data", "sample"), Path("double", "two_touches", "array.log")
MODEL = Path("pretrained", "touch", "lomp_stream")
BROUGHT = "git checkout data/sample pretrained"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the place of the results and whether to replay to the parser of this command."""
    parser.add_argument("--out", type=Path, default=Path("predictions", "demo"), help="a folder (default %(default)s)")
    parser.add_argument("--live", action="store_true", help="replay the recording on the live page instead")
    parser.add_argument(
        "--http-port", default=str(live.PORT), metavar="N", help="port of the page (default %(default)s; 0: any)"
    )


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Predict the sample, or replay it. Raises InputError where it is not there."""
    model = str(paths.require(workspace.brought(MODEL), BROUGHT))
    sample = paths.require(workspace.brought(SAMPLE) / LOG, BROUGHT)
    if given.live:
        words = [model, "--replay", str(sample), "--loop", "--http-port", given.http_port]
        live.main(workspace, parsed(live, words))
        return
    predict.main(workspace, parsed(predict, [model, str(workspace.brought(SAMPLE)), "--out", str(given.out)]))
    print(f"picture: {given.out / 'double-two_touches.png'}; animation: {given.out / 'double-two_touches.gif'}")
    print("the same on the live page: `tactile demo --live`; on your own log: `tactile predict touch/lomp_stream LOG`")


def parsed(command, words: list[str]) -> argparse.Namespace:
    """Return the arguments of another command, as if these words had followed its name."""
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return parser.parse_args(words)
