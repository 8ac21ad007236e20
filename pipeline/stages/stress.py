"""Score the trained models, as they are, on perturbed test data: where does each model fail?

With `look` this is a smoke test, of `stress.<experiment>.look` of params.yaml.
Usage: python -m pipeline.stages.stress EXPERIMENT [look]
"""

from collections.abc import Callable, Mapping

from tqdm import tqdm

from pipeline.stability import loop
from tactile.base import arguments, files, params, workers
from tactile.base.availability import why_not_run
from tactile.base.paths import Workspace

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
    "n",
    "blocks",
)


def stress_model(
    workspace: Workspace, values: Mapping, experiment: str, model: str, report: Callable[[], None]
) -> list[tuple]:
    """Return rows of stress.csv for one model."""
    rows = loop.rows(workspace, values, experiment, model, report)
    return [(experiment, protocol, condition, model, seed, *rest) for protocol, condition, seed, *rest in rows]


def main(workspace: Workspace) -> None:
    """Stress the models of the experiment named on the command line."""
    values = params.load(workspace.params)
    given = arguments.parse(__doc__, experiment=values["experiments"], amount=("look", None))
    experiment, asked = given.experiment, values["stress"][given.experiment]
    params.check_known(asked["protocols"], values[experiment]["protocols"], f"stress.{experiment}.protocols")
    if given.amount:
        asked["perturbations"] = {name: [severity] for name, severity in asked["look"].items()}
    models, rows = list(values[experiment]["models"]), {}
    if why_not_run(workspace, experiment) is None:
        loop.prepare(workspace, values, experiment)
        runs = sum(1 for _ in loop.runs(values, experiment))
        with tqdm(total=len(models) * runs, desc=f"stress {experiment}", unit="run") as bar:
            # The slowest models, last in params.yaml, first: else one process would end long after the others.
            tasks = {model: (workspace, values, experiment, model) for model in reversed(models)}
            rows = dict(workers.run(stress_model, tasks, bar, steps=runs))
        files.remove_folder(workspace.stress_scenes(experiment), inside=workspace.experiment_folder(experiment))
    files.write_csv(workspace.stress(experiment), COLUMNS, (row for model in models for row in rows.get(model, [])))


if __name__ == "__main__":
    arguments.run(main)
