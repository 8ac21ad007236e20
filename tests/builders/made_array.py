"""Made-up results of the recorded array: scores and rows by unit of ten persons, in five folds and three starts."""

from collections.abc import Iterator

import pandas as pd

from pipeline.results import claim_inputs, one_table

FOLDS, FURTHER = ([f"{name}_{fold}" for fold in range(5)] for name in ("fold", "two_too"))
ERRORS = {  # model -> error on one contact, on two and on three, in % of contact
    "constant": (8.5, 10.9, 12.6), "linear": (6.2, 8.1, 9.9), "poly": (6.0, 8.0, 9.6), "tree": (8.0, 10.0, 12.0),
    "linear_array": (5.5, 7.4, 9.0), "poly_array": (5.6, 7.9, 9.9), "rbf": (4.7, 8.1, 9.4), "cnn": (4.8, 9.0, 11.0),
    "vgg": (5.8, 10.5, 13.0), "lomp": (4.6, 6.1, 7.3), "lomp_shared": (4.4, 6.0, 7.2),
}  # fmt: skip
WITH_TWO = {"constant": 10.8, "linear_array": 7.2, "rbf": 7.5, "cnn": 6.2, "lomp": 5.8}  # fitted to two contacts, too
FOUND = {"constant": (0.0, 0.0, 0.0), "cnn": (0.95, 0.4, 0.2), "vgg": (0.9, 0.3, 0.1), "lomp": (0.95, 0.92, 0.8)}
FOUND |= {"linear_array": (0.9, 0.3, 0.2)}
AWAY = {"constant": (1.4, 1.4, 1.4), "cnn": (0.5, 2.0, 3.0), "vgg": (0.5, 2.0, 3.0), "lomp": (0.3, 0.4, 0.5)}
AWAY |= {"lomp_shared": (0.2, 0.2, 0.2)}
CONDITIONS = ("one", "two", "three")


def rows_of(model: str, protocols, values, metric: str = "rmse", variant: str = "") -> Iterator[dict]:
    """Scores and rows by unit: two persons a protocol, three blocks each of k + 1 frames, k from 0 on over persons."""
    for fold, protocol in enumerate(protocols):
        for condition, value in zip(CONDITIONS, values, strict=False):
            place = {"experiment": "array_recorded", "protocol": protocol, "condition": condition, "model": model}
            for seed in range(3):
                yield place | {"metric": metric, "variant": variant, "seed": seed, "value": value}
                for person in (2 * fold, 2 * fold + 1):
                    level = value * (1 + 0.1 * (person / 4.5 - 1))
                    level = level**2 if metric.endswith("rmse") else level
                    for block in range(3 if metric == "rmse" else 1):
                        unit = f"{variant}{'/' * bool(variant)}unit_P{person}_{block}"
                        row = {"metric": f"{metric}_of_unit", "variant": unit, "seed": seed, "n": person + 1}
                        yield place | row | {"value": level * (1 + 0.01 * (block - 1) * (metric == "rmse"))}


def table(drop: str = "", **errors) -> pd.DataFrame:
    """The evidence with these errors; drop: a model of which the fourth fold is missing."""
    rows = []
    for model, values in (ERRORS | errors).items():
        rows += rows_of(model, FOLDS, values)
    for model, value in WITH_TWO.items():
        rows += rows_of(model, FURTHER, (0.0, value))
    for metric, table in (("touches_found", FOUND), ("away_rmse", AWAY)):
        for model, values in table.items():
            rows += rows_of(model, FOLDS, values, metric)
    rows += rows_of("lomp", FOLDS, (6.0, 7.9, 9.0), variant="alpha_0")
    kept = [row for row in rows if not (row["model"] == drop and row["protocol"] == "fold_3")]
    return pd.DataFrame(kept).reindex(columns=claim_inputs.COLUMNS)


def results(drop: str = "", **errors) -> one_table.Results:
    """The same, to be looked up."""
    return one_table.Results(table(drop, **errors))
