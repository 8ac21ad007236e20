"""Rules about the code itself: which room imports which, and what DVC watches."""

import ast
import functools
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from graphlib import TopologicalSorter
from pathlib import PurePath
from typing import NamedTuple

import pytest
import yaml
from builders.project import ROOT, SLOW_FIXTURES
from dvc.dependency.param import ParamsDependency
from dvc.repo import Repo

from benchmarks import mutation
from pipeline.results import shards
from tactile.base import imports as import_finder
from tactile.base import params
from tactile.base.imports import DOORS, HOUSES, NO_NUMBER, closure, imported_names, room
from tactile.base.paths import Workspace
from tactile.stages import train

CODE = sorted(path.relative_to(ROOT).as_posix() for house in HOUSES for path in (ROOT / house).rglob("*.py"))
CODE = [file for file in CODE if file not in {f"{house}/__init__.py" for house in HOUSES}]
# Each room, from the top down, and the rooms that it imports. It may also import whatever these import, and itself.
TOOL = {  # tactile/, what anyone installs; it knows nothing of the reproduction
    "commands": {"live", "own", "sheet/page"},
    "own": {"inference", "sheet", "stages"},  # sensors of your own: their settings, what their logs need, their report
    "live": {"inference", "targets"},
    "inference": {"drawing", "tasks"},
    "targets": {"drawing", "learning", "sheet"},  # any number, class or event that logs tell
    "stages": {"tasks"},  # of the pipeline, and of logs of your own
    "tasks": {"models", "experiments", "scoring"},
    "models": {"learning"},
    "learning": {"datasets"},
    "sheet/page": {"drawing", "sheet"},
    "sheet": {"experiments"},
    "drawing": {"scoring"},  # what people read of sensors and of papers: style, tables, the names of models
    "scoring": {"experiments"},
    "experiments": {"logs"},
    "logs": {"datasets"},
    "datasets": {"base"},
    "base": {"settings"},
    "settings": set(),  # pydantic classes; of a model's file it reads the class of its settings, and imports nothing
}
REPRODUCTION = {  # pipeline/, three papers re-run; what it takes of the tool is below each
    "commands": {"reporting", "tracking"},
    "stages": {"reporting/page", "stability", "tracking", "twins"},
    "studies": {"results", "stability"},
    "tracking": {"results"},
    "stability": {"scenes"},
    "twins": {"scenes"},
    "reporting/page": {"reporting"},
    "reporting": {"claims", "reporting/figures"},
    "reporting/figures": {"claims", "scenes"},
    "claims": {"results"},  # the only place that judges: claims, effects of scenes, sizes, stability
    "results": set(),  # the one table: shards, what the papers print, what is shown
    "scenes": set(),
}
OF_THE_TOOL = {
    "commands": {"commands"},
    "stages": {"own", "stages"},
    "tracking": {"inference"},
    "stability": {"tasks"},
    "twins": {"sheet"},
    "reporting/figures": {"drawing"},
    "results": {"scoring"},
    "scenes": {"datasets"},
}
ARROWS = {f"tactile/{name}": {f"tactile/{other}" for other in others} for name, others in TOOL.items()}
ARROWS |= {
    f"pipeline/{name}": {f"pipeline/{other}" for other in others} | {f"tactile/{x}" for x in OF_THE_TOOL.get(name, ())}
    for name, others in REPRODUCTION.items()
}
BY_NAME = {f"{name}/__init__.py" for name in DOORS}
BY_NAME |= {"tactile/base/cluster.py", "tactile/commands/command_line.py"}  # a task's function, a command
RUN = 'if __name__ == "__main__":'
VALUES = params.load(ROOT / "params.yaml")
SETS = shards.read_sets(Workspace(ROOT))
imports = functools.cache(import_finder.imports)


@pytest.fixture(scope="module", autouse=True)
def unchanging_code():
    """Parse each file once: 300 stages come to the same ones."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(import_finder, "imports", imports)
        yield


def reachable(name: str) -> set[str]:
    """Return a room and all rooms that ARROWS lead to from it."""
    return {name}.union(*(reachable(lower) for lower in ARROWS[name]))


def test_every_room_has_its_place():
    assert {room(file) for file in CODE} == set(ARROWS)
    list(TopologicalSorter(ARROWS).static_order())  # CycleError where two rooms import each other


def test_no_file_imports_another_that_imports_it():
    """A room's __init__ does not count, which Python runs before every file of the room."""
    needs = {file: {other for other in imports(file) if other != f"{room(file)}/__init__.py"} for file in CODE}
    list(TopologicalSorter(needs).static_order())  # CycleError names those of a circle


