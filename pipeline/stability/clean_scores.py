"""The clean level of a stress test: it must be what the stage `evaluate` found, or one of the two is out of date."""

from collections.abc import Callable, Sequence

import numpy as np

from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.scoring.estimates import read_csv

KEY = ["protocol", "condition", "model", "seed", "metric"]


def checker(workspace: Workspace, experiment: str, tolerance: float) -> Callable[[tuple, Sequence[tuple]], None]:
    """Return `check(run, scores)`, which raises InputError where a metric is not as scores.csv has it, or not in it.

    run: (protocol, condition, model, seed); tolerance: relative where a metric is above 1. Raises InputError where
    scores.csv has two rows for one metric.
    """
    path, made_by = workspace.scores(experiment), f"python -m tactile.stages.evaluate {experiment}"
    table = read_csv(path, [*KEY, "value"], made_by)
    for row in table.loc[table.duplicated(KEY), KEY].itertuples(index=False):
        raise InputError(f"{path}: two rows for {', '.join(map(str, row))}; run `{made_by}` again")
    written = table.set_index(KEY)["value"].to_dict()

    def check(run: tuple[str, str, str, int], scores: Sequence[tuple]) -> None:
        protocol, condition, model, seed = run
        for metric, _, value, *_ in scores:
            if (*run, metric) not in written:
                raise InputError(
                    f"{path}: no row for protocol {protocol}, condition {condition}, "
                    f"model {model}, seed {seed}, metric {metric}; run `{made_by}` again"
                )
            expected = written[*run, metric]
            if not np.isclose(value, expected, rtol=tolerance, atol=tolerance, equal_nan=True):
                raise InputError(
                    f"{path}: {model}, {protocol}, seed {seed} has {metric} {expected:.6g}, but the "
                    f"model gives {value:.6g} without any perturbation; run `{made_by}` again"
                )

    return check
