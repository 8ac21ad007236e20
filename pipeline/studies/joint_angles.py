"""Find what gives the object away in the recorded joint angles: extra trees on all angles, and on some.

Joints that never move rest at angles that differ by thousandths of a degree from one object's minutes to another's.
Usage: python -m pipeline.studies.joint_angles glove_recorded
"""

import numpy as np
import pyarrow as pa
from sklearn.ensemble import ExtraTreesClassifier
from tqdm import tqdm

from pipeline import experiments
from pipeline.base import arguments, files, params, paths
from pipeline.base.availability import why_not_run
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas

EXPERIMENT = "glove_recorded"
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


def probe(workspace: Workspace, settings: dict) -> list[tuple]:
    """Return the accuracy on the test grasps for each input and seed; settings: the block of settings."""
    path = paths.require(workspace.frames(EXPERIMENT), f"python -m pipeline.stages.ingest {EXPERIMENT}")
    frames, module = schemas.read(path), experiments.module(EXPERIMENT)
    frames = frames.take(pa.array(module.chosen(frames, settings)))
    objects = schemas.names(frames["condition"])
    seeds = settings["protocols"]["grasp_strain"]["seeds"]
    rows = []
    for name, x in tqdm(inputs(schemas.matrix(frames["strain"])).items(), desc=f"probe {EXPERIMENT}", unit="input"):
        for seed in seeds:
            part = module.split(frames, settings, "grasp_strain", seed)
            train, test = part == "train", part == "test"
            trees = ExtraTreesClassifier(TREES, random_state=seed).fit(x[train], objects[train])
            rows.append((name, seed, "accuracy", "1", float(trees.score(x[test], objects[test])), int(test.sum())))
    return rows


def main(workspace: Workspace) -> None:
    """Probe the recordings; without them the table is empty."""
    arguments.parse(__doc__, experiment=[EXPERIMENT])
    rows = (
        probe(workspace, params.load(workspace.params)[EXPERIMENT])
        if why_not_run(workspace, EXPERIMENT) is None
        else []
    )
    files.write_csv(workspace.probe(EXPERIMENT), COLUMNS, rows)


if __name__ == "__main__":
    arguments.run(main)
