"""The experiments, one module per experiment: what its recordings are and what its models are asked.

Every module provides

* `KIND`: `windows`, `series` or `images`, the kind of input its models see (tactile/tasks);
* `FACTS`: names, units, metrics and files, see tactile/base/facts.py;
* `recordings(folder)` -> the recordings in a folder of raw logs, sorted;
* `read_recording(path, settings)` -> (frames, rejected lines, report) of one recording; a module whose recordings may
  be long also has `read_in_parts`, which returns the frames part by part;
* `frames_schema(settings)` -> the schema of its frames table;
* where its logs are lines of text, `formats(settings, folder=None)` -> log -> format of its lines, the sensor's log
  first; folder: of a recording, whose logs these are;
* `split(rows, settings, protocol, seed)` -> (n,) name of the part that each row belongs to;

of sensors that people record themselves, which have `FACTS.log`:

* `log_problems(path, rows, settings)` -> problems of units and signs of one log that can be read;
* `findings(frames, rows, settings)` -> what all recordings show, each a Finding; rows: what a split divides;

and, by kind:

* windows: `labels(windows, settings)` -> pressure maps (n, map_rows * map_cols); `SCORES`, the name of the function in
  tactile/scoring/metrics.py that scores them, beside <SCORES>_by_frame where rows are of persons (`FACTS.subject`);
  `STRESSED`, the conditions that stress tests report; where these are not those of the recordings,
  `conditions(windows)` -> (n,) names;
* series: `task(protocol, settings)` -> datasets.series.Task;
* images: `chosen(frames, settings)` -> rows that become images; `images(frames, settings)` -> the images by modality.
"""

import importlib
from collections.abc import Mapping
from functools import cache
from types import ModuleType
from typing import get_args

from tactile.base.facts import Facts
from tactile.logs.formats import Format
from tactile.settings import Experiment

NAMES: tuple[str, ...] = get_args(Experiment)
EVERY = ("KIND", "FACTS", "recordings", "read_recording", "frames_schema", "split")
OF_OWN = ("formats", "log_problems", "findings")
OF_KIND = {"windows": ("labels", "SCORES", "STRESSED"), "series": ("task",), "images": ("chosen", "images")}


def module(experiment: str) -> ModuleType:
    """Return the module of an experiment that params.yaml names."""
    return importlib.import_module(f"tactile.experiments.{experiment}")


def facts(experiment: str) -> Facts:
    """Return the facts of an experiment."""
    return module(experiment).FACTS


def log_name(experiment: str) -> str | None:
    """Return what the sensor's log of a recording is called; None of public recordings."""
    return facts(experiment).log


def sensor_format(experiment: str, settings: Mapping) -> Format | None:
    """Return the format of the sensor's log; None where no line of text is read."""
    formats = getattr(module(experiment), "formats", None)
    return next(iter(formats(settings).values())) if formats else None


@cache
def having(fact: str) -> dict:
    """Return experiment -> its fact of this name, of those that have it: `having("log")` are people's own sensors."""
    return {name: value for name in NAMES if (value := getattr(facts(name), fact))}
