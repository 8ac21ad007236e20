"""Take the shards that run.py of a pack has computed on another machine into the evidence.

Nothing in the folder is believed: what is needed of it is copied, and the copies are checked before any is put in its
place. Names, commits and digests must have their form, shards and models be those of this checkout, tables have the
columns that it writes, and numbers be finite; links are not followed. Digests tell damage, not who computed a number:
take shards of people whom you trust. DVC takes them for shards of the present code: where that differs from the commit
that they are of, a line says so.
"""

import argparse
import csv
import math
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.commands import evidence
from pipeline.results import kept, shards
from pipeline.results.claim_inputs import COLUMNS, DATA
from pipeline.results.shards import Shard
from tactile.base import arguments, files, foreign, params
from tactile.base.errors import InputError
from tactile.base.imports import HOUSES
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.scoring import units
from tactile.settings.shards import ShardSet
from tools import pack

CURVES = ["model", "protocol", "seed", "epoch", "train_loss", "validation_loss"]
LARGEST_READ, READ_S = 256 << 20, 60  # bytes of memory and seconds that a Parquet file may take
LARGEST = 16 << 20  # bytes of a table; the largest of the evidence has 0.3 MB
COPY = "copy it again from the machine that computed it, or ask who gave it to you"
TEXT, COUNT, NUMBER = r"[\w ().,+:@%/-]{0,500}", r"\d{1,18}", r"-?\d{1,30}(\.\d{1,30})?([eE][+-]?\d{1,2})?"
SECONDS = r"\d{1,9}(\.\d{1,9})?"  # below 32 years
DIGEST = r"[0-9a-f]{64}"
FORMS = {  # of the columns of tables; a number may be missing, as of a training that failed
    "sha256": DIGEST, "data_sha256": f"({DIGEST})?", "kept_sha256": f"({DIGEST})?", "severity": NUMBER,
    "blocks": units.WRITTEN,
    "commit": r"[0-9a-f]{40}", "core_s": r"\d{1,9}",
    "train_s": SECONDS, "epochs": COUNT, "epoch": COUNT, "seed": f"({COUNT})?", "n": f"({COUNT})?",
    "train_loss": f"({NUMBER})?", "validation_loss": f"({NUMBER})?", "value": f"({NUMBER}|nan)?",
}  # fmt: skip


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
    elif changed := git("diff", "--name-only", commit, "--", *pack.SETTINGS, *HOUSES).stdout.split():
        print(f"{len(changed)} files, as {changed[0]}, changed since {commit}: see that they move no number of it")


def outputs(workspace: Workspace) -> dict[str, list[Path]]:
    """Return the stage of each shard -> the files that it writes, below the folder of the evidence."""
    from dvc.repo import Repo

    with Repo(str(workspace.root)) as repo:
        stages = repo.stage.load_file(str(workspace.root.resolve() / evidence.FILE))
        return {stage.name: [Path(out.def_path).relative_to("evidence") for out in stage.outs] for stage in stages}


