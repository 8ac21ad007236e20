"""params.yaml: what is refused before anything is removed or run, and when it is read."""

import argparse
import ast
import copy
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from builders.project import CODE, ROOT

from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.params_file import copied, set_values
from tactile.base.paths import Workspace
from tactile.commands import check
from tactile.settings import Params
from tactile.settings import models as settings_of_models
from tools import schema

WHOLE = params.load(ROOT / "params.yaml")
NETWORK = WHOLE["touch"]["models"]["cnn"]


def altered(*path, value) -> dict:
    """params.yaml with one value replaced; `path` leads to it, through keys."""
    values = copy.deepcopy(WHOLE)
    block = values
    for key in path[:-1]:
        block = block[key]
    block[path[-1]] = value
    return values


def text_file(folder: Path, text: str) -> Path:
    path = folder / "params.yaml"
    path.write_text(text)
    return path


HOSTILE = (
    "/some/folder",
    "../../../x",
    "..",
    "linear/../tree",
    "$(touch x)",
    "a;b",
    "'",
    "Linear",
    "",
    "lomp ",
    "__init__",
    "os",
    "params",
    1,
    None,
)


@pytest.mark.parametrize("key", HOSTILE)
def test_a_key_that_names_no_model_is_refused(key):
    words = "there is no tactile/models" if isinstance(key, str) else "expected text as a key"
    for block in ("touch", "physics.glove"):
        with pytest.raises(InputError, match=f"^{params.file_of(block)}, {block}.models: {words}"):
            params.check(altered(*block.split("."), "models", value={key: {}}))


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("touch", "touch: {sensor: {rows: 5}}\n", "^params/touch.yaml, touch: key 'source' is missing"),
        ("touch", "touch: [\n", "^params/touch.yaml, line 2: not valid YAML"),
        ("touch", "", "^params/touch.yaml: expected blocks of settings, such as `touch:`"),
        ("strain", "device: cpu\n", "^params/strain.yaml: 'device' is in params.yaml, too; keep one of them"),
        ("strain", "touch: {}\n", "^params/touch.yaml: 'touch' is in params/strain.yaml, too; keep one of them"),
    ],
)
def test_a_fault_in_a_file_of_an_experiment_is_told_of_that_file(name, text, words, tmp_path):
    path = copied(ROOT / "params.yaml", tmp_path)
    (tmp_path / "params" / f"{name}.yaml").write_text(text)
    with pytest.raises(InputError, match=words):
        params.load(path)


def test_a_value_is_set_in_the_file_of_its_experiment(tmp_path):
    path = copied(ROOT / "params.yaml", tmp_path)
    before = {file: file.read_text() for file in params.settings_files(path)}
    set_values({"strain.window.frames": 7, "device": "cpu"}, path)
    changed = {file.name for file, text in before.items() if file.read_text() != text}
    assert changed == {"strain.yaml", "params.yaml"}
    values = params.load(path)
    assert (values["strain"]["window"]["frames"], values["device"]) == (7, "cpu")
    with pytest.raises(InputError, match="there is no key 'strian.window'; did you mean 'strain'"):
        set_values({"strian.window": 1}, path)


def test_a_folder_without_settings_has_those_of_the_code_and_cannot_change_them(tmp_path):
    of_code, absent = ROOT / "params.yaml", tmp_path / "params.yaml"
    assert params.load(absent) == params.load(of_code)
    before = of_code.read_bytes()
    with pytest.raises(InputError, match=f"{absent}: not found; only a copy of the settings can be changed"):
        set_values({"device": "cpu"}, absent)
    assert of_code.read_bytes() == before and not absent.exists()
    of_folder = copied(absent, tmp_path / "other")
    set_values({"device": "cpu"}, of_folder)
    assert params.load(of_folder)["device"] == "cpu" and params.load(absent)["device"] == "auto"


@pytest.mark.parametrize("place", [("glove_recorded", "protocols"), ("stress", "touch", "perturbations")])
def test_a_key_that_is_no_text_is_refused(place):
    with pytest.raises(
        InputError, match=rf"^{params.file_of(place[0])}, {'.'.join(place)}: expected text as a key, got 1$"
    ):
        params.check(altered(*place, value={1: 2}))


