"""What a training stage saves is what the others load; a wrong stage or an untrained run gets one sentence."""

import json

import numpy as np
import pytest
from builders.project import ROOT

from tactile import models, tasks
from tactile.base import params, paths
from tactile.base.errors import InputError
from tactile.learning.spec import Spec
from tactile.learning.trained import Fitted
from tactile.scoring import metrics

SPEC = Spec(2, 1, 3, 1, 2)


@pytest.fixture
def values(workspace):
    """params.yaml in a folder of its own, with one run of `linear_array` of touch saved there."""
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(40, 2, 3)).astype(np.float32), rng.normal(size=(40, 2)).astype(np.float32)
    values = params.load(ROOT / "params.yaml")
    model = models.build("linear_array", SPEC, {}, "test")
    history = model.fit((x[:30], y[:30]), (x[30:], y[30:]), seed=0, device="cpu")
    Fitted(model, history, 1.0).save(workspace.run_folder("touch", "linear_array", "press", 0), {})
    return values | {"x": x, "expected": model.predict(x), "history": history}


def test_a_saved_run_is_loaded_as_it_was(workspace, values):
    run = tasks.load(workspace, values, "touch", "linear_array", "press", 0, SPEC)
    assert not run.failed
    assert np.array_equal(run.predict(values["x"]), values["expected"])
    folder = workspace.run_folder("touch", "linear_array", "press", 0)
    header, *epochs = (folder / "history.csv").read_text().splitlines()
    assert header == ",".join(values["history"][0]) and len(epochs) == len(values["history"])
    fit = json.loads((folder / "fit.json").read_text())
    assert (fit["parameters"], fit["epochs"]) == (run.model.parameters(), len(epochs))


def test_a_run_that_diverged_predicts_nothing(workspace, values):
    path = workspace.run_folder("touch", "linear_array", "press", 0) / "fit.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"best_epoch": 0}))
    run = tasks.load(workspace, values, "touch", "linear_array", "press", 0, SPEC)
    assert run.failed and np.isnan(run.predict(values["x"])).all()
    assert metrics.unless_failed([("rmse", "kPa", 1.0, 7)], False) == [("rmse", "kPa", 1.0, 7)]
    ((metric, unit, value, n),) = metrics.unless_failed([("rmse", "kPa", 1.0, 7)], True)
    assert (metric, unit, n) == ("rmse", "kPa", 7) and np.isnan(value)


def test_a_run_that_is_not_there_or_broken_says_how_to_train_it(workspace, values):
    with pytest.raises(InputError, match="press-1: not found; run `python -m tactile.stages.train touch` first"):
        tasks.load(workspace, values, "touch", "linear_array", "press", 1, SPEC)
    with pytest.raises(InputError, match="run `python -m tactile.stages.train glove` first"):
        tasks.load(workspace, values, "glove", "tree", "session_strain", 0, Spec(1, 32, 32, 1, 16))
    (workspace.run_folder("touch", "linear_array", "press", 0) / "fit.json").write_text("{}")
    with pytest.raises(
        InputError, match="key 'stop_reason' is missing; run `python -m tactile.stages.train touch` again"
    ):
        tasks.load(workspace, values, "touch", "linear_array", "press", 0, SPEC)


@pytest.mark.parametrize("model", sorted(path.stem for path in paths.MODELS.glob("lstm_*.py")))
def test_a_model_that_starts_from_model_zero_says_so(model):
    """Its `fit` gets no model-0 otherwise, and it would not be trained again where model-0 changes."""
    block = params.load(ROOT / "params.yaml")["strain"]["models"][model]
    assert params.transfers(model) == getattr(models.build(model, SPEC, block, "test"), "transfer", False)
