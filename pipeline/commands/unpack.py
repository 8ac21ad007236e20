"""Take the shards that run.py of a pack has computed on another machine into the evidence.

Each is checked against the digest that it was indexed with. DVC takes them for shards of the present code: where that
differs from the commit that they are of, a line says so.
"""

import argparse
import shutil
import subprocess
from collections.abc import Iterator, Mapping
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
    """Return the stage of each shard -> the files that it writes, in the folder of the evidence."""
    from dvc.repo import Repo

    with Repo(str(workspace.root)) as repo:
        stages = repo.stage.load_file(str(workspace.root.resolve() / evidence.FILE))
        return {stage.name: [Path(out.fs_path) for out in stage.outs] for stage in stages}


def checked(
    workspace: Workspace, folder: Path, sets: Mapping[str, ShardSet]
) -> Iterator[tuple[Shard, dict, list[Path]]]:
    """Yield (shard, its line of the index, its files below the evidence); InputError where one is not as indexed."""
    known = {shard.name: shard for shard in shards.shards(sets)}
    written, here = outputs(workspace), shards.folder(workspace).resolve()
    for line in shards.table(folder / "index.csv", shards.INDEX).to_dict("records"):
        shard = known.get(line["shard"])
        if shard is None:
            raise InputError(f"{folder / 'index.csv'}: evidence/shards.yaml has no shard {line['shard']}")
        kept = [path.relative_to(here) for path in written[evidence.stage(shard)]]
        for path in kept:
            if not (folder / path).is_file():
                raise InputError(f"{folder / path}: not there, though index.csv tells of {shard.name}; copy it again")
        if shards.digest(folder / path for path in kept) != line["sha256"]:
            raise InputError(f"{folder / kept[0]}: not the file that index.csv beside it tells of; copy it again")
        yield shard, line, kept


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


def take(workspace: Workspace, folder: Path, shard: Shard, kept: list[Path]) -> None:
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
    from dvc.repo import Repo

    if not (given.folder / "index.csv").is_file():
        raise InputError(f"{given.folder}: no index.csv in it; name the folder that run.py wrote, its --out")
    sets = shards.read_sets(workspace)
    found = list(checked(workspace, given.folder, sets))
    for commit in dict.fromkeys(line["commit"] for _, line, _ in found):
        check_commit(workspace, commit)
    index = shards.folder(workspace) / "index.csv"
    there = shards.table(index, shards.INDEX)
    lines = there.to_dict("records")
    new = [(shard, line, kept) for shard, line, kept in found if line not in lines]
    with Repo(str(workspace.root)) as repo:
        for shard, line, kept in new:
            say_other_data(there, sets, shard, line)
            take(workspace, given.folder, shard, kept)
            repo.commit(f"{workspace.root.resolve() / evidence.FILE}:{evidence.stage(shard)}", force=True)
            shards.upsert(index, shards.INDEX, shard.name, [line])  # last: of what is not in it, all is taken again
            print(f"{shard.name}: {', '.join(path.name for path in kept)}; {line['machine']}, {line['core_s']} core-s")
    print(f"{len(new)} shards taken; {len(found) - len(new)} were there")
