"""Growth of time and memory: every point in a process of its own, the median of its repeats."""

import statistics

import pytest
from benchmarks import growth, made
from benchmarks.measure import measured

from pipeline.base import paths


def points(task, against, sizes, unit, folder_of, repeats):
    """A point a size: median time, largest memory."""
    found = []
    for size in sizes:
        folder = folder_of(size)
        runs = [measured(task, folder, size) for _ in range(repeats)]
        seconds, mb = statistics.median(run["seconds"] for run in runs), max(run["mb"] for run in runs)
        found.append(growth.Point(task, against, size, unit, seconds, mb))
    return found


def test_growth_of_ingest(sizes, results, tmp_path):
    def folder(mb):
        made.recording(tmp_path / str(mb) / "logs" / "single" / "run0", mb)
        return tmp_path / str(mb)

    logs = [factor * sizes.growth.log_mb for factor in sizes.growth.factors]
    growth.write(results, points("ingest", growth.DATA, logs, "MB of log", folder, sizes.growth.repeats))


def test_growth_of_dataset(sizes, results, tmp_path, monkeypatch):
    def folder(frames):
        monkeypatch.setattr(paths, "ROOT", tmp_path / str(frames))
        made.frames_file(paths.frames("touch"), frames, made.touch_settings())
        return tmp_path / str(frames)

    counts = [factor * sizes.growth.frames for factor in sizes.growth.factors]
    growth.write(results, points("dataset", growth.DATA, counts, "frames", folder, sizes.growth.repeats))


@pytest.mark.parametrize(
    "task, base, unit", [("lomp_epoch", "windows", "windows"), ("lstm_epochs", "samples", "samples")]
)
def test_growth_of_training(sizes, results, tmp_path, task, base, unit):
    counts = [factor * getattr(sizes.growth, base) for factor in sizes.growth.factors]
    growth.write(results, points(task, growth.DATA, counts, unit, lambda _: tmp_path, sizes.growth.repeats))


@pytest.mark.parametrize("task", ["lomp_epoch_elements", "lomp_latency"])
def test_growth_with_elements(sizes, results, tmp_path, task):
    # The process is told the side; the exponent is of the number of elements.
    found = points(task, growth.ELEMENTS, sizes.growth.sides, "elements", lambda _: tmp_path, sizes.growth.repeats)
    growth.write(results, [point._replace(size=point.size**2) for point in found])
