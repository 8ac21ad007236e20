"""Make scratch workspaces, in which the pipeline runs without touching the checkout."""

import contextlib
import importlib
import os
import shutil
import sqlite3
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import pytest
import yaml

from pipeline.results import shards
from pipeline.results.claim_inputs import FULL
from pipeline.stages import agreement, shard
from tactile.base import files, modules, params
from tactile.base.availability import why_not_run
from tactile.base.imports import HOUSES
from tactile.base.params_file import copied, set_values
from tactile.base.paths import Workspace
from tactile.base.processes import ONE_THREAD

ROOT = Path(__file__).resolve().parents[2]
CODE = sorted(path for house in HOUSES for path in (ROOT / house).rglob("*.py"))
COMMAND_LINE = "tactile.commands.command_line"
SLOW_FIXTURES = {"miniature", "tab"}  # the whole pipeline, a browser
PARTS = ("data/README.md", "data/own/README.md", "data/sources/velostat_recorded/README.md")
PARTS += ("data/sources/strain_recorded/README.md", "data/sources/glove_recorded/README.md")
PARTS += ("data/sources/array_recorded/README.md",)
PARTS += (".dvcignore", "constraints.txt", "dvc.yaml", "params", "params.yaml")
PARTS += ("reports/material", "evidence/shards.yaml")


def leaves(block: dict, path: str = "") -> Iterator[str]:
    """Yield the dotted names of all settings but those of models, which are held against the signature of `build`."""
    for key, value in block.items():
        if key in ("models", "training"):
            continue
        if isinstance(value, dict) and value:
            yield from leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}"


def miniature_settings(workspace: Workspace) -> dict:
    """Put the settings at miniature scale into a workspace and return them."""
    copied(ROOT / "params.yaml", workspace.root)
    set_values(yaml.safe_load((ROOT / "tests" / "miniature.yaml").read_text()), workspace.params)
    return params.load(workspace.params)


def small_variants(folder: Path) -> None:
    """Put the sets of the evidence into a folder, with the variants of the miniature."""
    sets = yaml.safe_load((ROOT / "evidence" / "shards.yaml").read_text())
    for name, variants in yaml.safe_load((ROOT / "tests" / "variants.yaml").read_text()).items():
        sets[name]["variants"] = variants
    (folder / "evidence").mkdir(exist_ok=True)
    (folder / "evidence" / "shards.yaml").write_text(yaml.safe_dump(sets, sort_keys=False))


def run_stage(patch: pytest.MonkeyPatch, workspace: Workspace, stage: ModuleType, *arguments: str) -> None:
    """Run a stage in this process, with the arguments of its command line."""
    patch.setattr(sys, "argv", [stage.__name__, *arguments])
    stage.main(workspace)


def in_this_process(patch: pytest.MonkeyPatch) -> None:
    """Have `own` and `shard` run stages here, where torch is there already, in place of a process each (3 s)."""

    def run(root: Path, module: str, *arguments: str, quiet: bool = False) -> None:
        with pytest.MonkeyPatch.context() as called:
            called.setattr(sys, "argv", [module, *arguments, "--root", str(root)])
            main = importlib.import_module(module).main
            main() if module == COMMAND_LINE else main(Workspace(root))

    patch.setenv("WORKERS", "1")
    patch.setattr(modules, "run", run)


class Project:
    """A workspace in `folder`, at miniature scale, with a DVC of its own; `pipeline` in it is a link to the code."""

    def __init__(self, folder: Path):
        self.folder = folder / "project"
        for part in PARTS:
            source, target = ROOT / part, self.folder / part
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.is_dir():
                shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, target)
        for house in HOUSES:
            (self.folder / house).symlink_to(ROOT / house)  # DVC hashes what is behind it
        self.environment = os.environ | {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(self.folder),
            "WORKERS": "1",  # for runs this small, starting processes costs more than it saves
            "PYTHONFAULTHANDLER": "1",
            "DVC_NO_ANALYTICS": "1",
            "DVC_GLOBAL_CONFIG_DIR": str(folder / "global"),
            "DVC_SYSTEM_CONFIG_DIR": str(folder / "system"),
            "DVC_SITE_CACHE_DIR": str(folder / "site"),
        }
        # As on most machines: a store of its own, and bytecode beside the code, which must change no stage.
        for variable in ("MLFLOW_TRACKING_URI", "PYTHONDONTWRITEBYTECODE"):
            self.environment.pop(variable, None)
        for name, columns in (("index", shards.INDEX), ("times", shards.TIMES)):  # no committed shard is so small
            shards.upsert(self.folder / "evidence" / f"{name}.csv", columns, "", [])
        (self.folder / "evidence" / "look.csv").write_text(f"{','.join(agreement.MADE)}\n")
        small_variants(self.folder)
        self.set(yaml.safe_load((ROOT / "tests" / "miniature.yaml").read_text()))
        self.dvc("init", "--no-scm", "--quiet")

    def set(self, values: dict) -> None:
        """Change dotted keys of the settings."""
        set_values(values, self.folder / "params.yaml")

    def dvc(self, *arguments: str, check: bool = True) -> subprocess.CompletedProcess:
        """Run dvc in the copy; with `check`, a failure shows what it printed."""
        return self.run("-m", "dvc", *arguments, check=check)

    def stages(self, *lines: str) -> float:
        """Run stages (`tactile.stages.train touch`) in turn in one Python, which imports torch once for all of them.

        Return the processor time of that Python and its children in seconds. The time of all children of this process
        would count the miniature, too, where it ends meanwhile.
        """
        each = "    sys.argv = line.split()\n    runpy.run_module(sys.argv[0], run_name='__main__')"
        code = f"import os, runpy, sys\nfor line in sys.argv[1:]:\n{each}\nprint(sum(os.times()[:4]))"
        return float(self.run("-c", code, *lines).stdout.split()[-1])

    def run(self, *arguments: str, check: bool = True) -> subprocess.CompletedProcess:
        """Run this Python in the copy; with `check`, a failure shows what it printed, or the signal that ended it."""
        done = subprocess.run(
            [sys.executable, *arguments], cwd=self.folder, env=self.environment, capture_output=True, text=True
        )
        said = f"status {done.returncode} of {arguments}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}"
        assert not check or done.returncode == 0, said
        return done