def test_imports_point_one_way():
    wrong = [
        f"{file} imports {other}"
        for file in CODE
        for other in sorted(imports(file))
        if room(other) not in reachable(room(file))
    ]
    assert not wrong, "\n".join(wrong)


def test_nobody_imports_a_file_that_is_run():
    run = {file for file in CODE if RUN in (ROOT / file).read_text()}
    wrong = [f"{file} imports {other}" for file in CODE for other in sorted(imports(file) & run)]
    assert run and not wrong, "\n".join(wrong)


def imports_by_name(file: str) -> Iterator[tuple[str, bool]]:
    """Yield (line, whether the name is written out) of every import by name in a file."""
    for node in ast.walk(ast.parse((ROOT / file).read_text())):
        if isinstance(node, ast.Call):
            called = getattr(node.func, "attr", getattr(node.func, "id", ""))
            if called in ("import_module", "__import__"):
                constant = called == "__import__" or not node.args or isinstance(node.args[0], ast.Constant)
                yield f"{file}, line {node.lineno}", constant


def test_only_names_from_settings_are_imported_by_name():
    found = [(file, *each) for file in CODE for each in imports_by_name(file)]
    for file, where, constant in found:
        assert file in BY_NAME, f"{where}: import the module by name in {sorted(BY_NAME)} only"
        assert not constant, f"{where}: write `from pipeline.<room> import <module>`"
    assert {file for file, *_ in found} == BY_NAME


def test_reporting_does_not_reach_torch():
    for file in CODE:
        if room(file).startswith("pipeline/reporting"):
            for other in closure(file):
                packages = {step for name in imported_names(other) for step in name.split(".")}
                assert "torch" not in packages, f"{file} comes to {other}, which imports torch"


WITH_NETWORKS = {"tactile/models", "tactile/learning", "tactile/inference", "tactile/live", "pipeline/studies"}
WITH_NETWORKS |= {"pipeline/tracking"}  # rooms whose files may import torch at once
WITHOUT_TORCH = """
import importlib, sys
import pytest
assert pytest.main(["-q", "-p", "no:cacheprovider", sys.argv[1]]) == 0
for name in ["conftest", *sys.argv[2:]]:
    importlib.import_module(name)
    assert "torch" not in sys.modules, name + " imports torch"
"""


def test_torch_is_imported_where_a_network_is_used():
    """It takes 5 s of a core: no command and no file of tests waits for it that computes with none."""
    names = [file[:-3].replace("/", ".") for file in CODE if room(file) not in WITH_NETWORKS]
    command = [sys.executable, "-c", WITHOUT_TORCH, "tests/base/test_provenance.py", *names]
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}", "PYTEST_ADDOPTS": "-n 0"}
    for variable in [name for name in environment if name.startswith("PYTEST_XDIST")]:
        del environment[variable]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0 and len(names) > 100, (done.stdout + done.stderr)[-1000:]


class Entry(NamedTuple):
    """One stage of DVC: an entry of dvc.yaml, or one experiment of it."""

    name: str
    command: list[str]  # python, -m, module, arguments
    deps: set[str]
    params: list[str]
    always_runs: bool


@pytest.fixture(scope="module")
def entries() -> list[Entry]:
    """Return every stage of dvc.yaml, as DVC fills it in."""
    return list(stage_entries())


