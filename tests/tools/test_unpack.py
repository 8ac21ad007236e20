"""A folder of shards that a stranger made: whatever is wrong with it, the checkout stays byte for byte as it was."""

import argparse
import csv
import io
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders.project import ROOT

from pipeline.results import kept, shards
from tactile.base.errors import InputError
from tactile.base.params_file import copied
from tactile.base.paths import Workspace
from tools import unpack

SHARD, STUDY, VARIED = "strain-0-full", "input_frames_glove-0-full", "variants_glove-0-full"
RESULT, CURVES, ROWS = f"results/{SHARD}.csv", f"curves/{SHARD}.csv", f"results/{VARIED}.csv"
TABLE = "studies/glove/input_frames-0.csv"
DRAWN, STRESS = f"kept/{SHARD}.parquet", f"stress/{SHARD}.csv"
INDEXED = {RESULT: SHARD, TABLE: STUDY, ROWS: VARIED}
OUTPUTS = {"@".join(name.split("-", 1)): [Path(file)] for file, name in INDEXED.items()}
EVIL = "--upload-pack=touch pwned"


def held(folder: Path) -> dict[str, bytes | str]:
    """Return the content of every file below a folder, and where its links lead."""
    every = sorted(folder.rglob("*"))
    return {
        str(path): os.readlink(path) if path.is_symlink() else path.read_bytes()
        for path in every
        if path.is_symlink() or path.is_file()
    }


@pytest.fixture
def checkout(tmp_path, monkeypatch) -> Workspace:
    """Return a checkout with one seed of a study, in which nobody calls DVC."""
    made = Workspace(tmp_path / "checkout")
    made.root.mkdir()
    copied(ROOT / "params.yaml", made.root)
    evidence = made.root / "evidence"
    (evidence / "studies" / "glove").mkdir(parents=True)
    shutil.copy(ROOT / "evidence" / "shards.yaml", evidence)
    shutil.copy(ROOT / "evidence" / TABLE, evidence / "studies" / "glove" / "input_frames-1.csv")  # as of another seed
    monkeypatch.setattr(unpack, "outputs", lambda workspace: OUTPUTS)

    def run(command, **options):
        assert EVIL not in " ".join(command)
        return subprocess.CompletedProcess([], 0 if "dvc" in command else 1, "", "")  # git knows no commit

    monkeypatch.setattr(unpack.subprocess, "run", run)
    return made


@pytest.fixture
def out(tmp_path) -> Path:
    """Return a folder as run.py leaves it, of one shard, one study and one of variants; the shard keeps all it can."""
    folder = tmp_path / "out"
    for name in (*INDEXED, CURVES):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "evidence" / name, folder / name)
    for name in ("index.csv", "times.csv"):
        rows = (ROOT / "evidence" / name).read_text().splitlines(keepends=True)
        mine = [row for row in rows[1:] if row.startswith(tuple(f"{name}," for name in INDEXED.values()))]
        (folder / name).write_text("".join([rows[0], *mine]))
    (folder / "stress").mkdir()
    row = {"experiment": "strain", "protocol": "task_1", "condition": "task_1", "model": "esn", "metric": "error"}
    row |= {"seed": 0, "budget": "full", "unit": "mm", "value": 2.5, "n": 9, "perturbation": "noise", "severity": 0.1}
    write(folder / STRESS, [dict.fromkeys(shards.STRESS, "") | row])
    draw(folder)
    return folder


def draw(folder: Path, **changed) -> None:
    """Write what figures draw of the shard, one row, and note its digest; changed: column -> value."""
    row = {"protocol": "task_1", "seed": 0, "model": "esn", "window": 7, "place_mm": [1.5]} | changed
    schema = kept.none("strain").schema
    schema = schema if set(row) <= set(schema.names) else None
    (folder / "kept").mkdir(exist_ok=True)
    pq.write_table(pa.Table.from_pylist([row], schema), folder / DRAWN)
    index_kept(folder, SHARD)


