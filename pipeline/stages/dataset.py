"""Stage: windows (series, images) to a dataset, with labels and, for every run, the part each row belongs to.

Usage: python -m pipeline.stages.dataset EXPERIMENT
"""

import sys
from collections.abc import Iterator, Mapping

import pyarrow as pa

from pipeline.base import params, paths
from pipeline.base.errors import run_stage
from pipeline.base.params import experiment_module
from pipeline.datasets import images, schemas


def main() -> None:
    """Label and split the windows of the experiment named on the command line; series and images carry their labels."""
    values = params.load()
    experiment = params.experiment_argument(sys.argv, "dataset", values)
    module, settings = experiment_module(experiment), values[experiment]
    made_by = f"python -m pipeline.stages.ingest {experiment}"
    if experiment in params.SERIES:
        windows = schemas.read(paths.require(paths.frames(experiment), made_by))
        table = windows.rename_columns({"y_mm": "y"})
    elif experiment in params.IMAGES:
        frames = schemas.read(paths.require(paths.frames(experiment), made_by))
        windows = frames.take(pa.array(module.chosen(frames, settings))).combine_chunks()
        table = images.dataset_rows(windows, module.images(windows, settings))
    else:
        path = paths.require(paths.windows(experiment), f"python -m pipeline.stages.window {experiment}")
        table = windows = schemas.read(path)
    counts = []
    for protocol, seed in params.runs(values, experiment):
        part = module.split(windows, settings, protocol, seed)
        table = table.append_column(
            schemas.split_column(protocol, seed), pa.array(part, pa.string()).dictionary_encode()
        )
        counts.append(f"{protocol} {seed}: " + ", ".join(f"{(part == name).sum()} {name}" for name in schemas.PARTS))
    if experiment in (*params.SERIES, *params.IMAGES):
        schemas.write(paths.dataset(experiment), table.schema, [table])
    else:
        kind = pa.list_(pa.float32(), settings["label"]["map_rows"] * settings["label"]["map_cols"])
        schema = table.schema.append(pa.field("y", kind))
        schemas.write(paths.dataset(experiment), schema, labelled(table, module, settings))
    print(f"{experiment}: {table.num_rows} rows", *counts, sep="\n  ")


def labelled(windows: pa.Table, module, settings: Mapping) -> Iterator[pa.Table]:
    """The windows with their maps `y`, some at a time: maps are most of a dataset."""
    for first in range(0, windows.num_rows, schemas.GROUP_ROWS):
        some = windows.slice(first, schemas.GROUP_ROWS)
        yield some.append_column("y", schemas.lists(module.labels(some, settings), pa.float32()))


if __name__ == "__main__":
    run_stage(main)