def stage_entries() -> Iterator[Entry]:
    """Yield them."""
    with Repo(str(ROOT)) as repo:
        for stage in repo.index.stages:
            read = [dep for dep in stage.deps if isinstance(dep, ParamsDependency) and "shards" not in dep.def_path]
            settings = [name for dep in read for name in dep.params]
            deps = {dep.def_path for dep in stage.deps if not isinstance(dep, ParamsDependency)}
            first, *then = [stage.cmd] if isinstance(stage.cmd, str) else stage.cmd
            for further in then:
                yield Entry(stage.name, further.split(), deps, settings, stage.always_changed)
            python, option, module, *given = first.split()
            if module == "pipeline.stages.shard":
                computed = SETS[given[0]]
                given[0] = computed.experiment
                if study := shards.study(computed):  # the shard runs it
                    command = [python, option, f"pipeline.studies.{study}", *given]
                    yield Entry(f"{stage.name} study", command, deps, settings, False)
            yield Entry(stage.name, [python, option, module, *given], deps, settings, stage.always_changed)


def at(values, dotted: str):
    """Return the setting with a dotted name."""
    for key in dotted.split("."):
        values = values[key]
    return values


def models_of(names: Iterable[str]) -> set[str]:
    """Return the models whose settings are among the settings with these dotted names."""
    found = set()
    for name in names:
        keys, value = name.split("."), at(VALUES, name)
        if "models" in keys:
            chosen = keys[keys.index("models") + 1 :][:1] or value
        else:
            chosen = value.get("models", ()) if isinstance(value, Mapping) else ()
        found |= set(chosen)
    return found


def kind_of(experiment: str) -> str:
    """Return the kind of input that an experiment's models see, as its file says."""
    said = re.search(r'^KIND = "(\w+)"$', (ROOT / f"tactile/experiments/{experiment}.py").read_text(), re.MULTILINE)
    return said[1] if said else ""


def files_behind_doors(entry: Entry) -> dict[str, list[str]]:
    """Return the files of DOORS that a stage comes to: those of its experiments and of the models that it names."""
    known = VALUES["experiments"]
    experiments = [word for word in entry.command[3:4] if word in known] or known
    names = {
        "tactile/experiments": experiments,
        "tactile/models": models_of(entry.params) or models_of(f"{experiment}.models" for experiment in experiments),
        "pipeline/scenes": experiments,
        "tactile/tasks": {kind_of(experiment) for experiment in experiments},
    }
    files = {folder: [f"{folder}/{name}.py" for name in own] for folder, own in names.items()}
    return {folder: [file for file in own if file in CODE] for folder, own in files.items()}


# Files of `tasks` and `experiments` have functions for several stages. These are what the others of them import.
READ_LOGS = {"tactile.stages.ingest", "pipeline.stages.stress", "pipeline.studies.physics"}
SCORE_NOTHING = {"tactile.stages.dataset", "tactile.stages.train", "pipeline.stages.latency"}


def unused_by(entry: Entry) -> set[tuple[str, str]]:
    """Return the pairs of rooms of which a stage runs nothing that the first imports from the second."""
    module, *arguments = entry.command[2:]
    unused = set() if module in READ_LOGS else {("tactile/experiments", "tactile/logs")}
    unused |= {("tactile/tasks", "tactile/scoring")} if module in SCORE_NOTHING else set()
    if module == "tactile.stages.dataset":
        unused |= {("tactile/tasks", "tactile/models"), ("tactile/tasks", "tactile/learning")}
    if module == "tactile.stages.train" and kind_of(arguments[0]) != "series":  # of its file only KIND is read
        unused |= {("tactile/tasks", "tactile/experiments")}
    return unused


def test_dvc_watches_what_a_stage_imports(entries):
    wrong = []
    for entry in entries:
        if entry.always_runs:
            continue  # whatever changed
        needed = closure(f"{entry.command[2].replace('.', '/')}.py", files_behind_doors(entry), unused_by(entry))
        missing = {
            file
            for file in needed
            if room(file) not in NO_NUMBER and not any(file == dep or file.startswith(f"{dep}/") for dep in entry.deps)
        }
        wrong += [f"{entry.name}: add to deps {sorted(missing)}"] if missing else []
    assert len(entries) > 100 and not wrong, "\n".join(wrong)


def test_dvc_watches_code_that_is_there_and_can_change_a_number(entries):
    for name, dep in ((entry.name, dep) for entry in entries for dep in entry.deps):
        assert not dep.startswith(("pipeline/", "tactile/")) or (ROOT / dep).exists(), f"{name}: {dep} does not exist"
        assert not dep.startswith(("tactile/base", "tactile/settings")), f"{name}: {dep} can change no number"


