"""The study of the latent space: the truths that its decoders are held against."""

import numpy as np
from builders.project import ROOT

from pipeline.studies import latent
from tactile.base import params


def test_truths_are_those_of_the_seeds_recording(workspace):
    settings = params.load(ROOT / "params.yaml")["strain"]
    settings = settings | {"simulate": settings["simulate"] | {"samples": 300}}
    at_s = np.array([0.5])
    assert latent.true_drift(workspace, settings, "task_1", 0, at_s) == {}
    for k in range(2):
        folder = workspace.logs("strain") / "task_1" / f"run00{k}"
        folder.mkdir(parents=True)
        (folder / "truth.csv").write_text(f"t_s,drift0\n0,{k}\n1,{k + 2}\n")
    first, second, again = (latent.true_drift(workspace, settings, "task_1", seed, at_s) for seed in range(3))
    assert [float(truths["true deviation"][0, 0]) for truths in (first, second, again)] == [1.0, 2.0, 1.0]
    assert np.array_equal(first["true drift"], again["true drift"]) and first["true drift"].shape == (1, 6)
    assert not np.allclose(first["true drift"], second["true drift"])
