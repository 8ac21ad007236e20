"""What every member of a family provides: experiments, kinds of input, scenes, twins, studies, stages and reports.

Members are not listed here: the files of their folders are, and params.yaml. Models: test_contract_of_models.py.
"""

import ast
import copy
import importlib
import itertools

import numpy as np
import pyarrow as pa
import pytest
import yaml
from builders import array_contacts
from builders.project import ROOT

from pipeline import scenes
from pipeline.reporting import studies
from pipeline.results import shards
from pipeline.results.times import LATENCY
from pipeline.stages import render, twins
from tactile import experiments, tasks
from tactile.base import params, paths, workers
from tactile.base.paths import Workspace
from tactile.datasets import schemas

VALUES = params.load(ROOT / "params.yaml")
NAMES = sorted(path.stem for path in paths.EXPERIMENTS.glob("*.py") if path.stem != "__init__")


@pytest.mark.parametrize("name", NAMES)
def test_an_experiment_provides_what_its_kind_needs(name):
    module = experiments.module(name)
    absent = [each for each in (*experiments.EVERY, *experiments.OF_KIND[module.KIND]) if not hasattr(module, each)]
    assert not absent
    assert tasks.of(name).__name__ == f"tactile.tasks.{module.KIND}"


def test_params_yaml_lists_every_experiment_and_each_has_a_report():
    assert sorted(VALUES["experiments"]) == NAMES
    assert sorted(render.SIMULATED) == [name for name in NAMES if "source" in VALUES[name]]


def test_the_three_kinds_have_the_same_functions():
    """What the room's docstring names; helpers of one kind may stand beside them."""
    named = "source inputs rows labelled base fit adapted tested stream timed".split()
    modules = [tasks.of(name) for name in ("touch", "strain", "glove")]
    assert all(callable(getattr(module, function, None)) for module in modules for function in named)


SCENES = [name for name in NAMES if "simulate" in VALUES[name]]
EFFECTS = [(name, effect) for name in SCENES for effect in VALUES[name]["simulate"]["effects"]]
SMALL = {  # a few seconds of each scene, with faults enough to be seen
    "touch": {"single": {"points_per_side": 2, "depths": 2, "repetitions": 1, "presses_per_recording": 8}}
    | {"double": {"recordings": 1, "presses_per_recording": 3}, "specimens": 2},
    "strain": {"samples": 300, "specimens": 2},
    "glove": {"specimens": 2, "sessions": 2, "frames_per_object": 20},
}
FAULTS, SHORT_GAP = dict.fromkeys(("torn", "missing"), 0.02), {"gaps": 1, "gap_s": 4}
STRESSED = ("double", "task_2", "toy")  # the conditions in which every effect acts


def planned(name: str, **changes) -> tuple[list, dict]:
    """The recordings of a small scene, and the logs of two of the conditions STRESSED; changes: of effects."""
    settings = copy.deepcopy(VALUES[name])
    scene = settings["simulate"] = settings["simulate"] | SMALL[name]
    scene["faults"] = scene["faults"] | FAULTS | {key: one for key, one in SHORT_GAP.items() if key in scene["faults"]}
    scene["effects"] = dict.fromkeys(scene["effects"], True) | changes
    recordings, logs_of = scenes.plan(name, settings)
    recordings = list(recordings)
    chosen = itertools.islice((each for each in recordings if each.condition in STRESSED), 2)
    return recordings, {(each.condition, each.name): logs_of(each) for each in chosen}


@pytest.fixture(scope="module")
def whole():
    """`whole(name)`: `planned` with all effects, made once."""
    known = {}

    def make(name: str) -> tuple[list, dict]:
        if name not in known:
            known[name] = planned(name)
        return known[name]

    return make


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_names_its_recordings_once_and_writes_the_same_logs_again(name, whole):
    recordings, logs = whole(name)
    names = [(each.condition, each.name) for each in recordings]
    assert len(set(names)) == len(names) and len(logs) == 2
    assert planned(name)[1] == logs
    first, second = logs.values()
    assert first != second, "no recording is another's copy"
    for file, (lines, faults) in first.items():
        assert lines and all(0 < fault.line <= len(lines) + 1 for fault in faults), file


@pytest.mark.parametrize(("name", "effect"), EFFECTS)
def test_every_effect_of_a_scene_is_on_and_changes_the_logs(name, effect, whole):
    assert VALUES[name]["simulate"]["effects"][effect]
    assert planned(name, **{effect: False})[1] != whole(name)[1]


@pytest.mark.parametrize("name", twins.MODULES)
def test_a_twin_says_what_each_of_its_statistics_is(name):
    module = twins.MODULES[name]
    assert name in VALUES["experiments"] and callable(module.recorded) and callable(module.simulated)
    assert len(module.STATISTICS) >= {"touch": 8}.get(name, 6) and set(module.NOTES) <= set(module.STATISTICS)
    assert all(unit and len(meaning) > 20 for unit, meaning in module.STATISTICS.values())


@pytest.mark.parametrize("name", twins.MODULES)
def test_the_words_on_a_twin_are_about_numbers_that_it_has(name):
    rows = {statistic: dict.fromkeys(studies.SUMMARY, 0.5) for statistic in twins.MODULES[name].STATISTICS}
    twin = experiments.facts(name).twin
    assert "{" not in twin.said.format_map(rows)
    assert (twin.scene or name) in SCENES and "source" in VALUES[twin.scene or name]