@pytest.mark.parametrize("experiment", VALUES["experiments"])
def test_a_model_is_made_from_what_dvc_watches_for_its_stage(experiment, entries):
    """A change for which DVC runs the stage must train some model again; one for which it does not run, none."""
    (entry,) = (entry for entry in entries if entry.name == f"train@{experiment}")
    needed = closure("tactile/stages/train.py", files_behind_doors(entry), unused_by(entry))
    code = {file for model in VALUES[experiment]["models"] for file in train.code(experiment, model)}
    assert code == {file for file in needed if room(file) not in NO_NUMBER}
    read = {f"{experiment}.{key}" for key in ["models", *train.read_settings(VALUES, experiment)]}
    assert set(entry.params) == {"device", *read}
    assert "tactile/learning/lomp_network.py" in train.code("touch", "lomp")


OF_MODELS = "claim_inputs|kept|latency|models|predictions|scores|speed|stress"
MEASURED_HERE = re.compile(rf"data/(?!own/|sources/)\w+/({OF_MODELS})|reports/look")
OF_DATA = {"render_twins"}  # it compares scenes with recordings, and shows no model


def test_what_is_committed_of_reports_is_made_of_nothing_that_was_trained_or_measured_here():
    """Directly or by another stage; the look is ignored by git, and what follows from it has no outputs."""
    committed = {}
    with Repo(str(ROOT)) as repo:
        made = {out.def_path: stage for stage in repo.index.stages for out in stage.outs}
        for stage in repo.index.stages:
            paths = [out.def_path for out in stage.outs]
            if any(path.startswith("reports/") and not path.startswith("reports/look/") for path in paths):
                committed[stage.name] = all_deps(stage, made)
    assert len(committed) > 8 and OF_DATA < set(committed)
    reads = [(name, dep) for name, deps in committed.items() for dep in sorted(deps)]
    wrong = [f"{name} reads {dep}" for name, dep in reads if MEASURED_HERE.match(dep)]
    assert not wrong, "\n".join(wrong)
    of_data = {name for name, deps in committed.items() if any(dep.startswith("data/") for dep in deps)}
    assert of_data == OF_DATA | {"page", "metrics"}, "by reports/twins alone"
    assert MEASURED_HERE.match("data/touch/speed") and MEASURED_HERE.match("data/strain/scores.csv")
    assert "/reports/look/" in (ROOT / ".gitignore").read_text().split()


def all_deps(stage, made: Mapping) -> set[str]:
    """Return what a stage reads, and what that is made of; made: path -> the stage that writes it."""
    found, left = set(), [stage]
    while left:
        deps = {dep.def_path for dep in left.pop().deps if not isinstance(dep, ParamsDependency)} - found
        found |= deps
        inside = lambda out, dep: out == dep or out.startswith(f"{dep}/") or dep.startswith(f"{out}/")  # noqa: E731
        left += [other for out, other in made.items() if any(inside(out, dep) for dep in deps)]
    return found


def test_dvc_yaml_is_a_table_of_contents():
    text = (ROOT / "dvc.yaml").read_text()
    assert len(text.splitlines()) <= 330
    for name, entry in yaml.safe_load(text)["stages"].items():
        desc = entry.get("do", entry).get("desc")
        assert desc and "\n" not in desc, f"{name}: say in one line what it does (desc)"


def test_dvc_lock_has_no_stage_that_dvc_yaml_has_not(entries):
    """DVC never removes one, and reads and writes the whole file after every stage."""
    recorded = yaml.safe_load((ROOT / "dvc.lock").read_text())["stages"]
    dead = sorted(set(recorded) - {entry.name for entry in entries})
    assert not dead, f"take out of dvc.lock: {', '.join(dead)}"


def test_every_model_block_fits_its_build():
    from tactile import models
    from tactile.learning.spec import Spec
    from tactile.tasks import windows

    blocks = [(experiment, VALUES[experiment]["models"]) for experiment in VALUES["experiments"]]
    blocks += [(experiment, block["models"]) for experiment, block in VALUES["physics"].items()]
    for experiment, listed in blocks:
        kind = kind_of(experiment)
        spec = {"series": Spec(20, 1, 6, 1, 2), "images": Spec(1, 32, 32, 1, 16)}.get(kind)
        for model, block in listed.items():
            models.build(model, spec or windows.spec(VALUES[experiment]), block, f"{experiment}.models.{model}")


