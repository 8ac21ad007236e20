"""Write what people read of one experiment: tables, figures and findings in reports/<experiment>.

Everything with a measured time in it is in reports/<experiment>/speed; reports/<experiment>/accuracy is the
same in every run. Without its recordings, the committed folder of an experiment stays.
Usage: python -m pipeline.stages.render EXPERIMENT
"""

from collections.abc import Mapping
from pathlib import Path

from pipeline.base import arguments, files, params
from pipeline.base.availability import has_report, why_not_run
from pipeline.base.paths import Workspace
from pipeline.reporting import glove, own_sensor, recorded, strain, touch
from pipeline.scoring.results import say_kept

SIMULATED = {report.__name__.rpartition(".")[2]: report for report in (glove, strain, touch)}  # named as experiments


def write(workspace: Workspace, target: Path, experiment: str, settings: Mapping) -> None:
    """Write the report of recordings, of own logs or of a scene to `accuracy` and `speed` in the folder `target`."""
    if "source" not in settings:
        recorded.write(workspace, target, experiment, settings)
    elif settings["source"] != "simulated":
        own_sensor.write(workspace, target / "accuracy", experiment, settings)
    else:
        SIMULATED[experiment].write(workspace, target, settings)


def main(workspace: Workspace) -> None:
    """Render the experiment named on the command line; its folder in reports/ is replaced whole, or kept."""
    values = params.load(workspace.params)
    experiment = arguments.parse(__doc__, experiment=values["experiments"]).experiment
    target = workspace.reports / experiment
    reason = why_not_run(workspace, experiment)
    if reason and has_report(workspace, experiment):
        say_kept("reports", [experiment])
        return
    with files.replacing_folder(target) as draft:
        for part in ("accuracy", "speed"):
            (draft / part).mkdir()
            if reason:
                text = f"# {experiment}: not run\n\n{reason[0].upper()}{reason[1:]}.\n"
                files.write_text(draft / part / "README.md", text)
        if reason is None:
            write(workspace, draft, experiment, values[experiment])
    print(f"reports/{experiment}: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    arguments.run(main)
