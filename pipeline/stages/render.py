"""Write what people read of one experiment: tables, figures and findings in reports/<experiment>.

They are of the evidence. With `look`, the same is written to reports/look/<experiment> of what was computed here; that
of people's own logs, of which there is no evidence, is there alone. Everything with a measured time in it is in the
folder `speed`; the folder `accuracy` is the same in every run. The word `all` stands for every experiment.
Usage: python -m pipeline.stages.render EXPERIMENT|all [look]
"""

from collections.abc import Callable, Mapping
from pathlib import Path

from tqdm import tqdm

from pipeline.reporting import glove, recorded, strain, touch
from pipeline.results.claim_inputs import LOOK
from pipeline.results.one_table import of_own_logs
from tactile.base import arguments, files, params, workers
from tactile.base.availability import why_not_run
from tactile.base.paths import Workspace
from tactile.own import report as own_sensor

ALL = "all"
SIMULATED = {report.__name__.rpartition(".")[2]: report for report in (glove, strain, touch)}  # named as experiments


def write(workspace: Workspace, target: Path, experiment: str, settings: Mapping, look: bool) -> None:
    """Write the report of recordings, of own logs or of a scene to `accuracy` and `speed` in the folder `target`."""
    if "source" not in settings:
        recorded.write(workspace, target, experiment, settings, look)
    elif settings["source"] != "simulated":
        own_sensor.write(workspace, target / "accuracy", experiment, settings)
    else:
        SIMULATED[experiment].write(workspace, target, settings, look)


def render(workspace: Workspace, values: Mapping, experiment: str, look: bool, report: Callable[[], None]) -> None:
    """Render one experiment; its folder is replaced whole."""
    target = (workspace.look if look else workspace.reports) / experiment
    reason = why_not_run(workspace, experiment) if look else None
    if not look and experiment in of_own_logs(values):
        reason = f"of own logs there is no evidence; their report is in reports/look/{experiment}"
    with files.replacing_folder(target) as draft:
        for part in ("accuracy", "speed"):
            (draft / part).mkdir()
            if reason:
                text = f"# {experiment}: nothing to show\n\n{reason[0].upper()}{reason[1:]}.\n"
                files.write_text(draft / part / "README.md", text)
        if reason is None:
            write(workspace, draft, experiment, values[experiment], look)
    report()


def main(workspace: Workspace) -> None:
    """Render the experiment named on the command line, or all of them, in as many processes as there are cores."""
    values = params.load(workspace.params)
    given = arguments.parse(__doc__, experiment=(*values["experiments"], ALL), of=(LOOK, None))
    asked = values["experiments"] if given.experiment == ALL else [given.experiment]
    calls = {name: (workspace, values, name, given.of == LOOK) for name in asked}
    with tqdm(total=len(asked), desc="render", unit="report") as bar:
        list(workers.run(render, calls, bar))
    target = workspace.look if given.of == LOOK else workspace.reports
    for name in asked:
        count = sum(path.is_file() for path in (target / name).rglob("*"))
        print(f"{(target / name).relative_to(workspace.root)}: {count} files")


if __name__ == "__main__":
    arguments.run(main)
