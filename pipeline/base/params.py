"""Load params.yaml and reject unknown or missing keys and impossible values."""

import ast
import difflib
import functools
import re
import reprlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Literal, get_args, get_origin

from pydantic import ValidationError, create_model
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

from pipeline.base import blocks, paths
from pipeline.base.errors import InputError

DEEPEST = 20  # blocks and lists inside each other; params.yaml has 8. The parser in C crashes at some 30,000
SCALES = ("laptop", "paper")  # files of scales/
MODEL_KEY = re.compile(r"[a-z][a-z0-9_]*")  # a key becomes a file's, a folder's and a stage's name


def load(path: Path = paths.PARAMS) -> dict:
    """Return params.yaml as nested dictionaries, every key and value checked against pipeline/base/blocks.py.

    A stage calls it once, in its `main`, and hands the values on: a file that changes while a stage runs must not
    reach a part of it.
    Raises InputError when the file is missing or not YAML, or a key is unknown, missing or of the wrong kind.
    """
    if not path.is_file():
        raise InputError(f"{path.name}: not found; run the command from a checkout of the repository")
    values = parsed(path)
    check(values)
    return values


def check(values) -> None:
    """Check params.yaml against pipeline/base/blocks.py and pipeline/models; InputError names the first fault."""
    check_block(values, settings_block(), "")
    for experiment, block in values.items():
        if isinstance(block, Mapping) and "models" in block:
            check_models(block["models"], f"{experiment}.models")
    for experiment, block in values.get("physics", {}).items():
        check_models(block["models"], f"physics.{experiment}.models")


@functools.cache
def settings_block() -> type[blocks.Block]:
    """Return the pydantic model of params.yaml: one block per file of pipeline/experiments, beside blocks.Settings.

    A file names the class of its block as SETTINGS. It is parsed, not imported, as the models' are.
    """
    files = sorted(path for path in paths.EXPERIMENTS.glob("*.py") if path.stem != "__init__")
    experiments = {path.stem: (getattr(blocks, _assigned(path, "SETTINGS")), ...) for path in files}
    stressed = {
        path.stem: (blocks.SeededStress if _assigned(path, "KIND") == "images" else blocks.Stress, ...)
        for path in files
    }
    stress = create_model("StressTests", __base__=blocks.Block, **stressed)
    names = blocks.distinct(Literal[tuple(experiments)])
    return create_model(
        "Settings", __base__=blocks.Settings, experiments=(names, ...), stress=(stress, ...), **experiments
    )


def _assigned(path: Path, name: str, default=None):
    """Return what a file assigns to a name at its top level, `default` where nothing; InputError without a default."""
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == name:
            return ast.literal_eval(node.value)
    if default is not None:
        return default
    raise InputError(f"pipeline/experiments/{path.name}: {name} is missing; name a class of pipeline/base/blocks.py")


def parsed(path: Path):
    """Return a YAML file's content, read as DVC reads it: YAML 1.2, each key once; InputError where it is not YAML."""
    reader = YAML(typ="safe")
    try:
        text = path.read_text(encoding="utf-8")
        depth = 0
        for event in reader.parse(text):
            depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
            if isinstance(event, AliasEvent):
                raise InputError(f"{path.name}: '*{event.anchor}' repeats another value; write the value itself")
            if depth > DEEPEST:
                raise InputError(f"{path.name}: blocks or lists lie more than {DEEPEST} deep in each other")
        return reader.load(text)
    except (YAMLError, ValueError) as error:  # ValueError: no UTF-8, or a date like 2020-13-01
        mark = getattr(error, "problem_mark", None)
        where = f", line {mark.line + 1}" if mark else ""
        raise InputError(f"{path.name}{where}: not valid YAML ({getattr(error, 'problem', error)}); fix it") from error


def _shown(value) -> str:
    """Return a value of params.yaml as text, shortened."""
    short = reprlib.Repr()
    short.maxstring = short.maxother = short.maxlong = 60
    return short.repr(value)