def scene_of_twin(name: str, workspace: Workspace, values: dict) -> None:
    """What the scene of a twin is made from, small: settings of it, and the frames that it needs."""
    scene = experiments.facts(name).twin.scene or name
    values[scene]["simulate"] |= {"specimens": 1}
    if name == "array_recorded":
        array_contacts.scene(workspace.frames("touch"), np.random.default_rng(0))
    elif name == "touch":  # two recordings of a taxel, pressed sixteen times for ten seconds, eight seconds apart
        time_s = np.arange(0, 16 * 18, 0.05)
        force = np.interp(time_s % 18, [8, 8.1, 17.9, 18], [0, 1, 1, 0]) * (20 + 0.2 * (time_s // 18))
        columns = {"recording": ["pike9_force_20/exp1"] * len(time_s) + ["pike9_force_20/exp2"] * len(time_s)}
        columns |= {"t_s": np.tile(time_s, 2), "force_n": schemas.lists(np.tile(force, 2)[:, None], pa.float32())}
        ohm = 500 + 4000 / (1 + np.tile(force, 2))
        columns |= {"v": schemas.lists(ohm[:, None], pa.float32())}
        columns["recording"] = pa.array(columns["recording"]).dictionary_encode().cast(schemas.NAME)
        table = pa.table(columns)
        schemas.write(workspace.frames("velostat_recorded"), table.schema, [table])
    elif name == "glove":
        values[name]["simulate"] |= SMALL[name] | {"specimens": 1, "sessions": 3}
        recordings, logs_of = scenes.plan(name, values[name])
        scenes.write_logs(workspace.logs(name), recordings, logs_of)
        module, frames = experiments.module(name), []
        for folder in sorted(workspace.logs(name).glob("*/*")):
            frames.append(module.read_recording(folder, values[name])[0])
        schemas.write(workspace.frames(name), frames[0].schema, frames)


@pytest.mark.parametrize("name", twins.MODULES)
def test_a_twin_computes_each_of_its_statistics_once_a_recording(name, workspace):
    values = copy.deepcopy(VALUES)
    scene_of_twin(name, workspace, values)
    found = twins.MODULES[name].simulated(workspace, values)
    assert set(found["statistic"]) == set(twins.MODULES[name].STATISTICS)
    assert not found.duplicated(["recording", "statistic"]).any() and np.isfinite(found["value"]).all()


RUNNABLE = [
    f"{room.replace('/', '.')}.{path.stem}"
    for room in ("pipeline/stages", "pipeline/studies", "tactile/stages")
    for path in sorted((ROOT / room).glob("*.py"))
    if "\ndef main(" in path.read_text(encoding="utf-8")
]


SETS = shards.read_sets(Workspace(ROOT))


def run_by_dvc() -> set[str]:
    """The modules that the commands of both dvc.yaml name, also by a variable of a stage, the key of its
    entries, or the study of a set of the evidence."""
    modules, files = set(), [ROOT / "dvc.yaml", ROOT / "evidence" / "dvc.yaml"]
    for each in [each for file in files for each in yaml.safe_load(file.read_text())["stages"].values()]:
        command = each.get("do", each)["cmd"]
        commands = [command] if isinstance(command, str) else command
        stages = [block["stage"] for block in each.get("vars", []) if "stage" in block] or [""]
        keys = [*each.get("foreach", [])] or [""]
        modules |= {
            command.replace("${stage}", stage).replace("${key}", key).split()[2]
            for command in commands
            for stage in stages
            for key in keys
        }
    return modules | {f"pipeline.studies.{shards.study(each)}" for each in SETS.values()}


RUN_BY_DVC = run_by_dvc()


@pytest.mark.parametrize("name", RUNNABLE)
def test_a_stage_or_study_says_how_it_is_run_and_dvc_runs_it(name):
    tree = ast.parse(ROOT.joinpath(*name.split(".")).with_suffix(".py").read_text(encoding="utf-8"))
    assert f"python -m {name}" in ast.get_docstring(tree)
    (main,) = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "main"]
    assert [argument.arg for argument in main.args.args] == ["workspace"]
    assert name in RUN_BY_DVC


TIMED = {name: each for name, each in SETS.items() if each.study == LATENCY}  # it runs stages: test_latency.py
STUDIES = {name: each for name, each in SETS.items() if each.study and name not in TIMED}
SEED = 7  # no other number that a study is called with


@pytest.mark.parametrize("name", STUDIES)
def test_a_study_runs_everything_once_with_the_seed_that_is_named_and_writes_its_tables(name, workspace, monkeypatch):
    """Nothing is trained: what would be is noted."""
    study, experiment = STUDIES[name].study, STUDIES[name].experiment
    module, asked = importlib.import_module(f"pipeline.studies.{study}"), []

    def noted(function, tasks, bar, **named):
        for key, arguments in tasks.items():
            asked.append((function.__name__, *(each for each in arguments if isinstance(each, int | float | str))))
            yield key, []

    monkeypatch.setattr(workers, "run", noted)
    monkeypatch.setattr(module, "_write_latents", lambda *given: given[-1].write_text("t_s\n"), raising=False)
    monkeypatch.setattr("sys.argv", [study, experiment, str(SEED)])
    module.main(workspace)
    assert len(asked) > 1 and len(set(asked)) == len(asked) and all(each[-1] == SEED for each in asked)
    tables = {path.stem: path.read_text() for path in workspace.study_result(experiment, "any").parent.iterdir()}
    outs = yaml.safe_load((ROOT / "evidence" / "dvc.yaml").read_text())["stages"][name]["outs"]
    kept = [path.rpartition("/")[2].replace("${study}", study) for out in outs for path in out]
    assert sorted(f"{table}-${{item.seed}}.csv" for table in tables) == sorted(kept)
    headers = [set(text.split()[0].split(",")) for table, text in tables.items() if table != "latents"]
    assert all({"seed", "metric", "unit", "value"} <= header for header in headers)
