"""Settings of a sensor of your own: those of the checkout, with what its settings.yaml sets, and what follows from it.

`check`, `sheet`, `try` and `own` all take them from here.
"""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from tactile import experiments
from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.params_file import copied, set_values
from tactile.base.paths import Workspace
from tactile.datasets import images
from tactile.own.logs import on_a_line
from tactile.settings.targets import Asked

FILE = "settings.yaml"  # in a folder of logs
ASKED = tuple(Asked.model_fields)  # blocks of a target of one's own, which belong to no experiment
SEEDS = [0, 1, 2]
SMALLEST_IMAGE = 8  # pixels of a side; the networks halve an image two to five times
YARDSTICKS = {  # kind of input -> models of every sensor of one's own, in no table of the papers
    kind: {
        "window_trees": {"trees": 20, "min_samples_leaf": leaf},
        "window_ridge": {"parts": 4, "shares": kind == "images"},
    }
    for kind, leaf in (("windows", 20), ("series", 5), ("images", 1))  # a leaf of touch holds a whole map
}
# For sensors of a few channels, whose image is no picture.
WITHOUT_NETWORKS = ("constant", "naive_bayes", "tree", "window_trees", "window_ridge")
OF_PRESSES, TREES = "press_difference", {"trees": 50, "min_samples_leaf": 5}  # a model that must know it
OVERLAPPING = "random"  # protocols whose test part holds what was trained on: the papers' own, of no use here


def read(folder: Path) -> dict:
    """Return the dotted keys and values of FOLDER/settings.yaml, blocks before the keys inside them; {} without a file.

    Raises InputError as params.parsed, and for a setting that is there twice, in a block and by its dotted key.
    """
    path = folder / FILE
    if not path.exists():
        return {}
    values = params.parsed(path)
    if not isinstance(values, dict):
        raise InputError(f"{path}: expected dotted keys and values such as `touch.sensor.rows: 4`")
    found = {str(key): value for key, value in sorted(values.items(), key=lambda item: str(item[0]).count("."))}
    said: dict[str, str] = {}
    for key, value in found.items():
        for name in leaves({key: value}):
            if other := next((said[one] for one in said if params.share(one, name)), None):
                raise InputError(f"{path}: `{name}` is set twice, by `{other}` and by `{key}`; keep one of them")
            said[name] = key
    return found


def leaves(values: Mapping, above: str = "") -> dict:
    """Return the values that are no blocks, by their dotted keys, however blocks and dotted keys are mixed."""
    found = {}
    for key, value in values.items():
        name = f"{above}.{key}" if above else str(key)
        found |= leaves(value, name) if isinstance(value, Mapping) and value else {name: value}
    return found


def asked(folder: Path) -> Asked | None:
    """Return the target of one's own that FOLDER/settings.yaml asks for, and its test; None where it asks for none.

    Raises InputError for unknown keys and wrong values.
    """
    given: dict = {}
    for key, value in read(folder).items():
        block, _, inside = key.partition(".")
        if block in ASKED and inside and isinstance(given.setdefault(block, {}), dict):
            given[block] = given[block] | {inside: value}
        elif block in ASKED:
            given[block] = value
    return params.check_block(given, Asked, "", dict.fromkeys(ASKED, str(folder / FILE))) if given else None


def of_sensor(folder: Path) -> dict:
    """Return the settings of FOLDER/settings.yaml that are a sensor's, as `read` without the target of one's own."""
    return {key: value for key, value in read(folder).items() if key.partition(".")[0] not in ASKED}


def write(
    source: Path, target: Path, experiment: str, folder: Path, seeds: Sequence[int], models: Sequence[str] | None
) -> Path:
    """Write the settings for a sensor's logs to a folder, and return its params.yaml.

    source: params.yaml of the checkout; target: the folder; folder: of the logs; seeds: of every protocol; models: keys
    of the settings, None: all that there are. What follows from the sensor's settings is decided on what they come to,
    not on their spelling, and anything that they set themselves goes first. Raises InputError for unknown keys, parts
    of blocks and wrong values of settings.yaml.
    """
    settings, given, where = copied(source, target), of_sensor(folder), str(folder / FILE)
    listed = (f"{experiment}.protocols", f"{experiment}.models")  # whose entries may be those that follow
    first = {key: value for key, value in given.items() if not key.startswith(tuple(f"{name}." for name in listed))}
    _set(first, settings, where)
    block = params.read(settings)[experiment]
    changed = _following(experiment, block, seeds)
    set_values({key: value for key, value in changed.items() if not _is_set(given, key)}, settings)
    _set({key: value for key, value in given.items() if key not in first}, settings, where)
    if not _is_set(given, listed[1]):
        known = params.read(settings)[experiment]["models"]
        chosen = [model for model in models or known if model in known]
        if _is_no_picture(block, experiment):
            chosen = [model for model in chosen if model in WITHOUT_NETWORKS]
        set_values({listed[1]: {model: known[model] for model in chosen}}, settings)
    return settings


