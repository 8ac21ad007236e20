"""Write Tables 1 and 2 of the SP-ResNet paper, ours beside the published numbers.

Scores are fractions in files and percent in text; a difference of two of them is in points.
"""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from pipeline.datasets.images import MODALITIES, modality
from pipeline.reporting import experiment, sentences
from pipeline.reporting.words import markdown
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, number, size
from pipeline.scoring.glove_results import augmentation_gain, like_with_like, main_protocols, score, splits
from pipeline.scoring.published import METHODS, precision, precision_gain
from pipeline.scoring.results import Scores, estimate

METRICS = {"macro_precision": "Macro precision", "accuracy": "Accuracy"}


def score_table(scores: Scores, settings: Mapping) -> pd.DataFrame:
    """Return one row per protocol, model and metric, fractions in full precision."""
    return experiment.score_table(
        scores,
        [
            (p, modality(p), model, metric)
            for p in settings["protocols"]
            for model in settings["models"]
            for metric in METRICS
        ],
        units=dict.fromkeys(METRICS, "1"),
        published=lambda model, dataset, metric: (
            precision(model, dataset) / 100 if metric == "macro_precision" else np.nan
        ),
    )


def table_one(scores: Scores, settings: Mapping, counts: pd.DataFrame) -> str:
    """Write table1.md: precision and accuracy of three datasets in both splits, operations and parameters."""
    protocols = main_protocols(settings)
    split = next(iter(splits(settings))).replace("_", " ")
    seeds = len(settings["protocols"][protocols[MODALITIES[0]]]["seeds"])
    text = [
        "# Table 1: precision on three datasets of tactile images\n",
        f"Ours: mean [95 % t interval] over seeds, {sentences.replicates(settings, 'glove')}; higher is better. "
        "Published: the paper's one number. Macro precision: mean over objects of the share of images given "
        "that name that are it; accuracy: share of images named rightly. The paper writes `precision` without saying "
        "which. An interval may pass 100 %. `Constant (mean)` predicts the most frequent object.\n",
        "**The paper's split is not stated.** It speaks of 950 frames in a row of each object; frames at random seem "
        "likely, with neighbours of one grasp on both sides. Split by session, no grasp is on two sides: these are the "
        "numbers to believe, and the first table has them.\n",
        f"## Macro precision (%), split by {split}, {seeds} seeds\n",
    ]
    rows = []
    for model in settings["models"]:
        row = [model_name(model)]
        for dataset, protocol in protocols.items():
            row += [number(precision(model, dataset)), interval(score(scores, protocol, model))]
        rows.append(row)
    header = [f"{dataset}: {whose}" for dataset in protocols for whose in ("published", "ours")]
    text += [markdown.table(["Model", *header], rows), f"## Accuracy (%), split by {split}, {seeds} seeds\n"]
    rows = [
        [model_name(model), *(interval(score(scores, protocol, model, "accuracy")) for protocol in protocols.values())]
        for model in settings["models"]
    ]
    text += [markdown.table(["Model", *protocols], rows), split_table(scores, settings), count_table(counts)]
    return "\n".join(text)


def split_table(scores: Scores, settings: Mapping) -> str:
    """Write the part of table1.md on every model and dataset in both splits."""
    both = splits(settings)
    rows = []
    for model in settings["models"]:
        for dataset in MODALITIES:
            cells = [
                interval(score(scores, f"{split}_{dataset}", model, metric)) for metric in METRICS for split in both
            ]
            rows.append([model_name(model), dataset, number(precision(model, dataset)), *cells])
    header = ["Model", "Dataset", "published"]
    header += [f"{name}: {split.replace('_', ' ')}" for name in METRICS.values() for split in both]
    return "\n".join(
        [
            "## Random frames against sessions (%)\n",
            "Numbers without an interval are of one seed.\n",
            markdown.table(header, rows),
        ]
    )