def copy_project(project: "Project", folder: Path) -> "Project":
    """Return a copy of a project that ran, with its own copy of the code, without its MLflow store.

    The other process of tests may run a stage in the original meanwhile: a file that is removed before its turn comes
    (of the cache, under a passing name) is left out, and so are DVC's locks.
    """

    def copy_if_there(source: str, target: str) -> None:
        with contextlib.suppress(FileNotFoundError):
            shutil.copy2(source, target)

    copy = Project.__new__(Project)
    copy.folder = folder / "project"
    passing = shutil.ignore_patterns("tmp", "mlruns", "mlflow.db*")
    shutil.copytree(project.folder, copy.folder, symlinks=True, ignore=passing, copy_function=copy_if_there)
    copy_code(copy.folder)
    copy.environment = project.environment | {"PYTHONPATH": str(copy.folder)}
    return copy


def copy_code(folder: Path) -> None:
    """Put a copy of the code in the place of the link to it: for a test that changes the code."""
    for house in HOUSES:
        (folder / house).unlink()
        shutil.copytree(ROOT / house, folder / house, ignore=shutil.ignore_patterns("__pycache__"))


# Two halves of the pipeline that share no stage but that of SHARED: run side by side, they take half as long.
SHARED = ("ingest_recorded@velostat_recorded", "count")  # of seconds
HALVES = (
    ["claim_inputs@touch", "latency@touch", "latency@velostat_recorded", "latency@strain_recorded"]
    + ["latency@array_recorded", "stress@array_recorded"]
    + ["keep@touch", "stress@touch", "stress@velostat_recorded", "stress@strain_recorded"],
    ["claim_inputs@strain", "claim_inputs@glove", "latency@strain", "latency@glove", "latency@glove_recorded"]
    + ["keep@strain", "keep@glove", "stress@strain", "stress@glove", "stress@glove_recorded"],
)


def run_miniature(folder: Path) -> Project:
    """Run the whole pipeline once in `folder`, at miniature scale, and return the project.

    `folder`/opened tells which files each stage opened, `folder`/settings.txt which settings were read.
    """
    project = Project(folder)
    quiet = project.environment
    with warm_python(folder) as warm:
        project.environment = noting_opened(project) | warm
        project.dvc("repro", *SHARED)
        with ThreadPoolExecutor() as pool:
            list(pool.map(lambda targets: run_half(project, targets), HALVES))
        run_studies(project)
        project.dvc("repro")
    project.environment = quiet
    return project


@contextlib.contextmanager
def warm_python(folder: Path) -> Iterator[dict[str, str]]:
    """Yield the environment in which the `python` of a shell is a fork of a process that has imported the libraries.

    That the numbers are those of processes started one by one: test_same_hashes_after_a_kill_and_from_scratch.
    """
    made = tempfile.mkdtemp(prefix="warm")  # short: a socket's path has 107 characters at most
    address, code = f"{made}/socket", ROOT / "tests" / "warm"
    started = subprocess.Popen(
        [sys.executable, "-P", str(code / "server.py"), address],
        env=os.environ | ONE_THREAD,
        cwd=folder,
        stdin=subprocess.PIPE,
    )
    try:
        while not Path(address).exists():
            assert started.poll() is None, "tests/warm/server.py did not start"
            time.sleep(0.05)
        path = f"{code}{os.pathsep}{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        yield {"PATH": path, "WARM_SOCKET": address, "WARM_PYTHON": sys.executable}
    finally:
        started.stdin.close()
        started.wait()
        shutil.rmtree(made)