def copied(folder: Path, name: Path | str, draft: Path) -> Path:
    """Copy a file of a stranger's folder to the same place below `draft`, and return the copy.

    Raises InputError where it is missing, is too large, is no file, or is reached by a link.
    """
    place, target = folder / name, draft / name
    for path in (place, *place.parents[: len(Path(name).parts) - 1]):
        if path.is_symlink():
            raise InputError(f"{path}: is a link, which may lead anywhere; {COPY}")
    with foreign.reading(place, "a file of shards", COPY):
        if not stat.S_ISREG(place.stat().st_mode):
            raise InputError(f"{place}: is no file; {COPY}")
        if place.stat().st_size > LARGEST:
            raise InputError(f"{place}: has more than {LARGEST} bytes, and no table has as many; {COPY}")
        target.parent.mkdir(parents=True, exist_ok=True)
        opened = os.open(place, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        with open(opened, "rb") as source:
            content = source.read(LARGEST + 1)
        if len(content) > LARGEST:
            raise InputError(f"{place}: grows while it is read; {COPY}")
        target.write_bytes(content)
    return target


def rows_of(
    copy: Path, shown: Path, columns: Sequence[str] | None, older: Sequence[str] | None = None
) -> list[dict[str, str]]:
    """Return the rows of a stranger's table as text, each of the form in FORMS or TEXT.

    shown: the path that a message names; columns: those that it must have, None: any; older: or these. Raises
    InputError that names the line.
    """
    with foreign.reading(shown, "a table of shards", COPY):
        lines = list(csv.reader(copy.read_text(encoding="utf-8").splitlines(), strict=True))
    header = lines[0] if lines else []
    wrong = len(set(header)) != len(header) or not all(re.fullmatch(TEXT, name, re.ASCII) for name in header)
    if not header or wrong or (columns is not None and header not in (list(columns), older)):
        wanted = f"are not {','.join(columns)}" if columns else "are missing, doubled or no names"
        raise InputError(f"{shown}: its columns {wanted}; {COPY}")
    found = []
    for number, line in enumerate(lines[1:], start=2):
        if len(line) != len(header):
            raise InputError(f"{shown}, line {number}: {len(line)} values in {len(header)} columns; {COPY}")
        row = dict(zip(header, line, strict=True))
        for name, value in row.items():
            if not re.fullmatch(FORMS.get(name, TEXT), value, re.ASCII) or _endless(value):
                raise InputError(f"{shown}, line {number}: {name} is {_quoted(value)}, which it cannot be; {COPY}")
        found.append(row)
    return found


def _endless(value: str) -> bool:
    """Is it a number beyond all others?"""
    try:
        return math.isinf(float(value))
    except ValueError:
        return False


def _quoted(value: str) -> str:
    """Return the start of a stranger's text, without characters that a terminal obeys."""
    return ascii(value[: foreign.QUOTED])


def only(shown: Path, rows: Sequence[Mapping[str, str]], name: str, known: Collection[str]) -> None:
    """Raise InputError where a column of a stranger's table has a value that is none of `known`."""
    for number, row in enumerate(rows, start=2):
        if row[name] not in known:
            listed = ", ".join(sorted(known)[:5])
            said = f"{name} is {_quoted(row[name])}, and this checkout has {listed or 'none'}"
            raise InputError(f"{shown}, line {number}: {said}; {COPY}")


def named(workspace: Workspace, folder: Path, draft: Path, sets: Mapping[str, ShardSet]) -> list[tuple[Shard, dict]]:
    """Return (shard, its line of the index) of all in a folder. InputError for one that is not of this checkout."""
    known = {shard.name: shard for shard in shards.shards(sets)}
    shown = folder / "index.csv"
    lines, found = rows_of(copied(folder, "index.csv", draft), shown, shards.INDEX), {}
    for number, line in enumerate(lines, start=2):
        name = line["shard"]
        if name not in known:
            raise InputError(f"{shown}, line {number}: evidence/shards.yaml has no shard {_quoted(name)}; {COPY}")
        shard, each = known[name], sets[known[name].set]
        must = {
            "experiment": each.experiment, "seed": str(shard.seed), "budget": shard.budget,
            "protocol": shards.named(each),
        }  # fmt: skip
        for column, value in must.items():
            if line[column] != value:
                raise InputError(
                    f"{shown}, line {number}: {column} of {name} is {_quoted(line[column])}, in this checkout '{value}'"
                )
        if bool(line["data_sha256"]) == each.own_data:
            raise InputError(f"{shown}, line {number}: data_sha256 of {name} is {_quoted(line['data_sha256'])}; {COPY}")
        if name in found:
            raise InputError(f"{shown}, line {number}: {name} is listed twice; {COPY}")
        found[name] = (shard, line)
    for commit in dict.fromkeys(line["commit"] for line in lines):
        check_commit(workspace, commit)
    return list(found.values())


def check_files(
    workspace: Workspace, folder: Path, draft: Path, sets: Mapping[str, ShardSet], shard: Shard, tables: Sequence[Path],
    line: Mapping[str, str],
) -> list[Path]:  # fmt: skip
    """Copy the files of a shard to `draft`, and return their paths in it, with those that not every shard has.

    Raises InputError where they are not those that its line of the index tells of, or not tables of this repository.
    """
    each, of_experiment = sets[shard.set], params.read(workspace.params)[sets[shard.set].experiment]
    variants = {model for one in each.variants.values() for model in one.models}
    models = variants or {*(each.models or of_experiment["models"]), DATA}
    copies = [copied(folder, path, draft) for path in tables]
    if shards.digest(copies) != line["sha256"]:
        raise InputError(f"{folder / tables[0]}: not the file that index.csv beside it tells of; copy it again")
    for path, copy in zip(tables, copies, strict=True):
        if each.study:
            _check_study(workspace, folder / path, copy, shard, each, of_experiment)
            continue
        rows = rows_of(copy, folder / path, COLUMNS)
        for name, known in {
            "experiment": {each.experiment}, "protocol": set(each.protocols), "model": models,
            "budget": {"", shard.budget}, **({"variant": set(each.variants)} if each.variants else {}),
        }.items():  # fmt: skip
            only(folder / path, rows, name, known)
        if not rows:
            raise InputError(f"{folder / path}: has no row; {COPY}")
    further = check_kept(folder, draft, shard, each, models, line)
    curves = Path("curves") / f"{shard.name}.csv"
    if each.study or not os.path.lexists(folder / curves):
        return [*tables, *further]
    rows = rows_of(copied(folder, curves, draft), folder / curves, CURVES)
    for name, known in {"model": models, "protocol": set(each.protocols), "seed": {str(shard.seed)}}.items():
        only(folder / curves, rows, name, known)
    return [*tables, *further, curves]


def check_kept(
    folder: Path, draft: Path, shard: Shard, each: ShardSet, models: Collection[str], line: Mapping[str, str]
) -> list[Path]:
    """Copy what figures draw of a shard and its scores on perturbed data, where it has them, and return their paths.

    Raises InputError where they are not those that its line of the index tells of, or not tables of this repository.
    """
    drawn, stress = (
        path(Workspace(Path()), shard.name).relative_to("evidence") for path in (shards.kept_file, shards.stress_file)
    )
    there = [path for path in (drawn, stress) if os.path.lexists(folder / path)]
    copies = {path: copied(folder, path, draft) for path in there}
    if (shards.digest(copies.values()) if there else "") != line["kept_sha256"]:
        said = "not the file" if there else "missing, and the file"
        raise InputError(f"{folder / (there or [drawn])[0]}: {said} that index.csv beside it tells of; copy it again")
    known = {"protocol": set(each.protocols), "seed": {str(shard.seed)}}
    if drawn in copies:
        place, schema = folder / drawn, kept.none(each.experiment).schema
        how = {"memory": LARGEST_READ, "seconds": READ_S}
        rows = foreign.apart(place, "a table of shards", COPY, small_parquet, copies[drawn], schema, **how)
        for name, values in (known | {"model": {*models, kept.LABEL, kept.READING}}).items():
            if odd := set(map(str, rows[name])) - values:
                raise InputError(f"{folder / drawn}: {name} is {_quoted(min(odd))}, which it cannot be; {COPY}")
    if stress in copies:
        rows = rows_of(copies[stress], folder / stress, shards.STRESS, shards.STRESS[:-1])
        known |= {"experiment": {each.experiment}, "model": models, "budget": {"", shard.budget}}
        for name, values in known.items():
            only(folder / stress, rows, name, values)
    return there


def small_parquet(path: Path, schema: pa.Schema) -> dict[str, list]:
    """Return column -> its different names or numbers of a stranger's Parquet file, but of lists.

    Raises ValueError for a file that is too large, has other columns than `schema` or names that are none.
    """
    if path.stat().st_size > kept.LARGEST:
        raise ValueError(f"more than {kept.LARGEST} bytes")
    rows = pq.read_table(path)
    if not rows.schema.equals(schema):
        raise ValueError("its columns are others")
    single = [field for field in schema if not pa.types.is_list(field.type)]
    different = {field.name: rows[field.name].unique().to_pylist() for field in single}
    names = [name for field in single if field.type == schemas.NAME for name in different[field.name] if name]
    if any(not re.fullmatch(TEXT, name, re.ASCII) for name in names):
        raise ValueError("a name in it is none")
    return different


def _check_study(
    workspace: Workspace, shown: Path, copy: Path, shard: Shard, each: ShardSet, settings: Mapping
) -> None:
    """Raise InputError where a table of a study is not as those of other seeds, or is of another seed."""
    stem = copy.stem.removesuffix(f"-{shard.seed}")
    others = sorted((shards.folder(workspace) / "studies" / each.experiment).glob(f"{stem}-*.csv"))
    columns = None
    if others:
        with open(others[0], encoding="utf-8") as file:
            columns = next(csv.reader(file), None)
    rows = rows_of(copy, shown, columns)
    if not rows:
        raise InputError(f"{shown}: has no row; {COPY}")
    known = {"experiment": {each.experiment}, "seed": {str(shard.seed)}, "model": {*settings["models"], DATA}}
    for name in known.keys() & rows[0].keys():
        only(shown, rows, name, known[name])


def times_of(
    workspace: Workspace, folder: Path, draft: Path, sets: Mapping[str, ShardSet]
) -> dict[str, list[dict[str, str]]]:
    """Return shard -> its lines of times.csv, which a folder of studies lacks. InputError for a wrong one."""
    shown, found = folder / "times.csv", {}
    if not os.path.lexists(shown):
        return found
    of_models = {name: each for name, each in sets.items() if not shards.study(each)}
    known = {shard.name: shard for shard in shards.shards(of_models)}
    rows = rows_of(copied(folder, "times.csv", draft), shown, shards.TIMES)
    only(shown, rows, "shard", known)
    every = params.read(workspace.params)
    for number, row in enumerate(rows, start=2):
        shard = known[row["shard"]]
        each = sets[shard.set]
        models = each.models or every[each.experiment]["models"]
        if row["model"] not in models or row["protocol"] not in each.protocols or row["seed"] != str(shard.seed):
            said = _quoted(f"{row['model']}, {row['protocol']}, {row['seed']}")
            raise InputError(f"{shown}, line {number}: {shard.name} has no training {said}; {COPY}")
        found.setdefault(shard.name, []).append(row)
    return found


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


def take(workspace: Workspace, draft: Path, shard: Shard, checked: Sequence[Path], times: Sequence[dict]) -> None:
    """Put the checked copies of one shard's files in their place, and the times of its trainings into the table."""
    here = shards.folder(workspace)
    for file in (shards.kept_file, shards.stress_file):  # a former computation may have had one
        file(workspace, shard.name).unlink(missing_ok=True)
    for path in checked:
        with files.replacing(here / path) as target:
            shutil.copyfile(draft / path, target)
    if times:
        shards.upsert(here / "times.csv", shards.TIMES, shard.name, list(times))


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Take all shards of a folder, and have DVC hold them up to date."""
    if not (given.folder / "index.csv").is_file():
        raise InputError(f"{given.folder}: no index.csv in it; name the folder that run.py wrote, its --out")
    sets, index = shards.read_sets(workspace), shards.folder(workspace) / "index.csv"
    there = shards.table(index, shards.INDEX)
    lines = there.to_dict("records")
    with tempfile.TemporaryDirectory() as folder:
        draft = Path(folder)
        found = named(workspace, given.folder, draft, sets)
        times = times_of(workspace, given.folder, draft, sets)
        if new := [(shard, line) for shard, line in found if line not in lines]:
            tables = outputs(workspace)
            checked = [
                check_files(workspace, given.folder, draft, sets, shard, tables[evidence.stage(shard)], line)
                for shard, line in new
            ]
            for (shard, line), paths in zip(new, checked, strict=True):
                say_other_data(there, sets, shard, line)
                take(workspace, draft, shard, paths, times.get(shard.name, ()))
                print(f"{shard.name}: {line['machine']}, {line['core_s']} core-seconds")
    if new:
        targets = [f"{evidence.FILE}:{evidence.stage(shard)}" for shard, _ in new]
        command = [sys.executable, "-m", "dvc", "commit", "--quiet", "--force", *targets]
        done = subprocess.run(command, cwd=workspace.root, capture_output=True, text=True)
        if done.returncode:
            raise InputError(f"`dvc commit` failed: {done.stderr.strip()}; call this again when that is mended")
        for shard, line in new:  # last: a shard that is not in the index is taken again
            shards.upsert(index, shards.INDEX, shard.name, [line])
    print(f"{len(new)} shards taken; {len(found) - len(new)} were there")


if __name__ == "__main__":
    arguments.run_tool(__doc__, main, add_arguments)
