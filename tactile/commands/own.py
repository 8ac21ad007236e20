"""Train models on your own logs, apart from all else, and write what they score: reports/own/NAME.

NAME is the path of FOLDER in data/own, or else in the folder of work; no sensor lies in the folder of another, and one
process at a time trains on a sensor. Its logs say what they are of: array.log a pressure array, daq.log strain sensors,
scanner.log a glove. FOLDER/settings.yaml, where there is one, sets what differs from params/, by dotted keys such as
`touch.sensor.rows: 4`. The logs are checked first, as by `tactile check`. Nothing is simulated, and no file that git
follows changes: what is computed is in build/own/NAME, with every trained model in build/own/NAME/trained, for `tactile
predict MODEL LOGS`. What is up to date is not trained again.

Where settings.yaml has `target:` and `split:`, that target is tested instead, group by group, and its model is kept in
build/own/NAME/trained/target: docs/own_sensor.md.

Examples:

    tactile own data/own/finger
"""

import argparse
import os
import shlex
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from tactile import experiments
from tactile.base import files, modules, params, processes
from tactile.base.errors import InputError
from tactile.base.params_file import set_values
from tactile.base.paths import Workspace
from tactile.commands import check, sheet, targets
from tactile.commands.targets import Effort
from tactile.datasets import schemas
from tactile.logs import own_data
from tactile.own import report
from tactile.own import settings as own_settings
from tactile.settings.targets import Asked
from tactile.sheet import quantities, sources

STAGES = ("ingest", "window", "dataset", "train", "evaluate")  # `window` of what is cut into windows
TRAINED = "trained"  # folder of the models, in the workspace of a sensor


add_arguments = check.add_arguments


