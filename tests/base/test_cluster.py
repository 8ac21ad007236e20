"""A Dask cluster gives what local cores give, and says in one sentence what is wrong with it."""

import os

import distributed
import pytest
from builders import tasks
from builders.project import ROOT
from tqdm import tqdm

from tactile.base import cluster, workers
from tactile.base.errors import InputError


def results(monkeypatch, where: str, function=tasks.trained, **more) -> dict:
    """Run two tasks; WORKERS is `where`."""
    monkeypatch.setenv("WORKERS", where)
    with tqdm(total=6, desc="train it") as bar:
        found = dict(workers.run(function, {("press", seed): (seed,) for seed in (0, 1)}, bar, steps=3, **more))
        assert bar.n == 6
    return found


@pytest.mark.slow
def test_training_on_a_cluster_changes_no_bit(monkeypatch, tmp_path):
    here = results(monkeypatch, "1")
    assert here["press", 0] != here["press", 1]
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}{ROOT / 'tests'}")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as local:
        folders = {("press", seed): tmp_path / str(seed) for seed in (0, 1)}
        assert results(monkeypatch, local.scheduler_address, folders=folders) == here
        with pytest.raises(
            InputError, match=r"^train it, press [01], on worker tcp://\S+ .* its process ended with status -9"
        ):
            results(monkeypatch, local.scheduler_address, tasks.killed)
        with tqdm(total=1, desc="train it") as bar:
            done = dict(workers.run(tasks.lost_once, {"press": (tmp_path,)}, bar))
        assert (tmp_path / "first").exists() and done["press"] > 0, "another worker did what the killed one had begun"
        other = cluster.versions() | {"torch": "1.0"}
        monkeypatch.setattr(cluster, "versions", lambda: other)
        with pytest.raises(InputError, match=r"^worker tcp://\S+ .* has torch \S+, not 1.0: results would differ"):
            results(monkeypatch, local.scheduler_address)
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    with pytest.raises(InputError, match=r"^WORKERS=tcp://127.0.0.1:9: no Dask scheduler answers there"):
        results(monkeypatch, "tcp://127.0.0.1:9")


@pytest.mark.parametrize("given", ["0", "-1", "two", "tcp://host", "http://host:8786"])
def test_a_wrong_setting_is_one_sentence(given, monkeypatch):
    monkeypatch.setenv("WORKERS", given)
    with pytest.raises(InputError, match=f"^WORKERS={given}: expected a whole number of 1 or more, or a Dask sch"):
        workers.count()
