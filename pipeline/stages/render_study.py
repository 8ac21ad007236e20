"""Write what studies found for people: reports/STUDY, and the table that it is made of, reports/STUDY.csv.

Of stability the table is in the folder. `computed`: those whose tables are of the evidence, physics and rightsize.
Usage: python -m pipeline.stages.render_study computed|stability|twins
"""

from pipeline.base import arguments, files, params
from pipeline.base.paths import Workspace
from pipeline.reporting import studies

STUDIES = {
    "computed": (studies.physics, studies.rightsize),
    "stability": (studies.stability,),
    "twins": (studies.twins,),
}


def main(workspace: Workspace) -> None:
    """Render the studies named on the command line; their folders in reports/ are replaced whole."""
    chosen = STUDIES[arguments.parse(__doc__, name=tuple(STUDIES)).name]
    values = params.load(workspace.params)
    for study in chosen:
        target = workspace.reports / study.__name__
        with files.replacing_folder(target) as draft:
            table = study(workspace, draft, values)
        if table is not None:
            # As in scores.csv, a mean that does not exist is `nan`.
            missing = "nan" if study is studies.rightsize else ""
            files.write_table(target.with_suffix(".csv"), table, missing=missing)
        print(f"reports/{study.__name__}: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    arguments.run(main)
