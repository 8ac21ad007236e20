"""Load the settings, params.yaml and params/<experiment>.yaml, and refuse wrong keys and values.

A key has the same dotted name in messages, in evidence/shards.yaml and in settings.yaml of own logs:
`touch.window.stride` is in the block `touch` of params/touch.yaml.
"""

import copy
import difflib
import math
import reprlib
from collections.abc import Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin

from pydantic import ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

from tactile.base import foreign, paths
from tactile.base.errors import InputError
from tactile.settings import Experiment, Params
from tactile.settings.models import Models
from tactile.settings.shared import Block

Kind = TypeVar("Kind", bound=Block)
DEEPEST = 20  # blocks and lists inside each other; the settings have 8. The parser in C crashes at some 30,000


def load(path: Path, sources: Mapping[str, str] | None = None) -> dict:
    """Return all settings as nested dictionaries, every key and value checked against tactile/settings.

    path: params.yaml, see `settings_files`. A stage calls it once, in its `main`, and hands the values on: a file that
    changes while a stage runs must not reach a part of it. sources: as in `check`.
    Raises InputError when a file is not YAML, or a key is unknown, missing or of the wrong kind.
    """
    values = read(path)
    check(values, sources)
    return values


def settings_files(path: Path) -> list[Path]:
    """Return the files of settings: params.yaml, which is `path`, and those in the folder `params` beside it.

    Where there is no params.yaml, those that came with the code. Raises InputError where one of them is no file.
    """
    path = path if path.exists() else paths.BROUGHT / "params.yaml"
    files = [path, *sorted((path.parent / "params").glob("*.yaml"))]
    for file in files:
        _check_file(file)
    return files


def _check_file(path: Path) -> None:
    """Raise InputError for what is there and no file of text: a folder, a pipe, whose reader would wait for ever."""
    if path.exists() and not path.is_file():
        raise InputError(f"{name_of(path)}: is a folder or a device, not a file; put a file of settings in its place")


def file_of(dotted: str) -> str:
    """Return the name of the file that has a setting: params/touch.yaml for `touch.window`, or params.yaml."""
    block = dotted.partition(".")[0]
    return f"params/{block}.yaml" if block in get_args(Experiment) else "params.yaml"


def read(path: Path) -> Any:
    """Return the blocks of all files of settings as one mapping, unchecked. Raises InputError as `parsed`, and where a
    block is in two files.
    """
    path, *others = settings_files(path)
    values = parsed(path)
    file_with: dict[str, str] = {}
    for file in others:
        blocks = parsed(file)
        if not isinstance(values, dict) or not isinstance(blocks, dict):
            wrong = name_of(path if isinstance(blocks, dict) else file)
            raise InputError(f"{wrong}: expected blocks of settings, such as `{file.stem}:`")
        for key in blocks:
            if key in values:
                raise InputError(
                    f"{name_of(file)}: '{key}' is in {file_with.get(key, path.name)}, too; keep one of them"
                )
            file_with[key] = name_of(file)
        values |= blocks
    order = [key for key in Params.model_fields if key in values] if isinstance(values, dict) else []
    return {key: values[key] for key in dict.fromkeys([*order, *values])} if order else values


def name_of(path: Path) -> str:
    """Return the name of a file of settings as a message has it: `params.yaml`, `params/touch.yaml`."""
    return f"params/{path.name}" if path.parent.name == "params" else path.name


def check(values: object, sources: Mapping[str, str] | None = None) -> None:
    """Check all settings against tactile/settings; InputError names the first fault, unknown keys first.

    sources: the file that a dotted key was set from, where that is not `file_of` it; a sentence names it in its place.
    """
    check_block(values, Params, "", sources)


def parsed(path: Path) -> Any:
    """Return a YAML file's content, read as DVC reads it: YAML 1.2, each key once; InputError where it is not YAML."""
    name = name_of(path)
    _check_file(path)
    with foreign.reading(name, "valid YAML", "fix it"):  # no UTF-8, or a date like 2020-13-01
        try:
            return copy.deepcopy(_content(path.read_text(encoding="utf-8"), name))
        except MarkedYAMLError as error:
            where = f", line {error.problem_mark.line + 1}" if error.problem_mark else ""
            raise InputError(f"{name}{where}: not valid YAML ({error.problem}); fix it") from error


