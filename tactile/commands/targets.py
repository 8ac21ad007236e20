"""Test targets on the recorded sensors: the arm's place on another day, the object in another block of grasps.

It is what `tactile try` and `tactile own` do for a sensor whose settings.yaml has `target:` and `split:`, on recordings
that everybody can get (`tactile fetch strain_recorded`, `tactile fetch glove_recorded`). OUT gets README.md and
scores.csv.

Examples:

    tactile targets --out build/targets
"""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from tactile.base import files, params, provenance
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import sheet
from tactile.own import settings as own_settings
from tactile.settings.targets import Asked
from tactile.sheet import quantities, sources
from tactile.sheet.quantities import Sheet
from tactile.targets import features, kept, read, validate
from tactile.targets import report as own_target
from tactile.targets.read import Data
from tactile.targets.report import Section


class Effort(NamedTuple):
    """How much is computed."""

    windows: int  # at most
    trees: int  # of a forest


LOOK, FULL = Effort(4_000, 50), Effort(12_000, 100)
WIDE = 6_000  # windows at most of a sensor of several hundred elements, as whose statistics a gigabyte is soon full
MANY = 200  # elements
MODEL = "target"  # folder of the model, beside those that have no target of one's own


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the place of the results to the parser of this command."""
    parser.add_argument("--out", type=Path, required=True, metavar="OUT", help="such as reports/targets")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Test the targets of the recorded sensors."""
    values, sections = params.load(workspace.params), []
    for name, (experiment, _) in read.RECORDED.items():
        folder, settings = sheet.recorded(workspace, values, experiment)
        sheets = [quantities.sheet(one) for one in sources.sensors(experiment, experiment, folder, settings)]
        sections.append(section(experiment, read.recorded(name, folder, settings), sheets, FULL))
    own_target.write(
        given.out,
        "Targets of the recorded sensors",
        sections,
        "What the sensors themselves are worth, before any model sees them: [their data sheets](../sheet/README.md).",
    )
    print(f"{given.out}/README.md: what they score")


def section(sensor: str, data: Data, sheets: list[Sheet], effort: Effort) -> Section:
    """Test a target; sheets: of its sensor, [] where there is none; effort: how much is computed."""
    lines: Mapping = sheets[0].lines if sheets else {}
    length_s, reason = features.window_s(lines.get("creep, 1 s"), lines.get("creep, 10 s"))
    if data.target.window_s is not None:
        length_s, reason = data.target.window_s, "as target.window_s asks"
    most = min(effort.windows, WIDE) if data.series[0].reading.shape[1] > MANY else effort.windows
    windows = features.windows(data, length_s, most)
    print(f"{sensor}: {data.target.name}, {len(windows.y)} windows, groups: {', '.join(windows.groups)}")
    tested = validate.test_groups(windows, data.target.kind, data.target.unit, data.by, effort.trees)
    return Section(sensor, data.target, data.by, length_s, reason, windows, tested, [each.name for each in data.series])


def of_own(
    checkout: Workspace, trained: Path, experiment: str, folder: Path, name: str, asked: Asked, effort: Effort
) -> None:
    """Test the target of a sensor of one's own, and write reports/own/NAME, what it scores and what it said.

    The model that all groups choose is kept in the folder trained/target. name: of the sensor, its path in data/own.
    Raises InputError as `read.own`.
    """
    settings = own_settings.of_logs(checkout, experiment, folder)[experiment]
    data = read.own(experiment, folder, settings, asked)
    try:
        sheets = [quantities.sheet(one) for one in sources.sensors(experiment, name, folder, settings)]
        said = "What the sensor itself is worth, before any model sees it: [its data sheet](sheet.md)."
    except InputError as error:  # which needs more logs than a target does
        sheets, said = [], f"There is no data sheet of the sensor, for which its logs do not suffice ({error})."
    target = checkout.reports / "own" / name
    made = section(name, data, sheets, effort)
    with files.replacing_folder(target) as draft:
        own_target.write(draft, f"`{name}`: {asked.target.name}, your own logs", [made], said)
        files.write_text(draft / own_target.PREDICTIONS, own_target.predictions(made).to_csv(index=False))
        if sheets:
            sheet.write(draft, "sheet", sheets)
    with files.replacing_folder(trained) as draft:
        (draft / MODEL).mkdir()
        keep(draft / MODEL, experiment, folder, settings, data, made, effort)
    for warning in made.tested.warnings:
        print(f"warning: {warning}")
    print(f"\n{target}/README.md: what the models score on groups that they have not seen")
    print(f"{trained / MODEL}: the model of all groups, for `tactile predict MODEL LOGS`")


def keep(
    target: Path, experiment: str, folder: Path, settings: Mapping, data: Data, made: Section, effort: Effort
) -> None:
    """Fit the model that all groups choose, and write it to the folder `target`, which exists; folder: of the logs."""
    final = validate.final(made.windows, data.target.kind, effort.trees)
    scores = made.tested.scores
    names = scores[scores["model"] == validate.CHOSEN]["metric"].unique()
    kept.write(
        target,
        final,
        made.windows,
        {name: validate.over_tests(made.tested, validate.CHOSEN, name).mean for name in names},
        experiment=experiment,
        sensor=made.sensor,
        target=data.target,
        settings={block: settings[block] for block in kept.READ},
        window_s=made.length_s,
        by=data.by,
        interval_s=kept.interval_s(data),
        correlation=kept.correlated(data, experiment),
        commit=provenance.code()[0],
        trained_on=kept.trained_on(data, experiment, settings),
        logs=kept.logs(folder, data, experiment, made.windows),
        tests=kept.tests(made.tested),
    )
