"""Read the numbers that the three papers print: published.csv, under the names that models and data have here."""

from decimal import Decimal
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from tactile import experiments

PUBLISHED = Path(__file__).with_name("published.csv")
PRINTED = {  # paper -> models as it prints them; a model that is not listed has no published number
    "lomp": {
        "linear": "Linear Regression",
        "poly": "Polynomial Regression",
        "tree": "Decision Tree Regression",
        "rbf": "RBF-Net",
        "cnn": "CNN",
        "vgg": "VGG-16",
        "convlstm": "ConvLSTM",
        "rnn": "RNN",
        "lomp": "LoMP",
    },
    "latent": {"lstm_direct": "Direct training", "lstm_transfer": "Transfer learning"},
    "sp_resnet": {
        "naive_bayes": "Naive Bayes",
        "tree": "Decision Tree",
        "resnet18": "ResNet-18",
        "mobilenet": "MobileNet",
        "resnet3x3": "ResNet_3x3",
        "sp_resnet_nogcam": "SP-ResNet (no GCAM)",
        "sp_resnet": "SP-ResNet",
    },
}
METHODS = {  # of augmentation, as evidence/shards.yaml and SP-ResNet's Table 2 call them; `all` is the model of Table 1
    "none": "no augmentation",
    "A": "only A (flip)",
    "B": "only B (noise)",
    "C": "only C (affine)",
    "all": "all",
}
CONDITIONS = {"single touch": "single", "double touch": "double", "single touch (GTX 1070)": "single"}
CONDITIONS |= {"task 1": "task_1", "task 2": "task_2"}
COUNTS = {"multiply-accumulates": "macs", "parameters": "params"}


@cache
def _rows(paper: str) -> dict[tuple[str, str, str], tuple[str, str]]:
    """Return (model or augmentation method, condition, metric) -> value and unit as text: 116.90 has two decimals."""
    table = pd.read_csv(PUBLISHED, dtype=str)
    names = {printed: key for key, printed in PRINTED[paper].items()}
    names |= {printed: key for key, printed in METHODS.items() if paper == "sp_resnet"}
    return {
        (names[row.model], CONDITIONS.get(row.condition, row.condition), row.metric): (row.value, row.unit)
        for row in table[table["paper"] == paper].itertuples()
    }


def number(paper: str, model: str, condition: str, metric: str) -> float:
    """Return the number that a paper prints for a model, NaN where there is none."""
    value, _ = _rows(paper).get((model, condition, metric), (np.nan, ""))
    return float(value)


def score(experiment: str, model: str, condition: str, metric: str) -> float:
    """Return what a paper prints for a row of scores.csv, in that row's unit; NaN where it prints nothing."""
    paper = experiments.having("paper").get(experiment)
    if paper is None or metric != paper.metric:
        return float("nan")
    return round(number(paper.key, model, condition, paper.printed) / paper.times, 6)


def precision(model: str, dataset: str) -> float:
    """Return the precision in % of SP-ResNet's Tables 1 and 2; model: also a method of augmentation."""
    return number("sp_resnet", model, dataset, "precision")


def precision_gain(method: str, dataset: str) -> float:
    """Return the points that an augmentation method adds to training without any in SP-ResNet's Table 2."""
    return precision(method, dataset) - precision("none", dataset)


def counts() -> dict[tuple[str, str], tuple[Decimal, int]]:
    """Return (model, `macs` or `params`) -> the count as SP-ResNet's Table 1 prints it, and its unit."""
    rows = _rows("sp_resnet")
    return {
        (model, key): (Decimal(rows[model, "any", metric][0]), int(float(rows[model, "any", metric][1])))
        for model in PRINTED["sp_resnet"]
        for metric, key in COUNTS.items()
        if (model, "any", metric) in rows
    }


# Metrics of published.csv -> as the table of results calls them.
METRICS = {"RMSE": "rmse", "inference time": "p50_ms", "test error": "error", "training time": "train_s"}
METRICS |= {"precision": "macro_precision", **COUNTS}
ANY = "any"  # the condition of what has none, such as a count


def table(paper: str) -> pd.DataFrame:
    """Return what a paper prints in the words of the table of results: condition, model, variant, metric, value, step.

    step: one unit of the last printed digit. Percentages are fractions, counts plain numbers. An augmentation method is
    a variant of SP-ResNet, named `augmentation_<method>`. No row for a paper that published.csv does not have.
    """
    rows = []
    for (model, condition, metric), (text, unit) in (_rows(paper) if paper in PRINTED else {}).items():
        size = 0.01 if unit == "%" else float(unit) if unit.startswith("1") else 1.0
        step = float(Decimal(1).scaleb(int(Decimal(text).as_tuple().exponent)))
        model, variant = ("sp_resnet", f"augmentation_{model}") if model in METHODS else (model, "")
        condition = ANY if metric == "inference time" else condition
        rows.append((condition, model, variant, METRICS[metric], size * float(text), size * step))
    return pd.DataFrame(rows, columns=["condition", "model", "variant", "metric", "value", "step"])
