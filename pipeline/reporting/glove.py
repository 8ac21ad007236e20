"""The tables of reports/glove: Tables 1 and 2 of the SP-ResNet paper beside the published numbers.

Scores are fractions in files and percent in text; a difference of two of them is in points.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.datasets import schemas
from pipeline.datasets.images import MODALITIES, classes, modality, split_name
from pipeline.reporting import markdown
from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import interval, number, size
from pipeline.scoring import classification
from pipeline.scoring.results import (
    PUBLISHED,
    Estimate,
    Fit,
    Scores,
    estimate,
    read_csv,
    read_fit,
    read_predictions,
    shown,
)

PRINTED = {  # models as the paper prints them; a model that is not listed has no published number
    "naive_bayes": "Naive Bayes",
    "tree": "Decision Tree",
    "resnet18": "ResNet-18",
    "mobilenet": "MobileNet",
    "resnet3x3": "ResNet_3x3",
    "sp_resnet_nogcam": "SP-ResNet (no GCAM)",
    "sp_resnet": "SP-ResNet",
}
METHODS = {  # of augmentation, as augmentation.csv and the paper call them
    "none": "no augmentation",
    "A": "only A (flip)",
    "B": "only B (noise)",
    "C": "only C (affine)",
    "all": "all",
}
NETWORKS = ("resnet18", "mobilenet", "resnet3x3", "sp_resnet")  # of Table 1, without the ablation
METRICS = {"macro_precision": "Macro precision", "accuracy": "Accuracy"}


def published() -> dict[tuple[str, str], float]:
    """Tables 1 and 2: (model, or augmentation method; dataset) -> precision in %."""
    rows = pd.read_csv(PUBLISHED)
    rows = rows[(rows["paper"] == "sp_resnet") & (rows["metric"] == "precision")]
    keys = {("Table 1", printed): key for key, printed in PRINTED.items()}
    keys |= {("Table 2", printed): key for key, printed in METHODS.items()}
    return {(keys[row.source, row.model], row.condition): float(row.value) for row in rows.itertuples()}


def read_counts() -> pd.DataFrame:
    """counts.csv: multiply-accumulates and parameters."""
    names = ["model", "input_shape", "classes", "macs", "params", "published_macs", "published_params", "verdict"]
    return read_csv(paths.REPORTS / "counts.csv", [*names, "note"], "python -m pipeline.studies.counts")


def like_with_like(counts: pd.DataFrame) -> pd.DataFrame:
    """The rows of counts.csv at the shape that is trained here, by model."""
    return counts[counts["published_macs"].isna()].set_index("model")


def read_augmentation(settings: Mapping, metric: str) -> dict[tuple[str, str], list[float]]:
    """(method, dataset) -> a value a seed of `augmentation.seeds`, fractions; settings: the block `glove`.

    `all` is the model as Table 1 has it. Raises InputError that names a missing row.
    """
    block, made_by = settings["augmentation"], "python -m pipeline.studies.augmentation glove"
    protocols = {dataset: f"{block['split']}_{dataset}" for dataset in MODALITIES}
    path = paths.augmentation("glove")
    rows = read_csv(path, ["method", "protocol", "seed", "metric", "value"], made_by)
    values = {(row.method, row.protocol, int(row.seed), row.metric): row.value for row in rows.itertuples()}
    same_seeds = {protocol: {"seeds": block["seeds"]} for protocol in protocols.values()}
    complete = Scores("glove", {"protocols": same_seeds})
    found = {}
    for dataset, protocol in protocols.items():
        for method in METHODS:
            if method == "all":
                found[method, dataset] = complete.runs(protocol, dataset, block["model"], metric)
                continue
            for seed in block["seeds"]:
                if (method, protocol, seed, metric) not in values:
                    raise InputError(
                        f"{shown(path)}: no row for method {method}, protocol {protocol}, seed {seed}, metric "
                        f"{metric}; run `{made_by}` again"
                    )
            found[method, dataset] = [values[method, protocol, seed, metric] for seed in block["seeds"]]
    return found


def read_stag() -> pd.DataFrame:
    """Scores on the STAG data set by number of input frames; no row where the user has named no file."""
    names = ["model", "seed", "frames", "metric", "value"]
    return read_csv(paths.stag("glove"), names, "python -m pipeline.studies.stag glove")


def read_fits(experiment: str, settings: Mapping) -> dict[str, dict[str, list[Fit]]]:
    """Network -> protocol -> a fit a seed."""
    return {
        model: {
            protocol: [read_fit(experiment, model, protocol, seed) for seed in block["seeds"]]
            for protocol, block in settings["protocols"].items()
        }
        for model, own in settings["models"].items()
        if "training" in own
    }


def read_confusions(
    experiment: str, settings: Mapping, table: pa.Table, models: Mapping[str, str]
) -> dict[str, np.ndarray]:
    """Dataset -> (runs, classes, classes) test images of the main split; failed runs are left out.

    table: the dataset's; models: dataset -> the model that is asked.
    """
    protocols, found = main_protocols(settings), {}
    truth = np.eye(len(classes(table)))[table["label"].to_numpy()]
    for dataset, model in models.items():
        runs = []
        for seed in settings["protocols"][protocols[dataset]]["seeds"]:
            predicted = read_predictions(experiment, model, protocols[dataset], seed, table)
            rows = np.isfinite(predicted).all(axis=1)
            if rows.any():
                runs.append(classification.confusion(truth[rows], predicted[rows]))
        found[dataset] = np.array(runs).reshape(-1, truth.shape[1], truth.shape[1])
    return found


def scores_by_frames(table: pa.Table, protocol: str, settings: Mapping, models: Sequence[str]) -> pd.DataFrame:
    """Scores of the mean answer to 1 .. MOST_FRAMES images of a test session; columns as in stag.csv.

    table: the dataset's. Fewer, where an object has no test session that long; shorter sessions than the most frames
    are left out at every number of frames, so that all numbers are of the same sessions.
    """
    label = table["label"].to_numpy()
    names = np.char.add(np.char.add(schemas.names(table["condition"]), "/"), schemas.names(table["recording"]))
    _, session, images = np.unique(names, return_inverse=True, return_counts=True)
    tests = {
        seed: np.flatnonzero(schemas.names(table[schemas.split_column(protocol, seed)]) == "test")
        for seed in settings["protocols"][protocol]["seeds"]
    }
    longest = [images[session[test[label[test] == k]]].max() for test in tests.values() for k in set(label[test])]
    most = min(classification.MOST_FRAMES, *longest)
    rows = []
    for model in models:
        for seed, test in tests.items():
            predicted = read_predictions("glove", model, protocol, seed, table)
            failed = not np.isfinite(predicted[test]).all()
            used = test[images[session[test]] >= most]
            for frames in range(1, most + 1):
                first, mean = classification.by_frames(predicted[used], session[used], frames)
                truth = np.eye(predicted.shape[1])[label[used[first]]]
                for metric, unit, value, n in classification.scores(truth, mean):
                    rows.append((model, seed, frames, metric, unit, np.nan if failed else value, n))
    return pd.DataFrame(rows, columns=["model", "seed", "frames", "metric", "unit", "value", "n"])


def score(scores: Scores, protocol: str, model: str, metric: str = "macro_precision") -> Estimate:
    """Mean and interval over the seeds of one protocol, in percent."""
    return scores.estimate(protocol, modality(protocol), model, metric).percent()


def gain(scores: Scores, one: tuple[str, str], other: tuple[str, str], metric: str = "macro_precision") -> Estimate:
    """How far `one` is above `other` in points, paired by seed; each is (protocol, model)."""
    values = [
        dict(zip(scores.protocols[p]["seeds"], scores.runs(p, modality(p), model, metric), strict=True))
        for p, model in (one, other)
    ]
    return estimate([100 * (values[0][seed] - values[1][seed]) for seed in values[0] if seed in values[1]])


def splits(settings: Mapping) -> dict[str, list[str]]:
    """Split -> its protocols, the first being the main one."""
    found = {}
    for protocol in settings["protocols"]:
        found.setdefault(split_name(protocol), []).append(protocol)
    return found


def main_protocols(settings: Mapping) -> dict[str, str]:
    """Dataset -> its protocol in the main split."""
    return {modality(protocol): protocol for protocol in next(iter(splits(settings).values()))}


def score_table(scores: Scores, settings: Mapping, paper: Mapping[tuple[str, str], float]) -> pd.DataFrame:
    """A row for every protocol, model and metric, fractions in full precision; paper: see `published`."""
    rows = []
    for protocol in settings["protocols"]:
        dataset = modality(protocol)
        for model in settings["models"]:
            for metric in METRICS:
                printed = paper.get((model, dataset), np.nan) / 100 if metric == "macro_precision" else np.nan
                found = scores.estimate(protocol, dataset, model, metric)
                rows.append((protocol, dataset, model, metric, "1", printed, *found))
    names = ["protocol", "condition", "model", "metric", "unit", "published", "mean", "low", "high", "runs", "failed"]
    return pd.DataFrame(rows, columns=names)


def table_one(scores: Scores, settings: Mapping, counts: pd.DataFrame) -> str:
    """table1.md: precision and accuracy of three datasets in both splits, operations and parameters."""
    paper, protocols = published(), main_protocols(settings)
    split = next(iter(splits(settings))).replace("_", " ")
    seeds = len(settings["protocols"][protocols[MODALITIES[0]]]["seeds"])
    text = [
        "# Table 1: precision on three datasets of tactile images\n",
        "Ours: mean [95 % t interval] over seeds, each of which draws another split and another start; higher is "
        "better. Published: the paper's one number. Macro precision: mean over objects of the share of images given "
        "that name that are it; accuracy: share of images named rightly. The paper writes `precision` without saying "
        "which. An interval may pass 100 %. `Constant (mean)` answers with the most frequent object.\n",
        "**The paper's split is not stated.** It speaks of 950 frames in a row of each object; frames at random seem "
        "likely, with neighbours of one grasp on both sides. Split by session, no grasp is on two sides: these are the "
        "numbers to believe, and the first table has them.\n",
        f"## Macro precision (%), split by {split}, {seeds} seeds\n",
    ]
    rows = []
    for model in settings["models"]:
        row = [model_name(model)]
        for dataset, protocol in protocols.items():
            row += [number(paper.get((model, dataset), np.nan)), interval(score(scores, protocol, model))]
        rows.append(row)
    header = [f"{dataset}: {whose}" for dataset in protocols for whose in ("published", "ours")]
    text += [markdown.table(["Model", *header], rows), f"## Accuracy (%), split by {split}, {seeds} seeds\n"]
    rows = [
        [model_name(model), *(interval(score(scores, protocol, model, "accuracy")) for protocol in protocols.values())]
        for model in settings["models"]
    ]
    text += [markdown.table(["Model", *protocols], rows), split_table(scores, settings, paper), count_table(counts)]
    return "\n".join(text)


def split_table(scores: Scores, settings: Mapping, paper: Mapping[tuple[str, str], float]) -> str:
    """Every model and dataset in both splits."""
    both = splits(settings)
    rows = []
    for model in settings["models"]:
        for dataset in MODALITIES:
            cells = [
                interval(score(scores, f"{split}_{dataset}", model, metric)) for metric in METRICS for split in both
            ]
            rows.append([model_name(model), dataset, number(paper.get((model, dataset), np.nan)), *cells])
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
    """Operations and parameters: published, ours at the shape that gives the published ones, and like with like."""
    own = like_with_like(counts)
    rows = []
    for row in counts[counts["published_macs"].notna()].itertuples():
        classes = "no head" if np.isnan(row.classes) else f"{row.classes:,.0f} classes"
        reduction = f" ({row.note})" if str(row.note).startswith("reduction") else ""
        as_trained = not reduction or "as trained" in reduction
        rows.append(
            [
                model_name(row.model) + reduction,
                f"{row.input_shape}, {classes}",
                *(size(value) for value in (row.published_macs, row.macs, row.published_params, row.params)),
                row.verdict,
                *(size(own.loc[row.model, name]) if as_trained else "" for name in ("macs", "params")),
            ]
        )
    header = ["Network", "shape of the count", "published MACs", "our MACs", "published parameters", "our parameters"]
    header += ["verdict", "MACs, like with like", "parameters, like with like"]
    (shape,), (classes,) = own["input_shape"].unique(), own["classes"].unique()
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
    """table2.csv: precision with each method and its gain over none, fractions; values: metric -> read_augmentation."""
    paper, rows = published(), []
    for metric, found in values.items():
        for method, dataset in found:
            printed = (np.nan, np.nan)
            if metric == "macro_precision":
                printed = paper[method, dataset] / 100, (paper[method, dataset] - paper["none", dataset]) / 100
            own = estimate(found[method, dataset])
            more = augmentation_gain(found, method, dataset)
            more = [value / 100 for value in more[:3]]
            rows.append((method, dataset, metric, "1", printed[0], *own, printed[1], *more))
    names = ["method", "condition", "metric", "unit", "published", "mean", "low", "high", "runs", "failed"]
    return pd.DataFrame(rows, columns=[*names, "published_gain", "gain", "gain_low", "gain_high"])


def augmentation_gain(values: Mapping[tuple[str, str], list[float]], method: str, dataset: str) -> Estimate:
    """What a method adds to training without any, in points, paired by seed."""
    return estimate(100 * (np.array(values[method, dataset]) - np.array(values["none", dataset])))


def table_two(values: Mapping[tuple[str, str], list[float]], settings: Mapping) -> str:
    """table2.md: macro precision with each method, and what it adds; values: see `read_augmentation`."""
    paper, block = published(), settings["augmentation"]
    parts = []
    for cell in (
        lambda method, dataset: (
            number(paper[method, dataset]),
            interval(estimate(values[method, dataset]).percent()),
        ),
        lambda method, dataset: (
            number(paper[method, dataset] - paper["none", dataset]),
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