def check_block(given, kind: type[blocks.Block], where: str) -> blocks.Block:
    """Return a block of params.yaml as its pydantic model; InputError names the key that fails, unknown ones first."""
    try:
        return kind.model_validate(given)
    except ValidationError as error:
        faults = error.errors(include_url=False)
        fault = next((fault for fault in faults if fault["type"] == "extra_forbidden"), faults[0])
    *path, key = fault["loc"] or ("",)
    if key == "[key]":  # pydantic's name for the key of a mapping; that of a block comes as it is
        *path, key = path
        fault = fault | {"type": "invalid_key"}
    if fault["type"] == "invalid_key":
        raise InputError(f"params.yaml, {_dotted(where, *path)}: expected text as a key, got {_shown(key)}")
    inside = _dotted(where, *path) or "top level"
    if fault["type"] == "extra_forbidden":
        check_known([key], _at(kind, path).model_fields, inside)
    if fault["type"] == "missing":
        raise InputError(f"params.yaml, {inside}: key '{key}' is missing; add it")
    name = _dotted(where, *(step for step in fault["loc"] if not isinstance(step, int))) or "top level"
    if fault["type"] == "value_error":  # a rule of blocks.py's own, which says what should be
        raise InputError(f"params.yaml, {name}: {fault['ctx']['error']}")
    each = "a list of which each is " if isinstance(key, int) else ""
    expected = each + _expected(_at(kind, fault["loc"]))
    raise InputError(f"params.yaml, {name}: expected {expected}, got {_shown(fault['input'])}")


def _dotted(*names) -> str:
    """Join the names of nested keys to one, `touch.models.cnn`."""
    return ".".join(str(name) for name in names if name != "")


def _at(kind, path: Iterable):
    """Return the kind (an annotation) of the value at `path`, keys and places in lists, in a value of this kind."""
    for step in path:
        plain = get_args(kind)[0] if get_origin(kind) is Annotated else kind
        if isinstance(plain, type) and issubclass(plain, blocks.Block):
            field = plain.model_fields[step]
            kind = Annotated[field.annotation, field] if field.metadata else field.annotation
        else:
            kind = get_args(plain)[-1]  # of the entries of a list, or of the values of a mapping
    return kind


def is_optional(dotted: str) -> bool:
    """Tell whether params.yaml may lack a key (`strain.sensor.pressed_below_mm`); False for a key that is unknown."""
    *path, key = dotted.split(".")
    try:
        field = _at(settings_block(), path).model_fields[key]
    except (AttributeError, IndexError, KeyError):  # of what is no block
        return False
    return not field.is_required()


def _expected(kind) -> str:
    """Describe in words the values that a setting of this kind can have."""
    limits = {}
    while get_origin(kind) is Annotated:
        kind, *extras = get_args(kind)
        for limit in (limit for extra in extras for limit in getattr(extra, "metadata", ())):
            limits |= {name: getattr(limit, name) for name in ("ge", "le", "max_length") if hasattr(limit, name)}
    number = "d" if kind is int else "g"
    span = f" from {limits['ge']:{number}} to {limits['le']:{number}}" if "ge" in limits else ""
    if get_origin(kind) is Literal:
        return f"one of {', '.join(map(str, get_args(kind)))}"
    if get_origin(kind) is list:
        return f"a list of 1 to {limits['max_length']} entries"
    if get_origin(kind) is dict or not isinstance(kind, type):
        return "a non-empty block"
    if issubclass(kind, blocks.Block):
        return f"a block of settings ({', '.join(kind.model_fields) or '{}'})"
    return {int: "a whole number", float: "a number", bool: "true or false", str: "text"}[kind] + span


def check_known(given: Iterable, expected: Iterable[str], where: str) -> None:
    """Raise InputError that names the first key which is not among `expected`, with "did you mean"."""
    expected = list(expected)
    for key in given:
        if key not in expected:
            near = difflib.get_close_matches(str(key), expected, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(expected) or 'none'}"
            raise InputError(f"params.yaml, {where}: unknown key '{key}'; {hint}")


def check_models(models: Mapping, where: str) -> None:
    """Check a block of models against pipeline/models: every key a file's name, every setting one of its `build`.

    Raises InputError that names the first key or setting that fails.
    """
    for key, settings in models.items():
        if not isinstance(key, str) or not MODEL_KEY.fullmatch(key):
            raise InputError(
                f"params.yaml, {where}: {_shown(key)} cannot name a model; keys have small letters, digits and _"
            )
        check_model(key, settings, f"{where}.{key}")


