"""Write scores under stress as shards of the evidence have them, with made-up numbers."""

import functools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.results import shards
from tactile.base import files
from tactile.experiments import facts

Curve = Callable[[float, int], float]  # severity, seed -> error


def rows(
    experiment: str,
    place: tuple[str, str],
    curves: Mapping[str, Curve],
    tests: Mapping[str, Sequence[float]],
    seeds: Sequence[int] = (0, 1, 2, 3),
    variant: str = "",
    budget: str = "full",
) -> pd.DataFrame:
    """Return rows of `shards.STRESS`: of each model the error at the severities of each test, those of 0 among them."""
    metric = facts(experiment).metric
    made = [
        (model, seed, test, severity, 1 - curve(severity, seed) if metric == "accuracy" else curve(severity, seed))
        for model, curve in curves.items()
        for test, severities in tests.items()
        for severity in severities
        for seed in seeds
    ]
    table = pd.DataFrame(made, columns=["model", "seed", "perturbation", "severity", "value"])
    table = table.assign(experiment=experiment, protocol=place[0], condition=place[1], variant=variant, metric=metric)
    table = table.assign(unit=facts(experiment).output_unit, n=10, blocks="")
    return table.assign(budget=["" if model == "constant" else budget for model in table["model"]])[shards.STRESS]


def by_blocks(
    experiment: str,
    place: tuple[str, str],
    losses: Mapping[str, Callable[[float, int], Sequence[Sequence[float]]]],
    tests: Mapping[str, Sequence[float]],
    seeds: Sequence[int] = (0,),
    count: int = 10,
) -> pd.DataFrame:
    """Return rows as `rows` with blocks of `count` each.

    losses: model -> severity, seed -> person -> loss of each block.
    """
    square = facts(experiment).metric == "rmse"

    def mean(severity, seed, curve):
        value = np.mean([loss for person in curve(severity, seed) for loss in person])
        return 1 - value if facts(experiment).metric == "accuracy" else np.sqrt(value) if square else value

    curves = {model: functools.partial(mean, curve=curve) for model, curve in losses.items()}
    table = rows(experiment, place, curves, tests, seeds)
    persons = [losses[row.model](row.severity, row.seed) for row in table.itertuples()]
    blocks = [" / ".join(" ".join(f"{loss:.4g}:{count}" for loss in one) for one in each) for each in persons]
    return table.assign(blocks=blocks)


def keep(workspace, name: str, stress: pd.DataFrame, results: pd.DataFrame | None = None) -> None:
    """Keep rows of stress as a shard of the evidence; results: its rows, if not those at severity 0."""
    if results is None:
        run = ["experiment", "protocol", "condition", "model", "variant", "metric", "seed", "budget"]
        results = stress[stress["severity"] == 0].drop_duplicates(run)
    result, stressed = shards.result_file(workspace, name), shards.stress_file(workspace, name)
    files.write_table(result, results[shards.COLUMNS], missing="nan")
    files.write_table(stressed, stress, missing="nan")
    line = {"shard": name, "experiment": stress["experiment"].iloc[0], "protocol": "made", "seed": 0, "budget": "full"}
    line |= {"sha256": files.sha256(result), "kept_sha256": shards.kept_sha256(workspace, name)}
    line |= dict.fromkeys(set(shards.INDEX) - set(line), "")
    shards.upsert(shards.folder(workspace) / "index.csv", shards.INDEX, name, [line])


def copied_sets(workspace, root: Path) -> None:
    """Put the sets of the evidence into a workspace."""
    files.write_text(shards.folder(workspace) / "shards.yaml", (root / "evidence" / "shards.yaml").read_text())
