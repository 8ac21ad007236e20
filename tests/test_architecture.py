"""Rules about the code itself: who imports whom, and what DVC watches."""

import ast
from pathlib import Path

import pytest
import yaml

from pipeline.base import params
from pipeline.commands.scale import set_values

ROOT = Path(__file__).resolve().parent.parent
STAGES = {"simulate", "ingest", "window", "dataset", "train", "evaluate", "latency", "render", "collect", "track"}
STAGES |= {"augment", "count", "probe", "train_images", "train_series", "train_stag", "study", "judge"}
STAGES |= {"stress", "render_stability", "physics", "render_physics", "rightsize", "render_rightsize", "page"}
STAGES |= {"agreement", "settings"}
COMMANDS = {"fetch", "scale", "fit_material", "check", "record"}
WINDOWING = set()
# Modules that find, check, start and write things but cannot change a number: DVC need not watch them.
PLUMBING = {"availability", "blocks", "cluster", "errors", "files", "own", "params", "parent", "paths"}
PLUMBING |= {"runs", "workers"}
PLUMBING = {f"pipeline/{name}.py" for name in PLUMBING}
# Reading recordings is ingest's part of an experiment's file: of no concern to the stages after it.
READERS = {f"pipeline/logs/{name}.py" for name in ("parse", "alignment", "matlab", "report")}