def main(
    checkout: Workspace,
    given: argparse.Namespace,
    effort: Effort = targets.FULL,
    seeds: Sequence[int] = own_settings.SEEDS,
    models: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Train on the logs named on the command line, or test their target; seeds, models: as of `prepared`."""
    experiment = check.experiment_of(given.folder, given.experiment)
    if asked := own_settings.asked(given.folder):
        return of_target(checkout, experiment, given.folder, asked, effort)
    with prepared(checkout, given.folder, seeds, models) as sensor:
        run(checkout, sensor, params.load(sensor.workspace.params))


class Sensor(NamedTuple):
    """A sensor to train on."""

    experiment: str
    folder: Path  # of its logs
    name: str  # as of `name_of`
    workspace: Workspace  # build/own/NAME, as `prepare` makes it


@contextmanager
def prepared(
    checkout: Workspace, folder: Path, seeds: Sequence[int], models: Mapping[str, Sequence[str]] | None = None
) -> Iterator[Sensor]:
    """Give the block a sensor whose workspace is up to date, and keep other processes from it.

    seeds, models: as of `prepare`, models by experiment. Raises InputError for a folder that holds no sensor, and where
    another process trains on it.
    """
    with alone(checkout, check.experiment_of(folder), folder) as sensor:
        prepare(checkout, sensor, seeds, models and models[sensor.experiment])
        yield sensor


@contextmanager
def alone(checkout: Workspace, experiment: str, folder: Path) -> Iterator[Sensor]:
    """Keep other processes from a sensor during the block; errors as `prepared`."""
    name = name_of(checkout, folder)

    def refuse() -> None:
        both = f"`tactile own {folder}` or `tactile try {folder}`"
        raise InputError(f"{both} is already running; wait until it ends, or stop it")

    sensor = Sensor(experiment, folder, name, Workspace(checkout.root / "build" / "own" / name))
    with processes.holding(sensor.workspace.root / "lock", refuse):
        yield sensor


def of_target(checkout: Workspace, experiment: str, folder: Path, asked: Asked, effort: Effort) -> None:
    """Test the target of a sensor, alone; errors as `prepared` and `targets.of_own`, and what `check` says to fix."""
    settings = own_settings.of_logs(checkout, experiment, folder)[experiment]
    with alone(checkout, experiment, folder) as sensor:
        if problem := check.check_target(experiment, folder, settings, asked):
            raise InputError(f"fix first: {problem}")
        trained = sensor.workspace.root / TRAINED
        targets.of_own(checkout, trained, experiment, folder, sensor.name, asked, effort)


def name_of(checkout: Workspace, folder: Path) -> str:
    """Return the path of a sensor's folder below data/own, or else below the workspace: `finger` or `left/finger`.

    Raises InputError for a folder elsewhere, and for one in, or around, the folder or the report of another sensor.
    """
    folder = Path(os.path.abspath(folder))  # without ..
    if problem := own_data.linked(folder):
        raise InputError(f"fix first: {problem}")
    around = own_data.own_folder(checkout, folder) or Path(os.path.abspath(checkout.root))
    if not folder.is_relative_to(around):
        root = shlex.quote(str(folder.parent))
        raise InputError(f"{folder}: lies outside of {around}; add `--root {root}`, or another folder around it")
    parts = folder.relative_to(around).parts
    if not parts:
        raise InputError(f"{folder}: holds the folders of sensors; move its logs into one, such as {folder / 'finger'}")
    outer = [around for around in list(folder.parents)[: len(parts) - 1] if check.kinds_of(around)]
    logs = [log for name in experiments.having("log").values() for log in files.finished(folder.rglob(name))]
    inner = sorted(log.parents[2] for log in logs if len(log.relative_to(folder).parts) > 3)
    reports = checkout.reports.joinpath("own", *parts)
    inner += sorted(path for path in reports.glob("*") if path.is_dir())
    if other := outer or inner:
        raise InputError(f"{folder}: lies in one folder with {other[0]}, another sensor; move one of them")
    return "/".join(parts)


def run(checkout: Workspace, sensor: Sensor, values: Mapping) -> None:
    """Check logs, train on them and write their report; values: the settings of the workspace.

    Raises InputError that names the first thing to fix.
    """
    experiment, folder, name, workspace = sensor
    if problem := check.check(checkout, experiment, folder, values):
        raise InputError(f"fix first: {problem}")
    windows = experiments.module(experiment).KIND == "windows"
    for stage in (stage for stage in STAGES if windows or stage != "window"):
        if stage == "train":
            fit_centres(workspace, experiment, values)
        modules.run(workspace.root, f"tactile.stages.{stage}", experiment)
    modules.run(workspace.root, "tactile.commands.command_line", "coverage", experiment, quiet=True)
    target = checkout.reports / "own" / name
    with files.replacing_folder(target) as draft:
        report.write(workspace, draft, experiment, values[experiment])
        of = sources.sensors(experiment, name, folder, values[experiment])
        sheet.write(draft, "sheet", [quantities.sheet(sensor) for sensor in of])
    trained = workspace.root / TRAINED
    with files.replacing_folder(trained) as draft:
        for model in values[experiment]["models"]:
            if model != "constant":
                package = [f"{experiment}/{model}", str((draft / model).absolute())]
                modules.run(workspace.root, "tactile.commands.command_line", "export", *package, quiet=True)
    print(f"\n{target}/README.md: what they score; sheet.md beside it: what the sensor itself is worth")
    names = ", ".join(sorted(path.name for path in trained.glob("*")))
    print(f"{trained}: {names}, for `tactile predict MODEL LOGS`")


def fit_centres(workspace: Workspace, experiment: str, values: Mapping) -> None:
    """Lower `rbf.centres`, and say so, to half of the windows that the smallest run trains on, where these are fewer.

    With as many centres as windows the model would keep each window by heart. values: the settings of the workspace.
    """
    centres = values[experiment]["models"].get("rbf", {}).get("centres", 0)
    runs = [schemas.split_column(*run) for run in params.runs(values, experiment)] if centres else []
    table = schemas.read(workspace.dataset(experiment), runs) if runs else {}
    least = min((int((schemas.names(table[name]) == "train").sum()) for name in runs), default=centres)
    if least < centres:
        fewer = max(1, least // 2)
        set_values({f"{experiment}.models.rbf.centres": fewer}, workspace.params)
        print(f"rbf: {least} windows train, fewer than {centres} centres; it has {fewer}, half as many as windows")


def prepare(checkout: Workspace, sensor: Sensor, seeds: Sequence[int], models: Sequence[str] | None) -> None:
    """Make or renew a workspace: the settings with this sensor's settings, its logs.

    The logs are links to the files of its folder. What the stages have written there stays. seeds: of every protocol;
    models: keys of the settings, None: all that there are.
    """
    experiment, folder, name, workspace = sensor
    settings = own_settings.write(checkout.params, workspace.root, experiment, folder, seeds, models)
    own_settings.say_left_out(params.read(settings)[experiment], experiment)
    set_values({f"{experiment}.source": f"data/own/{name}"}, settings)
    logs = workspace.root / "data" / "own"
    shutil.rmtree(logs, ignore_errors=True)
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            link = logs / name / path.relative_to(folder)
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to(path.resolve())
