"""Stage: what people read of the stability tests of all experiments, in reports/stability.

Usage: python -m pipeline.stages.render_stability
"""

from pathlib import Path

import pandas as pd

from pipeline.base import files, params, paths
from pipeline.base.availability import why_not_run
from pipeline.base.errors import InputError, run_stage
from pipeline.reporting import stability as stability_report
from pipeline.reporting.figures import stability as stability_figures


def main() -> None:
    """Render all experiments of params.yaml; the folder in reports/ is replaced whole."""
    values = params.load()
    target = paths.REPORTS / "stability"
    with files.replacing_folder(target) as draft:
        _write(values, draft)
    print(f"reports/stability: {sum(path.is_file() for path in target.rglob('*'))} files")


def _write(values: dict, folder: Path) -> None:
    """All of the report, into the new folder."""
    found, trained, pictures, absent = [], [], {}, {}
    for experiment in values["experiments"]:
        if reason := why_not_run(experiment):
            absent[experiment] = reason[0].upper() + reason[1:]
            continue
        if experiment not in values["stress"]:
            raise InputError(f"params.yaml, stress: there is no block '{experiment}'; add one")
        settings, stress = values[experiment], values["stress"][experiment]
        table = stability_report.read(experiment, settings, stress)
        found.append(stability_report.failures(table, experiment))
        trained.append(stability_report.training_failures(experiment, settings))
        pictures[experiment] = []
        for name, title, panels in stability_report.panels(table, experiment):
            _, error, unit = stability_report.ERRORS[experiment]
            ylabel = error if unit == "1" else f"{error} ({unit})"
            stability_figures.small_multiples(folder / name, panels, title, ylabel)
            pictures[experiment].append(name)
    failures = pd.concat(found, ignore_index=True) if found else pd.DataFrame(columns=stability_report.FAILURES)
    training = pd.concat(trained, ignore_index=True) if trained else pd.DataFrame(columns=stability_report.TRAININGS)
    for name, part in (("failures", failures), ("training", training)):
        files.write_table(folder / f"{name}.csv", part)
    texts = {
        "README": stability_report.findings(failures, training, pictures, absent),
        "failures": stability_report.failure_text(failures),
        "training": stability_report.training_text(training),
    }
    for name, text in texts.items():
        files.write_text(folder / f"{name}.md", text)


if __name__ == "__main__":
    run_stage(main)