def index_kept(folder: Path, name: str) -> None:
    """Note the digest of what a shard has in `kept` and `stress`."""
    lines = list(csv.DictReader(io.StringIO((folder / "index.csv").read_text())))
    there = [path for part in ("kept", "stress") for path in (folder / part).glob(f"{name}.*")]
    for line in lines:
        if line["shard"] == name:
            line["kept_sha256"] = shards.digest(there) if there else ""
    write(folder / "index.csv", lines)


def test_a_folder_as_run_left_it_is_taken(checkout, out, capsys):
    unpack.main(checkout, argparse.Namespace(folder=out))
    assert "3 shards taken; 0 were there" in capsys.readouterr().out
    for name in (*INDEXED, CURVES, DRAWN, STRESS, "index.csv", "times.csv"):
        assert (checkout.root / "evidence" / name).read_bytes() == (out / name).read_bytes(), name


def test_scores_under_stress_of_an_older_computation_have_no_blocks_and_are_taken(checkout, out):
    removed_column(STRESS, "blocks")(out)
    index_kept(out, SHARD)
    unpack.main(checkout, argparse.Namespace(folder=out))
    assert (checkout.root / "evidence" / STRESS).read_bytes() == (out / STRESS).read_bytes()
    assert shards.stress(checkout)["blocks"].eq("").all() and len(shards.stress(checkout)) == 1


Change = Callable[[Path], object]


def value(file: str, column: str, new: str, row: int = 0, indexed: bool = True) -> Change:
    """Return what puts a value into a table; indexed: the digest of the table in index.csv is then that of the new."""

    def change(folder: Path) -> None:
        lines = list(csv.DictReader(io.StringIO((folder / file).read_text())))
        lines[row][column] = new
        write(folder / file, lines)
        if indexed and file in INDEXED:
            index(folder, file)

    return change


def write(path: Path, rows: list[dict]) -> None:
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def index(folder: Path, file: str) -> None:
    """Note the digest of a file in the line of its shard."""
    lines = list(csv.DictReader(io.StringIO((folder / "index.csv").read_text())))
    for line in lines:
        if line["shard"] == INDEXED[file]:
            line["sha256"] = shards.digest([folder / file])
    write(folder / "index.csv", lines)


def content(file: str, new: bytes) -> Change:
    def change(folder: Path) -> None:
        (folder / file).write_bytes(new)
        if file in INDEXED:
            index(folder, file)

    return change


def link(file: str) -> Change:
    """Return what puts a link to the same content in the place of a file or a folder."""

    def change(folder: Path) -> None:
        place, elsewhere = folder / file, folder.parent / "elsewhere"
        place.rename(elsewhere)
        place.symlink_to(elsewhere)

    return change


def fifo(file: str) -> Change:
    def change(folder: Path) -> None:
        (folder / file).unlink()
        os.mkfifo(folder / file)

    return change


def twice(folder: Path) -> None:
    with open(folder / "index.csv", "a") as file:
        file.write((folder / "index.csv").read_text().splitlines()[1] + "\n")


def removed_column(file: str, column: str) -> Change:
    def change(folder: Path) -> None:
        rows = list(csv.DictReader(io.StringIO((folder / file).read_text())))
        write(folder / file, [{name: each for name, each in row.items() if name != column} for row in rows])
        if file in INDEXED:
            index(folder, file)

    return change


def kept_value(*given) -> Change:
    """Return what puts a value into a table whose digest is then noted, see `value`."""
    return lambda folder: (value(*given)(folder), index_kept(folder, SHARD))


def kept_content(*given) -> Change:
    return lambda folder: (content(*given)(folder), index_kept(folder, SHARD))


