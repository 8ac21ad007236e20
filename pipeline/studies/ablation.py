"""Train and score models of the tables with one thing changed: LoMP's messages, or the frames that a model sees.

Split and training are those of the tables. The row that each is compared with is among the rows or in the tables. Rows
of models that `<experiment>.models` has not are left out. Writes the scores of one seed on the test part of the first
protocol; `render` compares them.
Usage: python -m pipeline.studies.ablation touch SEED
"""

from collections.abc import Mapping

from tqdm import tqdm

from pipeline import models
from pipeline.base import arguments, files, params, workers
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.datasets.windows import read_dataset
from pipeline.learning.trained import Trained
from pipeline.scoring import ablation as scored
from pipeline.scoring import metrics
from pipeline.tasks import windows as tasks_windows

CONDITIONS = ("single", "double")  # as in Table I
COLUMNS = ("row", "protocol", "condition", "seed", "metric", "unit", "value", "n")


def train_run(workspace: Workspace, values: Mapping, experiment: str, name: str, seed: int, report) -> list[tuple]:
    """Train and score one run of a row; return rows of ablation.csv."""
    import torch

    torch.set_num_threads(1)
    settings = values[experiment]
    row, protocol = settings["ablation"][name], next(iter(settings["protocols"]))
    spec = tasks_windows.spec(settings)
    data = read_dataset(workspace.dataset(experiment), spec.frames)
    x, part, condition = data.x[:, -row["frames"] :], data.part(protocol, seed), schemas.names(data.rows["condition"])
    block, where = scored.block_of(settings, name), f"{experiment}.ablation.{name}"
    regressor = models.build(row["of"], spec._replace(frames=row["frames"]), block, where)
    train, validation = ((x[part == side], data.y[part == side]) for side in ("train", "validation"))
    regressor.fit(train, validation, seed=seed, device=values["device"], progress=report)
    run, rows = Trained(regressor, failed=regressor.summary.best_epoch == 0), []
    for tested in CONDITIONS:
        chosen = (part == "test") & (condition == tested)
        if chosen.any():
            scores = metrics.touch(data.y[chosen], run.predict(x[chosen]), settings)
            scores = metrics.unless_failed(scores, run.failed)
            rows += [(name, protocol, tested, seed, *score) for score in scores]
    return rows


def check(settings: Mapping, experiment: str) -> None:
    """Raise InputError for a row that cannot be trained, or compared with the one that it names."""
    for name, row in settings["ablation"].items():
        where = f"{experiment}.ablation.{name}"
        beside = row.get("beside", "")
        if beside:
            params.check_known([beside], settings["ablation"], f"{where}.beside")
        params.check_model(row["of"], scored.block_of(settings, name), f"{where}.settings")
        if row["frames"] > settings["window"]["frames"]:
            raise InputError(
                f"{params.file_of(where)}, {where}.frames: a window has {settings['window']['frames']} frames"
            )


def main(workspace: Workspace) -> None:
    """Train and score all rows of the experiment and seed named on the command line."""
    values = params.load(workspace.params)
    experiment, seed = arguments.of_study(__doc__, ["touch"])
    settings = values[experiment]
    check(settings, experiment)
    rows_run = {name: row for name, row in settings["ablation"].items() if row["of"] in settings["models"]}
    runs = [(experiment, name, seed) for name in rows_run]
    blocks = [scored.block_of(settings, name) for name in rows_run]
    epochs = max(map(params.epochs, blocks), default=0)
    with tqdm(total=epochs * len(runs), desc=f"ablate {experiment}", unit="epoch") as bar:
        rows = dict(workers.run(train_run, {run: (workspace, values, *run) for run in runs}, bar, steps=epochs))
    files.write_csv(workspace.study_result(experiment, "ablation"), COLUMNS, (row for run in runs for row in rows[run]))


if __name__ == "__main__":
    arguments.run(main)
