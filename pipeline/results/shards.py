"""Name the shards of the evidence, and read what is committed of them.

A shard is one seed of an experiment at one budget of training, of all models or of variants of some. The entries of
evidence/shards.yaml are sets, one for each amount of data; shards are called `<set>-<seed>-<budget>`. The files:

* results/<shard>.csv: rows of the one table of results.
* studies/<experiment>/<table>-<seed>.csv: in place of that, the tables of a study, a set with the key `study`.
* stress/<shard>.csv: rows as those of results, on perturbed readings and scenes; severity 0 is without. The column
  blocks has the losses of presses, grasps or frames in a row, of recordings that are scored by unit, see `units`.
* curves/<shard>.csv: losses over epochs, CURVE_POINTS of each training.
* kept/<shard>.parquet: what figures draw of it, see `kept`. Not every shard has this and stress.
* index.csv: of each shard its digest, costs, machine and commit, and a digest of what it has of `kept` and `stress`;
  times.csv: seconds of each training.
"""

import hashlib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from pipeline.results.claim_inputs import COLUMNS, DATA, FULL, HALF, KEY
from tactile.base import files, foreign, params, paths, processes
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.scoring import units
from tactile.scoring.estimates import read_csv
from tactile.settings.shards import ShardSet

BUDGETS = (HALF, FULL)
STRESS = [*COLUMNS, "perturbation", "severity", "blocks"]  # older files have no blocks
INDEX = ["shard", "experiment", "protocol", "seed", "budget", "sha256", "core_s", "machine", "commit", "data_sha256"]
INDEX += ["kept_sha256"]
TIMES = ["shard", "model", "protocol", "seed", "epochs", "train_s"]
WORDS = ("variant", "budget", "blocks")  # columns of STRESS that may be empty
CARD = ", "  # in a machine's name: that of its card, or another torch, comes after the processor's
SHARD = "shard"  # column of those tables, and of the rows of `read`
STUDY = "study"  # in the column `protocol` of index.csv, for a study
NUMBERS = {"seed": int, "epochs": float, "core_s": float, "train_s": float}  # columns of both
MADE_BY = "tactile evidence"
SETS = "evidence/shards.yaml"
VARIANTS = "variants"  # the study that runs them


class Shard(NamedTuple):
    """One shard of the evidence."""

    set: str
    seed: int
    budget: str

    @property
    def name(self) -> str:
        """Return the name of its files and of its stage."""
        return f"{self.set}-{self.seed}-{self.budget}"


def folder(workspace: Workspace) -> Path:
    """Return the folder of the evidence."""
    return workspace.root / "evidence"


def read_sets(workspace: Workspace) -> dict[str, ShardSet]:
    """Return name -> set, in the order in which shards are computed. Raises InputError for a wrong key or value."""
    path = paths.require(folder(workspace) / "shards.yaml", "git checkout evidence/shards.yaml")
    sets = {}
    for name, (block, other) in _entries(params.parsed(path), "").items():
        other = {key: value for key, value in other.items() if key != "stress"}
        if {"study", "variants"} & block.keys():  # it trains no models, or those that it names
            other = {key: value for key, value in other.items() if key != "models"}
        whole = _joined(other, block)
        if "variants" in block:
            entries = _entries(block["variants"], f"{name}.variants.")
            whole["variants"] = {key: _joined(like, own) for key, (own, like) in entries.items()}
        sets[name] = params.check_block(whole, ShardSet, name, {name: SETS})
    return sets


def _entries(blocks: object, where: str) -> dict[str, tuple[dict, dict]]:
    """Return name -> (entry, the one that it is `like`); where: what stands before the names, with a dot."""
    if not isinstance(blocks, dict):
        raise InputError(f"{SETS}{where and ', ' + where[:-1]}: expected a block for each name")
    for name, block in blocks.items():
        shown = f"{SETS}, {where}{params.shown(name)}"
        if not isinstance(block, dict) or not isinstance(block.get("set", {}), dict):
            raise InputError(f"{shown}: expected a block, in which `set` is a block")
        if "like" in block and block["like"] not in ("", *blocks):
            raise InputError(f"{shown}: there is none to be like: {params.hint(block['like'], blocks)}")
    return {name: (block, blocks.get(block.get("like"), {})) for name, block in blocks.items()}


def _joined(other: dict, block: dict) -> dict:
    """Return the keys of both blocks, and of `set` the entries of both; those of `block` first."""
    return {**other, **block, "set": {**other.get("set", {}), **block.get("set", {})}}


