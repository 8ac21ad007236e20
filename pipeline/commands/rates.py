"""Search the learning rate of every network of touch in the same way, on validation windows.

Each network is trained with each rate of a grid, kept constant, for the same number of updates, on the training part of
the first protocol and seed; the test part is not read. The grid goes on beyond an end for as long as the lowest error
is there. Writes reports/rates/<experiment>.csv and .md: the lowest validation RMSE per network and rate, and the
seconds. It changes no setting.
"""

import argparse
import csv
import math
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pipeline import models
from pipeline.base import files, params, paths
from pipeline.base.errors import InputError
from pipeline.datasets.windows import Dataset, read_dataset
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import number, table
from pipeline.tasks import windows as tasks_windows

NETWORKS = ("cnn", "vgg", "convlstm", "rnn", "lomp")  # of Table I
GRID = range(-8, -3)  # 1e-4 to 1e-2, see `rate`
COLUMNS = ("model", "learning_rate", "batch_size", "updates", "best_epoch", "epochs", "rmse_kpa", "seconds")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes to its parser."""
    parser.add_argument("experiment", choices=["touch"])
    parser.add_argument("--updates", type=int, default=1000, help="of each training (default 1000)")


def rate(place: int) -> float:
    """Return the learning rate at a place of the endless grid ..., 1e-4 (-8), 3e-4 (-7), 1e-3 (-6), ..."""
    return float(f"{(1, 3)[place % 2]}e{place // 2}")


def beyond(errors: Mapping[int, float]) -> int | None:
    """Return the next place beyond the end of a network's grid where its error is lowest; None if that is no end.

    errors: place -> validation RMSE, NaN where the training diverged.
    """
    known = {place: rmse for place, rmse in errors.items() if math.isfinite(rmse)}
    if not known:
        return None
    lowest = min(known, key=known.get)
    return {min(errors): lowest - 1, max(errors): lowest + 1}.get(lowest)


def search(values: Mapping, experiment: str, model: str, learning_rate: float, updates: int, data: Dataset) -> tuple:
    """Return the row (COLUMNS) of one network at one rate; a training that diverged has NaN as RMSE."""
    import torch

    torch.set_num_threads(1)
    settings = values[experiment]
    protocol, seed = params.runs(values, experiment)[0]
    part = data.part(protocol, seed)
    train, validation = (data.windows(part == name, streams=False) for name in ("train", "validation"))
    block = params.model_settings(values, experiment, model)
    epochs = max(1, round(updates / math.ceil(len(train[0]) / block["training"]["batch_size"])))
    constant = {
        "learning_rate": learning_rate,
        "max_epochs": epochs,
        "patience": epochs,
        "plateau": epochs,
        "drop": 1.0,
    }
    block = block | {"training": block["training"] | constant}
    network = models.build(model, tasks_windows.spec(settings), block, f"{experiment}.models.{model}")
    began = time.perf_counter()
    history = network.fit(train, validation, seed=seed, device=values["device"])
    losses = [row["validation_loss"] for row in history]
    best = network.summary.best_epoch
    rmse = math.sqrt(losses[best - 1]) if best and np.isfinite(losses).all() else float("nan")
    done = len(history) * math.ceil(len(train[0]) / block["training"]["batch_size"])
    taken = time.perf_counter() - began
    return (model, learning_rate, block["training"]["batch_size"], done, best, len(history), rmse, taken)


def text(values: Mapping, experiment: str, rows: list[Mapping]) -> str:
    """Write the table of a network per row and a rate per column; rows: those of the CSV file, as numbers or text."""
    protocol, seed = params.runs(values, experiment)[0]
    rates = sorted({float(row["learning_rate"]) for row in rows})
    lines = []
    for model in dict.fromkeys(row["model"] for row in rows):
        tried = {float(row["learning_rate"]): float(row["rmse_kpa"]) for row in rows if row["model"] == model}
        errors = {rate: rmse for rate, rmse in tried.items() if math.isfinite(rmse)}
        set_to = values[experiment]["models"][model]["training"]["learning_rate"]
        lowest = f"{min(errors, key=errors.get):g}" if errors else "none"
        words = dict.fromkeys(tried, "diverged") | {rate: number(rmse) for rate, rmse in errors.items()}
        cells = [words.get(rate, "-") for rate in rates]
        lines.append([model_name(model), *cells, lowest, f"{set_to:g}"])
    seconds = sum(float(row["seconds"]) for row in rows)
    return "\n".join(
        [
            "# Learning rates\n",
            f"Lowest validation RMSE (kPa) of {rows[0]['updates']} updates, or the nearest number of whole epochs, "
            f"with a constant rate; split `{protocol}`, seed {seed}, {seconds:.0f} s in all. The same search for every "
            "network, further where the lowest error is at an end of it; the test part was not read.\n",
            table(["Network", *(f"{rate:g}" for rate in rates), "Lowest at", "params.yaml has"], lines),
        ]
    )


def main(given: argparse.Namespace) -> None:
    """Search the rates of the experiment named on the command line."""
    if given.updates < 1:
        raise InputError(f"--updates {given.updates}: give a whole number of 1 or more")
    values = params.load()
    wanted = [model for model in NETWORKS if model in values[given.experiment]["models"]]
    made_by = f"python -m pipeline.stages.dataset {given.experiment}"
    data = read_dataset(
        paths.require(paths.dataset(given.experiment), made_by), values[given.experiment]["window"]["frames"]
    )
    rows = []
    with tqdm(total=len(wanted) * len(GRID), desc=f"rates {given.experiment}", unit="training") as bar:
        for model in wanted:
            errors, places = {}, list(GRID)
            while places:
                place = places.pop(0)
                rows.append(search(values, given.experiment, model, rate(place), given.updates, data))
                errors[place] = rows[-1][COLUMNS.index("rmse_kpa")]
                bar.update()
                if not places and (further := beyond(errors)) is not None:
                    places, bar.total = [further], bar.total + 1
    write(values, given.experiment, rows, paths.REPORTS / "rates")


def write(values: Mapping, experiment: str, rows: list[tuple], folder: Path) -> None:
    """Write <experiment>.csv and .md to `folder`."""
    files.write_csv(folder / f"{experiment}.csv", COLUMNS, rows)
    with open(folder / f"{experiment}.csv", newline="", encoding="utf-8") as file:
        files.write_text(folder / f"{experiment}.md", text(values, experiment, list(csv.DictReader(file))))
    print(f"{paths.shown(folder / experiment)}.csv, .md: {len(rows)} trainings")
