"""Our training against the papers' own recipe at equal core-seconds: the loss that each leaves on the validation part.

The papers say Adam with a constant rate, for LoMP 0.001 (section III-E); we take torch's moments, float32 and our batch
for it. Strain networks are not here: they are trained by their paper's recipe.
"""

import numpy as np
import pytest

from benchmarks.made import ROOT
from tactile import models, tasks
from tactile.base import params, paths
from tactile.base.paths import Workspace
from tactile.learning import regressors, training

PAPERS_RATE = 1e-3
SEEDS = (0, 1, 2)  # of the first weights and the order of batches


@pytest.mark.parametrize(
    ("experiment", "model", "protocol", "epochs"),
    [("touch", "lomp", "press", 4), ("glove", "sp_resnet", "random_frames_combined", 4)],
)
def test_training_recipe(record, sizes, monkeypatch, experiment, model, protocol, epochs):
    epochs = epochs if sizes.name == "full" else 1
    values = params.load(ROOT / "params.yaml")
    block = values[experiment]["models"][model]
    dataset = paths.require(Workspace(ROOT).dataset(experiment), "dvc repro")

    def fit(seed: int, epochs: int, **changed) -> tuple[float, float]:
        """Return the validation loss of the kept weights, and the seconds, which are one core's."""
        recipe = block | {"training": block["training"] | changed | {"epochs": epochs}}
        place = dataset, experiment, values[experiment], protocol, 0

        def build(spec):
            model_of_seed = models.build(model, spec, recipe, "benchmark")
            fit_once = model_of_seed.fit
            model_of_seed.fit = lambda *parts, **given: fit_once(*parts, **given | {"seed": seed})
            return model_of_seed

        done = tasks.of(experiment).fit(*place, build, device="cpu")
        return min(row["validation_loss"] for row in done.history), done.seconds

    ours = [fit(seed, epochs) for seed in SEEDS]
    monkeypatch.setattr(training, "rate_at", lambda done: 1.0)
    monkeypatch.setattr(regressors, "BETAS", (0.9, 0.999))
    paper = {"learning_rate": PAPERS_RATE, "precision": "float32"}
    seconds = np.median([taken for _, taken in ours])
    as_long = max(1, round(epochs * seconds / fit(0, epochs, **paper)[1]))  # epochs
    theirs = [fit(seed, as_long, **paper) for seed in SEEDS]
    taken = np.median([taken for _, taken in theirs])
    record(
        f"training_recipe_{model}",
        what=f"{experiment}/{model}, validation loss after {epochs} epochs ({seconds:.0f} core-s), mean of 3 seeds",
        peer_is=f"the paper's recipe (Adam, rate {PAPERS_RATE}, float32), {as_long} epochs ({taken:.0f} core-s)",
        unit="loss",
        ours=float(np.mean([loss for loss, _ in ours])),
        peer=float(np.mean([loss for loss, _ in theirs])),
        rounds=len(SEEDS),
    )
