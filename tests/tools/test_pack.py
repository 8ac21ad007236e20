"""Shards on a machine without network, DVC or git: packed here, computed there, taken back."""

import argparse
import csv
import importlib.metadata
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor

import pandas as pd
import pytest
import yaml
from builders.project import ROOT, Project

from pipeline.results import one_table, shards
from tactile.base import files
from tactile.base.errors import InputError
from tactile.base.imports import HOUSES
from tactile.base.paths import Workspace
from tools import pack, unpack

# What a borrowed machine has; of all else that is installed here it has nothing but what travels.
HAS = ("numpy", "pandas", "pyarrow", "torch", "numba", "scikit-learn", "scipy", "pyyaml", "safetensors")
HAS += ("threadpoolctl", "tqdm", "packaging", "typing_extensions", "matplotlib", "jinja2", "psutil", "rich", "pip")
LACKING = """
import sys
from importlib.machinery import PathFinder
LACKS = {lacks!r}
class Finder(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.partition(".")[0] in LACKS else super().find_spec(name, path, target)
sys.meta_path[sys.meta_path.index(PathFinder)] = Finder
"""
COMPUTES = ("datasets", "experiments", "learning", "logs", "models", "scoring", "tasks")
COMPUTES = (*(f"tactile/{room}" for room in COMPUTES), "pipeline/results", "pipeline/scenes", "pipeline/stability")

# Takes the place of pipeline/stages/shard.py: says what it was called with, and ends as `fate` says for its name.
STUB = """
import json, os, subprocess, sys, time
from pathlib import Path
given, root = sys.argv[1:sys.argv.index("--root")], Path(sys.argv[-1])
name, evidence = "-".join(given), root / "evidence"
fate, begun = json.loads((root.parent / "fate.json").read_text()).get(name, ""), time.time()
time.sleep(0.3)
if fate == "stays":
    sleeper = subprocess.Popen(["sleep", "60"])
    (evidence / "results").mkdir(exist_ok=True)
    (evidence / "results" / f"{name}.csv").write_text("half a")
    (root / "sleeper.txt").write_text(str(sleeper.pid))
    sleeper.wait()
with open(root / "calls.txt", "a") as calls:
    kept = {key: os.environ.get(key) for key in ("WORKERS", "CUDA_VISIBLE_DEVICES", "CUDA_MPS_PIPE_DIRECTORY")}
    calls.write(json.dumps({"name": name, "begun": begun, "ended": time.time(), **kept}) + "\\n")
if fate == "fails":
    sys.exit("error: no luck")
if len(given) == 3:
    (evidence / "results").mkdir(exist_ok=True)
    (evidence / "results" / f"{name}.csv").write_text(name)
    new = not (evidence / "index.csv").exists()
    with open(evidence / "index.csv", "a") as index:
        index.write(("shard,commit\\n" if new else "") + name + ",COMMIT\\n")
"""
TORCH = """
import os, sys
class cuda:
    is_available = staticmethod(lambda: True)
    get_device_name = staticmethod(lambda: "A card")
def zeros(count, device):
    sys.exit({code} if device == "cuda" else 9)
"""
CONTROL = """#!/bin/sh
if [ "$1" = -f ]; then echo $$ > "$DAEMON"; exec sleep 60; fi
read word; [ "$word" = quit ] && kill "$(cat "$DAEMON")"
"""


def write_wheel(folder, name):
    """Write a package of one empty module; name: that of the file, which tells the systems that it is for."""
    module, version, tag = name.split("-", 2)
    folder.mkdir(exist_ok=True)
    with zipfile.ZipFile(folder / f"{name}.whl", "w") as wheel:
        about = f"{module}-{version}.dist-info"
        wheel.writestr(f"{module}.py", "")
        wheel.writestr(f"{about}/METADATA", f"Metadata-Version: 2.1\nName: {module}\nVersion: {version}\n")
        wheel.writestr(f"{about}/WHEEL", f"Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: {tag}\n")
        wheel.writestr(f"{about}/RECORD", "")


