"""The clean level of a stress test: it must be what the stage `evaluate` found, or one of the two is out of date."""

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.base.errors import InputError
from pipeline.scoring.metrics import Row
from pipeline.scoring.results import Scores


def check(
    written: Scores, run: tuple[str, str, str, int], settings: Mapping, scores: Sequence[Row], tolerance: float
) -> None:
    """Raise InputError where a metric in `scores` is off by more than `tolerance` (relative where it is above 1).

    run: (protocol, condition, model, seed); settings: the experiment's block of settings; written: its scores.csv.
    """
    protocol, condition, model, seed = run
    place = settings["protocols"][protocol]["seeds"].index(seed)
    for metric, _, value, _ in scores:
        expected = written.runs(protocol, condition, model, metric)[place]
        if not np.isclose(value, expected, rtol=tolerance, atol=tolerance, equal_nan=True):
            raise InputError(
                f"{written.path}: {model}, {protocol}, seed {seed} has {metric} {expected:.6g}, but the "
                f"model gives {value:.6g} without any perturbation; run `{written.made_by}` again"
            )
