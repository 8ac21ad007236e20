"""Recorded data from their files to scores, times and stress: on files made up here, and on the real ones."""

from itertools import product

import numpy as np
import pandas as pd
import pytest
from builders import grasps, strain_workspaces
from builders.project import ROOT, leaves, run_stage
from opened.noted import Noted, ignore_bookkeeping

from pipeline.base import params
from pipeline.logs import sources
from pipeline.stages import agreement, dataset, evaluate, ingest, latency, stress, train, window

# A model in closed form of each, which every processor fits to the same digits but the last (RBF-Net is none: of six
# k-means fits on another processor one ends 0.25 % off), and its protocols.
MODEL = {"velostat_recorded": "constant", "strain_recorded": "ridge", "glove_recorded": "naive_bayes"}
PROTOCOLS = {
    "velostat_recorded": ("repetition", "pike1_force_20"),
    "strain_recorded": ("within_day_xy", "across_days_xy", "new_places_xy"),
    "glove_recorded": ("grasp_pressure", "grasp_combined", "grasp_strain"),
}


def made_velostat(folder):
    """Two repetitions of ten presses of 1 s with each of two tips, on a taxel that reads 900 counts at rest."""
    devices = (("velostat_data", 143.0), ("futek_data", 250.0))
    for tip, repetition, (device, rate_hz) in product(("pike1_force_20", "pike5_force_20"), ("exp1", "exp2"), devices):
        t = np.arange(0, 20, 1 / rate_hz)
        force = 20 * np.maximum(0, np.sin(np.pi * t)) ** 2
        values = force if device == "futek_data" else 900 - 20 * force
        path = folder / device / tip / f"exp_{tip}_sensor1_{repetition}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("".join(f"{v:.4f} {1.6e9 + s:.6f}\n" for v, s in zip(values, t, strict=True)))


def made_strain(folder):
    """60 presses on one day and 30 on the next, which has a channel more."""
    for name, channels, cycles in (("new_test/para5_long.mat", 6, 60), ("para5_long_n.mat", 7, 30)):
        strain_workspaces.save(folder, strain_workspaces.workspace(channels, cycles), name)


def made_glove(folder):
    """Six grasps of each of two objects."""
    for first in range(0, 1200, 100):
        content = grasps.xml(grasps.grasp(seed=first))
        condition = "ball" if first < 600 else "mug"
        grasps.save(folder, content, f"{condition}_{first:06d}-{first + 90:06d}.dsa", condition)


MADE = {"velostat_recorded": made_velostat, "strain_recorded": made_strain, "glove_recorded": made_glove}


@pytest.fixture
def stages(workspace, monkeypatch):
    """`stages(experiment, folder, values, more)`: all up to the scores, and `more`, of one model in this process."""
    monkeypatch.setenv("WORKERS", "1")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")  # put back after `latency`

    def run(experiment, folder, values, more=()):
        monkeypatch.setattr(sources, "is_complete", lambda workspace, name: True)
        monkeypatch.setattr(sources, "folder", lambda workspace, name: folder)
        monkeypatch.setattr(params, "load", lambda _: values)
        windows = [window] if experiment == "velostat_recorded" else []
        for module in [ingest, *windows, dataset, train, evaluate, *more]:
            run_stage(monkeypatch, workspace, module, experiment)

    return run


def settings(experiment, model):
    """params.yaml with one model and the protocols of PROTOCOLS for one experiment."""
    values = params.load(ROOT / "params.yaml")
    block = values[experiment]
    block["models"] = {model: block["models"][model]}
    block["protocols"] = {name: block["protocols"][name] for name in PROTOCOLS[experiment]}
    return values


@pytest.mark.parametrize("experiment", MADE)
def test_every_setting_of_recorded_data_is_read(workspace, experiment, stages, tmp_path, monkeypatch):
    """All stages on recordings that are made up here, with settings that note what is read of them."""
    values, read = settings(experiment, "constant"), set()
    values[experiment]["latency"] |= {"warm_up": 1, "calls": 2}
    values["stress"][experiment]["protocols"] = list(PROTOCOLS[experiment][:1])
    if experiment == "strain_recorded":
        values["stress"][experiment]["perturbations"]["time"] = [0.3, 0.6]  # minutes: these days are short
    MADE[experiment](tmp_path / "made")
    ignore_bookkeeping(monkeypatch.setattr)
    stages(experiment, tmp_path / "made", Noted(values, read), [latency, stress])
    scores = pd.read_csv(workspace.scores(experiment))
    assert set(scores["protocol"]) == set(PROTOCOLS[experiment]) and np.isfinite(scores["value"]).any()
    own = {name for name in leaves(values) if name.startswith((f"{experiment}.", f"stress.{experiment}."))}
    own -= {name for name in own if ".usable." in name}  # the report on stability reads these
    assert own and sorted(own - read) == []


@pytest.mark.slow
@pytest.mark.parametrize("experiment", MADE)
def test_real_recordings_have_the_committed_scores(workspace, experiment, stages, recordings):
    folder = recordings(experiment)
    stages(experiment, folder, settings(experiment, MODEL[experiment]))
    committed = pd.read_csv(ROOT / "reports" / "scores.csv")
    chosen = (committed["experiment"] == experiment) & (committed["model"] == MODEL[experiment])
    committed = committed[chosen & committed["protocol"].isin(PROTOCOLS[experiment])]
    both = committed.merge(
        pd.read_csv(workspace.scores(experiment)), on=agreement.KEY, how="outer", suffixes=("", "_here")
    )
    assert len(both) == len(committed) > 0
    assert both["value_here"].to_numpy() == pytest.approx(both["value"].to_numpy(), rel=1e-4, nan_ok=True)
