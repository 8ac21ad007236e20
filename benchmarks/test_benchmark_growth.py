"""Growth of time and memory: every point in a process of its own, the median of its repeats."""

import math
import statistics

import pytest

from benchmarks import growth, made
from benchmarks.measure import measured
from tactile.base.paths import Workspace


def points(task, against, sizes, unit, folder_of, repeats):
    """A point a size: median time, largest memory. repeats: how often each size is measured."""
    found = []
    for size, times in zip(sizes, repeats, strict=True):
        folder = folder_of(size)
        runs = [measured(task, folder, size) for _ in range(times)]
        seconds, mb = statistics.median(run["seconds"] for run in runs), max(run["mb"] for run in runs)
        found.append(growth.Point(task, against, size, unit, seconds, mb))
    return found


def points_of_data(task, base, unit, folder_of, sizes):
    """Points of a task at `base` times its factors."""
    factors = sizes.factors_of(task)
    repeats = [sizes.repeats_of(task, factor) for factor in factors]
    return points(task, growth.DATA, [factor * base for factor in factors], unit, folder_of, repeats)


def test_growth_of_ingest(sizes, results, tmp_path):
    def folder(mb):
        recordings = math.ceil(mb / growth.LARGEST_LOG_MB)
        for number in range(recordings):
            made.recording(tmp_path / str(mb) / made.LOGS / f"run{number}", mb / recordings)
        return tmp_path / str(mb)

    found = points_of_data("ingest", sizes.growth.log_mb, "MB of log", folder, sizes.growth)
    growth.write(results, found)


def test_growth_of_dataset(sizes, results, tmp_path, monkeypatch):
    def folder(frames):
        workspace = Workspace(tmp_path / str(frames))
        made.frames_file(workspace.frames("touch"), frames, made.touch_settings())
        return tmp_path / str(frames)

    growth.write(results, points_of_data("dataset", sizes.growth.frames, "frames", folder, sizes.growth))


@pytest.mark.parametrize(
    "task, unit",
    [("lomp_epoch", "windows"), ("cnn_epoch", "windows"), ("lomp_predictions", "windows"), ("lstm_epochs", "samples")],
)
def test_growth_of_networks(sizes, results, tmp_path, task, unit):
    base = getattr(sizes.growth, unit)
    growth.write(results, points_of_data(task, base, unit, lambda _: tmp_path, sizes.growth))


@pytest.mark.parametrize("task", ["lomp_epoch_elements", "lomp_latency"])
def test_growth_with_elements(sizes, results, tmp_path, task):
    # The process is told the side; the exponent is of the number of elements.
    sides = sizes.growth.sides
    repeats = [sizes.growth.repeats] * len(sides)
    found = points(task, growth.ELEMENTS, sides, "elements", lambda _: tmp_path, repeats)
    growth.write(results, [point._replace(size=point.size**2) for point in found])