@lru_cache(maxsize=64)
def _content(text: str, name: str) -> Any:
    """Return the content of a file called `name`. Commands read the same files several times, at 5 ms each."""
    reader, depth = YAML(typ="safe"), 0
    for event in reader.parse(text):
        depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
        if isinstance(event, AliasEvent):
            raise InputError(f"{name}: '*{event.anchor}' repeats another value; write the value itself")
        if depth > DEEPEST:
            raise InputError(f"{name}: blocks or lists lie more than {DEEPEST} deep in each other")
    return reader.load(text)


def shown(value: object) -> str:
    """Return a setting as text, shortened."""
    short = reprlib.Repr()
    short.maxstring = short.maxother = short.maxlong = 60
    return short.repr(value)


def check_block(given: object, kind: type[Kind], where: str, sources: Mapping[str, str] | None = None) -> Kind:
    """Return a block of settings as its pydantic model; InputError names the key that fails, unknown ones first.

    where: the dotted key of the block; sources: as in `check`.
    """
    try:
        return kind.model_validate(given)
    except ValidationError as error:
        faults = error.errors(include_url=False)
    fault = next((fault for fault in faults if fault["type"] == "extra_forbidden"), faults[0])
    *path, key = fault["loc"] or ("",)
    if key == "[key]":  # pydantic's name for the key of a mapping; that of a block comes as it is
        *path, key = path
        fault |= {"type": "invalid_key"}
    inside, name = _dotted(where, *path), _dotted(where, *path, key)
    file = next((file for dotted, file in (sources or {}).items() if share(dotted, name)), file_of(name))
    block, place = file + ", " + (inside or "top level"), file + ", " + (name or "top level")
    if fault["type"] == "invalid_key":
        raise InputError(f"{block}: expected text as a key, got {shown(key)}")
    if fault["type"] == "extra_forbidden" and kind_at(kind, path)[0] is Models:
        raise InputError(f"{block}: there is no tactile/models/{key}.py; {hint(key, Models.model_fields)}")
    if fault["type"] == "extra_forbidden":
        raise InputError(f"{block}: unknown key '{key}'; {hint(key, kind_at(kind, path)[0].model_fields)}")
    if fault["type"] == "missing":
        raise InputError(f"{block}: key '{key}' is missing; add it{kind_at(kind, fault['loc'])[1]}")
    if fault["type"] == "value_error":  # a rule of our own, which says what should be
        raise InputError(f"{place}: {fault['ctx']['error']}")
    expected, meaning = kind_at(kind, fault["loc"])
    wrong = fault["msg"][0].lower() + fault["msg"][1:]
    if fault["type"] in ("model_type", "dict_type"):
        keys = expected.model_fields if isinstance(expected, type) and issubclass(expected, Block) else {}
        wrong = f"input should be a block of settings ({', '.join(keys)})" if keys else "input should be a block"
    raise InputError(f"{place}: {wrong}, got {shown(fault['input'])}{meaning}")


def _dotted(*names: object) -> str:
    """Join the names of nested keys to one, `touch.models.cnn`; entries of lists are `channels[0]`."""
    text = "".join(f"[{name}]" if isinstance(name, int) else f".{name}" for name in names if name != "")
    return text.removeprefix(".")


def share(one: str, other: str) -> bool:
    """Tell whether one of two dotted keys is the other, or leads to it."""
    one, other = (f"{dotted}.".replace("[", ".") for dotted in (one, other))
    return one.startswith(other) or other.startswith(one)


def kind_at(kind: Any, path: Iterable) -> tuple[Any, str]:
    """Return the type at `path`, keys and places in lists, in a value of this type, and what its key means.

    The meaning is in brackets and has a space before it; it is empty where the last key of a block has none.
    """
    meaning = ""
    for step in path:
        if isinstance(kind, type) and issubclass(kind, Block):
            field = kind.model_fields[step]
            kind, meaning = field.annotation, f" (meaning: {field.description})"
        else:
            kind = get_args(kind)[-1]  # of the entries of a list, or of the values of a mapping
        kind = get_args(kind)[0] if get_origin(kind) is Annotated else kind
    return kind, meaning


def parts(dotted: str, given: object, known: object) -> tuple[dict, list[str]]:
    """Return what sets only the keys that a block has, by dotted keys, and the required keys that it lacks.

    A block replaces all keys of the former one, so one that lacks some is refused, although its dotted keys say the
    same. dotted, given: key and value as written; known: the former value. A whole block, one with an unknown key and
    what is no block are returned as they are, with [].
    """
    try:
        kind = kind_at(Params, dotted.split("."))[0]
    except (AttributeError, IndexError, KeyError):
        return {dotted: given}, []
    if not (isinstance(kind, type) and issubclass(kind, Block)):
        return {dotted: given}, []
    if not isinstance(given, Mapping) or not isinstance(known, Mapping) or set(given) - set(kind.model_fields):
        return {dotted: given}, []
    lacking = [key for key, field in kind.model_fields.items() if field.is_required() and key not in given]
    lacking = [f"'{key}'" for key in lacking if key in known]
    inside: dict[str, object] = {}
    for key, value in given.items():
        of_key, further = parts(f"{dotted}.{key}", value, known.get(key))
        inside |= of_key
        lacking += further
    return (inside, lacking) if lacking else ({dotted: given}, [])


