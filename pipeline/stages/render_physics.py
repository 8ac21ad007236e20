"""Stage: which effects of the simulated scenes the results need: reports/physics.csv and reports/physics.

Usage: python -m pipeline.stages.render_physics
"""

import pandas as pd

from pipeline.base import files, params, paths
from pipeline.base.errors import InputError, run_stage
from pipeline.reporting import physics as physics_report
from pipeline.reporting.figures import physics as physics_figures
from pipeline.reporting.verdicts import physics as physics_verdicts
from pipeline.scoring import results
from pipeline.scoring.variants import COLUMNS, variants


def read(experiment: str, values: dict) -> pd.DataFrame:
    """physics.csv of an experiment. Raises InputError where a row of params.yaml's runs is missing."""
    path, made_by = paths.physics(experiment), f"python -m pipeline.studies.physics {experiment}"
    scores = results.read_csv(path, COLUMNS, made_by)
    there = set(zip(scores["effect"], scores["seed"], scores["condition"], scores["model"], strict=True))
    conditions = list(dict.fromkeys(scores["condition"]))
    for effect, seed in variants(values, experiment):
        for condition in conditions or ["any"]:
            for model in values["physics"][experiment]["models"]:
                if (effect, seed, condition, model) not in there:
                    raise InputError(
                        f"{results.shown(path)}: no row for effect {effect}, seed {seed}, condition {condition}, "
                        f"model {model}; run `{made_by}` again"
                    )
    if len(there) < len(scores):
        raise InputError(f"{results.shown(path)}: a run has two rows; run `{made_by}` again")
    return scores


def main() -> None:
    """Judge and render all experiments."""
    values = params.load()
    scores = {experiment: read(experiment, values) for experiment in values["physics"]}
    found = {experiment: physics_verdicts.assess(experiment, table) for experiment, table in scores.items()}
    with files.replacing_folder(paths.REPORTS / "physics") as draft:
        for experiment, one in found.items():
            unit = physics_report.ERRORS[scores[experiment]["metric"].iloc[0]]
            title = f"{physics_report.TITLES[experiment]}: an effect of the scene left out"
            physics_figures.matrices(draft / f"{experiment}.png", title, one, unit)
        files.write_text(draft / "README.md", physics_report.readme(found, scores, values))
    rows = [row for experiment, one in found.items() for row in physics_verdicts.report_rows(experiment, one)]
    files.write_table(paths.REPORTS / "physics.csv", pd.DataFrame(rows))
    for experiment, one in found.items():
        spare = [judged.effect for judged in one.effects if judged.verdict == physics_verdicts.NOT_NEEDED]
        print(f"{experiment}: not needed: {', '.join(spare) or 'none'}")


if __name__ == "__main__":
    run_stage(main)