def packed(workspace, folder, *names, processes=1):
    """Pack shards in the workspace, unpack the archive in a new folder, and return that; one package comes along."""
    wheels = folder.parent / "wheels"
    write_wheel(wheels, "probe_of_packs-1.0-py3-none-any")
    archive = folder.parent / "pack.zip"
    given = argparse.Namespace(archive=archive, shards=list(names), processes=processes, wheels=wheels)
    pack.main(workspace, given)
    with zipfile.ZipFile(archive) as unpacking:
        unpacking.extractall(folder)
    return folder


def run(folder, out, *options, **variables):
    """Run run.py of an unpacked pack, and return what it printed."""
    command = [sys.executable, folder / "run.py", "--out", out, *options]
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | variables
    return subprocess.run(command, cwd=folder.parent, env=environment, capture_output=True, text=True)


@pytest.fixture
def stubs(workspace, tmp_path):
    """Return `stubs(*names, processes)`: an unpacked pack whose shards compute nothing."""
    (tmp_path / "evidence").mkdir()
    shutil.copy(ROOT / "evidence" / "shards.yaml", tmp_path / "evidence")

    def make(*names, processes=1, **fate):
        folder = packed(workspace, tmp_path / "there", *names, processes=processes)
        commit = json.loads((folder / "pack.json").read_text())["commit"]
        (folder / "pipeline" / "stages" / "shard.py").write_text(STUB.replace("COMMIT", commit))
        (folder / "fate.json").write_text(json.dumps(fate))
        return folder

    return make


def calls(folder):
    """Return what each call of the stub was, in the order in which they ended."""
    return [json.loads(line) for line in (folder / "work" / "calls.txt").read_text().splitlines()]


def jobs(out):
    return {name: each["status"] for name, each in json.loads((out / "run.json").read_text())["jobs"].items()}


def test_a_pack_holds_code_settings_and_shards_and_no_data(stubs, tmp_path):
    folder = stubs("glove_frames_strain@1-half", "touch_press@0-half", "physics_strain@2-full", processes=4)
    told = {each.pop("set"): each for each in json.loads((folder / "pack.json").read_text())["shards"]}
    assert list(told) == ["glove_frames_strain", "touch_press", "physics_strain"]  # as they were named
    assert told["glove_frames_strain"]["data"] == "glove_frames_pressure" and told["physics_strain"]["data"] is None
    assert [each["processes"] for each in told.values()] == [4, 4, 1]
    assert told["touch_press"]["minutes"] == 5  # half of its 10
    there = {path.name for path in folder.iterdir()} - {"fate.json"}
    assert there == {*pack.CODE, "evidence", "pack.json", "params", "params.yaml", "run.py", "wheels"}
    assert not list(folder.rglob("__pycache__")) and (tmp_path / "pack.zip").stat().st_size < pack.MOST_BYTES
    assert not (folder / "evidence" / "index.csv").exists()


def test_what_cannot_be_packed_is_named(workspace, tmp_path, monkeypatch, stubs):
    for names, said in {
        ("strain_recorded@0-half",): "strain_recorded@0-half: strain_recorded is of recordings, which do not travel",
        ("glove_recorded",): "glove_recorded: glove_recorded is of recordings",
        ("touch_pres",): "no 'touch_pres'; did you mean 'touch_press'",
        ("strain@24-half",): "no 'strain@24-half'; did you mean 'strain@",
    }.items():
        with pytest.raises(InputError, match=re.escape(said)):
            packed(workspace, tmp_path / "there", *names)
    monkeypatch.setattr(pack, "MOST_BYTES", 1000)
    with pytest.raises(InputError, match="pack.zip: .* MB, and 0 MB is the most"):
        packed(workspace, tmp_path / "there", "strain@0-half")
    assert not (tmp_path / "pack.zip").exists()


