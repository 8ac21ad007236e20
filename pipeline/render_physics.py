"""Stage: which effects of the simulated scenes the results need: reports/physics.csv and reports/physics.

Usage: python -m pipeline.render_physics
"""

import os
import shutil

import pandas as pd

from pipeline import effects, figures_physics, params, paths, report_physics, results
from pipeline.errors import InputError, run_stage
from pipeline.variants import COLUMNS, variants


def read(experiment: str, values: dict) -> pd.DataFrame:
    """physics.csv of an experiment. Raises InputError where a row of params.yaml's runs is missing."""
    path, made_by = paths.physics(experiment), f"python -m pipeline.physics {experiment}"
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


def _repr(value: float) -> str:
    """The shortest text that reads back as the same number."""
    return repr(float(value))


def main() -> None:
    """Judge and render all experiments."""
    values = params.load()
    scores = {experiment: read(experiment, values) for experiment in values["physics"]}
    found = {experiment: effects.assess(experiment, table) for experiment, table in scores.items()}
    target = paths.REPORTS / "physics"
    draft = target.with_name("physics.unfinished")
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    for experiment, one in found.items():
        unit = report_physics.ERRORS[scores[experiment]["metric"].iloc[0]]
        title = f"{report_physics.TITLES[experiment]}: an effect of the scene left out"
        figures_physics.matrices(draft / f"{experiment}.png", title, one, unit)
    text = report_physics.readme(found, scores, values)
    (draft / "README.md").write_text(text, encoding="utf-8")
    rows = [row for experiment, one in found.items() for row in effects.report_rows(experiment, one)]
    table = paths.REPORTS / "physics.csv"
    unfinished = table.with_name("physics.csv.unfinished")
    pd.DataFrame(rows).to_csv(unfinished, index=False, lineterminator="\n", float_format=_repr)
    shutil.rmtree(target, ignore_errors=True)
    draft.rename(target)
    os.replace(unfinished, table)
    for experiment, one in found.items():
        spare = [judged.effect for judged in one.effects if judged.verdict == effects.NOT_NEEDED]
        print(f"{experiment}: not needed: {', '.join(spare) or 'none'}")


if __name__ == "__main__":
    run_stage(main)