def indexed(workspace: Workspace, name: str, experiment: str, seed: int, kept: Path, protocol: str = "") -> None:
    """Put the line of a shard, whose file is there, into the index."""
    line = dict.fromkeys(shards.INDEX, "") | {"shard": name, "experiment": experiment, "seed": seed}
    line |= {"sha256": files.sha256(kept), "protocol": protocol, "core_s": 1, "machine": "a core"}
    shards.upsert(shards.folder(workspace) / "index.csv", shards.INDEX, name, [line])


SETS = ("touch_press", "strain", "glove_session")  # of the evidence, whose shard is what the miniature has trained


def run_studies(project: Project) -> None:
    """Compute all studies and variants of the evidence with two seeds, on the data and models of the miniature.

    What the stages have trained, scored and put under stress is kept as the shards of SETS, too.
    """
    workspace = Workspace(project.folder)
    sets = shards.read_sets(workspace)
    computed = {(study, each.experiment): name for name, each in sets.items() if (study := shards.study(each))}
    for seed in (0, 1):
        asked = [place for place in sorted(computed) if seed < sets[computed[place]].seeds]
        asked = [(study, one) for study, one in asked if study == "latency" or why_not_run(workspace, one) is None]
        project.stages(*(f"pipeline.studies.{study} {experiment} {seed}" for study, experiment in asked))
        for experiment in ("touch", "strain", "glove"):
            for table in workspace.study_result(experiment, "any").parent.glob("*.csv"):
                name = f"{computed.get((table.stem, experiment), f'{table.stem}_{experiment}')}-{seed}-full"
                varied = table.stem == shards.VARIANTS
                kept = shards.study_file(workspace, experiment, table.stem, seed)
                kept = shards.result_file(workspace, name) if varied else kept
                kept.parent.mkdir(parents=True, exist_ok=True)
                table.rename(kept)
                indexed(workspace, name, experiment, seed, kept, "" if varied else shards.STUDY)
    values = params.read(workspace.params)
    for name in SETS:
        of_look = workspace.stress(sets[name].experiment)
        tried = of_look.read_bytes()
        project.stages(f"pipeline.stages.stress {sets[name].experiment}")
        shard.write(workspace, workspace, shards.Shard(name, 0, FULL), sets[name], values, 1.0)
        of_look.write_bytes(tried)


# Prints the stages that the targets need, one per line, in an order in which they can run. In a process of its own:
# DVC's reading of dvc.yaml is not made for threads.
STEPS = """
import sys
from dvc.repo import Repo
from dvc.repo.reproduce import collect_stages, get_active_graph, plan_repro
with Repo() as repo:
    for stage in plan_repro(get_active_graph(repo.index.graph), collect_stages(repo, sys.argv[1:])):
        print(stage.name)
"""


def run_half(project: Project, targets: list[str]) -> None:
    """Run the stages that the targets need, one by one beside another DVC in the same project.

    SHARED is left out: DVC would look whether it is up to date, and stops where it may not, because the other DVC
    runs a stage that depends on it.
    """
    names = project.run("-c", STEPS, *targets).stdout.split()
    project.dvc("--wait-for-lock", "repro", "--single-item", *(name for name in names if name not in SHARED))


def noting_opened(project: Project) -> dict[str, str]:
    """Return the environment in which the stages of a project note which files they open and which settings they read.

    See opened/sitecustomize.py and opened/noted.py.
    """
    notes = project.folder.parent / "opened"
    notes.mkdir()
    path = f"{ROOT / 'tests' / 'opened'}{os.pathsep}{project.environment['PYTHONPATH']}"
    settings = str(project.folder.parent / "settings.txt")
    return project.environment | {"OPENED": str(notes), "SETTINGS_READ": settings, "PYTHONPATH": path}


def lock(project) -> dict:
    """Return the hash of every output in dvc.lock, without measured times and the verdicts that follow from them."""
    stages = yaml.safe_load((project.folder / "dvc.lock").read_text())["stages"]
    outs = {out["path"]: out["md5"] for stage in stages.values() for out in stage.get("outs", [])}
    measured = ("latency", "speed", "claims", "index.html", "appendix.html")
    return {path: value for path, value in outs.items() if not any(word in path for word in measured)}


def mlflow_runs(project) -> list[tuple]:
    """Return (experiment, protocol, model, seed) of every complete run in the MLflow store."""
    with sqlite3.connect(project.folder / "mlflow.db") as store:
        rows = store.execute(
            "select run_uuid, key, value from tags join runs using (run_uuid) "
            "where lifecycle_stage = 'active' and status = 'FINISHED'"
        ).fetchall()
    runs: dict = {}
    for run, key, value in rows:
        runs.setdefault(run, {})[key] = value
    looks = [r for r in runs.values() if "seed" in r]  # a run of the evidence is of all its seeds
    return sorted((r["experiment"], r["protocol"], r["model"], int(r["seed"])) for r in looks)