@pytest.mark.slow
def test_packages_come_in_the_versions_of_constraints_and_for_the_other_machine(tmp_path, monkeypatch):
    index, here, there = tmp_path / "index", "cp311-cp311-win_amd64", "cp312-cp312-manylinux_2_17_x86_64"
    pins = dict(re.findall(r"^(\S+)==(\S+)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE))
    for name in pack.PACKAGES:
        name = name if name in pins else name.replace("-", "_")
        for tag in (here, there) if name in ("pydantic_core", "ruamel.yaml.clib") else ("py3-none-any",):
            for version in (pins[name], "99.0"):
                write_wheel(index, f"{name.replace('-', '_')}-{version}-{tag}")
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(index))
    (tmp_path / "wheels").mkdir()
    pack.download(tmp_path / "wheels")
    found = {path.name for path in (tmp_path / "wheels").iterdir()}
    assert len(found) == len(pack.PACKAGES) and not any("-99.0-" in name or here in name for name in found)
    (index / f"skops-{pins['skops']}-py3-none-any.whl").unlink()
    with pytest.raises(InputError, match="pip could not download .*skops.*; name a folder of them by --wheels"):
        pack.download(tmp_path / "wheels2")


@pytest.mark.slow
def test_a_run_that_is_killed_at_its_deadline_leaves_whole_shards_and_the_next_goes_on(stubs, tmp_path):
    fate = {"strain-0-full": "fails", "strain-1-half": "stays", "glove_session": "fails"}
    names = ("strain@0-half", "strain@0-full", "strain@1-half", "glove_session@0-full", "physics_strain@0-full")
    folder, out = stubs(*names, **fate), tmp_path / "out"
    done = run(folder, out, "--minutes", "0.08", "--workers", "3", "--card", "no")
    assert done.returncode == 1, done.stderr
    assert jobs(out) == {
        "data_strain": "done", "data_glove_session": "failed (1)", "strain-0-half": "done",
        "strain-0-full": "failed (1)", "strain-1-half": "killed: the minutes are over",
        "glove_session-0-full": "not begun: data_glove_session failed (1)", "physics_strain-0-full": "done",
    }  # fmt: skip
    assert "strain-0-full: failed (1)\n  error: no luck" in done.stdout and "strain-0-half" in done.stdout
    with open(out / "index.csv") as index:
        whole = {row["shard"] for row in csv.DictReader(index)}
    assert whole == {"strain-0-half", "physics_strain-0-full"}
    assert all((out / "results" / f"{name}.csv").read_text() == name for name in whole)
    sleeper = (folder / "work" / "sleeper.txt").read_text()
    state = subprocess.run(["ps", "-o", "stat=", "-p", sleeper], text=True, capture_output=True).stdout
    assert state[:1] in ("", "Z"), "what a killed shard has started is killed, too"
    assert (folder / "site" / "probe_of_packs.py").exists()  # the package that came along
    about = json.loads((out / "run.json").read_text())
    assert about["versions"]["torch"] == importlib.metadata.version("torch") and about["machine"]

    (folder / "fate.json").write_text("{}")
    first = len(calls(folder))
    assert run(folder, out, "--minutes", "1", "--card", "no").returncode == 0
    again = {call["name"] for call in calls(folder)[first:]}
    left = {"strain-0-full", "strain-1-half", "glove_session-0-full"}
    assert again == {"strain", "glove_session", *left}
    assert jobs(out)["strain-0-half"] == "there already" and jobs(out)["strain-1-half"] == "done"
    told = json.loads((folder / "pack.json").read_text()) | {"commit": "another"}
    (folder / "pack.json").write_text(json.dumps(told))
    done = run(folder, out, "--minutes", "1", "--card", "no")
    assert done.returncode == 1 and "name another --out" in done.stderr


@pytest.mark.slow
def test_no_more_processes_than_asked_for_run_at_once(stubs, tmp_path):
    names = [f"touch_press@{seed}-{budget}" for seed in (0, 1) for budget in ("half", "full")]
    folder = stubs(*names, "strain@0-half", "strain@1-half", "strain@2-half", processes=2)
    assert run(folder, tmp_path / "out", "--minutes", "1", "--workers", "4", "--card", "no").returncode == 0
    made = calls(folder)
    busy = [sum(int(each["WORKERS"]) for each in made if each["begun"] <= one["begun"] < each["ended"]) for one in made]
    assert max(busy) == 4
    shares = {call["name"]: call["WORKERS"] for call in made}
    assert shares["touch_press"] == shares["strain"] == "2"  # each set's data on half of the processes
    assert shares["touch_press-0-half"] == "2" and shares["strain-0-half"] == "1"
    begun = {call["name"]: call["begun"] for call in made}
    ended = {call["name"]: call["ended"] for call in made}
    assert all(begun[name] > ended[name.split("-")[0]] for name in begun if "-" in name)


@pytest.mark.slow
@pytest.mark.parametrize("shared", [True, False])
def test_a_card_is_shared_where_that_works(stubs, tmp_path, shared):
    names = ["touch_press@0-half", "touch_press@1-half", "strain@0-half"]
    folder, out, tools = stubs(*names), tmp_path / "out", tmp_path / "tools"
    (folder / "torch.py").write_text(TORCH.format(code=0 if shared else 1))
    tools.mkdir()
    (tools / "nvidia-cuda-mps-control").write_text(CONTROL)
    (tools / "nvidia-cuda-mps-control").chmod(0o755)
    path, daemon = f"{tools}{os.pathsep}{os.environ['PATH']}", tmp_path / "daemon.txt"
    options = ("--minutes", "1", "--workers", "3", "--gpu-processes", "1")
    done = run(folder, out, *options, PATH=path, DAEMON=str(daemon))
    assert done.returncode == 0, done.stderr
    about = json.loads((out / "run.json").read_text())
    assert (about["card"], about["card_shared"]) == ("A card", shared)
    made = {call["name"]: call for call in calls(folder)}
    on_card = [made[f"touch_press-{seed}-half"] for seed in (0, 1)]
    assert all((each["CUDA_MPS_PIPE_DIRECTORY"] is not None) is shared for each in on_card)
    assert all(each["CUDA_VISIBLE_DEVICES"] != "" for each in on_card)
    assert all(made[name]["CUDA_VISIBLE_DEVICES"] == "" for name in ("strain-0-half", "strain", "touch_press"))
    first, second = sorted(on_card, key=lambda each: each["begun"])
    assert first["ended"] <= second["begun"]  # one process at a time was to use the card
    with pytest.raises(ProcessLookupError):
        os.kill(int(daemon.read_text()), 0)


def test_shards_that_end_at_once_are_all_in_the_index(tmp_path):
    index = tmp_path / "index.csv"

    def add(number):
        shards.upsert(index, shards.INDEX, f"strain-{number}-half", [{"shard": f"strain-{number}-half"}])

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(add, range(24)))
    assert len(pd.read_csv(index)) == 24