TRAINING = ("models", "cnn", "training")
IMPOSSIBLE = [
    (("models",), {"lompp": {}}, "there is no tactile/models/lompp.py; did you mean 'lomp'"),
    (("models", "lomp", "hidden"), 0, r"lomp.hidden: .* greater than or equal to 1, got 0 \(meaning: .*\)$"),
    (("models", "lomp", "hidden"), 10**9, "less than or equal to 8192"),
    (("models", "lomp", "neighbours"), 5, "input should be 4 or 8"),
    (("models", "lomp", "alpha"), float("nan"), "a finite number"),
    (("models", "cnn", "channels"), ["a"], r"channels\[0\]: input should be a valid integer, got 'a'"),
    (("models", "cnn", "channels"), [], "list should have at least 1 item"),
    (("models", "cnn", "channels"), [1] * 1001, "list should have at most 1000 items"),
    (("models", "tree", "max_features"), -1, "greater than or equal to 0.000001"),
    (TRAINING, 3, r"should be a block of settings \(learning_rate, .*rest_share\), got 3"),
    (TRAINING, NETWORK["training"] | {"learning_rate": 1e300}, "learning_rate: .* less than or equal to 10"),
    (TRAINING, NETWORK["training"] | {"rest_share": 1.5}, "rest_share: .* less than or equal to 1"),
    (TRAINING, NETWORK["training"] | {"precision": "float16"}, "precision: input should be 'float32' or 'bfloat16'"),
    (TRAINING, NETWORK["training"] | {"batch_sise": 8}, "'batch_sise'; did you mean 'batch_size'"),
    (TRAINING, {"learning_rate": 0.1}, r"key 'batch_size' is missing; add it \(meaning: "),
    (("models", "linear"), {"ridge": 1.0}, "unknown key 'ridge'; known: none"),
    (("split",), {"seed": 0, "train": 0.9, "validation": 0.9}, "leave nothing to test on"),
    (("sensor", "rows"), 10**5, r"less than or equal to 256, got 100000 \(meaning: Rows of elements\)"),
    (("simulate", "devices", "array_hz"), 1e9, "less than or equal to 100000"),
]


@pytest.mark.parametrize(("path", "value", "words"), IMPOSSIBLE, ids=lambda part: str(part)[:40])
def test_an_impossible_value_is_one_sentence(path, value, words):
    with pytest.raises(InputError, match=words) as error:
        params.check(altered("touch", *path, value=value))
    assert str(error.value).startswith("params/touch.yaml, touch.")


def test_a_model_without_settings_is_named(tmp_path):
    path = tmp_path / "nearest.py"
    path.write_text("def build(spec, *, k: int):\n    return None\n")
    with pytest.raises(TypeError, match=r"nearest.py: declare its settings as `class Settings\(Block\)`"):
        settings_of_models.declared(path)


def test_settings_of_a_model_are_read_without_its_other_imports(tmp_path):
    path = tmp_path / "nearest.py"
    path.write_text(
        '"""Build the nearest neighbours.\n\nMore."""\nfrom pydantic import Field\nimport no_such_package\n'
        "from tactile.settings.shared import Block, Count\n"
        'class Settings(Block):\n    k: Count = Field(description="Neighbours")\n'
        '    width: float = Field(ge=1 / 64, le=2**3, description="Share of them")\n'
    )
    settings, meaning = settings_of_models.declared(path)
    assert settings(k=3, width=1 / 64).k == 3 and meaning == "Build the nearest neighbours."
    with pytest.raises(ValueError, match="greater than or equal to 0.015625"):
        settings(k=3, width=1 / 65)


@pytest.mark.parametrize("wrong", ["k: Nearest", "k: int = no_such_package.K", "k: int = Field(ge=1 / 0)"])
def test_settings_of_a_model_that_python_cannot_make_are_one_sentence(tmp_path, wrong):
    path = tmp_path / "nearest.py"
    path.write_text(
        "from pydantic import Field\nimport no_such_package\nfrom tactile.settings.shared import Block\n"
        f"class Settings(Block):\n    {wrong}\n"
    )
    with pytest.raises(TypeError, match=r"^tactile/models/nearest.py: its class Settings cannot be made \("):
        settings_of_models.declared(path)


def undescribed(whole: dict) -> list[str]:
    """Keys of a JSON schema, with their class, that have no description."""
    classes = {"Params": whole} | whole["$defs"]
    return [
        f"{name}.{key}"
        for name, block in classes.items()
        for key, field in block["properties"].items()
        if len(field.get("description", "").split()) < (1 if name == "Models" else 2)
    ]


