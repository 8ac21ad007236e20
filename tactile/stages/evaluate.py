"""Predict and score the test part, which nothing before this reads, with every trained model.

Usage: python -m tactile.stages.evaluate EXPERIMENT
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tqdm import tqdm

from tactile import tasks
from tactile.base import arguments, files, params, workers
from tactile.base.availability import why_not_run
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.learning.trained import Trained

COLUMNS = ("experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n")


def evaluate_model(
    workspace: Workspace, values: Mapping, experiment: str, model: str, target: Path, report: Callable[[], None]
) -> list[tuple]:
    """Predict with every run of one model, write the predictions to `target`, return rows of scores.csv.

    A run whose training diverged before any usable epoch predicts NaN and keeps its rows, with NaN as value.
    """
    import torch

    from tactile.learning.regressors import TorchRegressor

    torch.set_num_threads(1)

    def load(*run: Any) -> Trained:
        trained = tasks.load(workspace, values, experiment, model, *run)
        if isinstance(trained.model, TorchRegressor):
            trained.model.predict_on(values["device"])
        return trained

    scores, parts = [], []
    path, runs = workspace.dataset(experiment), params.runs(values, experiment)
    for protocol, seed, tests in tasks.of(experiment).tested(path, experiment, values[experiment], runs, load):
        for rows, predicted, scored in tests:
            scores += [(experiment, protocol, condition, model, seed, *row) for condition, *row in scored]
            parts.append(schemas.prediction_rows(protocol, seed, rows, predicted))
        report()
    schemas.write(target / f"{model}.parquet", parts[0].schema, parts)
    return scores


def main(workspace: Workspace) -> None:
    """Evaluate the experiment named on the command line."""
    values = params.load(workspace.params)
    experiment = arguments.parse(__doc__, experiment=values["experiments"]).experiment
    models, runs = list(values[experiment]["models"]), params.runs(values, experiment)
    scores, reason = {}, why_not_run(workspace, experiment)
    with files.replacing_folder(workspace.predictions(experiment)) as draft:
        if reason:
            files.write_text(draft / "not_run.txt", reason + "\n")  # DVC warns of an empty folder
        else:
            calls = {model: (workspace, values, experiment, model, draft) for model in models}
            with tqdm(total=len(models) * len(runs), desc=f"evaluate {experiment}", unit="run") as bar:
                scores = dict(workers.run(evaluate_model, calls, bar, steps=len(runs)))
    files.write_csv(workspace.scores(experiment), COLUMNS, (row for model in models for row in scores.get(model, [])))


if __name__ == "__main__":
    arguments.run(main)