def is_optional(dotted: str) -> bool:
    """Tell whether the settings may lack a key (`strain.sensor.pressed_below_mm`); False for a key that is unknown."""
    *path, key = dotted.split(".")
    try:
        field = kind_at(Params, path)[0].model_fields[key]
    except (AttributeError, IndexError, KeyError):  # of what is no block
        return False
    return not field.is_required()


def keys(dotted: str) -> list[str]:
    """Return the keys that a block may have, those that it may lack, too; none of what is no block."""
    try:
        kind = kind_at(Params, filter(None, dotted.split(".")))[0]
    except (AttributeError, IndexError, KeyError):
        return []
    return list(kind.model_fields) if isinstance(kind, type) and issubclass(kind, Block) else []


def hint(key: object, expected: Iterable[str]) -> str:
    """Return what to say of an unknown key: the likely right one, or all."""
    near = difflib.get_close_matches(str(key), list(expected), n=1)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(expected) or 'none'}"


def check_known(given: Iterable, expected: Iterable[str], where: str) -> None:
    """Raise InputError that names the first key which is not among `expected`, with "did you mean"."""
    expected = list(expected)
    for key in given:
        if key not in expected:
            raise InputError(f"{file_of(where)}, {where}: unknown key '{key}'; {hint(key, expected)}")


def check_model(key: str, settings: object, where: str) -> Block:
    """Return one model's block, checked against `Settings` in its file; InputError names the first fault."""
    if key not in Models.model_fields:
        raise InputError(
            f"{file_of(where)}, {where}: there is no tactile/models/{key}.py; {hint(key, Models.model_fields)}"
        )
    return check_block(settings, kind_at(Models, [key])[0], where)


def model_settings(params: Mapping, experiment: str, model: str) -> Mapping:
    """Return one model's block, of MODEL_ZERO that of the model that it is.

    InputError names the models that params.yaml lists where there is none.
    """
    models = params[experiment]["models"]
    model = params[experiment]["model_zero"] if model == paths.MODEL_ZERO else model
    if model not in models:
        raise InputError(f"{file_of(experiment)}, {experiment}.models: no model '{model}'; listed: {', '.join(models)}")
    return models[model]


def runs(params: Mapping, experiment: str) -> list[tuple[str, int]]:
    """Return every (protocol, seed) of an experiment, in the order of params.yaml."""
    return [(name, seed) for name, block in params[experiment]["protocols"].items() for seed in block["seeds"]]


def epochs(block: Mapping) -> int:
    """Return the number of epochs that a model's block asks for; 1 where it is solved in one step."""
    return block.get("training", {}).get("epochs", 1)


def at_budget(block: Mapping, budget: float) -> Mapping:
    """Return the settings of a model whose training has a share of its epochs, and its rate drops as much earlier."""
    if "training" not in block:
        return block
    of_epochs = [key for key in ("epochs", "drop_epoch") if key in block["training"]]
    return {**block, "training": block["training"] | {k: math.ceil(budget * block["training"][k]) for k in of_epochs}}


def run_settings(values: Mapping, experiment: str, model: str, protocol: str) -> Mapping:
    """Return a model's block as it is trained for one protocol.

    A training has the share `budget` of the epochs of its recipe, and more where the protocol asks for more `passes`.
    """
    block = at_budget(model_settings(values, experiment, model), values[experiment]["budget"])
    passes = values[experiment]["protocols"][protocol].get("passes", 1)
    if passes == 1 or "training" not in block:
        return block
    return {**block, "training": block["training"] | {"epochs": passes * epochs(block)}}


def transfers(model: str) -> bool:
    """Tell whether a model starts from model-0: its file says `TRANSFER = True`. The file is read, not imported."""
    return "\nTRANSFER = True\n" in (paths.MODELS / f"{model}.py").read_text(encoding="utf-8")


def training_command(experiment: str) -> str:
    """Return the command that trains the models of an experiment."""
    return f"python -m tactile.stages.train {experiment}"
