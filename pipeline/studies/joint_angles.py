"""Find what gives the object away in the recorded joint angles: extra trees on all angles, and on some.

Joints that never move rest at angles that differ by thousandths of a degree from one object's minutes to another's.
Usage: python -m pipeline.studies.joint_angles glove_recorded SEED
"""

from collections.abc import Callable, Mapping

import numpy as np
import pyarrow as pa
from sklearn.ensemble import ExtraTreesClassifier
from tqdm import tqdm

from pipeline import experiments
from pipeline.base import arguments, files, params, paths, workers
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.experiments.glove_recorded import JOINTS

EXPERIMENT, PROTOCOL = "glove_recorded", "grasp_strain"
TABLE = "joint_angles"
COLUMNS = ("input", "seed", "metric", "unit", "value", "n")
STILL = [0, 3, 4]  # joints that never move during a grasp
TREES = 200


def inputs(angles: np.ndarray) -> dict[str, np.ndarray]:
    """Return the inputs of the trees by name; angles: (n, 7) in degrees as recorded."""
    return {
        "all seven angles as recorded": angles,
        "the three joints that never move": angles[:, STILL],
        "all seven angles, rounded to 0.1 degrees": angles.round(1),
    }


def named(workspace: Workspace, settings: Mapping, seen: str, seed: int, _report: Callable) -> list[tuple]:
    """Return rows of COLUMNS, of the test grasps; settings: the experiment's block; seen: see `inputs`."""
    path = paths.require(workspace.frames(EXPERIMENT), f"python -m pipeline.stages.ingest {EXPERIMENT}")
    frames, module = schemas.read(path), experiments.module(EXPERIMENT)
    frames = frames.take(pa.array(module.chosen(frames, settings)))
    x, objects = inputs(schemas.matrix(frames["strain"]))[seen], schemas.names(frames["condition"])
    part = module.split(frames, settings, PROTOCOL, seed)
    train, test = part == "train", part == "test"
    trees = ExtraTreesClassifier(TREES, random_state=seed).fit(x[train], objects[train])
    return [(seen, seed, "accuracy", "1", float(trees.score(x[test], objects[test])), int(test.sum()))]


def main(workspace: Workspace) -> None:
    """Train and score the trees on every input, with the seed named on the command line."""
    experiment, seed = arguments.of_study(__doc__, [EXPERIMENT])
    settings = params.load(workspace.params)[experiment]
    runs = {seen: (workspace, settings, seen, seed) for seen in inputs(np.zeros((0, JOINTS)))}
    with tqdm(total=len(runs), desc=f"joint angles {experiment}", unit="input") as bar:
        rows = dict(workers.run(named, runs, bar))
    files.write_csv(workspace.study_result(experiment, TABLE), COLUMNS, (row for seen in runs for row in rows[seen]))


if __name__ == "__main__":
    arguments.run(main)