def count_table(counts: pd.DataFrame) -> str:
    """Write the part of table1.md on operations and parameters, at the published shapes and like with like."""
    alike = like_with_like(counts)
    rows = []
    for row in counts[counts["published_macs"].notna()].itertuples():
        head = "no head" if np.isnan(row.classes) else f"{row.classes:,.0f} classes"
        reduction = f" ({row.note})" if str(row.note).startswith("reduction") else ""
        as_trained = not reduction or "as trained" in reduction
        rows.append(
            [
                model_name(row.model) + reduction,
                f"{row.input_shape}, {head}",
                *(size(value) for value in (row.published_macs, row.macs, row.published_params, row.params)),
                row.verdict,
                *(size(alike.loc[row.model, name]) if as_trained else "" for name in ("macs", "params")),
            ]
        )
    header = ["Network", "shape of the count", "published MACs", "our MACs", "published parameters", "our parameters"]
    header += ["verdict", "MACs, like with like", "parameters, like with like"]
    (shape,), (classes,) = alike["input_shape"].unique(), alike["classes"].unique()
    notes = {row.model: row.note for row in counts.itertuples() if isinstance(row.note, str)}
    notes = {model: note for model, note in notes.items() if not note.startswith("reduction")}
    return "\n".join(
        [
            "## Multiply-accumulates (MACs) and parameters\n",
            f"The published counts do not compare like with like: they are of different images and classes. Like with "
            f"like: {shape} images and {classes:.0f} classes, as trained here. Reproduced: both counts equal the "
            "published ones at the precision that is printed.\n",
            markdown.table(header, rows),
            *(f"{model_name(model)}: {note}.\n" for model, note in notes.items()),
        ]
    )


def augmentation_table(values: Mapping[str, Mapping[tuple[str, str], list[float]]]) -> pd.DataFrame:
    """Return table2.csv: precision with each method and its gain over none; values: metric -> read_augmentation."""
    rows = []
    for metric, by_method in values.items():
        for method, dataset in by_method:
            printed = (np.nan, np.nan)
            if metric == "macro_precision":
                printed = precision(method, dataset) / 100, precision_gain(method, dataset) / 100
            more = [points / 100 for points in augmentation_gain(by_method, method, dataset)[:3]]
            mean = estimate(by_method[method, dataset])
            rows.append((method, dataset, metric, "1", printed[0], *mean, printed[1], *more))
    names = ["method", "condition", "metric", "unit", "published", "mean", "low", "high", "runs", "failed"]
    return pd.DataFrame(rows, columns=[*names, "published_gain", "gain", "gain_low", "gain_high"])


def table_two(values: Mapping[tuple[str, str], list[float]], settings: Mapping) -> str:
    """Write table2.md: macro precision with each method, and what it adds; values: see `read_augmentation`."""
    block = settings["augmentation"]
    parts = []
    for cell in (
        lambda method, dataset: (
            number(precision(method, dataset)),
            interval(estimate(values[method, dataset]).percent()),
        ),
        lambda method, dataset: (
            number(precision_gain(method, dataset)),
            interval(augmentation_gain(values, method, dataset)),
        ),
    ):
        rows = [[printed, *(text for d in MODALITIES for text in cell(m, d))] for m, printed in METHODS.items()]
        header = [f"{dataset}: {whose}" for dataset in MODALITIES for whose in ("published", "ours")]
        parts.append(markdown.table(["Augmentation", *header], rows[1:] if parts else rows))
    return "\n".join(
        [
            "# Table 2: data augmentation\n",
            f"{model_name(block['model'])}, split by {block['split'].replace('_', ' ')}, {len(block['seeds'])} seeds "
            "(the paper: 10 runs a method, of which it prints one number). Ours: mean [95 % t interval]; higher is "
            "better. A: flipped, B: noise, C: moved, turned or scaled. `all` is the model of Table 1.\n",
            "## Macro precision (%)\n",
            parts[0],
            "## Gain over no augmentation (points), paired by seed\n",
            parts[1],
        ]
    )