def imports(path: Path) -> set[str]:
    """Files of this project that a file imports, at the top or inside a function."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            file = Path(name.replace(".", "/")).with_suffix(".py")
            if name.startswith("pipeline") and (ROOT / file).is_file():
                found.add(file.as_posix())
    return found


def closure(file: str) -> set[str]:
    """A file and everything that it imports, directly or not."""
    seen, todo = set(), [file]
    while todo:
        current = todo.pop()
        if current not in seen:
            seen.add(current)
            todo += imports(ROOT / current)
    return seen


def kind(file: str) -> str:
    path = Path(file)
    if path.parent.name in ("experiments", "scenes", "models"):
        return path.parent.name
    return "stages" if path.stem in STAGES | COMMANDS else "nouns"


def test_imports_point_one_way():
    allowed = {
        "stages": {"experiments", "scenes", "models", "nouns"},
        "experiments": {"nouns"},
        "scenes": {"scenes", "nouns"},
        "models": {"nouns"},
        "nouns": {"nouns"},
    }
    files = [path.relative_to(ROOT).as_posix() for path in (ROOT / "pipeline").rglob("*.py")]
    for file in files:
        for other in imports(ROOT / file):
            # The figure of the film's characteristic curve draws the fitted material itself.
            if (file, other) == ("pipeline/reporting/figures/touch.py", "pipeline/scenes/material.py"):
                continue
            # Simulated recordings, and logs that are only checked, are cut into windows exactly as the stage does it.
            if other == "pipeline/stages/window.py" and file in WINDOWING:
                continue
            assert kind(other) in allowed[kind(file)], f"{file} imports {other}"


@pytest.mark.parametrize("stage", ["render", "judge", "page", "render_stability", "render_physics", "render_rightsize"])
def test_reports_do_not_import_torch(stage):
    for file in closure(f"pipeline/{stage}.py"):
        source = (ROOT / file).read_text()
        assert "import torch" not in source and "from torch" not in source, file


def stage_entries():
    """(name, command words, deps) of every entry of dvc.yaml, one matrix value each."""
    content = yaml.safe_load((ROOT / "dvc.yaml").read_text())
    values = params.load()
    for name, entry in content["stages"].items():
        axes = entry.get("matrix", {"": [""]})
        (axis, choices), *_ = axes.items()
        if isinstance(choices, str):
            experiment, block = choices.strip("${}").split(".")
            choices = list(values[experiment][block])
        for choice in choices:
            fill = "${item." + axis + "}"
            text = yaml.safe_dump(entry).replace(fill, str(choice))
            filled = yaml.safe_load(text)
            yield f"{name}@{choice}", filled["cmd"].split(), set(filled["deps"])


@pytest.mark.parametrize("entry", list(stage_entries()), ids=lambda entry: entry[0])
def test_dvc_watches_what_a_stage_imports(entry):
    name, command, deps = entry
    model = name.partition("@")[2]
    needed = closure(command[2].replace(".", "/") + ".py")
    if command[2] in ("pipeline.stages.train", "pipeline.stages.train_images"):
        needed |= closure(f"pipeline/models/{model}.py")
    if command[2] == "pipeline.stages.train_series":
        needed |= closure(f"pipeline/models/{model if name.startswith('train') else 'lstm_direct'}.py")
        needed |= closure(f"pipeline/experiments/{command[3]}.py") - READERS
    if command[2] == "pipeline.stages.stress":
        needed |= {path.relative_to(ROOT).as_posix() for path in (ROOT / "pipeline/scenes").glob("*.py")}
        needed |= closure(f"pipeline/experiments/{command[3]}.py") - {"pipeline/logs/matlab.py"}
    if command[2] == "pipeline.stages.simulate":
        needed |= closure(f"pipeline/scenes/{command[3]}.py")
    if command[2] == "pipeline.stages.ingest":
        needed |= closure(f"pipeline/experiments/{command[3]}.py")
    if command[2] == "pipeline.stages.dataset":
        needed |= closure(f"pipeline/experiments/{command[3]}.py")
        needed -= READERS
    if command[2] == "pipeline.studies.physics":
        models = params.load()["physics"][command[3]]["models"]
        for file in (f"scenes/{command[3]}", f"experiments/{command[3]}", *(f"models/{model}" for model in models)):
            needed |= closure(f"pipeline/{file}.py")
    missing = {
        file for file in needed - PLUMBING if file not in deps and not any(file.startswith(f"{dep}/") for dep in deps)
    }
    assert not missing, f"{name}: add to deps {sorted(missing)}"
    for dep in deps:
        assert not dep.startswith("pipeline/") or (ROOT / dep).exists(), f"{name}: {dep} does not exist"


def test_every_model_block_fits_its_build():
    from pipeline.learning.regressors import Spec

    values = params.load()
    blocks = [(experiment, values[experiment]["models"]) for experiment in values["experiments"]]
    blocks += [(experiment, block["models"]) for experiment, block in values["physics"].items()]
    for experiment, models in blocks:
        for model, block in models.items():
            if experiment in params.SERIES:
                spec = Spec(20, 1, 6, 1, 2)
            elif experiment in params.IMAGES:
                spec = Spec(1, 32, 32, 1, 16)
            else:
                spec = Spec(*params.shapes(values[experiment]))
            params.build_model(model, spec, block, f"{experiment}.models.{model}")


def test_lomp_of_params_yaml_has_the_published_size():
    from pipeline.learning.regressors import Spec

    settings = params.load()["touch"]
    model = params.build_model("lomp", Spec(*params.shapes(settings)), settings["models"]["lomp"], "touch.models.lomp")
    assert model.parameters() == 2_741_712


@pytest.mark.parametrize("scale", ["laptop", "full"])
def test_scales_set_values_that_params_yaml_accepts(scale, tmp_path):
    copy = tmp_path / "params.yaml"
    copy.write_text((ROOT / "params.yaml").read_text())
    values = yaml.safe_load((ROOT / "scales" / f"{scale}.yaml").read_text())
    set_values(values, copy)
    loaded = params.load(copy)
    for dotted, value in values.items():
        block = loaded
        for key in dotted.split("."):
            block = block[key]
        assert block == value
    if scale == "laptop":  # params.yaml is the laptop scale, to the letter
        assert copy.read_text() == (ROOT / "params.yaml").read_text()
    laptop = yaml.safe_load((ROOT / "scales" / "laptop.yaml").read_text())
    assert set(values) == set(laptop), "every scale sets the same keys, so that one undoes the other"


def test_numbers_in_the_readme_are_those_of_the_reports():
    readme = (ROOT / "README.md").read_text()
    results = readme.split("## Results")[1].split("\n## ")[0]
    rows = [line for line in results.splitlines() if line.startswith("|")]
    reports = "\n".join(path.read_text() for path in (ROOT / "reports").rglob("*.md"))
    assert rows
    for row in rows:
        assert row in reports, f"README.md shows a row that no report has: {row}"


def test_an_unknown_experiment_is_refused():
    from pipeline.base.errors import InputError

    with pytest.raises(InputError, match="usage: python -m pipeline.stages.window touch|velostat_recorded"):
        params.experiment_argument(["window", "tuch"], "window", params.load())
