"""Derive the numbers that claims need beside scores, times and counts: rows of the one table of results.

Errors at high pressure and the tilt of maps, the curve of an element off its centre, correlations of strands, pairs of
objects that are confused, and scores by number of input frames. A variant is a number of frames or a pair of objects;
what is no model's is of the model `data`.
"""

from collections.abc import Iterator, Mapping
from typing import TypeAlias

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.results import glove_results
from tactile import experiments
from tactile.base import params, paths
from tactile.base.paths import Workspace
from tactile.datasets import fits, labels, schemas
from tactile.datasets.images import classes
from tactile.scoring import metrics
from tactile.scoring.estimates import read_csv, read_predictions, read_windows

KEY = ["experiment", "protocol", "condition", "model", "variant", "metric"]
COLUMNS = [*KEY, "seed", "budget", "unit", "value", "n"]
LOOK, HALF, FULL = "look", "half", "full"  # budgets of training, from the smallest
DERIVED_METRICS: tuple[str, ...] = (
    "confusion",
    "high_pressure_error",
    "left_right_tilt",
    "macs",
    "off_centre_shift",
    "params",
)
DERIVED_METRICS += ("strand_correlation", "train_s")  # those of the one table that are no scores of a model
DATA = "data"  # the model of a number that is of the data alone
HIGH_KPA = 200.0  # "when a high pressure is applied": the upper half of the paper's 30 to 400 kPa
KPA_BINS = np.arange(50.0, 401.0, 50.0)
Row: TypeAlias = dict[str, object]


def rows(workspace: Workspace, experiment: str, settings: Mapping) -> pd.DataFrame:
    """Return the rows of an experiment of a paper, of COLUMNS; settings: its block of settings.

    What is derived from predictions is of the look; a study has no budget but its own.
    """
    common = {"experiment": experiment, "n": 1, "budget": LOOK}
    kind = experiments.module(experiment).KIND
    derived = [common | row for row in DERIVED[kind](workspace, settings)]
    return pd.DataFrame(derived, columns=COLUMNS).astype({"seed": "Int64"})


def touch(workspace: Workspace, settings: Mapping) -> Iterator[Row]:
    """Yield what the claims of LoMP need of the array."""
    table = read_windows(workspace, "touch")
    for protocol, block in settings["protocols"].items():
        for seed in block["seeds"]:
            tested = schemas.names(table[schemas.split_column(protocol, seed)]) == "test"
            for model in settings["models"]:
                maps = read_predictions(workspace, "touch", model, protocol, seed, table)
                run = {"protocol": protocol, "model": model, "seed": seed}
                found = (
                    high_pressure_error(settings, table, maps, tested),
                    left_right_tilt(settings, table, maps, tested),
                )
                yield from (run | row for row in found if row["n"])
    for element, shift in press_shift(workspace, settings).items():
        yield {"condition": "single", "model": DATA, "metric": "off_centre_shift", "seed": element} | {
            "unit": "counts", "value": shift,
        }  # fmt: skip


def high_pressure_error(settings: Mapping, table: pa.Table, maps: np.ndarray, tested: np.ndarray) -> Row:
    """Return the mean distance of predicted from true peak pressure (kPa) on single touches above HIGH_KPA.

    table: the dataset's, n windows; maps: (n, map_rows * map_cols) in kPa, NaN for a failed run; tested: (n,) those of
    the test part.
    """
    peak = np.nan_to_num(labels.peaks_kpa(table, settings)).max(axis=1)
    chosen = tested & (schemas.names(table["condition"]) == "single") & (peak > HIGH_KPA)
    off = np.abs(maps[chosen].max(axis=1) - peak[chosen])
    value = float(off.mean()) if len(off) else np.nan
    return {"condition": "single", "metric": "high_pressure_error", "unit": "kPa", "value": value, "n": len(off)}


def left_right_tilt(settings: Mapping, table: pa.Table, maps: np.ndarray, tested: np.ndarray) -> Row:
    """Return how much further left the pressure of maps lies on the tape than right, as a share of all of it.

    The mean is over the windows in which the tape is pressed and the map is not empty; arguments: as above.
    """
    pressed = schemas.matrix(table["y"]).max(axis=1) >= metrics.touch_threshold_kpa(settings)
    chosen = maps[tested & pressed & (schemas.names(table["condition"]) == "tape")]
    label = settings["label"]
    column = np.maximum(chosen.reshape(-1, label["map_rows"], label["map_cols"]), 0).sum(axis=1)
    half = label["map_cols"] // 2
    left, right = column[:, :half].sum(axis=1), column[:, -half:].sum(axis=1)
    some = left + right > 0
    value = float(np.mean((left - right)[some] / (left + right)[some])) if some.any() else np.nan
    return {"condition": "tape", "metric": "left_right_tilt", "unit": "1", "value": value, "n": len(chosen)}