def test_every_key_has_a_meaning():
    whole = Params.model_json_schema()
    assert not undescribed(whole)
    assert len(whole["$defs"]) > 100, "the classes of all blocks, of models too"
    whole["$defs"]["LookBack"]["properties"]["frames"]["description"] = ""
    assert undescribed(whole) == ["LookBack.frames"]


def test_every_key_of_params_yaml_is_in_the_schema():
    """Or is a name: of a protocol, a task, a condition."""
    whole, named = Params.model_json_schema(), set()

    def walk(value, field: dict, where: str) -> None:
        field = whole["$defs"][field["$ref"].rpartition("/")[2]] if "$ref" in field else field
        for key, inside in value.items() if isinstance(value, dict) else ():
            if key in field.get("properties", {}):
                walk(inside, field["properties"][key], f"{where}.{key}")
            else:
                named.add(where)
                extra = field["additionalProperties"]
                walk(inside, extra if isinstance(extra, dict) else {"additionalProperties": True}, where)

    walk(WHOLE, whole, "")
    assert named == {
        ".array_recorded.protocols",
        ".glove.protocols",
        ".glove_recorded.protocols",
        ".physics.glove.scene",
        ".physics.strain.scene",
        ".physics.touch.scene",
        ".strain.protocols",
        ".strain_recorded.protocols",
        *(f".stress.{experiment}.usable" for experiment in WHOLE["experiments"]),
        ".stress.touch.recordings",
        ".velostat_recorded.ingest.format",
        ".velostat_recorded.protocols",
    }


def test_editors_find_the_schema_where_it_is_written(tmp_path):
    schema.main(Workspace(tmp_path), None)
    assert "params.schema.json" in (ROOT / ".gitignore").read_text().split()
    assert json.loads((tmp_path / "params.schema.json").read_text())["properties"]["touch"]
    for path in (ROOT / "params.yaml", *(ROOT / "params").glob("*.yaml")):
        named = path.read_text().partition("\n")[0].removeprefix("# yaml-language-server: $schema=")
        assert (path.parent / named).resolve() == ROOT / "params.schema.json"


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"strain.sensor.chanels": 6}, "there is no key 'strain.sensor.chanels'; did you mean 'channels'?"),
        ({"strain.wonder": 6}, "there is no key 'strain.wonder'; known: source, "),
        ({1: 2, "strain.sensor.channels": 6}, "there is no key '1'; known: "),
        ({"strain.sensor.channels": 0}, "strain.sensor.channels: input should be greater than or equal to 1, got 0"),
        ({"glove.split.validation": 0.3}, "glove.split: train and validation leave nothing to test on"),
        (
            {
                "strain.sensor.unit": "ohm",
                "strain.ingest.format": {"daq.log": {"separator": ",", "rises_when_pressed": False}},
            },
            "strain: resistance has no highest value that falling readings could be taken from; remove",
        ),
        ({"glove.sensor.areas": {"mat": {"rows": 4}}}, "glove.sensor.areas.mat: key 'cols' is missing; add it"),
        (
            {"glove.sensor.areas": {"mat": {"row": 4}}},
            "glove.sensor.areas.mat: unknown key 'row'; did you mean 'rows'?",
        ),
    ],
)
def test_the_file_that_a_wrong_key_is_in_is_named(workspace, values, words, tmp_path):
    """Here FOLDER/settings.yaml of a sensor, whose keys are set in a copy of params.yaml."""
    folder = tmp_path / "mine" / "stretch" / "run000"
    folder.mkdir(parents=True)
    settings = tmp_path / "mine" / "settings.yaml"
    settings.write_text(yaml.safe_dump(values))
    experiment = list(values)[-1].partition(".")[0]
    with pytest.raises(InputError) as error:
        check.main(workspace, argparse.Namespace(experiment=experiment, folder=tmp_path / "mine"))
    name, said = re.fullmatch(r"(.*?settings.yaml)[:,] (.*)", str(error.value)).groups()
    assert name == str(settings) and said.startswith(words)


def test_a_wrong_key_beside_those_of_another_file_is_named_in_params_yaml():
    sources = {"strain.sensor.channels": "settings.yaml"}
    with pytest.raises(InputError, match="^settings.yaml, strain.sensor.channels: "):
        params.check(altered("strain", "sensor", "channels", value=0), sources)
    with pytest.raises(InputError, match="^params/strain.yaml, strain.ingest.rate_hz: "):
        params.check(altered("strain", "ingest", "rate_hz", value=0), sources)


