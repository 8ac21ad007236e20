"""Compute the next shards of the evidence for some minutes; each is kept, in evidence/, when it is done.

A shard is one seed of an experiment at one budget of training, all its models, or one seed of variants or of a study.
evidence/shards.yaml lists them, in the order in which they are computed. What is up to date is not computed again, and
a shard that would not end within the minutes left is not begun. Ctrl-C loses the shard that runs, and of it the
trainings that had not ended.

Examples:

    tactile evidence --list
    tactile evidence touch_press --minutes 60
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Mapping

from pipeline.results import shards
from pipeline.results.claim_inputs import HALF
from pipeline.results.shards import Shard
from tactile.base import params, provenance
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.settings.shards import ShardSet

FILE = "evidence/dvc.yaml"
LONGEST_MINUTES = 30  # of a shard: what runs longer is ended


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the minutes and the sets to the parser of this command."""
    parser.add_argument("sets", nargs="*", metavar="SET", help="only shards of these sets of evidence/shards.yaml")
    parser.add_argument("--minutes", type=float, default=150.0, help="begin no shard that would end later (150)")
    parser.add_argument("--list", action="store_true", help="say which shards are to be computed, and compute none")


def stage(shard: Shard) -> str:
    """Return the name of a shard's stage in FILE."""
    return f"{shard.set}@{shard.seed}-{shard.budget}"


def stale(workspace: Workspace, known: list[Shard]) -> list[Shard]:
    """Return the shards that are missing, or made from other code, settings or shards.yaml."""
    command = [sys.executable, "-m", "dvc", "status", "--json", FILE]
    done = subprocess.run(command, cwd=workspace.root, capture_output=True, text=True)
    if done.returncode:
        raise InputError(f"`dvc status {FILE}` failed: {done.stderr.strip()}")
    changed = json.loads(done.stdout)
    return [shard for shard in known if f"{FILE}:{stage(shard)}" in changed]


def minutes(sets: Mapping[str, ShardSet], shard: Shard) -> float:
    """Return how long a shard takes on two cores, about."""
    return sets[shard.set].minutes * (0.5 if shard.budget == HALF else 1)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Compute shards until the minutes are over."""
    sets = shards.read_sets(workspace)
    for name in given.sets:
        if name not in sets:
            raise InputError(f"evidence/shards.yaml has no set '{name}'; {params.hint(name, sets)}")
    chosen = {name: each for name, each in sets.items() if not given.sets or name in given.sets}
    todo = stale(workspace, shards.shards(chosen))
    whole = sum(minutes(sets, shard) for shard in todo)
    print(f"{len(todo)} of {len(shards.shards(chosen))} shards to compute, about {whole:.0f} minutes")
    if given.list:
        print(*(shard.name for shard in todo), sep="\n")
        return
    if provenance.git_state(workspace)[1] == "true":
        print("the code differs from the last commit; commit it first, so that the index names what made the shards")
    until, done = time.monotonic() + 60 * given.minutes, 0
    for shard in todo:
        if time.monotonic() + 60 * minutes(sets, shard) > until:
            continue
        command = [sys.executable, "-m", "dvc", "repro", "-s", f"{FILE}:{stage(shard)}"]
        try:
            ended = subprocess.run(command, cwd=workspace.root, timeout=60 * LONGEST_MINUTES).returncode
        except subprocess.TimeoutExpired as error:
            raise InputError(
                f"{shard.name}: not done after {LONGEST_MINUTES} minutes; call again to go on, or list fewer `models` "
                "in its set of evidence/shards.yaml"
            ) from error
        if ended:
            raise InputError(f"{shard.name}: failed; its message is above")
        done += 1
    print(f"{done} shards computed, {len(todo) - done} left")