def check_model(key: str, settings, where: str) -> blocks.Block:
    """Return one model's block, checked against the signature of its `build`; InputError names the first fault."""
    known = model_keys()
    if key not in known:
        near = difflib.get_close_matches(key, known, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"
        raise InputError(f"params.yaml, {where}: there is no pipeline/models/{key}.py; {hint}")
    return check_block(settings, model_block(paths.MODELS / f"{key}.py"), where)


def model_keys() -> list[str]:
    """Return the names of the files in pipeline/models."""
    return sorted(path.stem for path in paths.MODELS.glob("*.py") if path.stem != "__init__")


@functools.cache
def model_block(path: Path) -> type[blocks.Block]:
    """Return the pydantic model of a model's block: the keyword-only arguments of `build`, of their annotations' kinds.

    The file is parsed, not imported: imports of torch and scikit-learn would cost every stage 3 s.
    """
    tree = ast.parse(path.read_text(encoding="utf-8"))
    (build,) = (node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == "build")
    kinds = {argument.arg: (_kind(argument, path), ...) for argument in build.args.kwonlyargs}
    return create_model(path.stem, __base__=blocks.Block, **kinds)


def _kind(argument: ast.arg, path: Path):
    """Return the kind in `blocks` that annotates an argument of `build`."""
    name = argument.annotation.id if isinstance(argument.annotation, ast.Name) else ""
    if not hasattr(blocks, name):
        raise InputError(
            f"pipeline/models/{path.name}: build's argument '{argument.arg}' needs a kind of pipeline/base/blocks.py "
            "as its annotation, such as Count, Positive or WindowTraining"
        )
    return getattr(blocks, name)


def scale_settings(name: str, experiment: str, settings: Mapping) -> list[tuple[list[str], object]]:
    """Return (keys, value) of every setting of a scale (a file of scales/) below an experiment, of what it has.

    A model or protocol that is not among its own has no settings.

    settings: the experiment's block of params.yaml.
    """
    scale = [(dotted.split("."), value) for dotted, value in parsed(paths.SCALES / f"{name}.yaml").items()]
    below = [(keys, value) for (block, *keys), value in scale if block == experiment]
    chosen = ("models", "protocols")
    return [(keys, value) for keys, value in below if keys[0] not in chosen or keys[1] in settings[keys[0]]]


def scale_of(experiment: str, settings: Mapping) -> str:
    """Return the scale that an experiment's settings are of: laptop, paper, both where they are the same, or other.

    settings: the experiment's block of params.yaml. What only a study of it reads is not looked at.
    """
    names = [
        name
        for name in SCALES
        if all(
            functools.reduce(lambda block, key: block[key], keys, settings) == value
            for keys, value in scale_settings(name, experiment, settings)
        )
    ]
    return "both" if len(names) > 1 else names[0] if names else "other"


def model_settings(params: Mapping, experiment: str, model: str) -> Mapping:
    """Return one model's block, of MODEL_ZERO that of the model that it is.

    InputError names the models that params.yaml lists where there is none.
    """
    models = params[experiment]["models"]
    model = params[experiment]["model_zero"] if model == paths.MODEL_ZERO else model
    if model not in models:
        raise InputError(f"params.yaml, {experiment}.models: no model '{model}'; listed: {', '.join(models)}")
    return models[model]


def runs(params: Mapping, experiment: str) -> list[tuple[str, int]]:
    """Return every (protocol, seed) of an experiment, in the order of params.yaml."""
    return [(name, seed) for name, block in params[experiment]["protocols"].items() for seed in block["seeds"]]


def epochs(block: Mapping) -> int:
    """Return the number of epochs that a model's block asks for; 1 where it is solved in one step."""
    return block.get("training", {}).get("epochs", 1)


def run_settings(values: Mapping, experiment: str, model: str, protocol: str) -> dict:
    """Return a model's block for one protocol: where this asks for more `passes`, a training has more epochs."""
    block = model_settings(values, experiment, model)
    passes = values[experiment]["protocols"][protocol].get("passes", 1)
    if passes == 1 or "training" not in block:
        return block
    return block | {"training": block["training"] | {"epochs": passes * epochs(block)}}


def transfers(model: str) -> bool:
    """Tell whether a model starts from model-0: its file says `TRANSFER = True`. The file is parsed, not imported."""
    return _assigned(paths.MODELS / f"{model}.py", "TRANSFER", False)


def training_command(experiment: str) -> str:
    """Return the command that trains the models of an experiment."""
    return f"python -m pipeline.stages.train {experiment}"