def lacking() -> set[str]:
    """Return the modules that are installed here and that neither a borrowed machine has nor a pack carries."""

    def known(name):
        return re.sub(r"[-_.]+", "-", name).lower()

    has, todo = set(), list(HAS)
    while todo:
        name = known(todo.pop())
        if name not in has:
            has.add(name)
            try:
                needs = importlib.metadata.requires(name) or []
            except importlib.metadata.PackageNotFoundError:
                continue
            todo += [re.match(r"[\w.-]+", each)[0] for each in needs if "extra ==" not in each]
    has |= {known(name) for name in (*pack.PACKAGES, "tactile-reproduction")}
    modules = importlib.metadata.packages_distributions()
    return {module for module, owners in modules.items() if not has & set(map(known, owners))} - {*HOUSES}


@pytest.fixture
def bare(tmp_path):
    """Return PYTHONPATH of a folder that makes Python lack what a borrowed machine lacks."""
    folder = tmp_path / "bare"
    folder.mkdir()
    lacks = lacking()
    assert {"dvc", "mlflow", "onnx", "prettytable"} <= lacks
    (folder / "sitecustomize.py").write_text(LACKING.format(lacks=lacks))
    return str(folder)


@pytest.mark.slow
def test_the_code_of_a_shard_imports_what_is_there_or_travels(bare):
    names = [f"pipeline.stages.{name}" for name in ("shard", "simulate", "keep")]
    names += [f"tactile.stages.{name}" for name in ("ingest", "window", "dataset", "train", "evaluate")]
    for room in COMPUTES:
        names += [f"{room.replace('/', '.')}.{path.stem}" for path in (ROOT / room).glob("[a-z]*.py")]
    sets = shards.read_sets(Workspace(ROOT)).values()
    names += [f"pipeline.studies.{study}" for each in sets if (study := shards.study(each))]
    code = f"import importlib\nfor name in {sorted(set(names))}:\n    importlib.import_module(name)"
    path = f"{bare}{os.pathsep}{ROOT}"
    subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": path}, check=True)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A checkout in miniature that git knows, with one small set."""
    made = Project(tmp_path_factory.mktemp("pack"))
    evidence = made.folder / "evidence"
    shutil.copy(ROOT / "evidence" / "dvc.yaml", evidence)
    sets = yaml.safe_load((evidence / "shards.yaml").read_text())
    small = {"protocols": ["task_1"], "models": ["constant", "lstm_direct"], "seeds": 1, "set": {}}
    sets["strain"] |= small
    (evidence / "shards.yaml").write_text(yaml.safe_dump(sets, sort_keys=False))
    git(made, "init", "-q")
    commit(made, "first")
    return made


