"""Search the learning rate of every network of touch in the same way, on validation windows.

Each network is trained with each rate of a grid, with its own recipe of params.yaml otherwise (epochs, batches, the
schedule of the rate), on the first protocol. The grid begins around the rate that params.yaml has and goes on beyond an
end for as long as the lowest error is there; it is searched at the first seed. The two rates with the lowest errors are
then trained at all seeds, and the mean over these decides. The test part is not read. The trainings go to as many
processes as there are cores (WORKERS=n for another number). Writes reports/rates/<experiment>.csv, with every training,
and .md, the tables. It changes no setting.
"""

import argparse
import csv
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from pipeline import models, tasks
from pipeline.base import files, params, paths, workers
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import number, table

NETWORKS = ("cnn", "vgg", "convlstm", "rnn", "lomp", "lomp_stream")
AROUND = range(-2, 2)  # places that the grid has at least, from that of params.yaml
COLUMNS = ("model", "learning_rate", "seed", "batch_size", "epochs", "best_epoch", "rmse_kpa", "seconds")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes to its parser."""
    parser.add_argument("experiment", choices=["touch"])


def rate(place: int) -> float:
    """Return the learning rate at a place of the endless grid ..., 1e-3 (-9), 2e-3 (-8), 5e-3 (-7), 1e-2 (-6), ..."""
    return float(f"{(1, 2, 5)[place % 3]}e{place // 3}")


def place_of(learning_rate: float) -> int:
    """Return the place of the grid whose rate is nearest, as a ratio."""
    near = 3 * math.floor(math.log10(learning_rate))
    return min(range(near - 1, near + 5), key=lambda place: abs(math.log(rate(place) / learning_rate)))


def beyond(errors: Mapping[int, float]) -> int | None:
    """Return the next place beyond the end of a network's grid where its error is lowest; None if that is no end.

    errors: place -> validation RMSE, NaN where the training diverged.
    """
    lowest = two_lowest(errors)[:1]
    return {min(errors): lowest[0] - 1, max(errors): lowest[0] + 1}.get(lowest[0]) if lowest else None


def two_lowest(errors: Mapping) -> list:
    """Return the keys of the two lowest errors, the lowest first; those with NaN are left out."""
    return sorted((key for key, rmse in errors.items() if math.isfinite(rmse)), key=errors.get)[:2]


def train_run(
    workspace: Workspace,
    values: Mapping,
    experiment: str,
    model: str,
    learning_rate: float,
    seed: int,
    report: Callable[..., None],
) -> tuple:
    """Return the row (COLUMNS) of one network at one rate; a training that diverged has NaN as RMSE."""
    import torch

    torch.set_num_threads(1)
    protocol, _ = params.runs(values, experiment)[0]
    block = params.model_settings(values, experiment, model)
    block = block | {"training": block["training"] | {"learning_rate": learning_rate}}

    def build(spec):
        return models.build(model, spec, block, f"{experiment}.models.{model}")

    place = workspace.dataset(experiment), experiment, values[experiment], protocol, seed
    fitted = tasks.of(experiment).fit(*place, build, device=values["device"], progress=report, base=None)
    reason, best = fitted.model.summary
    rmse = math.nan if reason == "diverged" else math.sqrt(fitted.history[best - 1]["validation_loss"])
    return model, learning_rate, seed, block["training"]["batch_size"], len(fitted.history), best, rmse, fitted.seconds


def search(workspace: Workspace, values: Mapping, experiment: str, networks: Sequence[str]) -> list[tuple]:
    """Return the rows (COLUMNS) of all trainings, by network, rate and seed."""
    blocks = {model: params.model_settings(values, experiment, model)["training"] for model in networks}
    steps = max(block["epochs"] for block in blocks.values())
    protocol, first = params.runs(values, experiment)[0]
    rows, errors = {}, {model: {} for model in networks}

    def train(wanted: Iterable[tuple[str, int, int]]) -> None:
        tasks = {key: (workspace, values, experiment, key[0], rate(key[1]), key[2]) for key in wanted}
        bar.total += steps * len(tasks)
        bar.refresh()
        if tasks:
            rows.update(workers.run(train_run, tasks, bar, steps=steps))

    with tqdm(total=0, desc=f"rates {experiment}", unit="epoch") as bar:
        places = {
            model: [place_of(block["learning_rate"]) + step for step in AROUND] for model, block in blocks.items()
        }
        while any(places.values()):
            train((model, place, first) for model, tried in places.items() for place in tried)
            for model, tried in places.items():
                errors[model] |= {place: rows[model, place, first][COLUMNS.index("rmse_kpa")] for place in tried}
            further = {model: beyond(errors[model]) if tried else None for model, tried in places.items()}
            places = {model: [] if place is None else [place] for model, place in further.items()}
        others = [seed for seed in values[experiment]["protocols"][protocol]["seeds"] if seed != first]
        train((model, place, seed) for model in networks for place in two_lowest(errors[model]) for seed in others)
    return [rows[key] for key in sorted(rows, key=lambda key: (networks.index(key[0]), *key[1:]))]


def text(values: Mapping, experiment: str, rows: Sequence[Mapping]) -> str:
    """Write the table of a network per row and a rate per column; rows: those of the CSV file, as numbers or text."""
    protocol, first = params.runs(values, experiment)[0]
    errors: dict[str, dict[float, dict[int, float]]] = {}
    for row in rows:
        of_rate = errors.setdefault(row["model"], {}).setdefault(float(row["learning_rate"]), {})
        of_rate[int(row["seed"])] = float(row["rmse_kpa"])
    rates = sorted({tried for of_model in errors.values() for tried in of_model})
    lines, diverged = [], []
    for model, of_model in errors.items():
        at_first = {tried: by_seed[first] for tried, by_seed in of_model.items()}
        means = {tried: float(np.mean(list(of_model[tried].values()))) for tried in two_lowest(at_first)}
        cells = [_cell(at_first[tried]) if tried in at_first else "-" for tried in rates]
        compared = "; ".join(f"{tried:g}: {_cell(mean)}" for tried, mean in sorted(means.items())) or "-"
        lowest = f"{two_lowest(means)[0]:g}" if two_lowest(means) else "none"
        set_to = values[experiment]["models"][model]["training"]["learning_rate"]
        lines.append([model_name(model), *cells, compared, lowest, f"{set_to:g}"])
        diverged += [
            f"{model_name(model)} at {tried:g} (seed {seed})"
            for tried, by_seed in of_model.items()
            for seed, rmse in by_seed.items()
            if math.isnan(rmse)
        ]
    seconds = sum(float(row["seconds"]) for row in rows)
    seeds = ", ".join(map(str, values[experiment]["protocols"][protocol]["seeds"]))
    header = ["Network", *(f"{tried:g}" for tried in rates), "Mean of the two lowest", "Lowest at", "params.yaml has"]
    return "\n".join(
        [
            "# Learning rates\n",
            f"Validation RMSE (kPa) of the best epoch by highest learning rate, split `{protocol}`, seed {first}; of "
            f"the two rates with the lowest errors also the mean over the seeds {seeds}, which decides. Each network "
            "has all of its own recipe of params but for the rate. The search is the same for all, further where the "
            f"lowest error is at an end of the grid. {len(rows)} trainings, {seconds:.0f} s of processes in all. "
            "No test part was read.\n",
            f"Diverged: {', '.join(diverged) or 'none'}.\n",
            table(header, lines),
        ]
    )


def _cell(rmse: float) -> str:
    return "diverged" if math.isnan(rmse) else number(rmse)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Search the rates of the experiment named on the command line."""
    values, experiment = params.load(workspace.params), given.experiment
    networks = [model for model in NETWORKS if model in values[experiment]["models"]]
    if not networks:
        raise InputError(
            f"params/{experiment}.yaml, {experiment}.models: no network to train; list one of {', '.join(NETWORKS)}"
        )
    paths.require(workspace.dataset(experiment), f"python -m pipeline.stages.dataset {experiment}")
    values = {**values, experiment: {**values[experiment], "budget": 1.0}}  # all epochs, not the look's share
    write(values, experiment, search(workspace, values, experiment, networks), workspace.reports / "rates")


def write(values: Mapping, experiment: str, rows: list[tuple], folder: Path) -> None:
    """Write <experiment>.csv and .md to `folder`."""
    files.write_csv(folder / f"{experiment}.csv", COLUMNS, rows)
    with open(folder / f"{experiment}.csv", newline="", encoding="utf-8") as file:
        files.write_text(folder / f"{experiment}.md", text(values, experiment, list(csv.DictReader(file))))
    print(f"{folder / experiment}.csv, .md: {len(rows)} trainings")
