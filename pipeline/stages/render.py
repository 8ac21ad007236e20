"""Write what people read of one experiment: tables, figures and findings in reports/<experiment>.

Everything with a measured time in it is in reports/<experiment>/speed; reports/<experiment>/accuracy is the
same in every run. Without its recordings, the committed folder of an experiment stays.
Usage: python -m pipeline.stages.render EXPERIMENT
"""

from pipeline.base import arguments, files, params
from pipeline.base.availability import has_report, why_not_run
from pipeline.base.paths import Workspace
from pipeline.reporting import glove, glove_recorded, own_sensor, strain, strain_recorded, touch, velostat_recorded
from pipeline.scoring.results import say_kept

REPORTS = {  # each module is named as its experiment
    report.__name__.rpartition(".")[2]: report
    for report in (glove, glove_recorded, strain, strain_recorded, touch, velostat_recorded)
}


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
        if reason is None and values[experiment].get("source", "simulated") != "simulated":
            own_sensor.write(workspace, draft / "accuracy", experiment, values[experiment])
        elif reason is None:
            REPORTS[experiment].write(workspace, draft, values[experiment])
    print(f"reports/{experiment}: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    arguments.run(main)
