"""Every training in MLflow opens with the weights of its own seed, and says of readings what its model says."""

import copy

import mlflow
import numpy as np
import pytest
import yaml
from builders.made_results import fit_linear, write_results
from builders.project import ROOT

from pipeline.tracking import mlflow_runs
from tactile.base import params
from tactile.base.paths import Workspace
from tactile.inference import consistent, mlflow_store

SEEDS = (2, 0, 1)  # as params.yaml may list them: a run's place is not its seed
FRAMES, STEP, ELEMENTS = 4, 2, 6


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    """A workspace whose linear models of three seeds, fitted to windows and maps of their own, are in its store."""
    workspace = Workspace(tmp_path_factory.mktemp("tracked"))
    touch = copy.deepcopy(params.load(ROOT / "params.yaml")["touch"])
    touch |= {"models": {"linear": {}}, "protocols": {"press": {"seeds": list(SEEDS)}}}
    touch["sensor"] |= {"rows": 2, "cols": 3}
    touch["label"] |= {"map_rows": 3, "map_cols": 5}
    touch["window"] |= {"frames": FRAMES, "frame_step": STEP}
    values = {"experiments": ["touch"], "device": "auto", "touch": touch}
    write_results(workspace.root, values)
    workspace.params.write_text(yaml.safe_dump(values))
    known = {seed: fit_linear(touch, seed, workspace.run_folder("touch", "linear", "press", seed)) for seed in SEEDS}
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        mlflow_runs.track(workspace, values)
    return workspace, known


def test_every_seeds_run_opens_with_its_own_weights(tracked, monkeypatch):
    workspace, known = tracked
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{workspace.mlflow_database}")
    readings = np.random.default_rng(9).integers(0, 1024, (12, ELEMENTS)).astype(np.float32)
    reach = (FRAMES - 1) * STEP
    seen = np.stack([readings[k - reach : k + 1 : STEP] for k in range(reach, len(readings))])
    with mlflow_store.opened(workspace) as client:
        runs = client.search_runs([client.get_experiment_by_name("touch").experiment_id])
    assert sorted(int(run.data.tags["seed"]) for run in runs) == sorted(SEEDS)
    said = {}
    for run in runs:
        seed = int(run.data.tags["seed"])
        said[seed] = mlflow.pyfunc.load_model(f"runs:/{run.info.run_id}/model").predict(readings)
        assert np.isnan(said[seed][:reach]).all()
        own = known[seed].predict(seen).reshape(-1, 3, 5)
        np.testing.assert_allclose(said[seed][reach:], own, rtol=1e-5, atol=1e-5)
        package = mlflow_store.downloaded(workspace, run.info.run_id, workspace.root / f"package-{seed}")
        assert consistent.read(package).seed == seed and run.data.params["seed"] == str(seed)
    assert np.ptp([maps[reach:] for maps in said.values()], axis=0).min() > 1e-3, "no seed says what another one says"
