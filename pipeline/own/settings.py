"""Settings of a sensor of your own: those of the checkout, with what its settings.yaml sets, and what follows from it.

`check`, `sheet`, `try` and `own` all take them from here.
"""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from pipeline.base import params
from pipeline.base.errors import InputError
from pipeline.base.params_file import copied, set_values
from pipeline.base.paths import Workspace
from pipeline.datasets import images
from pipeline.models import press_difference
from pipeline.settings.targets import Asked

FILE = "settings.yaml"  # in a folder of logs
ASKED = tuple(Asked.model_fields)  # blocks of a target of one's own, which belong to no experiment
SEEDS = [0, 1, 2]
SMALLEST_IMAGE = 8  # pixels of a side; the networks halve an image two to five times
YARDSTICKS = {  # of every sensor of one's own, in no table of the papers
    experiment: {
        "window_trees": {"trees": 20, "min_samples_leaf": leaf},
        "window_ridge": {"parts": 4, "shares": experiment == "glove"},
    }
    for experiment, leaf in (("touch", 20), ("strain", 5), ("glove", 1))  # a leaf of touch holds a whole map
}
# For sensors of a few channels, whose image is no picture.
WITHOUT_NETWORKS = ("constant", "naive_bayes", "tree", "window_trees", "window_ridge")
PRESSED = "strain.sensor.pressed_below_mm"  # the setting that says what a press is
OF_PRESSES, TREES = "press_difference", {"trees": 50, "min_samples_leaf": 5}  # a model that must know it
OVERLAPPING = "random"  # protocols whose test part holds what was trained on: the papers' own, of no use here


def read(folder: Path) -> dict:
    """Return the dotted keys and values of FOLDER/settings.yaml; {} where there is none. Errors as params.parsed."""
    path = folder / FILE
    if not path.exists():
        return {}
    values = params.parsed(path)
    if not isinstance(values, dict):
        raise InputError(f"{path}: expected dotted keys and values such as `touch.sensor.rows: 4`")
    return values


def asked(folder: Path) -> Asked | None:
    """Return the target of one's own that FOLDER/settings.yaml asks for, and its test; None where it asks for none.

    Raises InputError for unknown keys and wrong values.
    """
    given = {key: value for key, value in read(folder).items() if key in ASKED}
    return params.check_block(given, Asked, "", dict.fromkeys(ASKED, str(folder / FILE))) if given else None


def write(
    source: Path, target: Path, experiment: str, folder: Path, seeds: Sequence[int], models: Sequence[str] | None
) -> Path:
    """Write the settings for a sensor's logs to a folder, and return its params.yaml.

    source: params.yaml of the checkout; target: the folder; folder: of the logs; seeds: of every protocol; models: keys
    of the settings, None: all that there are. Raises InputError for unknown keys and wrong values of settings.yaml.
    """
    settings = copied(source, target)
    block = params.read(settings)[experiment]
    known = dict(block["models"]) | YARDSTICKS[experiment]
    of_sensor = {key: value for key, value in read(folder).items() if key not in ASKED}
    each = {"seeds": list(seeds)}
    protocols = {
        key: dict(value) | each for key, value in block["protocols"].items() if not key.startswith(OVERLAPPING)
    }
    if experiment == "strain" and isinstance(tasks := of_sensor.get("strain.sensor.tasks"), dict) and tasks:
        protocols = dict.fromkeys(tasks, each)
    if of_sensor.get(PRESSED) is not None:
        frames = of_sensor.get("strain.window.frames", block["window"]["frames"])
        known[OF_PRESSES] = TREES | {"press": frames - max(press_difference.REST)}
    changed = {
        f"{experiment}.budget": 1.0,
        f"{experiment}.protocols": protocols,
        f"{experiment}.models": {model: known[model] for model in models or known if model in known},
    }
    set_values({key: value for key, value in changed.items() if key not in of_sensor}, settings)
    where = str(folder / FILE)
    set_values(of_sensor, settings, where)
    values = params.read(settings)
    params.check(values, dict.fromkeys(of_sensor, where))
    if experiment == "glove":
        set_values(_of_images(values["glove"], seeds, of_sensor), settings)
    return settings


def of_logs(workspace: Workspace, experiment: str, folder: Path) -> dict:
    """Return all settings for a sensor's logs; errors as `write`."""
    with tempfile.TemporaryDirectory() as draft:
        return params.read(write(workspace.params, Path(draft), experiment, folder, SEEDS, None))


def say_left_out(block: Mapping, experiment: str) -> None:
    """Print which models there are where networks of images are left out; block: settings of the experiment."""
    if experiment == "glove" and min(images.shape(block)) < SMALLEST_IMAGE:
        print(f"fewer than {SMALLEST_IMAGE} pixels on a side: {', '.join(block['models'])}, no networks of images")


def _of_images(block: Mapping, seeds: Sequence[int], of_sensor: Mapping) -> dict:
    """Return the settings that follow from a sensor's areas: one protocol per dataset of images, and which models.

    block: the settings of `glove` with this sensor's settings; of_sensor: these settings, which go first.
    """
    changed = {"glove.window.stride": 1}  # every frame; the settings thin out the simulated sessions
    changed["glove.protocols"] = {f"session_{name}": {"seeds": list(seeds)} for name in images.modalities(block)}
    if min(images.shape(block)) < SMALLEST_IMAGE:
        models = {key: value for key, value in block["models"].items() if key in WITHOUT_NETWORKS}
        changed["glove.models"] = models
    return {key: value for key, value in changed.items() if key not in of_sensor}
