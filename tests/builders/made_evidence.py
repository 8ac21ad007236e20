"""Keep made-up shards in a workspace: scores, learning curves, times and lines of the index."""

import pandas as pd
import yaml

from pipeline.results import shards
from pipeline.results.claim_inputs import COLUMNS
from tactile.base import files
from tactile.base.paths import Workspace

METRICS = {"touch": ("rmse", "kPa"), "strain": ("error", "mm"), "glove": ("macro_precision", "1")}


def scores(
    experiment: str, protocol: str, condition: str, by_model: dict, seed: int, budget="full", variant=""
) -> list:
    """Return a row of the one table for each model of `by_model`, model -> its score; of `linear` without a budget."""
    metric, unit = METRICS[experiment]
    place = {"experiment": experiment, "protocol": protocol, "condition": condition, "variant": variant, "seed": seed}
    return [
        place | {"model": model, "metric": metric, "unit": unit, "value": value, "n": 9}
        | {"budget": "" if model == "linear" else budget}
        for model, value in by_model.items()
    ]  # fmt: skip


def write_sets(workspace: Workspace, sets: dict) -> None:
    """Write shards.yaml."""
    files.write_text(shards.folder(workspace) / "shards.yaml", yaml.safe_dump(sets))


def keep(workspace: Workspace, shard: str, rows: list[dict], commit: str = "c0ffee", machine: str = "AMD EPYC") -> None:
    """Keep a shard SET-SEED-BUDGET; each of its networks is trained for two epochs, in 10 s more than its seed."""
    folder, table = shards.folder(workspace), pd.DataFrame(rows).reindex(columns=COLUMNS)
    files.write_table(shards.result_file(workspace, shard), table, "nan")
    seed = int(shard.split("-")[-2])
    trained = [{"model": row["model"], "protocol": row["protocol"], "seed": seed} for row in rows if row["budget"]]
    trained = [run for place, run in enumerate(trained) if run not in trained[:place]]
    losses = [
        run | {"epoch": epoch, "train_loss": (1.0 + seed) / epoch, "validation_loss": (2.0 + seed) / epoch}
        for run in trained
        for epoch in (1, 2)
    ]
    if losses:
        files.write_table(folder / "curves" / f"{shard}.csv", pd.DataFrame(losses))
    times = [{"shard": shard, **run, "epochs": 2, "train_s": 10 + seed} for run in trained]
    shards.upsert(folder / "times.csv", shards.TIMES, shard, times)
    line = {"shard": shard, "experiment": rows[0]["experiment"], "protocol": rows[0]["protocol"], "seed": seed}
    line |= {"budget": shard.split("-")[-1], "sha256": files.sha256(shards.result_file(workspace, shard))}
    line |= {"core_s": 60, "machine": machine, "commit": commit, "data_sha256": ""}
    shards.upsert(folder / "index.csv", shards.INDEX, shard, [dict.fromkeys(shards.INDEX, "") | line])