def git(project, *arguments):
    identity = ["-c", "user.name=test", "-c", "user.email=test@example.org"]
    command = ["git", "-C", str(project.folder), *identity, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def commit(project, message):
    git(project, "add", "params.yaml", "params", "evidence/shards.yaml", "constraints.txt", *HOUSES)
    git(project, "commit", "-q", "--allow-empty", "-m", message)
    return git(project, "rev-parse", "HEAD")


@pytest.mark.slow
def test_only_what_is_committed_is_packed(project, tmp_path):
    project.set({"device": "cpu"})
    with pytest.raises(InputError, match="code or settings differ from the last commit"):
        packed(Workspace(project.folder), tmp_path / "there", "strain@0-half")
    git(project, "checkout", "-q", "params.yaml", "params")
    folder = packed(Workspace(project.folder), tmp_path / "there", "strain@0-half")
    told = json.loads((folder / "pack.json").read_text())
    assert told["commit"] == git(project, "rev-parse", "HEAD")


@pytest.fixture
def take(project, monkeypatch, capsys):
    """Return `take(out)`, which takes the shards of a folder into the project and returns what that prints."""
    for name, value in project.environment.items():
        if name.startswith("DVC_"):
            monkeypatch.setenv(name, value)

    def call(out):
        unpack.main(Workspace(project.folder), argparse.Namespace(folder=out))
        return capsys.readouterr().out

    return call


@pytest.mark.slow
def test_a_shard_is_packed_computed_elsewhere_and_taken_back(project, take, tmp_path, bare):
    workspace = Workspace(project.folder)
    folder, out = packed(workspace, tmp_path / "there", "strain@0-half"), tmp_path / "out"
    done = run(folder, out, "--minutes", "5", "--workers", "1", "--card", "no", PYTHONPATH=bare)
    assert done.returncode == 0, done.stdout + done.stderr
    assert {"results", "curves", "logs", "index.csv", "times.csv", "run.json"} <= {path.name for path in out.iterdir()}
    assert "strain-0-half: " in take(out)
    (line,) = pd.read_csv(project.folder / "evidence" / "index.csv").dropna(subset="shard").to_dict("records")
    assert line["commit"] == git(project, "rev-parse", "HEAD") and line["core_s"] > 0
    assert "torch" not in line["machine"]  # it is the one in constraints.txt
    rows = one_table.results(workspace, []).rows(experiment="strain", protocol="task_1", budget="half")
    rows = rows[rows["metric"] != "train_s"]
    assert set(rows["model"]) == {"lstm_direct"} and "error" in set(rows["metric"])
    assert set(pd.read_csv(project.folder / "evidence" / "times.csv")["model"]) == {"constant", "lstm_direct"}


def write_shard(folder, name, experiment, tables, protocol="study", **line):
    """Write a shard of the committed evidence as run.py leaves it, with its line of the index."""
    paths = [folder / table for table in tables]
    for path, table in zip(paths, tables, strict=True):
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "evidence" / table, path)
    _, seed, budget = name.rsplit("-", 2)
    line = {"shard": name, "experiment": experiment, "sha256": shards.digest(paths), "machine": "A card", **line}
    line |= {"protocol": protocol, "seed": seed, "budget": budget, "core_s": 7, "kept_sha256": ""}
    shards.upsert(folder / "index.csv", shards.INDEX, name, [line])


