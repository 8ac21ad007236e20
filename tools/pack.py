"""Pack shards of the evidence for a machine without network, DVC or git, such as one with a card that is borrowed.

The archive holds the code and settings of this commit, the packages that the machine may lack, and run.py, which
computes the shards there; `python -m tools.unpack` takes what it computed. Data do not travel: the machine simulates
them, so that shards of recordings stay here.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path

from pipeline import scenes
from pipeline.commands import evidence
from pipeline.results import shards
from pipeline.results.shards import Shard
from tactile import experiments
from tactile.base import arguments, files, params, paths, provenance
from tactile.base.errors import InputError
from tactile.base.imports import HOUSES
from tactile.base.paths import Workspace
from tactile.settings.shards import ShardSet

SETTINGS = ("params.yaml", "params", "evidence/shards.yaml")  # of the workspace
CODE = (*HOUSES, "constraints.txt")  # beside which run.py goes, at the top of the archive
RUN = "evidence/run.py"
# What a shard imports and a machine for machine learning may lack; it takes those that it has not in this version.
PACKAGES = ("annotated-types", "google-re2", "pydantic", "pydantic-core", "typing-extensions", "typing-inspection")
PACKAGES += ("ruamel.yaml", "ruamel.yaml.clib", "skops")
PYTHON = "3.12"  # of the other machine, for which the compiled packages are
PLATFORMS = ("manylinux_2_28_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64")
MOST_BYTES = 10_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the archive and the shards to the parser of this command."""
    parser.add_argument("archive", type=Path, metavar="OUT.zip", help="the archive to write")
    what = "SET: what is missing or out of date of it; SET@SEED-BUDGET: that shard; without any, as SET for all"
    parser.add_argument("shards", nargs="*", metavar="SET[@SEED-BUDGET]", help=what)
    parser.add_argument("--processes", type=int, default=1, help="of each shard that trains on a card (1)")
    parser.add_argument("--wheels", type=Path, metavar="FOLDER", help="packages to pack; without it pip downloads them")


def chosen(workspace: Workspace, sets: Mapping[str, ShardSet], names: list[str]) -> list[Shard]:
    """Return the shards that were named, in that order; they are begun in it. InputError for a wrong name."""
    every = shards.shards(sets)
    known = {evidence.stage(shard): shard for shard in every}
    for name in names:
        if name not in known and name not in sets:
            raise InputError(f"evidence/shards.yaml has no '{name}'; {params.hint(name, [*sets, *known])}")
        experiment = sets[name.partition("@")[0]].experiment
        if experiment not in scenes.NAMES:
            raise InputError(f"{name}: {experiment} is of recordings, which do not travel; compute it here")
    asked = [each for each in every if each.set in names or not names]
    stale = evidence.stale(workspace, asked) if asked else []
    if left := dict.fromkeys(each.set for each in stale if sets[each.set].experiment not in scenes.NAMES):
        print(f"left out, for their recordings do not travel: {', '.join(left)}; compute them here")
    picked = []
    for name in names or sets:
        picked += [known[name]] if name in known else [each for each in stale if each.set == name]
    return [each for each in dict.fromkeys(picked) if sets[each.set].experiment in scenes.NAMES]


def plan(sets: Mapping[str, ShardSet], shard: Shard, processes: int) -> dict:
    """Return what run.py is told of a shard; data: the set whose data it needs, or none."""
    each = sets[shard.set]
    card = experiments.module(each.experiment).KIND != "series"  # series are trained on the processor
    trainings = len(each.models) * len(each.protocols) or processes  # without `models`, all of the experiment
    return shard._asdict() | {
        "minutes": evidence.minutes(sets, shard),
        "processes": min(processes, trainings) if card else 1,
        "card": card,
        "data": None if each.own_data else each.like or shard.set,
    }


def download(folder: Path) -> None:
    """Put the wheels of PACKAGES, of the versions in constraints.txt, into a folder."""
    lines = (paths.CODE.parent / "constraints.txt").read_text(encoding="utf-8").split()
    pins = {re.sub(r"[-_.]+", "-", line.partition("==")[0]).lower(): line for line in lines}
    wanted = [pins[re.sub(r"[-_.]+", "-", name)] for name in PACKAGES]
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary=:all:"]
    command += ["--python-version", PYTHON, "--implementation", "cp"]
    command += [word for platform in PLATFORMS for word in ("--platform", platform)]
    done = subprocess.run([*command, "--dest", str(folder), *wanted], capture_output=True, text=True)
    if done.returncode:
        reason = (done.stderr.strip() or "no message").splitlines()[-1]
        raise InputError(f"pip could not download {', '.join(wanted)} ({reason}); name a folder of them by --wheels")


def write(workspace: Workspace, archive: Path, packed: Mapping, wheels: Path) -> None:
    """Write the archive; packed: pack.json. InputError where it is too large."""
    with tempfile.TemporaryDirectory() as folder:
        notes = Path(folder) / "pack.json"
        files.write_text(notes, json.dumps(packed, indent=1) + "\n")
        members = {name: workspace.root / name for name in SETTINGS} | {name: paths.CODE.parent / name for name in CODE}
        members |= {"run.py": paths.require(paths.CODE.parent / RUN, f"git checkout {RUN}"), "pack.json": notes}
        with files.replacing(archive) as draft:
            with zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as packing:
                for name, top in members.items():
                    for path in (top, *sorted(top.rglob("*"))):
                        if "__pycache__" not in path.parts:
                            packing.write(path, Path(name) / path.relative_to(top))
                for wheel in sorted(wheels.glob("*.whl")):
                    packing.write(wheel, f"wheels/{wheel.name}")
            if (size := draft.stat().st_size) > MOST_BYTES:
                draft.unlink()
                most = f"{MOST_BYTES / 1e6:.0f} MB is the most"
                raise InputError(f"{archive}: {size / 1e6:.1f} MB, and {most}; leave out wheels or large files of code")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Pack the shards that were named, or all that are missing or out of date."""
    if given.processes < 1:
        raise InputError(f"--processes {given.processes}: expected 1 or more")
    commit, changed = provenance.git_state(workspace, [*SETTINGS, *CODE, RUN])
    if changed == "true":
        raise InputError("code or settings differ from the last commit, which the shards will name; commit them first")
    sets = shards.read_sets(workspace)
    todo = chosen(workspace, sets, given.shards)
    if not todo:
        raise InputError("no shard to pack: all are up to date; name one as SET@SEED-BUDGET to compute it again")
    packed = {"commit": commit, "shards": [plan(sets, shard, given.processes) for shard in todo]}
    with tempfile.TemporaryDirectory() as folder:
        if given.wheels is None:
            download(Path(folder))
        write(workspace, given.archive, packed, given.wheels or Path(folder))
    whole = sum(each["minutes"] for each in packed["shards"])
    size = given.archive.stat().st_size / 1e6
    print(f"{given.archive}: {len(todo)} shards, on two cores about {whole:.0f} minutes; {size:.1f} MB")


if __name__ == "__main__":
    arguments.run_tool(__doc__, main, add_arguments)
