"""params.yaml: loading, and refusing what nobody would read."""

import difflib
import importlib
import inspect
import reprlib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import yaml

from pipeline import paths
from pipeline.errors import InputError
from pipeline.schema import SCHEMA

LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # yaml.safe_load's own is ten times slower


def load(path: Path = paths.PARAMS) -> dict:
    """params.yaml as nested dictionaries, every key checked against pipeline/schema.py.

    Raises InputError when the file is missing or not YAML, or a key is unknown, missing or of the wrong kind.
    """
    if not path.is_file():
        raise InputError(f"{path.name}: not found; run the command from a checkout of the repository")
    try:
        values = LOADER(path.read_text(encoding="utf-8")).get_single_data()
    except (yaml.YAMLError, ValueError, RecursionError) as error:  # ValueError: no UTF-8, or a date like 2020-13-01
        where = getattr(error, "problem_mark", None)
        line = f", line {where.line + 1}" if where else ""
        raise InputError(f"{path.name}{line}: not valid YAML ({getattr(error, 'problem', error)}); mend it") from error
    check_block(values, SCHEMA, "")
    return values


def _shown(value) -> str:
    """A value of params.yaml, shortened."""
    short = reprlib.Repr()
    short.maxstring = short.maxother = short.maxlong = 60
    return short.repr(value)


def check_block(given, schema: Mapping, where: str) -> None:
    """Hold a block of params.yaml against its part of the schema; InputError names the first key that fails."""
    check_keys(given, schema, where or "top level")
    for key, wanted in schema.items():
        name = f"{where}.{key}" if where else key
        if isinstance(wanted, Mapping):
            check_block(given[key], wanted, name)
        elif wrong := wanted(given[key]):
            raise InputError(f"params.yaml, {name}: expected {wrong}, got {_shown(given[key])}")


def check_keys(given: Mapping, expected: Iterable[str], where: str) -> None:
    """InputError that names the first unknown key (with "did you mean") or the first missing one."""
    expected = list(expected)
    if not isinstance(given, Mapping):
        keys = ", ".join(expected) or "{}"
        raise InputError(f"params.yaml, {where}: expected a block of settings ({keys}), got {_shown(given)}")
    check_known(given, expected, where)
    for key in expected:
        if key not in given:
            raise InputError(f"params.yaml, {where}: key '{key}' is missing; add it")


def check_known(given: Iterable, expected: Iterable[str], where: str) -> None:
    """InputError that names the first key which is not among `expected`, with "did you mean"."""
    expected = list(expected)
    for key in given:
        if key not in expected:
            near = difflib.get_close_matches(str(key), expected, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(expected) or 'none'}"
            raise InputError(f"params.yaml, {where}: unknown key '{key}'; {hint}")


def check_call(function: Callable, settings: Mapping, where: str) -> None:
    """Hold a block of settings against a function whose keyword-only arguments are the block's schema.

    A number is checked against the annotation: `int` takes no fraction, `float` takes any number.
    """
    wanted = {
        name: parameter.annotation
        for name, parameter in inspect.signature(function).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    }
    check_keys(settings, wanted, where)
    for name, kind in wanted.items():
        value = settings[name]
        accepted = {float: (int, float), int: int, str: str, bool: bool, dict: Mapping, list: list}.get(kind)
        if accepted is None:
            continue
        if not isinstance(value, accepted) or (isinstance(value, bool) and kind is not bool):
            hint = " (YAML reads 1e-3 as text: write 1.0e-3)" if isinstance(value, str) and kind is float else ""
            raise InputError(f"params.yaml, {where}.{name}: expected {kind.__name__}, got {_shown(value)}{hint}")


def build_model(key: str, spec, settings: Mapping, where: str):
    """The model of `pipeline/models/<key>.py`, built for `spec` with its block of params.yaml.

    Raises InputError when there is no such file or when the block does not fit `build`'s signature.
    """
    known = sorted(path.stem for path in (paths.ROOT / "pipeline" / "models").glob("*.py") if path.stem != "__init__")
    if key not in known:
        near = difflib.get_close_matches(key, known, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"
        raise InputError(f"params.yaml, {where}: there is no pipeline/models/{key}.py; {hint}")
    build = importlib.import_module(f"pipeline.models.{key}").build
    check_call(build, settings, where)
    return build(spec, **settings)


def model_settings(params: Mapping, experiment: str, model: str) -> Mapping:
    """One model's block, or the sentence that says which models params.yaml lists."""
    models = params[experiment]["models"]
    if model not in models:
        raise InputError(f"params.yaml, {experiment}.models: no model '{model}'; listed: {', '.join(models)}")
    return models[model]


def runs(params: Mapping, experiment: str) -> list[tuple[str, int]]:
    """Every (protocol, seed) of an experiment, in the order of params.yaml."""
    return [(name, seed) for name, block in params[experiment]["protocols"].items() for seed in block["seeds"]]


def experiment_argument(argv: list[str], stage: str, params: Mapping) -> str:
    """The experiment named on a stage's command line (`python -m pipeline.<stage> <experiment>`)."""
    if len(argv) != 2 or argv[1] not in params["experiments"]:
        raise InputError(f"usage: python -m pipeline.{stage} {'|'.join(params['experiments'])}")
    return argv[1]


def experiment_module(experiment: str):
    """`pipeline/experiments/<experiment>.py`: its task, labels, splits and metrics."""
    return importlib.import_module(f"pipeline.experiments.{experiment}")


def training_stage(experiment: str) -> str:
    """The stage that trains an experiment's models."""
    return "train_series" if experiment in SERIES else "train_images" if experiment in IMAGES else "train"


def training_command(experiment: str, model: str) -> str:
    """What to run to have one model trained."""
    return f"python -m pipeline.{training_stage(experiment)} {experiment} {model}"


def training_arguments(argv: list[str], stage: str, params: Mapping, what: str = "MODEL") -> tuple[str, str]:
    """Experiment and model named on the command line of a stage that trains; `what` may stand for the model."""
    own = [experiment for experiment in params["experiments"] if training_stage(experiment) == stage]
    if len(argv) == 3 and argv[1] in params["experiments"] and argv[1] not in own:
        raise InputError(f"{argv[1]} is not trained by {stage}; run `{training_command(argv[1], argv[2])}`")
    if len(argv) != 3 or argv[1] not in own:
        raise InputError(f"usage: python -m pipeline.{stage} {'|'.join(own)} {what}")
    return argv[1], argv[2]


SERIES = ("strain", "strain_recorded")  # experiments whose models see a whole series, not windows
IMAGES = ("glove", "glove_recorded")  # experiments whose models see one tactile image and name the object


def shapes(settings: Mapping) -> tuple[int, int, int, int, int]:
    """(frames, rows, cols, map_rows, map_cols) of an experiment's task; settings: its block of params.yaml."""
    sensor, label = settings["sensor"], settings["label"]
    return settings["window"]["frames"], sensor["rows"], sensor["cols"], label["map_rows"], label["map_cols"]
