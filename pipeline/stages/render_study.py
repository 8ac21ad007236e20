"""Write what studies found for people: reports/STUDY, and the table that it is made of, reports/STUDY.csv.

Of stability it is reports/stress.csv, what the evidence scored. `computed`: physics and rightsize.
Usage: python -m pipeline.stages.render_study computed|stability|twins
"""

from pipeline.reporting import stability, studies
from tactile.base import arguments, files, params
from tactile.base.paths import Workspace

STUDIES = {
    "computed": (studies.physics, studies.rightsize),
    "stability": (stability.stability,),
    "twins": (studies.twins,),
}
TABLES = {stability.stability: "stress.csv"}  # the others are called as their folder


def main(workspace: Workspace) -> None:
    """Render the studies named on the command line; their folders in reports/ are replaced whole."""
    chosen = STUDIES[arguments.parse(__doc__, name=tuple(STUDIES)).name]
    values = params.load(workspace.params)
    for study in chosen:
        target = workspace.reports / study.__name__
        with files.replacing_folder(target) as draft:
            table = study(workspace, draft, values)
        # As in scores.csv, a number that does not exist is `nan`.
        missing = "nan" if study in (studies.rightsize, stability.stability) else ""
        files.write_table(workspace.reports / TABLES.get(study, f"{study.__name__}.csv"), table, missing=missing)
        print(f"reports/{study.__name__}: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    arguments.run(main)