def _set(given: Mapping, settings: Path, where: str) -> None:
    """Set values of settings.yaml, `where`, and check all settings; errors as `write`."""
    values = params.read(settings)
    _refuse_faults_of_others(given, values, where)
    for key, value in given.items():
        alone, lacking = params.parts(key, value, _at(values, key))
        if lacking and alone:
            lines = ", ".join(f"`{on_a_line({name: each})[1:-1]}`" for name, each in alone.items())
            raise InputError(
                f"{where}: the block `{key}` lacks {', '.join(lacking)}; add what it lacks, or, to change only what "
                f"it has, write {lines} in its place"
            )
    set_values(dict(given), settings, where)
    params.check(params.read(settings), dict.fromkeys(given, where))


def _refuse_faults_of_others(given: Mapping, values: Mapping, where: str) -> None:
    """Raise InputError for a model that is to be trained with faults and cannot be."""
    for name in leaves(given):
        experiment, *inside = name.split(".")
        if len(inside) < 3 or inside[0] != "models" or "faults" not in inside[2:]:
            continue
        can = [model for model in values[experiment]["models"] if _takes_faults(experiment, model)]
        if inside[1] in values[experiment]["models"] and inside[1] not in can:
            key = f"{name.partition('.faults')[0]}.faults"
            raise InputError(
                f"{where}: `{key}`: {inside[1]} cannot be trained with faults; of the models of {experiment} these "
                f"can: {', '.join(can)}"
            )


def _takes_faults(experiment: str, model: str) -> bool:
    """Tell whether a model can be trained with faults."""
    return params.is_optional(f"{experiment}.models.{model}.training.faults")


def _at(values: Mapping, dotted: str):
    """Return a value of nested settings; None where there is none."""
    for key in dotted.split("."):
        values = values.get(key) if isinstance(values, Mapping) else None
    return values


def _is_set(given: Mapping, dotted: str) -> bool:
    """Tell whether the sensor's settings have a key, by itself or within a block."""
    return any(dotted == key or dotted.startswith(f"{key}.") for key in given)


def _following(experiment: str, block: Mapping, seeds: Sequence[int]) -> dict:
    """Return the settings that follow from those of a sensor, by dotted keys; block: the experiment's, with its own.

    Training at the full budget, every protocol without overlap and the models of sensors of one's own; of a glove one
    protocol per dataset of images, and every frame, since the settings thin out the simulated sessions.
    """
    each = {"seeds": list(seeds)}
    of_protocols = block["protocols"].items()
    protocols = {key: dict(value) | each for key, value in of_protocols if not key.startswith(OVERLAPPING)}
    kind = experiments.module(experiment).KIND
    known = dict(block["models"]) | YARDSTICKS[kind]
    changed = {}
    if kind == "series":
        protocols = dict.fromkeys(block["sensor"].get("tasks") or protocols, each)
        if block["sensor"].get("pressed_below_mm") is not None:
            from tactile.models import press_difference  # here, because the import of torch takes seconds

            known[OF_PRESSES] = TREES | {"press": block["window"]["frames"] - max(press_difference.REST)}
    if kind == "images":
        changed[f"{experiment}.window.stride"] = 1
        protocols = {f"session_{name}": each for name in images.modalities(block)}
    of_all = {"budget": 1.0, "protocols": protocols, "models": known}
    return changed | {f"{experiment}.{key}": value for key, value in of_all.items()}


def _is_no_picture(block: Mapping, experiment: str) -> bool:
    """Tell whether the images of a glove or mat are too small for networks; block: settings of the experiment."""
    return experiments.module(experiment).KIND == "images" and min(images.shape(block)) < SMALLEST_IMAGE


def of_logs(workspace: Workspace, experiment: str, folder: Path) -> dict:
    """Return all settings for a sensor's logs; errors as `write`."""
    with tempfile.TemporaryDirectory() as draft:
        return params.read(write(workspace.params, Path(draft), experiment, folder, SEEDS, None))


def say_left_out(block: Mapping, experiment: str) -> None:
    """Print which models there are where networks of images are left out; block: settings of the experiment."""
    if _is_no_picture(block, experiment):
        print(f"fewer than {SMALLEST_IMAGE} pixels on a side: {', '.join(block['models'])}, no networks of images")