HOSTILE: dict[str, Change] = {
    # names and paths
    "a shard above": value("index.csv", "shard", "../../pipeline/x"),
    "an absolute shard": value("index.csv", "shard", "/tmp/x"),
    "a shard of nobody": value("index.csv", "shard", "strain-99-full"),
    "another experiment": value("index.csv", "experiment", "touch", row=1),
    "another protocol": value("index.csv", "protocol", "task_0", row=1),
    "another seed": value("index.csv", "seed", "1"),
    "another budget": value("index.csv", "budget", "half"),
    "a shard twice": twice,
    # what git and the terminal get
    "an option for a commit": value("index.csv", "commit", EVIL),
    "a name for a commit": value("index.csv", "commit", "HEAD"),
    "a short commit": value("index.csv", "commit", "7142594"),
    "control characters": value("index.csv", "machine", "AMD\x1b[31m EPYC"),
    "markup": value("index.csv", "machine", "<script>alert(1)</script>"),
    # digests
    "no digest": value("index.csv", "sha256", ""),
    "a digest in capitals": value("index.csv", "sha256", "A" * 64),
    "another digest": value("index.csv", "sha256", "0" * 64),
    "a digest of data that is none": value("index.csv", "data_sha256", "x"),
    "no digest of data": value("index.csv", "data_sha256", ""),
    "costs of no end": value("index.csv", "core_s", "inf"),
    "costs below zero": value("index.csv", "core_s", "-1"),
    "a changed result": value(RESULT, "value", "0.001", indexed=False),
    "a changed study": value(TABLE, "value", "0.001", indexed=False),
    # tables with a digest that fits
    "an endless result": value(RESULT, "value", "inf"),
    "a result beyond numbers": value(RESULT, "value", "1e999"),
    "a result in words": value(RESULT, "value", "better"),
    "a formula": value(RESULT, "condition", "=HYPERLINK(1)"),
    "a model of nobody": value(RESULT, "model", "lstm_indirect"),
    "a model of another experiment": value(RESULT, "model", "lomp"),
    "a protocol of nobody": value(RESULT, "protocol", "task_9"),
    "an experiment of nobody": value(RESULT, "experiment", "touch"),
    "a budget of another shard": value(RESULT, "budget", "half"),
    "half an n": value(RESULT, "n", "1.5"),
    "a seed below zero": value(RESULT, "seed", "-1"),
    "a column too few": removed_column(RESULT, "unit"),
    "a study's model of nobody": value(TABLE, "seed", "7"),
    "a study's endless value": value(TABLE, "value", "-Infinity"),
    "a study's column too few": removed_column(TABLE, "n"),
    "a variant of nobody": value(ROWS, "variant", "width_3"),
    "no variant": value(ROWS, "variant", ""),
    "a variant's model of nobody": value(ROWS, "model", "tree"),
    "a variant's protocol of nobody": value(ROWS, "protocol", "random_frames_strain"),
    "a variant's endless value": value(ROWS, "value", "inf"),
    "a changed variant": value(ROWS, "value", "0.001", indexed=False),
    "times of a variant": value("times.csv", "shard", VARIED),
    "an empty result": content(RESULT, b""),
    "only a header": content(RESULT, b"experiment,protocol,condition,model,variant,metric,seed,budget,unit,value,n\n"),
    "a binary result": content(RESULT, bytes(range(256))),
    "a large result": content(RESULT, b"x" * (unpack.LARGEST + 1)),
    # what no digest tells of
    "curves in words": value(CURVES, "train_loss", "low"),
    "endless curves": value(CURVES, "validation_loss", "inf"),
    "curves of nobody": value(CURVES, "model", "lstm_indirect"),
    "curves of another seed": value(CURVES, "seed", "3"),
    "binary curves": content(CURVES, b"\xff\xfe\x00"),
    "times below zero": value("times.csv", "train_s", "-1"),
    "times that are none": value("times.csv", "train_s", "nan"),
    "endless times": value("times.csv", "train_s", "1e999"),
    "epochs in words": value("times.csv", "epochs", "many"),
    "times of nobody": value("times.csv", "shard", "strain-99-full"),
    "times of a model of nobody": value("times.csv", "model", "lstm_indirect"),
    "times of another seed": value("times.csv", "seed", "1"),
    "binary times": content("times.csv", b"\xff\xfe\x00"),
    "a binary index": content("index.csv", b"\xff\xfe\x00"),
    "an empty index": content("index.csv", b""),
    "an index of another table": content("index.csv", b"a,b\n1,2\n"),
    "a quote without end": content("index.csv", b'shard,experiment\n"'),
    # what figures draw, and scores of stress
    "a kept file that is not indexed": value("index.csv", "kept_sha256", "", row=1),
    "another digest of it": value("index.csv", "kept_sha256", "0" * 64, row=1),
    "a digest of it that is none": value("index.csv", "kept_sha256", "x"),
    "a missing kept file": lambda folder: (folder / DRAWN).unlink(),
    "a changed stress": value(STRESS, "value", "0.001"),
    "a kept model of nobody": lambda folder: draw(folder, model="lomp"),
    "a kept protocol of nobody": lambda folder: draw(folder, protocol="task_9"),
    "a kept seed of another": lambda folder: draw(folder, seed=1),
    "a kept name that is none": lambda folder: draw(folder, condition="<script>"),
    "another kept column": lambda folder: draw(folder, more=1),
    "a kept file of text": kept_content(DRAWN, b"text"),
    "a large kept file": kept_content(DRAWN, b"x" * (kept.LARGEST + 1)),
    "a stress of nobody": kept_value(STRESS, "model", "lomp"),
    "a stress of another budget": kept_value(STRESS, "budget", "half"),
    "an endless stress": kept_value(STRESS, "value", "inf"),
    "blocks of no samples": kept_value(STRESS, "blocks", "2.5:0"),
    "a severity in words": kept_value(STRESS, "severity", "much"),
    "a linked kept file": link(DRAWN),
    "a pipe for stress": fifo(STRESS),
    # what is no file
    "a linked index": link("index.csv"),
    "linked times": link("times.csv"),
    "a linked result": link(RESULT),
    "linked curves": link(CURVES),
    "a linked folder": link("results"),
    "a linked folder of studies": link("studies/glove"),
    "a pipe for times": fifo("times.csv"),
    "a pipe for a result": fifo(RESULT),
    "a missing result": lambda folder: (folder / RESULT).unlink(),
    "a folder for a result": lambda folder: ((folder / RESULT).unlink(), (folder / RESULT).mkdir()),
}


