"""Train every network of an experiment for longer than params.yaml says, and tell whether its training had ended.

A training has ended when a longer one changes the validation error by less than 1 %. Each network is trained with its
own recipe but `--times` as many epochs (the schedule of the rate stretches with them), on the protocols named (default:
the first), at the first `--seeds` seeds. The run beside it is that of data/EXPERIMENT/models, so train the experiment
first. The test part is not read, no setting is changed, and the models that the reports are about stay as they are.
The trainings go to as many processes as there are cores (WORKERS=n for another number). Writes
reports/longer/EXPERIMENT.csv, one row per training, and .md, the table; rows of other protocols stay.
"""

import argparse
import math
from collections.abc import Callable, Mapping, Sequence

import pandas as pd
from tqdm import tqdm

from pipeline import tasks
from pipeline.base import files, params, workers
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.claims.longer import COLUMNS, ENDED, changes, path, read
from pipeline.commands.rates import error_of, fit
from pipeline.datasets import fits
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import number, table

LENGTHS = ("epochs", "drop_epoch")  # of a block `training`: what grows with the length


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes to its parser."""
    parser.add_argument("experiment", choices=["touch", "strain", "glove", "strain_recorded", "glove_recorded"])
    parser.add_argument("--protocols", nargs="+", metavar="NAME", help="default: the first of params.yaml")
    parser.add_argument("--times", type=int, choices=range(2, 11), default=2, metavar="N", help="default: 2")
    parser.add_argument("--seeds", type=int, default=1, metavar="N", help="how many, default: 1")


def lengthened(block: Mapping, times: int) -> dict:
    """Return a model's block of settings with `times` as many epochs."""
    training = {key: value * times if key in LENGTHS else value for key, value in block["training"].items()}
    return {**block, "training": training}


def trained(workspace: Workspace, experiment: str, model: str, protocol: str, seed: int) -> tuple[int, float]:
    """Return (epochs, validation error of the epoch that was kept) of a run of data/EXPERIMENT/models."""
    folder = workspace.run_folder(experiment, model, protocol, seed)
    fit = fits.read(folder, params.training_command(experiment))
    history = pd.read_csv(folder / "history.csv").set_index("epoch")
    return fit["epochs"], error_of(experiment, history["validation_loss"][fit["best_epoch"]])


def train_longer(
    workspace: Workspace,
    values: Mapping,
    experiment: str,
    model: str,
    protocol: str,
    seed: int,
    times: int,
    report: Callable[..., None],
) -> tuple:
    """Return the row (COLUMNS) of one run of params.yaml (`values`), trained `times` as long beside the one there is.

    A training that diverged has NaN as error.
    """
    block = lengthened(params.run_settings(values, experiment, model, protocol), times)
    error, fitted = fit(workspace, values, experiment, model, block, protocol, seed, report)
    return (
        protocol,
        model,
        seed,
        *trained(workspace, experiment, model, protocol, seed),
        len(fitted.history),
        error,
        fitted.seconds,
    )


def chosen(values: Mapping, experiment: str, protocols: Sequence[str] | None, seeds: int) -> list[tuple]:
    """Return (protocol, model, seed) of the trainings; InputError names a protocol that params.yaml has not."""
    settings = values[experiment]
    names = protocols or list(settings["protocols"])[:1]
    unknown = [name for name in names if name not in settings["protocols"]]
    if unknown:
        known = ", ".join(settings["protocols"])
        raise InputError(f"--protocols: {experiment} has no '{unknown[0]}'; take of {known}")
    networks = [model for model, block in settings["models"].items() if "training" in block]
    return [
        (name, model, seed)
        for name in names
        for model in networks
        for seed in settings["protocols"][name]["seeds"][:seeds]
    ]


def text(experiment: str, rows: pd.DataFrame) -> str:
    """Write the table of a network per row; rows: those of the CSV file."""
    lines = []
    for row in changes(rows).itertuples():
        cells = [number(row.longer_error), f"{100 * row.change:+.1f}", "yes" if abs(row.change) < ENDED else "no"]
        if math.isnan(row.change):  # one run at least has no error to compare
            cells = ["diverged", "", "not known"]
        lengths = [str(row.epochs), str(row.longer_epochs)]
        lines.append([row.protocol, model_name(row.model), *lengths, number(row.error), *cells, str(row.runs)])
    unit = "cross-entropy" if tasks.kind(experiment) == "images" else "root mean square, in the label's unit"
    header = ["Split", "Network", "Epochs", "Longer", "Error", "Error, longer", "Change (%)", "Ended?", "Runs"]
    return "\n".join(
        [
            f"# Trained for longer: {experiment}\n",
            f"Validation error ({unit}) of the epoch that was kept, mean over runs, with the epochs of params.yaml and "
            f"with more. A training has ended where the longer one changes the error by less than {ENDED:.0%}. No test "
            "part was read.\n",
            table(header, lines),
        ]
    )


def write(workspace: Workspace, experiment: str, rows: pd.DataFrame) -> None:
    """Write <experiment>.csv and .md to reports/longer; rows of protocols that are not among `rows` stay."""
    before = read(path(workspace, experiment))
    rows = pd.concat([before[~before["protocol"].isin(rows["protocol"])], rows])
    files.write_table(path(workspace, experiment), rows)
    files.write_text(path(workspace, experiment).with_suffix(".md"), text(experiment, rows))
    print(f"{path(workspace, experiment)}, .md: {len(rows)} trainings")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Train the networks of the experiment named on the command line."""
    values, experiment = params.load(workspace.params), given.experiment
    runs = chosen(values, experiment, given.protocols, given.seeds)
    for protocol, model, seed in runs:  # before hours of training, not after
        trained(workspace, experiment, model, protocol, seed)
    jobs = {run: (workspace, values, experiment, run[1], run[0], run[2], given.times) for run in runs}
    steps = given.times * max(
        (values[experiment]["models"][model]["training"]["epochs"] for _, model, _ in runs), default=0
    )
    with tqdm(total=steps * len(runs), desc=f"longer {experiment}", unit="epoch") as bar:
        rows = dict(workers.run(train_longer, jobs, bar, steps=steps))
    write(workspace, experiment, pd.DataFrame([rows[run] for run in runs], columns=COLUMNS))
