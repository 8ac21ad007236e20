"""Write what one study found for people: reports/NAME, and the table that it is made of, reports/NAME.csv.

Of stability the table is in the folder.
Usage: python -m pipeline.stages.render_study NAME
"""

from pipeline.base import arguments, files, params
from pipeline.base.paths import Workspace
from pipeline.reporting import studies

STUDIES = {study.__name__: study for study in (studies.physics, studies.rightsize, studies.stability)}


def main(workspace: Workspace) -> None:
    """Render the study named on the command line; its folder in reports/ is replaced whole."""
    name = arguments.parse(__doc__, name=(*STUDIES, "twins")).name
    values, target = params.load(workspace.params), workspace.reports / name
    with files.replacing_folder(target) as draft:
        twins = name == "twins"  # of the recordings and scenes as they are
        table = studies.twins(workspace, draft) if twins else STUDIES[name](workspace, draft, values)
    if table is not None:
        # As in scores.csv, a mean that does not exist is `nan`.
        files.write_table(target.with_suffix(".csv"), table, missing="nan" if name == "rightsize" else "")
    print(f"reports/{name}: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    arguments.run(main)
