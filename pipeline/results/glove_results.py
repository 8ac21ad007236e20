"""Read and derive the results on tactile images: counts, confusions, scores by number of frames.

Scores are fractions in files; a difference of two of them is in points.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.results import studies
from tactile.base.paths import Workspace
from tactile.datasets.images import classes, modality, split_name
from tactile.scoring import classification
from tactile.scoring.estimates import read_csv, read_predictions

NETWORKS = ("resnet18", "mobilenet", "resnet3x3", "sp_resnet")  # of Table 1, without the ablation
COMPARED = ("sp_resnet", "resnet3x3")  # by number of input frames, figure 15
FRAMES_COLUMNS = ["form", "model", "seed", "frames", "metric", "value"]
MOST_CONFUSED = 3  # pairs that are listed; one that the paper names must be among them


def read_counts(workspace: Workspace) -> pd.DataFrame:
    """Read counts.csv: multiply-accumulates and parameters."""
    names = ["model", "input_shape", "classes", "macs", "params", "published_macs", "published_params", "verdict"]
    return read_csv(workspace.reports / "counts.csv", [*names, "note"], "python -m pipeline.studies.counts")


def like_with_like(counts: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of counts.csv at the shape that is trained here, by model."""
    return counts[counts["published_macs"].isna()].set_index("model")


def read_frames(workspace: Workspace, dataset: str, models: Sequence[str]) -> pd.DataFrame:
    """Return FRAMES_COLUMNS: scores by number of input frames on one dataset of the glove, in both forms.

    No row where the study was not computed, or of another dataset than it trained on.
    """
    rows = studies.read(workspace, "glove", "input_frames", ["condition", *FRAMES_COLUMNS])
    rows = rows[(rows["condition"] == dataset) & rows["model"].isin(models)]
    return with_one_frame(rows.drop(columns="condition"))


def with_one_frame(rows: pd.DataFrame) -> pd.DataFrame:
    """Return scores by number of frames whose networks trained on several have their beginning, the one of one frame.

    That is the one whose predictions are averaged, where no other was trained: of the same models and seeds.
    """
    trained, mean = (rows[rows["form"] == form] for form in ("trained", "mean"))
    if len(trained) and not (trained["frames"] == 1).any():
        first = mean[(mean["frames"] == 1) & mean["model"].isin(trained["model"]) & mean["seed"].isin(trained["seed"])]
        trained = pd.concat([first.assign(form="trained"), trained])
    return pd.concat([trained, mean])[["form", *rows.columns.drop("form")]]


def judged_form(rows: pd.DataFrame) -> str:
    """Return the form that the claims on figure 15 are judged on: `trained` where there is one."""
    return "trained" if (rows["form"] == "trained").any() else "mean"


def read_confusions(
    workspace: Workspace, experiment: str, settings: Mapping, table: pa.Table, models: Mapping[str, str]
) -> dict[str, np.ndarray]:
    """Count dataset -> (runs, classes, classes) test images of the main split; failed runs are left out.

    table: the dataset's; models: dataset -> the model that is asked.
    """
    protocols, confusions = main_protocols(settings), {}
    truth = np.eye(len(classes(table)))[table["label"].to_numpy()]
    for dataset, model in models.items():
        runs = []
        for seed in settings["protocols"][protocols[dataset]]["seeds"]:
            predicted = read_predictions(workspace, experiment, model, protocols[dataset], seed, table)
            rows = np.isfinite(predicted).all(axis=1)
            if rows.any():
                runs.append(classification.confusion(truth[rows], predicted[rows]))
        confusions[dataset] = np.array(runs).reshape(-1, truth.shape[1], truth.shape[1])
    return confusions


def pair_shares(counts: np.ndarray) -> np.ndarray:
    """Return (classes, classes) in %: of the images of two objects, how many were given the other's name.

    counts: (classes, classes) images of one run or of several together.
    """
    images = counts.sum(axis=1)
    both = images[:, None] + images
    return 100 * np.divide(counts + counts.T, both, out=np.zeros(counts.shape), where=both > 0)


def splits(settings: Mapping) -> dict[str, list[str]]:
    """Return split -> its protocols, the first being the main one."""
    by_split: dict[str, list[str]] = {}
    for protocol in settings["protocols"]:
        by_split.setdefault(split_name(protocol), []).append(protocol)
    return by_split


def main_protocols(settings: Mapping) -> dict[str, str]:
    """Return dataset -> its protocol in the main split."""
    return {modality(protocol): protocol for protocol in next(iter(splits(settings).values()))}