@pytest.mark.parametrize("change", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_folder_leaves_the_checkout_as_it_was(change, checkout, out):
    change(out)
    before = held(checkout.root)
    with pytest.raises(InputError) as raised:
        unpack.main(checkout, argparse.Namespace(folder=out))
    assert held(checkout.root) == before
    assert str(raised.value).isprintable() and str(out) in str(raised.value)


def test_what_changes_while_it_is_checked_is_not_taken(checkout, out, monkeypatch):
    def change(*given):
        (out / RESULT).write_text("changed behind its back")

    monkeypatch.setattr(unpack, "say_other_data", change)
    unpack.main(checkout, argparse.Namespace(folder=out))
    assert (checkout.root / "evidence" / RESULT).read_bytes() == (ROOT / "evidence" / RESULT).read_bytes()


def test_the_evidence_of_this_checkout_stands_its_own_checks(tmp_path, monkeypatch):
    workspace, folder = Workspace(ROOT), ROOT / "evidence"
    monkeypatch.setattr(unpack, "check_commit", lambda *given: None)
    sets = shards.read_sets(workspace)
    found = unpack.named(workspace, folder, tmp_path, sets)
    assert len(found) == len(shards.table(folder / "index.csv", shards.INDEX))
    times = unpack.times_of(workspace, folder, tmp_path, sets)
    assert sum(map(len, times.values())) == len(shards.table(folder / "times.csv", shards.TIMES))
    for shard, line in found:
        if not sets[shard.set].study and shard.seed == 0:
            result = Path("results") / f"{shard.name}.csv"
            unpack.check_files(workspace, folder, tmp_path, sets, shard, [result], line)


def test_what_a_former_computation_kept_goes_with_it(checkout, out):
    unpack.main(checkout, argparse.Namespace(folder=out))
    for name in (DRAWN, STRESS):
        (out / name).unlink()
    index_kept(out, SHARD)
    unpack.main(checkout, argparse.Namespace(folder=out))
    assert not any((checkout.root / "evidence" / name).exists() for name in (DRAWN, STRESS))
    assert not list(shards.checked(checkout, shards.kept_file))
