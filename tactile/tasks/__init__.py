"""The three kinds of input that models see: windows, series and images. One module per kind, with the same functions:

* `source(workspace, experiment)` -> the table that a dataset is made of; `inputs(frames, settings)`: the same from
  frames alone.
* `rows(table, module, settings)` -> (rows that a split divides, the dataset's columns before splits).
* `labelled(table, module, settings)` -> (schema, parts) of the whole dataset, whose splits are columns by now.
* `base(experiment, settings, protocol)` -> the protocol whose network transfer learning starts from, or None.
* `fit(path, experiment, settings, protocol, seed, build, *, device, progress, base)` -> a `Fitted` model; `path`: the
  dataset's file, `build(spec)`: makes the model, `base`: the folder of the network that transfer starts from.
* `adapted(model, spec)` -> the model with the methods that this kind of input needs.
* `tested(path, experiment, settings, runs, load)` -> predictions and scores of every run's test part, run by run.
* `stream(path, experiment, settings, protocol, seed)` -> (spec, inputs of the test part); `timed(model, x)` ->
  (function, inputs) of one prediction as a device would ask for it.

What differs between experiments of one kind is in the experiment's module (tactile/experiments).
"""

import importlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import ModuleType

import pyarrow as pa

from tactile import experiments, models
from tactile.base import params, paths
from tactile.base.paths import Workspace
from tactile.datasets import fits, schemas
from tactile.learning.trained import Trained


def kind(experiment: str) -> str:
    """Return an experiment's kind of input, the name of a module of this room."""
    return experiments.module(experiment).KIND


def of(experiment: str) -> ModuleType:
    """Return the module of this room for an experiment's kind of input."""
    return importlib.import_module(f"tactile.tasks.{kind(experiment)}")


def write_dataset(
    path: Path, experiment: str, inputs: pa.Table, settings: Mapping, runs: Iterable[tuple[str, int]]
) -> list[str]:
    """Write the labelled dataset with one split column per run (protocol, seed); return lines of counts."""
    task, module = of(experiment), experiments.module(experiment)
    rows, table = task.rows(inputs, module, settings)
    counts = [f"{experiment}: {table.num_rows} rows"]
    for protocol, seed in runs:
        part = module.split(rows, settings, protocol, seed)
        column = pa.array(part, pa.string()).dictionary_encode()
        table = table.append_column(schemas.split_column(protocol, seed), column)
        counts.append(f"  {protocol} {seed}: " + ", ".join(f"{(part == name).sum()} {name}" for name in schemas.PARTS))
    schemas.write(path, *task.labelled(table, module, settings))
    return counts


def load(workspace: Workspace, values: Mapping, experiment: str, model: str, protocol: str, seed: int, spec) -> Trained:
    """Return the trained model of one run of params.yaml (`values`); spec: the shapes of the experiment's task.

    Raises InputError where the run has not been trained.
    """
    block = params.model_settings(values, experiment, model)
    built = of(experiment).adapted(models.build(model, spec, block, f"{experiment}.models.{model}"), spec)
    made_by = params.training_command(experiment)
    folder = paths.require(workspace.run_folder(experiment, model, protocol, seed), made_by)
    built.load(folder)
    return Trained(built, failed=fits.read(folder, made_by)["best_epoch"] == 0)
