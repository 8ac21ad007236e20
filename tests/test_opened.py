"""DVC must know every file that a stage opens: what is not among its deps may change, and results are stale."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
import yaml
from builders.project import CODE, ROOT
from opened.sitecustomize import NATIVE

# Python's own files are imported (test_architecture.py), settings are watched by their keys, and what stages write is
# finished under another name: these are no results of another stage.
HOUSE = r"(pipeline|tactile)"
OWN = re.compile(rf"({HOUSE}(/\S+)?/__pycache__(/.*)?|.*\.pyc?|{HOUSE}(/\w+)*|params\.yaml|params(/\w+\.yaml)?)")
PROCESS = re.compile(r"\.\d+-[^/]+(?=\.unfinished)")  # in the name of its draft
DRAFT = re.compile(r"(\.unfinished(?=/|$)|^data/\w+/unfinished/.*)")
# Of the report of ingest these stages read whether there is anything to do. If not, frames and dataset are empty.
WHETHER_RUN = re.compile(r"data/(\w+)/ingest\.json")
EVIDENCE = re.compile(r"evidence/(curves|kept|results|stress|studies)(/.*)?")  # a change is one of its index
# This stage always runs, so that what it reads is never stale; what it writes is no output of DVC's. Its deps say after
# which stages it runs: those that make the last of what it reads.
ALWAYS = {
    "this_machine": re.compile(
        r"dvc\.lock|mlruns(/.*)?|mlflow\.db.*|data/\w+(/.*)?|pipeline/results/published\.csv|evidence(/.*)?"
        r"|reports(/look(/agreement\.md(\..*)?)?)?"
    ),
}


def covered(path: str, places: Sequence[str]) -> bool:
    """Whether a path is one of `places` or below one."""
    return any(path == place or path.startswith(f"{place}/") for place in places)


def notes(folder: Path, stage: str) -> set[tuple[str, str]]:
    """(how, path below the project) of all that the processes of a stage opened."""
    lines = [line for file in folder.glob(f"{stage}.*") for line in file.read_text().splitlines()]
    return {tuple(PROCESS.sub("", line).split(" ", 1)) for line in lines}


def undeclared(project: Path, opened: set[tuple[str, str]], deps: Sequence[str], outs: Sequence[str]) -> list[str]:
    """What a stage opened that is neither among its `deps` nor its `outs`, as `<how> <path>`."""
    found = []
    for how, path in sorted(opened):
        finished = DRAFT.sub("", path)
        if not finished or OWN.fullmatch(path) or covered(finished, outs if how == "write" else [*deps, *outs]):
            continue
        if how != "write" and any(covered(out, [finished]) for out in outs):
            continue  # a folder around an output: for the names of drafts in it, which killed processes have left
        if how != "write" and EVIDENCE.fullmatch(path) and "evidence/index.csv" in deps:
            continue
        ran = WHETHER_RUN.fullmatch(path)
        if ran and {f"data/{ran[1]}/frames.parquet", f"data/{ran[1]}/dataset.parquet"} & set(deps):
            continue
        if (project / path).is_dir():  # with nothing in it but what is declared
            if how == "read":  # as `rmtree` opens the folders inside of another by their names alone; files are noted
                continue
            files = [file.relative_to(project).as_posix() for file in (project / path).rglob("*") if file.is_file()]
            if all(covered(file, [*deps, *outs]) for file in files):
                continue
        found.append(f"{how} {path}")
    return found


def locked(project: Path) -> dict[str, tuple[list[str], list[str]]]:
    """Stage -> paths of its deps and outs, as DVC recorded them."""
    stages: Mapping = yaml.safe_load((project / "dvc.lock").read_text())["stages"]
    return {
        name: tuple([entry["path"] for entry in stage.get(kind, [])] for kind in ("deps", "outs"))
        for name, stage in stages.items()
    }


def test_dvc_knows_what_every_stage_opens(miniature):
    folder, found, never = miniature.folder.parent / "opened", {}, []
    for stage, (deps, outs) in locked(miniature.folder).items():
        opened = notes(folder, stage)
        assert opened, f"{stage}: nothing was noted"
        if stage in ALWAYS:
            opened = {(how, path) for how, path in opened if not ALWAYS[stage].fullmatch(path)}
        if wrong := undeclared(miniature.folder, opened, deps, outs):
            found[stage] = wrong
        paths = [path for _, path in opened]
        never += [f"{stage}: {dep}" for dep in deps if not any(covered(path, [dep]) for path in paths)]
    print("Declared, but not opened at this scale and with these data:", *never, sep="\n  ")
    assert not found, yaml.safe_dump(found)


SEEN = {  # of a stage that runs at miniature scale: a Parquet file, and weights that a compiled reader opens
    "train@touch": {("read", "data/touch/dataset.parquet")},
    "evaluate@touch": {("read", "data/touch/models/cnn/press-0/network.safetensors")},
    "ingest@touch": {("list", "data/touch/logs"), ("write", "data/touch/frames.parquet.unfinished")},
}


@pytest.mark.parametrize("stage", SEEN)
def test_what_a_stage_opens_is_noted(miniature, stage):
    opened = notes(miniature.folder.parent / "opened", stage)
    assert SEEN[stage] <= opened
    deps, outs = locked(miniature.folder)[stage]
    wanted = [f"{how} {path}" for how, path in sorted(SEEN[stage]) if how != "write"]
    assert undeclared(miniature.folder, SEEN[stage], [], outs) == wanted and not undeclared(
        miniature.folder, SEEN[stage], deps, outs
    )


def test_nothing_else_opens_files_behind_pythons_back():
    """Compiled readers that the pipeline uses are those in NATIVE."""
    wrapped = {name for functions in NATIVE.values() for name in functions}
    for path in CODE:
        if path == ROOT / "tactile" / "own" / "tables.py":
            continue  # of `tactile import`, which no stage runs
        source = path.read_text()
        used = set(re.findall(r"\b(?:parquet|pq)\.(\w+)\(", source))
        for names in re.findall(r"from (?:safetensors|pyarrow)\.\w+ import ([^\n]+)", source):
            used |= {name.strip() for name in names.split(",")}
        assert used <= wrapped, f"{path.name}: {used - wrapped}"
        assert not re.search(r"memory_map\(|OSFile\(|pyarrow\.(dataset|feather|fs|orc)|h5py|safe_open", source), (
            path.name
        )
