"""Score recordings press by press, or grasp by grasp: what intervals of recorded data are over.

Seeds of a recorded experiment are starts of networks on the same recordings; how far a number would differ with other
presses is told by drawing the presses anew, with repetition (bootstrap; Efron 1979), the same ones for every model.
Of recordings of several persons, persons are drawn anew, and of each that is drawn what is theirs. Of metrics other
than the main one a person is one unit: how persons differ holds already how frames of one differ, and rows are few.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline import experiments
from pipeline.base.paths import Workspace
from pipeline.datasets import images, schemas
from pipeline.scoring import metrics
from pipeline.scoring.results import read_predictions, read_windows

MOST_UNITS = 100  # of a condition: presses in a row are one where there are more
MOST_OF_SUBJECT = 10  # likewise of one person: how persons differ weighs more
SUFFIX = "_of_unit"  # of the metric's name; the variant is the unit, or <variant>/<unit>
DRAWS = 1000
DRAW = "draw"  # name of the index of values that are draws, not runs


def rows(workspace: Workspace, experiment: str, settings: Mapping, protocols: Sequence[str]) -> Iterator[Mapping]:
    """Yield a row of the one table for every unit of the test part; value: mean squared error (of `rmse`), mean, share.

    settings: the experiment's block; protocols: those that are scored so. Where rows are of persons, a row for each
    person and further metric follows, of the function <SCORES>_by_frame of `metrics`.
    """
    table, module = read_windows(workspace, experiment), experiments.module(experiment)
    facts, condition, unit = module.FACTS, schemas.names(table["condition"]), _numbers(table)
    subject = schemas.names(table[facts.subject]) if facts.subject else None
    for protocol in protocols:
        for seed in settings["protocols"][protocol]["seeds"]:
            for model in settings["models"]:
                predicted = read_predictions(workspace, experiment, model, protocol, seed, table)
                if not np.isfinite(predicted).any():  # a failed run
                    continue
                wrong = _loss(facts.metric, table, predicted)
                known = np.isfinite(wrong) & (unit >= 0)
                shares = {facts.metric: (wrong[known], np.ones(known.sum()))}
                if subject is not None:
                    further = getattr(metrics, f"{module.SCORES}_by_frame")
                    shares |= further(schemas.matrix(table["y"])[known], predicted[known], settings)
                pooled = facts.pooled
                if facts.metric == "accuracy":  # images of all objects, which are the conditions of a dataset
                    pooled = (images.modality(protocol),)
                for name in pooled or np.unique(condition[known]):
                    chosen = known if pooled else known & (condition == name)
                    for metric, (share, of) in shares.items():
                        most = MOST_OF_SUBJECT if metric == facts.metric else 1
                        block = _named(unit[chosen], None if subject is None else subject[chosen], most)
                        parts = pd.DataFrame({"share": share, "of": of})[chosen[known]]
                        sums = parts.groupby(block, observed=True).sum()
                        for number, each in sums[sums["of"] > 0].iterrows():
                            yield {
                                "experiment": experiment, "protocol": protocol, "condition": name, "model": model,
                                "variant": number, "metric": metric + SUFFIX, "seed": seed,
                                "unit": "", "value": float(f"{each['share'] / each['of']:.6g}"), "n": round(each["of"]),
                            }  # fmt: skip


def _numbers(table: pa.Table) -> np.ndarray:
    """Return the number of the press, or of the grasp, of each row of a dataset, (n,); -1 where it has none."""
    name = np.char.add(np.char.add(schemas.names(table["condition"]), "/"), schemas.names(table["recording"]))
    press = table["press"].to_numpy() if "press" in table.column_names else np.zeros(len(name), int)
    recording = np.unique(name, return_inverse=True)[1]
    number = np.unique(np.stack([recording, press]), axis=1, return_inverse=True)[1].reshape(-1)
    return np.where(press >= 0, number, -1)


def _named(unit: np.ndarray, subject: np.ndarray | None, most: int = MOST_OF_SUBJECT) -> pd.Categorical:
    """Return the names of blocks of units, (n,): unit_0, unit_1 ..., or of persons unit_P01_0 ...

    unit, subject: (n,). Several in a row are one block where there are more than MOST_UNITS, or `most` of one person.
    """
    name, order = np.full(len(unit), "", object), []
    for one in [None] if subject is None else np.unique(subject):
        rows = np.full(len(unit), True) if one is None else subject == one
        block = _blocks(unit[rows], MOST_UNITS if one is None else most)
        name[rows] = [f"unit_{'' if one is None else f'{one}_'}{number}" for number in block]
        order += list(dict.fromkeys(name[rows][np.argsort(block, kind="stable")]))
    return pd.Categorical(name, categories=order)


def _blocks(unit: np.ndarray, most: int) -> np.ndarray:
    """Return units numbered from 0 on, several in a row as one where there are more than `most`."""
    number = np.unique(unit, return_inverse=True)[1]
    return number // -(-(number.max(initial=0) + 1) // most)


def _loss(metric: str, table: pa.Table, predicted: np.ndarray) -> np.ndarray:
    """Return squared error, distance in mm, or whether it is right, (n,); NaN where nothing is predicted."""
    if metric == "accuracy":
        right = (predicted.argmax(axis=1) == table["label"].to_numpy()).astype(float)
        return np.where(np.isfinite(predicted).all(axis=1), right, np.nan)
    gap = predicted.astype(float) - schemas.matrix(table["y"])
    asked = np.isfinite(gap).any(axis=0)
    gap = gap[:, asked]
    return np.square(gap).mean(axis=1) if metric == "rmse" else np.linalg.norm(gap, axis=1)


def drawn(table: pd.DataFrame, metric: str) -> pd.Series:
    """Return the metric over units drawn anew, (DRAWS,), each unit averaged over seeds; table: its rows of one model.

    Where units are of several persons, persons are drawn, and for each that is drawn its units: rows of several
    protocols that test on different persons may stand together. The same units give the same draws, and as many persons
    the same persons, so that models are paired, and conditions and metrics by person.
    """
    mean = table.groupby("variant")["value"].mean()
    weight = table.groupby("variant")["n"].first().astype(float)
    order = sorted(mean.index, key=lambda name: (name.rpartition("_")[0], int(name.rpartition("_")[2])))
    value, weight = mean[order].to_numpy(), weight[order].to_numpy()
    _, first, size = np.unique([name.rpartition("_")[0] for name in order], return_index=True, return_counts=True)
    rng = np.random.default_rng(len(value) if len(first) == 1 else len(first))
    if len(first) == 1:
        picked = rng.integers(len(value), size=(DRAWS, len(value)))
        result = (weight * value)[picked].sum(axis=1) / weight[picked].sum(axis=1)
    else:
        sums = np.zeros((2, DRAWS))
        for draw, persons in enumerate(rng.integers(len(first), size=(DRAWS, len(first)))):
            picked = np.concatenate([first[one] + rng.integers(size[one], size=size[one]) for one in persons])
            sums[:, draw] = (weight * value)[picked].sum(), weight[picked].sum()
        result = sums[0] / sums[1]
    return pd.Series(np.sqrt(result) if metric.endswith("rmse") else result, index=pd.RangeIndex(DRAWS, name=DRAW))