def test_links_of_documents_lead_somewhere():
    for document in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")):
        text = document.read_text()
        for target in re.findall(r"\]\(([^)\s]+)\)", text):
            if re.match(r"https?:", target):
                continue
            name, _, anchor = target.partition("#")
            place = document.parent / name if name else document
            assert place.exists(), f"{document.name}: {target}"
            if anchor:
                content = place.read_text()
                heads = re.findall(r"^#+ (.*)$", content, re.MULTILINE)
                known = {re.sub(r"[^\w -]", "", head.lower()).replace(" ", "-") for head in heads}
                known |= set(re.findall(r' id="([\w-]+)"', content)) if place.suffix == ".html" else set()
                assert anchor in known, f"{document.name}: {target}"


def test_files_that_documents_name_are_there():
    texts = [(ROOT / "README.md").read_text(), *(path.read_text() for path in (ROOT / "docs").glob("*.md"))]
    places = re.findall(r"`((?:pipeline|tactile)/[^`\s]+)`", "\n".join(texts))
    assert len(places) > 20
    for place in places:
        before, names, after = re.fullmatch(r"([^{]*)(?:\{(.*)\}(.*))?", place).groups("")
        for name in names.split(","):  # <experiment> and the like stand for any
            wanted = re.sub(r"<\w+>", "*", f"{before}{name}{after}")
            assert any(ROOT.glob(wanted)), f"a document names {wanted}, which is not there"


def test_an_import_by_name_is_not_a_constant_in_disguise():
    """What is known when the code is written is imported where imports stand."""
    by_name = re.compile(r"""(?:experiments\.module|tasks\.of|scenes\.plan|models\.build)\(\s*f?["']""")
    wrong = [file for file in CODE if by_name.search((ROOT / file).read_text())]
    assert not wrong, wrong


def test_functions_that_get_faults_and_their_tests_are_there():
    found = list(mutation.chosen())
    for file, names, tests in found:
        tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
        assert all(mutation.places(tree, file, name) for name in names)  # else it says which
        assert all((ROOT / "tests" / test).exists() for test in tests.split()), tests
    for pattern, (names, tests) in mutation.CHOSEN.items():
        known = {name for file, each, of in found if of == tests and PurePath(file).match(pattern) for name in each}
        assert known == set(names.split()), pattern


TRAINS = {"test_adding.py", "test_contract_of_models.py"}  # files of tests/general that train or run stages


@pytest.mark.parametrize(
    "file",
    [file for file in sorted((ROOT / "tests" / "general").glob("*.py")) if file.name not in TRAINS],
    ids=lambda file: file.name,
)
def test_what_shows_that_parts_agree_is_among_the_fast_tests(file):
    tree = ast.parse(file.read_text(encoding="utf-8"))
    slow = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute) and node.attr == "slow"]
    used = {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    used |= {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
    assert not slow and not used & SLOW_FIXTURES, file.name


def test_no_two_files_of_tests_have_one_name():
    """Pytest imports each by its name alone, and runs one of two: which one it was is seen in a fresh clone."""
    names = [file.name for file in (ROOT / "tests").rglob("test_*.py")]
    assert len(names) == len(set(names))


@pytest.mark.slow
def test_a_room_that_mypy_lets_through_has_faults(tmp_path):
    """A room without faults leaves the list of pyproject.toml, and one that is not on the list has none."""
    written, unlisted = (ROOT / "pyproject.toml").read_text(encoding="utf-8"), tmp_path / "pyproject.toml"
    *_, let_through = tomllib.loads(written)["tool"]["mypy"]["overrides"]
    unlisted.write_text(written.replace("ignore_errors = true\n", ""), encoding="utf-8")
    command = [sys.executable, "-m", "mypy", "--config-file", unlisted, "--cache-dir", os.devnull]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout
    faulty = {".".join(PurePath(line.partition(":")[0]).parts[:2]) for line in said.splitlines() if ": error: " in line}
    assert {f"{room}.*" for room in faulty} == set(let_through["module"]), said[-3000:]
