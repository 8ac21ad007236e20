"""Say what a sensor is worth, from its logs alone: the numbers of a data sheet, in seconds, without any training.

SOURCE is a folder of logs as `tactile check` reads it, with its settings.yaml, or the name of an experiment whose logs
are on this machine, such as velostat_recorded (`tactile fetch velostat_recorded`) or touch (simulated). Several stand
side by side. Every number has the number of presses that it is of and a 95 % bootstrap interval over them; where logs
cannot tell a number, the sheet says why.

Examples:

    tactile sheet data/own/finger
    tactile sheet data/own/finger data/own/glove --json
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from tactile.base import files, params, paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import check
from tactile.experiments import facts
from tactile.logs import sources as public
from tactile.own import settings as own_settings
from tactile.sheet import quantities, sources
from tactile.sheet.cycles import Sensor
from tactile.sheet.page import figure, text
from tactile.sheet.quantities import Sheet


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add sources and what is written to the parser of this command."""
    parser.add_argument("source", nargs="+", metavar="SOURCE", help="such as data/own/finger, or touch")
    parser.add_argument("--json", action="store_true", help="numbers in full precision in place of Markdown")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="also draw loading curve, rest and a press (PNG)")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="write README.md, sheet.json and sheet.png there")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Print, or write, the sheet of every source named on the command line."""
    values = params.load(workspace.params)
    sheets = [quantities.sheet(sensor) for source in given.source for sensor in sensors(workspace, values, source)]
    if given.out:
        with files.changing_folder(given.out) as draft:
            write(draft, "README", sheets)
            files.write_text(draft / "sheet.json", text.as_json(sheets) + "\n")
    if given.figure:
        figure.draw(given.figure, sheets)
    if not given.out:
        print(text.as_json(sheets) if given.json else text.markdown(sheets, given.figure.name if given.figure else ""))


def write(folder: Path, name: str, sheets: Sequence[Sheet]) -> None:
    """Write sheets to <name>.md in a folder, with their picture sheet.png where there is something to draw."""
    picture = "sheet.png" if any(not sheet.given.untold for sheet in sheets) else ""
    (folder / "sheet.png").unlink(missing_ok=True)  # of a former sheet
    if picture:
        figure.draw(folder / picture, sheets)
    files.write_text(folder / f"{name}.md", text.markdown(sheets, picture))


def sensors(workspace: Workspace, values: Mapping, source: str) -> Iterator[Sensor]:
    """Yield the sensors of a folder, or of an experiment; InputError where there are no such logs. values: settings."""
    if source not in values["experiments"] or Path(source).is_dir():
        folder = Path(source)
        experiment = check.experiment_of(folder)
        settings = own_settings.of_logs(workspace, experiment, folder)[experiment]
        yield from sources.sensors(experiment, folder.name or str(folder.resolve().name), folder, settings)
        return
    if facts(source).source:
        yield from sources.sensors(source, source, *recorded(workspace, values, source))
        return
    folder = paths.require(workspace.logs(source), f"python -m pipeline.stages.simulate {source}")
    yield from sources.sensors(source, source, folder, values[source], simulated=True)


def recorded(workspace: Workspace, values: Mapping, source: str) -> tuple[Path, dict]:
    """Return the folder of a public recording, and its settings with every sample; InputError where it is not here."""
    if not public.is_complete(workspace, source):
        raise InputError(f"{public.folder(workspace, source)}: no recordings; run `tactile fetch {source}`")
    ingest = values[source]["ingest"]
    whole = ingest | {"every": 1} if "every" in ingest else ingest  # of every third sample, presses have seven readings
    return public.folder(workspace, source), values[source] | {"ingest": whole}