@pytest.mark.parametrize(
    "line", ["a: 01777", "a: 0o17", "a: 1e-3", "a: yes", "a: 12:30:00", "a: 1_000", "a: ~", "a: .nan"]
)
def test_values_mean_what_they_mean_to_dvc(line, tmp_path):
    from dvc.utils.serialize import parse_yaml

    assert repr(params.parsed(text_file(tmp_path, line))) == repr(parse_yaml(line, "params.yaml"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: 1\na: 2", "line 2: not valid YAML .*duplicate key"),
        ("a: " + "[" * 50_000, "more than 20 deep"),
        ("- " * 50_000 + "a", "more than 20 deep"),
        ("a: &a [1]\nb: [*a, *a]", "'\\*a' repeats another value"),
        ("a: !!python/object:os.system {}", "line 1: not valid YAML"),
        ("a: 2020-13-01", "not valid YAML .*month"),
        ("a: 1\n---\nb: 2", "line 2: not valid YAML"),
        ("a: \x00", "not valid YAML"),
    ],
)
def test_what_two_readers_could_take_differently_is_refused(text, words, tmp_path):
    with pytest.raises(InputError, match=words):
        params.parsed(text_file(tmp_path, text))


def test_params_yaml_is_read_in_main_alone():
    """A function that a stage hands to its workers must get its settings from the stage."""
    for path in CODE:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and node.name != "main":
                calls = [ast.unparse(call.func) for call in ast.walk(node) if isinstance(call, ast.Call)]
                assert "params.load" not in calls, f"{path.name}, {node.name}: takes its settings as an argument"


STAGE = """
import os, sys
from pathlib import Path
from tactile.base import errors
params = Path(sys.argv[1])
errors.run_stage(lambda: params.write_text(sys.argv[2]), params)
"""


@pytest.mark.parametrize(("after", "code"), [("a: 1\n", 0), ("a: 2\n", 1)])
def test_a_stage_fails_where_params_yaml_changed_while_it_ran(after, code, tmp_path):
    path = text_file(tmp_path, "a: 1\n")
    command = [sys.executable, "-c", STAGE, str(path), after]
    done = subprocess.run(command, cwd=ROOT, env=os.environ | {"DVC_STAGE": "s"}, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    assert code == 0 or done.stderr.startswith("error: params.yaml changed while this ran; run `dvc repro` again")


def test_no_stage_hands_a_value_of_params_yaml_to_the_shell():
    """Only names that dvc.yaml itself lists are part of a command, or of the name of a stage or an output."""
    content = yaml.safe_load((ROOT / "dvc.yaml").read_text())
    lists = {name for block in content["vars"] for name in block}
    for name, entry in content["stages"].items():
        own = {variable for block in entry.get("vars", []) for variable in block}
        filled = {"item", "key"} if entry.keys() & {"foreach", "matrix"} else set()
        assert set(re.findall(r"\$\{?(\w*)", yaml.safe_dump(entry))) <= lists | own | filled, name


@pytest.mark.parametrize(
    ("key", "optional"),
    [
        ("strain.sensor.pressed_below_mm", True),
        ("strain.sensor.channels", False),
        ("strain.sensor.wonder", False),
        ("strain.wonder.channels", False),
        ("device.wonder", False),
    ],
)
def test_keys_that_params_yaml_may_lack(key, optional):
    assert params.is_optional(key) is optional


@pytest.mark.parametrize("make", [Path.mkdir, lambda path: os.mkfifo(path)], ids=["folder", "pipe"])
@pytest.mark.parametrize("name", ["params.yaml", "params/touch.yaml"])
def test_a_folder_or_a_pipe_in_place_of_the_settings_is_one_sentence(make, name, tmp_path):
    shutil.copy(ROOT / "params.yaml", tmp_path)
    shutil.copytree(ROOT / "params", tmp_path / "params")
    (tmp_path / name).unlink()
    make(tmp_path / name)
    for read in (params.load, lambda file: copied(file, tmp_path / "copy")):
        with pytest.raises(InputError, match=f"^{name}: is a folder or a device, not a file"):
            read(tmp_path / "params.yaml")
