"""Write the raw serial logs of a simulated scene, with every injected fault listed in `faults.csv`.

Usage: python -m pipeline.stages.simulate touch|strain|glove
"""

import importlib
import sys

from tqdm import tqdm

from pipeline.base import files, params, paths
from pipeline.base.errors import InputError, run_stage

SCENES = ("touch", "strain", "glove")


def simulate(experiment: str, settings: dict) -> None:
    """Write data/<experiment>/logs/<condition>/<recording>/<device>.log and data/<experiment>/logs/faults.csv.

    `pipeline/scenes/<experiment>.py` gives the recordings and, for each, its logs with their faults.
    """
    recordings, logs_of = importlib.import_module(f"pipeline.scenes.{experiment}").plan(settings)
    rows = []
    with files.replacing_folder(paths.logs(experiment)) as draft:
        for recording in tqdm(recordings, desc=f"simulate {experiment}", unit="recording"):
            folder = draft / recording.condition / recording.name
            folder.mkdir(parents=True)
            for name, (lines, faults) in logs_of(recording).items():
                (folder / name).write_text("\n".join(lines) + "\n", encoding="ascii")
                rows += [(recording.condition, recording.name, name, fault.line, fault.kind) for fault in faults]
        files.write_csv(draft / "faults.csv", ["condition", "recording", "file", "line", "fault"], rows)


def main() -> None:
    """Simulate the experiment named on the command line."""
    experiment = sys.argv[1] if len(sys.argv) == 2 else ""
    if experiment not in SCENES:
        raise InputError(f"usage: python -m pipeline.stages.simulate {'|'.join(SCENES)}")
    simulate(experiment, params.load()[experiment])


if __name__ == "__main__":
    run_stage(main)
