"""Take the shards that run.py of a pack has computed on another machine into the evidence.

Each is checked against the digest that it was indexed with. DVC takes them for shards of the present code: where that
differs from the commit that they are of, a line says so.
"""

import argparse
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from pipeline.base import files
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.commands import evidence, pack
from pipeline.scoring import shards
from pipeline.scoring.shards import Shard
from pipeline.settings.shards import ShardSet


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the folder to the parser of this command."""
    parser.add_argument("folder", type=Path, metavar="OUT", help="the folder that run.py wrote")


def check_commit(workspace: Workspace, commit: str) -> None:
    """Raise InputError where git knows a commit that this checkout does not come from; say what changed since."""

    def git(*arguments: str) -> subprocess.CompletedProcess:
        return subprocess.run(["git", *arguments], cwd=workspace.root, capture_output=True, text=True)

    if git("cat-file", "-e", f"{commit}^{{commit}}").returncode:
        print(f"git does not know {commit}, the commit of these shards: whether it is of this code is not checked")
    elif git("merge-base", "--is-ancestor", commit, "HEAD").returncode:
        raise InputError(f"these shards are of commit {commit}, from which this checkout does not come; check it out")
    elif changed := git("diff", "--name-only", commit, "--", *pack.SETTINGS, "pipeline").stdout.split():
        print(f"{len(changed)} files, as {changed[0]}, changed since {commit}: see that they move no number of it")


def outputs(workspace: Workspace) -> dict[str, list[Path]]:
    """Return the stage of each shard -> the files that it writes, below the folder of the evidence."""
    from dvc.repo import Repo

    with Repo(str(workspace.root)) as repo:
        stages = repo.stage.load_file(str(workspace.root.resolve() / evidence.FILE))
        return {stage.name: [Path(out.def_path).relative_to("evidence") for out in stage.outs] for stage in stages}


def named(workspace: Workspace, folder: Path, sets: Mapping[str, ShardSet]) -> list[tuple[Shard, dict]]:
    """Return (shard, its line of the index) of all in a folder. InputError for one that is not of this checkout."""
    known = {shard.name: shard for shard in shards.shards(sets)}
    lines = shards.table(folder / "index.csv", shards.INDEX).to_dict("records")
    for line in lines:
        if line["shard"] not in known:
            raise InputError(f"{folder / 'index.csv'}: evidence/shards.yaml has no shard {line['shard']}")
    for commit in dict.fromkeys(line["commit"] for line in lines):
        check_commit(workspace, commit)
    return [(known[line["shard"]], line) for line in lines]


def check_files(folder: Path, shard: Shard, kept: Sequence[Path], digest: str) -> None:
    """Raise InputError where the files of a shard are not those that its line of the index tells of."""
    for path in kept:
        if not (folder / path).is_file():
            raise InputError(f"{folder / path}: not there, though index.csv tells of {shard.name}; copy it again")
    if shards.digest(folder / path for path in kept) != digest:
        raise InputError(f"{folder / kept[0]}: not the file that index.csv beside it tells of; copy it again")


def say_other_data(index: pd.DataFrame, sets: Mapping[str, ShardSet], shard: Shard, line: Mapping) -> None:
    """Say where this machine has a shard of the same data with another digest of them."""

    def data(name: str) -> str:
        return sets[name].like or name if name in sets else ""

    names = index["shard"].str.rsplit("-", n=2).str[0].map(data)
    others = index[(names == data(shard.set)) & (index["data_sha256"] != "") & (index["shard"] != shard.name)]
    if line["data_sha256"] and len(others) and line["data_sha256"] not in set(others["data_sha256"]):
        print(
            f"{shard.name}: its data differ from those of {others['shard'].iloc[0]}, as last digits of simulated data "
            "do between processors"
        )


def take(workspace: Workspace, folder: Path, shard: Shard, kept: Sequence[Path]) -> None:
    """Copy the files of one shard, and put the times of its trainings into the table."""
    here, curves = shards.folder(workspace), Path("curves") / f"{shard.name}.csv"
    for path in [*kept, *([curves] if (folder / curves).is_file() else [])]:
        with files.replacing(here / path) as draft:
            shutil.copyfile(folder / path, draft)
    times = shards.table(folder / "times.csv", shards.TIMES)
    if len(rows := times[times["shard"] == shard.name].to_dict("records")):
        shards.upsert(here / "times.csv", shards.TIMES, shard.name, rows)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Take all shards of a folder, and have DVC hold them up to date."""
    if not (given.folder / "index.csv").is_file():
        raise InputError(f"{given.folder}: no index.csv in it; name the folder that run.py wrote, its --out")
    sets, index = shards.read_sets(workspace), shards.folder(workspace) / "index.csv"
    there = shards.table(index, shards.INDEX)
    lines, found = there.to_dict("records"), named(workspace, given.folder, sets)
    if new := [(shard, line) for shard, line in found if line not in lines]:
        kept = outputs(workspace)
        for shard, line in new:
            check_files(given.folder, shard, kept[evidence.stage(shard)], line["sha256"])
        for shard, line in new:
            say_other_data(there, sets, shard, line)
            take(workspace, given.folder, shard, kept[evidence.stage(shard)])
            print(f"{shard.name}: {line['machine']}, {line['core_s']} core-seconds")
        targets = [f"{evidence.FILE}:{evidence.stage(shard)}" for shard, _ in new]
        command = [sys.executable, "-m", "dvc", "commit", "--quiet", "--force", *targets]
        done = subprocess.run(command, cwd=workspace.root, capture_output=True, text=True)
        if done.returncode:
            raise InputError(f"`dvc commit` failed: {done.stderr.strip()}; call this again when that is mended")
        for shard, line in new:  # last: a shard that is not in the index is taken again
            shards.upsert(index, shards.INDEX, shard.name, [line])
    print(f"{len(new)} shards taken; {len(found) - len(new)} were there")
