"""A scratch copy of the project in which the pipeline can run without touching the checkout."""

import functools
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import yaml

from pipeline import sources

ROOT = Path(__file__).resolve().parent.parent
PARTS = ("pipeline", "data/README.md", "data/own/README.md", "data/sources/velostat_recorded/README.md")
PARTS += ("data/sources/strain_recorded/README.md", "data/sources/glove_recorded/README.md")
PARTS += (".dvcignore", "constraints.txt", "dvc.yaml", "params.yaml", "scales")


def leaves(block: dict, path: str = "") -> Iterator[str]:
    """Dotted names of all settings but those of models, which are held against the signature of `build`."""
    for key, value in block.items():
        if key in ("models", "training"):
            continue
        if isinstance(value, dict) and value:
            yield from leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}"


class Project:
    """A copy of the project in `folder`, at miniature scale, with a DVC of its own."""

    def __init__(self, folder: Path):
        self.folder = folder / "project"
        for part in PARTS:
            source, target = ROOT / part, self.folder / part
            target.parent.mkdir(parents=True, exist_ok=True)
            if source.is_dir():
                shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, target)
        self.environment = os.environ | {
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(self.folder),
            "WORKERS": "1",  # for runs this small, starting processes costs more than it saves
            "DVC_NO_ANALYTICS": "1",
            "DVC_GLOBAL_CONFIG_DIR": str(folder / "global"),
            "DVC_SYSTEM_CONFIG_DIR": str(folder / "system"),
            "DVC_SITE_CACHE_DIR": str(folder / "site"),
        }
        # As on most machines: a store of its own, and bytecode beside the code, which must change no stage.
        for variable in ("MLFLOW_TRACKING_URI", "PYTHONDONTWRITEBYTECODE"):
            self.environment.pop(variable, None)
        self.set(yaml.safe_load((ROOT / "tests" / "miniature.yaml").read_text()))
        self.dvc("init", "--no-scm", "--quiet")

    def set(self, values: dict) -> None:
        """Change dotted keys of params.yaml."""
        from pipeline.scale import set_values

        set_values(values, self.folder / "params.yaml")

    def dvc(self, *arguments: str, check: bool = True) -> subprocess.CompletedProcess:
        """Run dvc in the copy; with `check`, a failure shows what it printed."""
        return self.run("-m", "dvc", *arguments, check=check)

    def stages(self, *lines: str) -> None:
        """Run stages (`train touch lomp`) in turn in one Python, which imports torch once, not for each of them."""
        each = "    sys.argv = line.split()\n    runpy.run_module('pipeline.' + sys.argv[0], run_name='__main__')"
        self.run("-c", f"import runpy, sys\nfor line in sys.argv[1:]:\n{each}", *lines)

    def run(self, *arguments: str, check: bool = True) -> subprocess.CompletedProcess:
        """Run this Python in the copy; with `check`, a failure shows what it printed."""
        done = subprocess.run(
            [sys.executable, *arguments], cwd=self.folder, env=self.environment, capture_output=True, text=True
        )
        assert not check or done.returncode == 0, f"{arguments}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}"
        return done


# Two halves of the pipeline that share no stage but `settings`: run side by side, they take half as long.
HALVES = (
    ["render@touch", "render@velostat_recorded", "render@strain_recorded", "rightsize_touch", "stress@touch"]
    + ["stress@velostat_recorded", "stress@strain_recorded", "physics_touch", "physics_strain"],
    ["render_strain", "render_glove", "render_glove_recorded", "rightsize_strain", "rightsize_glove", "stress@strain"]
    + ["stress@glove", "stress@glove_recorded", "physics_glove"],
)


def run_miniature(folder: Path) -> Project:
    """The whole pipeline, run once in `folder` at miniature scale.

    `folder`/opened tells what each stage opened, `folder`/settings.txt which settings were read.
    """
    project = Project(folder)
    quiet = project.environment
    project.environment = noting_opened(project)
    project.dvc("repro", "settings")  # which both halves need, and which takes seconds
    with ThreadPoolExecutor() as pool:
        list(pool.map(lambda targets: run_half(project, targets), HALVES))
    project.dvc("repro")
    project.environment = quiet
    return project


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

    `settings` is left out: DVC would look whether it is up to date, and stops where it may not, because the other DVC
    trains a model that depends on it.
    """
    names = project.run("-c", STEPS, *targets).stdout.split()
    project.dvc("--wait-for-lock", "repro", "--single-item", *(name for name in names if name != "settings"))


def noting_opened(project: Project) -> dict[str, str]:
    """The environment in which the stages of a project note what they open and which settings they read.

    See opened/sitecustomize.py and opened/noted.py.
    """
    notes = project.folder.parent / "opened"
    notes.mkdir()
    path = f"{ROOT / 'tests' / 'opened'}{os.pathsep}{project.environment['PYTHONPATH']}"
    settings = str(project.folder.parent / "settings.txt")
    return project.environment | {"OPENED": str(notes), "SETTINGS_READ": settings, "PYTHONPATH": path}


@pytest.fixture(scope="session", autouse=True)
def miniature_under_way(request, tmp_path_factory):
    """Starts the miniature before the first test, where a test of this session needs it: it takes three minutes."""
    with ThreadPoolExecutor() as pool:
        wanted = any("miniature" in item.fixturenames for item in request.session.items)
        yield pool.submit(run_miniature, tmp_path_factory.mktemp("miniature")) if wanted else None


@pytest.fixture(scope="session")
def miniature(miniature_under_way) -> Project:
    """The whole pipeline, run once at miniature scale with `dvc repro`."""
    return miniature_under_way.result()


@pytest.fixture(scope="session")
def recordings(tmp_path_factory):
    """`recordings(source)`: the folder of a source's recordings, laid out as `fetch` does it; a skip without them.

    They are looked for where `fetch` puts them, and in <TACTILE_RECORDINGS>/<source>, there also side by side without
    their folders. A folder that holds some but not all of them as they should be is an error, never a skip.
    """

    def find(name: str) -> Path:
        listed, elsewhere = sources.files(name), os.environ.get("TACTILE_RECORDINGS")
        for folder in [sources.folder(name), *([Path(elsewhere) / name] if elsewhere else [])]:
            places = {path: (folder / path, folder / Path(path).name) for path in listed}
            present = {path: next(filter(Path.is_file, two), None) for path, two in places.items()}
            if not any(present.values()):
                continue
            wrong = [path for path, file in present.items() if file is None or sources.sha256(file) != listed[path]]
            assert not wrong, (
                f"{folder}: {len(wrong)} of {len(listed)} recordings are missing or changed, as {wrong[0]}"
            )
            linked = tmp_path_factory.mktemp(name)
            for path, file in present.items():
                (linked / path).parent.mkdir(parents=True, exist_ok=True)
                (linked / path).symlink_to(file.resolve())
            return linked
        pytest.skip(f"recordings not here: run `python -m pipeline.fetch {name}` or set TACTILE_RECORDINGS")

    return functools.cache(find)
