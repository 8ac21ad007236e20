"""Find what gives the object away in the recorded hand: extra trees on its joint angles, its tactile cells, and both.

Joints that never move rest at angles that differ by thousandths of a degree from one object's minutes to another's; the
images of the networks have coarser steps. So the trees show, beside them, what angles of a tenth of a degree tell, and
what tactile cells add to these. Every division of a tree is the best of all inputs: among the roots of their number
that it draws as a rule, angles are rare beside 486 cells, and both together named fewer objects than angles alone.
Usage: python -m pipeline.studies.joint_angles glove_recorded SEED
"""

from collections.abc import Callable, Mapping

import numpy as np
import pyarrow as pa
from sklearn.ensemble import ExtraTreesClassifier
from tqdm import tqdm

from tactile import experiments
from tactile.base import arguments, files, params, paths, workers
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.experiments.glove_recorded import CELLS, JOINTS

EXPERIMENT = "glove_recorded"
SPLITS = ("grasp", "block")
TABLE = "joint_angles"
COLUMNS = ("input", "split", "seed", "metric", "unit", "value", "n")
STILL = [0, 3, 4]  # joints that never move during a grasp
TREES = 200
CELLS_ALONE, ANGLES_ALONE = "the tactile cells", "all seven angles, rounded to 0.1 degrees"
BOTH = "the tactile cells and the rounded angles"


def inputs(angles: np.ndarray, cells: np.ndarray) -> dict[str, np.ndarray]:
    """Return the inputs of the trees by name; angles: (n, 7) in degrees as recorded; cells: (n, 486) in counts."""
    rounded = angles.round(1)
    return {
        "all seven angles as recorded": angles,
        "the three joints that never move": angles[:, STILL],
        ANGLES_ALONE: rounded,
        CELLS_ALONE: cells,
        BOTH: np.hstack([cells, rounded]),
    }


def named(workspace: Workspace, settings: Mapping, seen: str, seed: int, _report: Callable) -> list[tuple]:
    """Return rows of COLUMNS, of the test grasps; settings: the experiment's block; seen: see `inputs`."""
    path = paths.require(workspace.frames(EXPERIMENT), f"python -m tactile.stages.ingest {EXPERIMENT}")
    frames, module = schemas.read(path), experiments.module(EXPERIMENT)
    frames = frames.take(pa.array(module.chosen(frames, settings)))
    x = inputs(schemas.matrix(frames["strain"]), schemas.matrix(frames["pressure"]))[seen]
    objects, rows = schemas.names(frames["condition"]), []
    for split in SPLITS:
        part = module.split(frames, settings, f"{split}_combined", seed)
        train, test = part == "train", part == "test"
        trees = ExtraTreesClassifier(TREES, max_features=1.0, random_state=seed).fit(x[train], objects[train])
        right = float(trees.score(x[test], objects[test]))
        rows.append((seen, split, seed, "accuracy", "1", right, int(test.sum())))
    return rows


def main(workspace: Workspace) -> None:
    """Train and score the trees on every input, with the seed named on the command line."""
    experiment, seed = arguments.of_study(__doc__, [EXPERIMENT])
    settings = params.load(workspace.params)[experiment]
    names = inputs(np.zeros((0, JOINTS)), np.zeros((0, CELLS)))
    runs = {seen: (workspace, settings, seen, seed) for seen in names}
    with tqdm(total=len(runs), desc=f"joint angles {experiment}", unit="input") as bar:
        rows = dict(workers.run(named, runs, bar))
    files.write_csv(workspace.study_result(experiment, TABLE), COLUMNS, (row for seen in runs for row in rows[seen]))


if __name__ == "__main__":
    arguments.run(main)