LATENT = [f"studies/strain/{name}-1.csv" for name in ("drift", "latents")]


@pytest.mark.slow
def test_what_is_taken_is_as_indexed_and_of_this_checkout(project, take, tmp_path):
    out, evidence = tmp_path / "out", project.folder / "evidence"
    head = git(project, "rev-parse", "HEAD")
    write_shard(out, "latent_strain-1-full", "strain", LATENT, commit=head, data_sha256="b" * 64)
    result = "results/glove_session-0-full.csv"
    of_glove = "+".join(f"session_{name}" for name in ("pressure", "strain", "combined"))
    write_shard(out, "glove_session-0-full", "glove", [result], of_glove, commit=head, data_sha256="c" * 64)
    files.write_text(out / "results" / "glove_session-1-half.csv", "killed before it was indexed")
    line = {"shard": "input_frames_glove-0-full", "data_sha256": "a"}
    shards.upsert(evidence / "index.csv", shards.INDEX, line["shard"], [line])
    said = take(out)
    assert "2 shards taken; 0 were there" in said
    assert "glove_session-0-full: its data differ from those of input_frames_glove-0-full" in said
    assert all((evidence / path).read_text() == (out / path).read_text() for path in LATENT)
    assert not (evidence / "results" / "glove_session-1-half.csv").exists()
    assert not {"latent_strain@1-full", "glove_session@0-full"} & set(
        json.loads(project.dvc("status", "--json", "evidence/dvc.yaml").stdout)
    )
    before = {path: path.stat().st_mtime_ns for path in evidence.rglob("*") if path.is_file()}
    assert "0 shards taken; 2 were there" in take(out)
    assert {path: path.stat().st_mtime_ns for path in evidence.rglob("*") if path.is_file()} == before

    (out / LATENT[0]).write_text("another drift")
    shards.upsert(evidence / "index.csv", shards.INDEX, "latent_strain-1-full", [])
    with pytest.raises(InputError, match="drift-1.csv: not the file that index.csv beside it tells of"):
        take(out)
    shutil.rmtree(out)
    with pytest.raises(InputError, match="no index.csv in it"):
        take(out)
    write_shard(out, "strain-9-full", "strain", ["results/strain-9-full.csv"], commit=head, data_sha256="d" * 64)
    with pytest.raises(InputError, match="evidence/shards.yaml has no shard 'strain-9-full'"):
        take(out)
    shutil.rmtree(out)
    git(project, "checkout", "-q", "-b", "side")
    elsewhere = commit(project, "elsewhere")
    git(project, "checkout", "-q", "-")
    result = "results/strain-0-full.csv"
    write_shard(out, "strain-0-full", "strain", [result], "task_1", commit=elsewhere, data_sha256="d" * 64)
    with pytest.raises(InputError, match=f"of commit {elsewhere}, from which this checkout does not come"):
        take(out)
    assert not (evidence / "results" / "strain-0-full.csv").exists()
