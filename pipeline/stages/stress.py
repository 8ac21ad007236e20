"""Stage: the trained models, as they are, on perturbed test data: where does each of them fail?

Usage: python -m pipeline.stages.stress EXPERIMENT
"""

import sys
from collections.abc import Callable, Mapping
from types import ModuleType

from tqdm import tqdm

from pipeline.base import files, params, paths, workers
from pipeline.base.availability import why_not_run
from pipeline.base.errors import InputError, run_stage

COLUMNS = (
    "experiment",
    "protocol",
    "condition",
    "model",
    "seed",
    "perturbation",
    "severity",
    "metric",
    "unit",
    "value",
)
COLUMNS += ("n",)


def stressor(experiment: str) -> ModuleType:
    """The module whose `rows(values, experiment, model, report)` perturbs and scores one model."""
    if experiment in params.SERIES:
        from pipeline.stability import series as stress_series

        return stress_series
    if experiment in params.IMAGES:
        from pipeline.stability import images as stress_images

        return stress_images
    from pipeline.stability import windows as stress_windows

    return stress_windows


def stress_model(values: Mapping, experiment: str, model: str, report: Callable[[], None]) -> list[tuple]:
    """Rows of stress.csv for one model."""
    found = stressor(experiment).rows(values, experiment, model, report)
    return [(experiment, protocol, condition, model, seed, *rest) for protocol, condition, seed, *rest in found]


def main() -> None:
    """Stress the models of the experiment named on the command line."""
    values = params.load()
    experiment = params.experiment_argument(sys.argv, "stress", values)
    if experiment not in values["stress"]:
        raise InputError(f"params.yaml, stress: there is no block '{experiment}'; add one")
    protocols, block = values[experiment]["protocols"], values["stress"][experiment]
    params.check_known(block["protocols"], protocols, f"stress.{experiment}.protocols")
    models, found = list(values[experiment]["models"]), {}
    if why_not_run(experiment) is None:
        module = stressor(experiment)
        if hasattr(module, "prepare"):  # scenes that all models share
            module.prepare(values, experiment)
        runs = sum(len(protocols[name]["seeds"]) for name in block["protocols"])
        with tqdm(total=len(models) * runs, desc=f"stress {experiment}", unit="run") as bar:
            # The slowest models, last in params.yaml, first: else one process would end long after the others.
            tasks = {model: (values, experiment, model) for model in reversed(models)}
            found = dict(workers.run(stress_model, tasks, bar, steps=runs))
        files.remove_folder(paths.stress_scenes(experiment), inside=paths.experiment_folder(experiment))
    files.write_csv(paths.stress(experiment), COLUMNS, (row for model in models for row in found.get(model, [])))


if __name__ == "__main__":
    run_stage(main)
