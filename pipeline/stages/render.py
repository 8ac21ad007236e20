"""Stage: what people read: tables, figures and findings of one experiment in reports/<experiment>.

Everything with a measured time in it is in reports/<experiment>/speed; reports/<experiment>/accuracy is the
same in every run.
Usage: python -m pipeline.stages.render EXPERIMENT
"""

import sys

from pipeline import pages_glove, pages_strain, pages_touch
from pipeline.base import files, params, paths
from pipeline.base.availability import why_not_run
from pipeline.base.errors import run_stage

WRITERS = {
    "touch": pages_touch.write_touch,
    "velostat_recorded": pages_touch.write_velostat_recorded,
    "strain": pages_strain.write_strain,
    "strain_recorded": pages_strain.write_strain_recorded,
    "glove": pages_glove.write_glove,
    "glove_recorded": pages_glove.write_glove_recorded,
}


def main() -> None:
    """Render the experiment named on the command line; its folder in reports/ is replaced whole."""
    values = params.load()
    experiment = params.experiment_argument(sys.argv, "render", values)
    target = paths.REPORTS / experiment
    reason = why_not_run(experiment)
    with files.replacing_folder(target) as draft:
        for part in ("accuracy", "speed"):
            (draft / part).mkdir()
            if reason:
                text = f"# {experiment}: not run\n\n{reason[0].upper()}{reason[1:]}.\n"
                files.write_text(draft / part / "README.md", text)
        if reason is None:
            WRITERS[experiment](values[experiment], draft)
    print(f"reports/{experiment}: {sum(path.is_file() for path in target.rglob('*'))} files")


if __name__ == "__main__":
    run_stage(main)