def shards(sets: dict[str, ShardSet]) -> list[Shard]:
    """Return all shards: of each set first the seeds at both budgets, so that a verdict grows seed by seed."""
    return [Shard(name, seed, at) for name, each in sets.items() for seed in range(each.seeds) for at in budgets(each)]


def budgets(each: ShardSet) -> tuple[str, ...]:
    """Return the budgets of a set; a study or a variant has its own recipe, which is run whole."""
    return (FULL,) if study(each) else tuple(each.budgets)


def study(each: ShardSet) -> str:
    """Return the module of pipeline/studies that the shards of a set run; none where they train and score models."""
    return each.study or (VARIANTS if each.variants else "")


def named(each: ShardSet) -> str:
    """Return what index.csv has in the column `protocol` for the shards of a set."""
    return STUDY if each.study else "+".join(each.protocols)


def result_file(workspace: Workspace, shard: str) -> Path:
    """Return the file that keeps the rows of a shard of this name."""
    return folder(workspace) / "results" / f"{shard}.csv"


def kept_file(workspace: Workspace, shard: str) -> Path:
    """Return the file that keeps what figures draw of a shard of this name."""
    return folder(workspace) / "kept" / f"{shard}.parquet"


def stress_file(workspace: Workspace, shard: str) -> Path:
    """Return the file that keeps what the models of a shard score on perturbed readings and scenes."""
    return folder(workspace) / "stress" / f"{shard}.csv"


def kept_sha256(workspace: Workspace, shard: str) -> str:
    """Return the digest of what a shard has of `kept_file` and `stress_file`; empty where it has neither."""
    there = [path for name in (kept_file, stress_file) if (path := name(workspace, shard)).exists()]
    return digest(there) if there else ""


def checked(
    workspace: Workspace, file: Callable[[Workspace, str], Path], experiment: str = ""
) -> Iterator[tuple[pd.Series, Path]]:
    """Yield (line of the index, file) of the shards that have one; file: `kept_file` or `stress_file`.

    experiment: the only one that is asked for, or every one. Raises InputError where a file is not as indexed.
    """
    index = folder(workspace) / "index.csv"
    for _, row in table(index, INDEX).iterrows():
        if experiment not in ("", row["experiment"]):
            continue
        path = file(workspace, row["shard"])
        if kept_sha256(workspace, row["shard"]) != row["kept_sha256"]:
            raise InputError(f"{path}: not the file that {index} tells of; run `{MADE_BY} {row['shard']}` again")
        if path.exists():
            yield row, path


def study_file(workspace: Workspace, experiment: str, table: str, seed: int) -> Path:
    """Return the file that keeps one seed of a table of a study; `Workspace.study` finds those of all seeds."""
    return folder(workspace) / "studies" / experiment / f"{table}-{seed}.csv"


def digest(kept: Iterable[Path]) -> str:
    """Return the digest of a shard's files: of one its own, of several that of theirs, in the order of their names."""
    each = [files.sha256(path) for path in sorted(kept)]
    return each[0] if len(each) == 1 else hashlib.sha256("".join(each).encode()).hexdigest()


def table(path: Path, columns: list[str]) -> pd.DataFrame:
    """Return index.csv or times.csv as text, without a row where there is no such file.

    Raises InputError where it is no such table.
    """
    if not path.exists():
        return pd.DataFrame(columns=columns)
    remedy = f"get it again from git (`git checkout {path.parent.name}/{path.name}`)"
    with foreign.reading(path, "a CSV table", remedy):
        found = pd.read_csv(path, dtype=str, keep_default_na=False)
        if absent := [name for name in columns if name not in found.columns]:
            raise InputError(f"{path}: column '{absent[0]}' is missing; {remedy}")
        if not isinstance(found.index, pd.RangeIndex):  # pandas takes the first field of longer rows for their names
            raise InputError(f"{path}: its rows have more fields than its header; {remedy}")
        for name in NUMBERS.keys() & set(columns):  # ValueError where one is no number
            found[name][found[name] != ""].astype(NUMBERS[name])
    return found


def upsert(path: Path, columns: list[str], shard: str, rows: list[dict]) -> None:
    """Put the rows of one shard into a table, in place of those that it had; the table stays in order of shards.

    Of several processes that do so at once, one waits for the other.
    """
    with processes.holding(path.parent / ".lock", lambda: None):
        former, new = table(path, columns), pd.DataFrame(rows, columns=columns).astype(str)
        together = pd.concat([former[former["shard"] != shard], new])
        files.write_table(path, together.sort_values("shard", kind="stable"))