def press_shift(workspace: Workspace, settings: Mapping) -> pd.Series:
    """Return element -> by how many counts its reading is lower for presses off its centre, at the same pressure.

    Single-touch frames under an element's area, in bins of 50 kPa: near the centre (within a quarter of the pitch in
    x and y) against the rest, mean over the bins that have both.
    """
    path = paths.require(workspace.frames("touch"), "python -m tactile.stages.ingest touch")
    frames = schemas.read(path, columns=["condition", "v", "force_n", "x_mm", "y_mm"])
    frames = frames.filter(schemas.names(frames["condition"]) == "single")
    sensor, pitch = settings["sensor"], settings["sensor"]["pitch_mm"]
    force, x, y = (schemas.matrix(frames[name])[:, 0] for name in ("force_n", "x_mm", "y_mm"))
    column = np.clip(x // pitch, 0, sensor["cols"] - 1).astype(int)
    row = np.clip(y // pitch, 0, sensor["rows"] - 1).astype(int)
    element = row * sensor["cols"] + column
    reading = schemas.matrix(frames["v"])[np.arange(len(x)), element]
    near = np.maximum(np.abs(x - (column + 0.5) * pitch), np.abs(y - (row + 0.5) * pitch)) <= pitch / 4
    level = np.digitize(labels.pressure_kpa(force, settings["label"]["tip_radius_mm"]), KPA_BINS)
    table = pd.DataFrame({"element": element, "level": level, "near": near, "reading": reading.astype(float)})
    mean = table[table["level"] > 0].groupby(["element", "level", "near"])["reading"].mean().unstack("near")
    if not {True, False} <= set(mean.columns):
        return pd.Series(dtype=float)
    return (mean[True] - mean[False]).dropna().groupby("element").mean()


def strain(workspace: Workspace, settings: Mapping) -> Iterator[Row]:
    """Yield what the claims of the latent space need of the fingers, and the cost of every training."""
    table = read_windows(workspace, "strain")
    for task in settings["protocols"]:
        for number, correlation in enumerate(strand_correlations(table, task).values()):
            yield {"protocol": task, "condition": task, "model": DATA, "metric": "strand_correlation"} | {
                "seed": number, "unit": "1", "value": correlation,
            }  # fmt: skip
    made_by = params.training_command("strain")
    for model in settings["models"]:
        times = read_csv(workspace.training_times("strain", model), ["protocol", "seed", "train_s"], made_by)
        for run in times.itertuples():
            place = {"protocol": run.protocol, "condition": run.protocol, "model": model, "seed": run.seed}
            yield place | {"metric": "train_s", "unit": "s", "value": run.train_s}
        for task, block in settings["protocols"].items():
            for seed in block["seeds"]:
                fit = fits.read(workspace.run_folder("strain", model, task, seed), made_by)
                place = {"protocol": task, "condition": task, "model": model, "seed": seed}
                yield place | {"metric": "params", "unit": "1", "value": fit["parameters"]}


def strand_correlations(table: pa.Table, task: str) -> dict[str, float]:
    """Return recording -> mean absolute correlation of two strands' voltages; table: the dataset's."""
    recording, chosen = schemas.names(table["recording"]), schemas.names(table["condition"]) == task
    voltage = schemas.matrix(table["v"]).astype(float)
    pair = np.triu_indices(voltage.shape[1], 1)
    parts = {name: voltage[chosen & (recording == name)] for name in np.unique(recording[chosen])}
    return {name: float(np.abs(np.corrcoef(part.T)[pair]).mean()) for name, part in parts.items()}


def glove(workspace: Workspace, settings: Mapping) -> Iterator[Row]:
    """Yield what the claims of SP-ResNet need of the glove."""
    table, protocols = read_windows(workspace, "glove"), glove_results.main_protocols(settings)
    if "sp_resnet" in settings["models"]:
        yield from confusions(workspace, settings, table, protocols)
    compared = [model for model in glove_results.COMPARED if model in settings["models"]]
    for dataset in ("combined", "pressure"):
        frames = glove_results.read_frames(workspace, dataset, compared)
        place = {"protocol": f"{settings['input_frames']['split']}_{dataset}", "condition": dataset, "budget": None}
        yield from (place | row for row in by_frames(frames))


def confusions(workspace: Workspace, settings: Mapping, table: pa.Table, protocols: Mapping[str, str]) -> Iterator[Row]:
    """Yield for every two objects the share of their images that SP-ResNet gave the other's name, by seed.

    Beside it the mean over all pairs.
    """
    names = classes(table)
    first, second = np.triu_indices(len(names), 1)
    for dataset, protocol in protocols.items():
        counts = glove_results.read_confusions(workspace, "glove", settings, table, {dataset: "sp_resnet"})[dataset]
        seeds = settings["protocols"][protocol]["seeds"]
        if len(counts) < len(seeds):  # a run failed: its score says so
            continue
        place = {"protocol": protocol, "condition": dataset, "model": "sp_resnet", "unit": "1", "n": len(first)}
        shares = {seed: glove_results.pair_shares(run) / 100 for seed, run in zip(seeds, counts, strict=True)}
        for i, j in zip(first, second, strict=True):
            pair = place | {"variant": f"{names[i]}_and_{names[j]}"}
            yield from (
                pair | {"metric": "confusion", "seed": seed, "value": share[i, j]} for seed, share in shares.items()
            )
        for seed, share in shares.items():
            yield place | {
                "variant": "mean_pair",
                "metric": "confusion",
                "seed": seed,
                "value": share[first, second].mean(),
            }


def by_frames(table: pd.DataFrame) -> Iterator[Row]:
    """Yield the scores by number of input frames, of the form that is judged; table: of `read_frames`."""
    if not len(table):
        return
    for row in table[table["form"] == glove_results.judged_form(table)].itertuples():
        yield {"model": row.model, "variant": f"frames_{row.frames}", "metric": row.metric, "unit": "1"} | {
            "seed": row.seed, "value": row.value,
        }  # fmt: skip


DERIVED = {"windows": touch, "series": strain, "images": glove}  # by kind of input
