"""Describe grasps by the same numbers in the recordings (a robot hand) and in the scene (a glove); see __init__.

The recorded hand has 36 objects, three fingers of which two close, other matrices and encoders in its joints: nothing
of it can be fitted to. What is compared is free of the number of cells, of their units and of the number of objects:
shares, ratios and correlations of the same kind of frames, with as many objects at a time (OBJECTS_PER_SET). The
frames are those of the last second of a grasp, FRAMES of them, evenly spread, when the hand has closed. Pressure is a
cell's rise above the lowest reading that it ever has, in the device's own unit (recorded: counts, which grow with
pressure; simulated: siemens); cells that hardly ever rise (LIVE) are left out, such as those of the folded finger.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
from sklearn.tree import DecisionTreeClassifier

from tactile.base import paths
from tactile.base.paths import Workspace
from tactile.datasets import images, schemas, specimens
from tactile.datasets.seeding import generator
from tactile.experiments import glove, glove_recorded

OBJECTS_PER_SET = 12
SETS = 20
DISTAL = 1  # number of the recorded matrix on the first finger's distal link
LAST_S = 1.0
FRAMES = 10
ACTIVE = 0.1  # of the highest rise in the frame
LIVE = 0.03  # of the highest rise of any cell
HELD = 5  # last frames of a grasp, half a second, that the hold is judged by

STATISTICS = {
    "active_cells": (
        "1",
        "Share of the cells that read more than a tenth of the frame's highest, mean over the grasps of an object; "
        "comparable as a share of the cells that any object reaches.",
    ),
    "alike_within": (
        "1",
        "Cosine between the pressure patterns of two grasps of one object, mean over pairs: 1 where every grasp lands "
        "on the same cells.",
    ),
    "alike_others": (
        "1",
        "Cosine between the pressure patterns of an object and of other objects, over that between two grasps of the "
        "object: 1 where patterns do not depend on the object.",
    ),
    "load_spread": ("1", "Standard deviation of the total reading between grasps of one object, over its mean."),
    "load_wander": (
        "1",
        "Standard deviation of the total reading during the last half second of a grasp, over its mean.",
    ),
    "held_share": (
        "1",
        "Variance of the pressure pattern within the last half second of a grasp, over its sum with that between "
        "grasps of the object: 0 where only a new grasp changes anything.",
    ),
    "joint_spread": (
        "deg",
        "Standard deviation of a joint's angle between grasps of one object, median over the joints that move; the "
        "robot's angles are its encoders', the glove's those that its films show.",
    ),
    "pressure_between": ("1", "Share of the variance of pressure patterns that lies between objects."),
    "joint_between": ("1", "Share of the variance of joint angles that lies between objects."),
    "rank": (
        "1",
        "Effective rank of pressure patterns (participation ratio of their variances), over the number of objects.",
    ),
    "tree_grasps": ("1", "Accuracy of a decision tree on pressure patterns of grasps that it has not seen."),
    "tree_frames": ("1", "The same on frames that it has not seen, drawn at random, so that it knows their grasps."),
    "shift": (
        "1",
        "Standard deviation of the middle of the contact between grasps of one object, along the fingers, over the "
        "length of the matrix (recorded: the distal one of the first finger; simulated: the palm).",
    ),
}
NOTES = {
    "held_share": "Not comparable: a robot's joints are locked when it has closed, a hand goes on re-adjusting; how "
    "much it does is the scene's yardstick, which asks for more than a locked hand has.",
    "joint_between": "Not comparable: the robot's angles are its encoders', the glove's those that its films show, put "
    "on anew for every grasp. 2.2 degrees of misfit alone would give 0.985, below the recorded lowest; the rest is "
    "where an object's edge comes to lie between two joints.",
    "rank": "At the edge of the range: other draws of the scene came out within it. Left as it is.",
    "tree_frames": "Follows from held_share: frames of one grasp are less alike in a hand that re-adjusts.",
}


class Grasps(NamedTuple):
    """The last second of every grasp."""

    condition: np.ndarray  # (grasps,) names of the objects
    pressure: np.ndarray  # (grasps, FRAMES, cells), rise above the lowest reading of the cell
    joints: np.ndarray  # (grasps, joints) degrees, last frame
    middle: np.ndarray  # (grasps,) of the contact along one matrix, share of its length; NaN without contact there


def recorded(workspace: Workspace, settings: Mapping) -> pd.DataFrame:
    """Return the statistics of the recorded grasps: columns recording, statistic, value.

    settings: params.yaml. A recording is an object, or a set of objects where the statistic is of several. Raises
    InputError where the recordings have not been read.
    """
    table = schemas.read(
        paths.require(workspace.frames("glove_recorded"), "python -m tactile.stages.ingest glove_recorded")
    )
    cells, angles = schemas.matrix(table["pressure"]).astype(float), schemas.matrix(table["strain"]).astype(float)
    start = int(np.prod(glove_recorded.MATRICES[0]))
    rows, cols = glove_recorded.MATRICES[DISTAL]
    matrix = np.arange(start, start + rows * cols).reshape(rows, cols)
    return statistics(grasps(table, cells, angles, matrix))


def simulated(workspace: Workspace, settings: Mapping) -> pd.DataFrame:
    """Return the statistics of the scene's grasps, as `recorded`; raises InputError where its logs have not been read.

    Angles are what the mean of a joint's film shows by the scene's own law; the empty hand is no grasp, and the grasps
    are of one glove, as those of the recordings are of one hand.
    """
    table = schemas.read(paths.require(workspace.frames("glove"), "python -m tactile.stages.ingest glove"))
    of_one = specimens.of_seed(schemas.names(table["recording"]), 0)
    table = table.filter(pa.array(of_one & (schemas.names(table["condition"]) != "empty_hand")))
    block = settings["glove"]
    ohm, film = block["sensor"]["reference_ohm"], block["simulate"]["film"]
    cells = glove.conductance(schemas.matrix(table["pressure"]), ohm)
    strain = glove.conductance(schemas.matrix(table["strain"]), ohm).reshape(-1, 15, 9)
    joints = glove.joint_means(strain, images.GLOVE["strain"].joint).reshape(len(cells), -1)
    joints = joints[:, joints.any(axis=0)]
    angles = 90 * (joints * film["rest_bend_ohm"] - 1) / film["bend_gain"]
    palm = np.arange(glove.PRESSURE_CELLS).reshape(15, 18)[3:, 9:]
    return statistics(grasps(table, cells, angles, palm))


def grasps(table: pa.Table, cells: np.ndarray, angles: np.ndarray, matrix: np.ndarray) -> Grasps:
    """Return the last second of every grasp of a frames table.

    cells, angles: (frames, ...) of the table's rows; matrix: (rows, cols) numbers of the cells that `middle` is of.
    """
    conditions, names = schemas.names(table["condition"]), schemas.names(table["recording"])
    time = table["t_s"].to_numpy()
    edges = np.flatnonzero((conditions[1:] != conditions[:-1]) | (names[1:] != names[:-1])) + 1
    rows = []
    for grasp in np.split(np.arange(len(conditions)), edges):
        wanted = time[grasp[-1]] - np.linspace(LAST_S, 0, FRAMES)
        rows.append(grasp[np.abs(time[grasp][:, None] - wanted).argmin(axis=0)])
    rows = np.array(rows)
    rise = cells[rows] - cells.min(axis=0)
    live = rise.max(axis=(0, 1)) > LIVE * rise.max()
    by_row = rise[:, -1][:, matrix].sum(axis=2)  # (grasps, rows of the matrix)
    total = by_row.sum(axis=1)
    place = np.arange(len(matrix)) / len(matrix)
    touched = total > LIVE * rise.max()
    middle = np.where(touched, by_row @ place / np.where(touched, total, 1.0), np.nan)
    return Grasps(conditions[rows[:, -1]], rise[:, :, live], angles[rows[:, -1]], middle)


def statistics(data: Grasps) -> pd.DataFrame:
    """Return recording, statistic, value: one row per object and statistic of one object, per set and of several."""
    rows = [(name, *row) for name in np.unique(data.condition) for row in of_object(data, name)]
    for number in range(SETS):
        chosen = generator(number, "twins", "glove").permutation(np.unique(data.condition))[:OBJECTS_PER_SET]
        inside = np.isin(data.condition, chosen)
        rows += [(f"set {number}", *row) for row in of_set(Grasps(*(part[inside] for part in data)), number)]
    return pd.DataFrame(rows, columns=["recording", "statistic", "value"])


def of_object(data: Grasps, name: str) -> Iterator[tuple[str, float]]:
    """Yield (statistic, value) of one object against itself and the others."""
    mine = data.condition == name
    held = data.pressure[mine]
    last, patterns = held[:, -1], unit(data.pressure[:, -1])
    yield "active_cells", float((last > ACTIVE * last.max(axis=1, keepdims=True)).mean())
    cosine = patterns[mine] @ patterns.T
    within = cosine[:, mine][np.triu_indices(mine.sum(), 1)].mean()
    yield "alike_within", float(within)
    yield "alike_others", float(cosine[:, ~mine].mean() / within)
    total = held.sum(axis=2)
    yield "load_spread", float(total[:, -1].std(ddof=1) / total[:, -1].mean())
    end = total[:, -HELD:]
    yield "load_wander", float(np.median(end.std(axis=1, ddof=1) / end.mean(axis=1)))
    pattern = unit(held[:, -HELD:])
    between = pattern.mean(axis=1).var(axis=0, ddof=1).sum()
    within_hold = pattern.var(axis=1, ddof=1).sum(axis=1).mean()
    yield "held_share", float(within_hold / (within_hold + between)) if within_hold else 0.0
    middle = data.middle[mine][np.isfinite(data.middle[mine])]
    if len(middle) > 2:  # objects between the pads leave the palm free
        yield "shift", float(middle.std(ddof=1))
    moving = data.joints.std(axis=0) > 1.0
    yield "joint_spread", float(np.median(data.joints[mine][:, moving].std(axis=0, ddof=1)))


def of_set(data: Grasps, seed: int) -> Iterator[tuple[str, float]]:
    """Yield (statistic, value) of several objects; seed: of the tree's halves."""
    objects, label = np.unique(data.condition, return_inverse=True)
    patterns = unit(data.pressure[:, -1])
    yield "pressure_between", between_share(patterns, label)
    yield "joint_between", between_share(data.joints, label)
    variances = np.linalg.svd(patterns - patterns.mean(axis=0), compute_uv=False) ** 2
    yield "rank", float(variances.sum() ** 2 / (variances**2).sum() / len(objects))
    rng = generator(seed, "twins", "glove", "halves")
    x = unit(data.pressure).reshape(-1, data.pressure.shape[2])
    grasp = np.arange(len(label)).repeat(FRAMES)
    of_grasps = rng.permutation(len(label))[: len(label) // 2]
    of_frames = rng.permutation(len(x))[: len(x) // 2]
    for name, train in (
        ("tree_grasps", np.isin(grasp, of_grasps)),
        ("tree_frames", np.isin(np.arange(len(x)), of_frames)),
    ):
        tree = DecisionTreeClassifier(random_state=0).fit(x[train], label[grasp[train]])
        yield name, float((tree.predict(x[~train]) == label[grasp[~train]]).mean())


def unit(pressure: np.ndarray) -> np.ndarray:
    """Return patterns (..., cells) of length 1; a frame without a rise stays 0."""
    length = np.linalg.norm(pressure, axis=-1, keepdims=True)
    return np.divide(pressure, length, out=np.zeros_like(pressure), where=length > 0)


def between_share(x: np.ndarray, label: np.ndarray) -> float:
    """Return the share of the variance of x (n, values) that lies between the means of its labels (n,)."""
    mean = x.mean(axis=0)
    parts = [(label == k).sum() * ((x[label == k].mean(axis=0) - mean) ** 2).sum() for k in np.unique(label)]
    return float(sum(parts) / ((x - mean) ** 2).sum())