def read(workspace: Workspace) -> pd.DataFrame:
    """Return the rows of all committed shards; of metric `train_s` the seconds of trainings.

    The last column, `shard`, names the shard that a row is of. What no epochs change is in a seed's shard at `full` and
    in that at `half`, which another machine may have computed: the former counts. The times are of one machine for each
    experiment and protocol, see `timed_on`. None where none are. Raises InputError where a file is not as indexed.
    """
    tables = [pd.DataFrame(columns=[*COLUMNS, SHARD, "of"])]
    index, times = folder(workspace) / "index.csv", trainings(workspace)
    splits = [runs[runs["machine"] == timed_on(runs)] for _, runs in times.groupby(["experiment", "protocol"])]
    of_shard = dict(list(pd.concat([times[:0], *splits]).sort_index().groupby("shard")))
    lines = table(index, INDEX)
    whole = set(lines["shard"])
    for row in lines.itertuples():
        if row.protocol == STUDY:
            continue
        path = paths.require(result_file(workspace, row.shard), MADE_BY)
        if files.sha256(path) != row.sha256:
            raise InputError(f"{path}: not the file that {index} tells of; run `{MADE_BY} {row.shard}` again")
        rows = read_csv(path, COLUMNS, MADE_BY)
        if row.budget == HALF and f"{row.shard.removesuffix(HALF)}{FULL}" in whole:
            rows = rows[rows["budget"].notna()]
        tables.append(rows[COLUMNS].assign(**{SHARD: row.shard, "of": int(row.seed or 0)}))
        if row.shard in of_shard:
            tables.append(_training_times(of_shard[row.shard], rows))
    return _once(pd.concat(tables, ignore_index=True))


def trainings(workspace: Workspace) -> pd.DataFrame:
    """Return times.csv with experiment, budget and machine of each training's shard; no row where there is none."""
    index = table(folder(workspace) / "index.csv", INDEX)[["shard", "experiment", "budget", "machine"]]
    times = table(folder(workspace) / "times.csv", TIMES).merge(index, on="shard")
    return times.astype({"seed": int, "epochs": float, "train_s": float})


def timed_on(runs: pd.DataFrame) -> str:
    """Return the machine that made the most full trainings, of two that made as many the one without a card.

    Where none is full, that of the most trainings; seconds of two machines are no two values of one time. runs: of
    `trainings`; empty where there are none.
    """
    full = runs[runs["budget"] == FULL]
    made = (full if len(full) else runs)["machine"].value_counts()
    return min(made.index, key=lambda name: (-made[name], CARD in name, name), default="")


def stress(workspace: Workspace) -> pd.DataFrame:
    """Return what the models of all committed shards scored under stress, columns STRESS; no row where none has any.

    Raises InputError where a file is not as indexed, and where its blocks are none.
    """
    tables = [pd.DataFrame(columns=STRESS, dtype=object)]
    for row, path in checked(workspace, stress_file):
        rows = read_csv(path, STRESS[:-1], MADE_BY).reindex(columns=STRESS)
        rows = rows.astype(dict.fromkeys(WORDS, object)).fillna(dict.fromkeys(WORDS, ""))
        wrong = rows.index[~rows["blocks"].astype(str).str.fullmatch(units.WRITTEN)]
        if len(wrong):
            raise InputError(
                f"{path}, line {wrong[0] + 2}: blocks are {rows['blocks'][wrong[0]]!r}, and not loss:count of each; "
                f"run `{MADE_BY} {row['shard']}` again"
            )
        tables.append(rows)
    return pd.concat(tables[1:] or tables, ignore_index=True)


def _once(rows: pd.DataFrame) -> pd.DataFrame:
    """Return every result once: what describes the data of a set stands in the shards of all its seeds.

    It is the same result to nine digits: seeds that two machines computed differ in the last ones. Where it is another
    one, the set has grown, and that of the highest seed (column `of`) describes the most specimens.
    """
    of_data = rows[rows["model"] == DATA].sort_values("of", kind="stable")
    former = of_data.index[of_data.duplicated([*KEY, "seed", "budget"], keep="last")]
    rows = rows.drop(index=former, columns="of")
    return rows[~rows.assign(value=[float(f"{value:.9g}") for value in rows["value"]]).duplicated(COLUMNS)]


def _training_times(times: pd.DataFrame, rows: pd.DataFrame) -> pd.DataFrame:
    """Return the trainings of one shard as rows of the one table; rows: those of its results."""
    variants = rows.drop_duplicates("model").set_index("model")["variant"]
    place = {"condition": times["protocol"]}
    place |= {"variant": times["model"].map(variants), "metric": "train_s", "unit": "s", "value": times["train_s"]}
    return times.assign(**place).reindex(columns=[*COLUMNS, SHARD])
