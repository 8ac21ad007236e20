"""DVC must know every file that a stage opens: what is not among its deps may change, and results are stale."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest
import yaml
from builders.project import ROOT, Project, noting_opened
from opened.sitecustomize import NATIVE

# Python's own files are imported (test_architecture.py), settings are watched by their keys, and what stages write is
# finished under another name: these are no results of another stage.
OWN = re.compile(r"(pipeline(/\S+)?/__pycache__(/.*)?|.*\.pyc?|pipeline(/\w+)*|params\.yaml|params(/\w+\.yaml)?)")
DRAFT = re.compile(r"(\.unfinished(?=/|$)|^data/\w+/unfinished/.*)")
# Of the report of ingest these stages read whether there is anything to do. If not, frames and dataset are empty.
WHETHER_RUN = re.compile(r"data/(\w+)/ingest\.json")
# These stages always run, so that what they read is never stale; what they write is no output of DVC's. Their deps say
# after which stages they run: those that make the last of what they read.
ALWAYS = {
    "track": re.compile(
        r"dvc\.lock|mlruns(/.*)?|data/\w+/(dataset\.parquet|frames\.parquet|ingest\.json|latency|models)(/.*)?"
    ),
    "agreement": re.compile(r"reports/agreement\.md(\..*)?|data/\w+/scores\.csv"),
}


def covered(path: str, places: Sequence[str]) -> bool:
    """Whether a path is one of `places` or below one."""
    return any(path == place or path.startswith(f"{place}/") for place in places)


def notes(folder: Path, stage: str) -> set[tuple[str, str]]:
    """(how, path below the project) of all that the processes of a stage opened."""
    lines = [line for file in folder.glob(f"{stage}.*") for line in file.read_text().splitlines()]
    return {tuple(line.split(" ", 1)) for line in lines}


def undeclared(project: Path, opened: set[tuple[str, str]], deps: Sequence[str], outs: Sequence[str]) -> list[str]:
    """What a stage opened that is neither among its `deps` nor its `outs`, as `<how> <path>`."""
    found = []
    for how, path in sorted(opened):
        finished = DRAFT.sub("", path)
        if not finished or OWN.fullmatch(path) or covered(finished, outs if how == "write" else [*deps, *outs]):
            continue
        ran = WHETHER_RUN.fullmatch(path)
        if ran and {f"data/{ran[1]}/frames.parquet", f"data/{ran[1]}/dataset.parquet"} & set(deps):
            continue
        if (project / path).is_dir():  # with nothing in it but what is declared
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


STAGE = """
import os, subprocess, sys
from pathlib import Path
import numpy as np
import pyarrow.parquet
from safetensors.torch import load_file

Path("data/declared.csv").read_text()
Path("data/known/a.csv").read_bytes()
os.listdir("data/known")
if sys.argv[1:] != ["child"]:
    Path("data/by_python.csv").read_text()
    np.load("data/by_numpy.npy")
    pyarrow.parquet.read_table("data/by_pyarrow.parquet")
    load_file("data/by_safetensors.safetensors")
    list(Path("data/listed").glob("*"))
    Path("data/draft.csv.unfinished").write_text("")
    os.rename("data/draft.csv.unfinished", "data/other.csv")
    Path("data/touch/ingest.json").read_text()
    subprocess.run([sys.executable, __file__, "child"], check=True)
    with pyarrow.parquet.ParquetWriter("data/out.parquet.unfinished", pyarrow.schema([])):
        pass
    os.rename("data/out.parquet.unfinished", "data/out.parquet")
else:
    open("data/by_child.csv").close()
"""


@pytest.mark.slow
def test_what_a_stage_opens_is_noted(tmp_path):
    import numpy as np
    import pyarrow.parquet
    import torch
    from safetensors.torch import save_file

    project = Project(tmp_path)
    data = project.folder / "data"
    for name in ("declared.csv", "by_python.csv", "by_child.csv", "known/a.csv", "listed/b.csv", "touch/ingest.json"):
        (data / name).parent.mkdir(exist_ok=True)
        (data / name).write_text("{}")
    np.save(data / "by_numpy.npy", np.zeros(1))
    pyarrow.parquet.write_table(pyarrow.table({"a": [1]}), data / "by_pyarrow.parquet")
    save_file({"a": torch.zeros(1)}, data / "by_safetensors.safetensors")
    (project.folder / "stage.py").write_text(STAGE)
    deps, outs = ["data/declared.csv", "data/known", "stage.py"], ["data/out.parquet"]
    stage = {"cmd": "python stage.py", "deps": deps, "outs": outs}
    (project.folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": {"one": stage}}))
    project.environment = noting_opened(project)
    project.dvc("repro")
    assert locked(project.folder) == {"one": (deps, outs)}
    opened = notes(tmp_path / "opened", "one")
    assert undeclared(project.folder, opened, deps, outs) == [
        "list data/listed",
        "read data/by_child.csv",
        "read data/by_numpy.npy",
        "read data/by_pyarrow.parquet",
        "read data/by_python.csv",
        "read data/by_safetensors.safetensors",
        "read data/touch/ingest.json",
        "write data/draft.csv.unfinished",
        "write data/other.csv",
    ]
    assert ("write", "data/out.parquet.unfinished") in opened


def test_nothing_else_opens_files_behind_pythons_back():
    """Compiled readers that the pipeline uses are those in NATIVE."""
    wrapped = {name for functions in NATIVE.values() for name in functions}
    for path in (ROOT / "pipeline").rglob("*.py"):
        source = path.read_text()
        used = set(re.findall(r"\b(?:parquet|pq)\.(\w+)\(", source))
        for names in re.findall(r"from (?:safetensors|pyarrow)\.\w+ import ([^\n]+)", source):
            used |= {name.strip() for name in names.split(",")}
        assert used <= wrapped, f"{path.name}: {used - wrapped}"
        assert not re.search(r"memory_map\(|OSFile\(|pyarrow\.(dataset|feather|fs|orc)|h5py|safe_open", source), (
            path.name
        )
