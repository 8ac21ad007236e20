"""Stage: write the raw serial logs of a simulated scene, with every injected fault listed in `faults.csv`.

Usage: python -m pipeline.simulate touch
"""

import csv
import shutil
import sys

from tqdm import tqdm

from pipeline import params, paths
from pipeline.errors import InputError, run_stage
from pipeline.scenes import touch


def simulate_touch(settings: dict) -> None:
    """Write data/touch/logs/<condition>/<recording>/<device>.log and data/touch/logs/faults.csv."""
    scene, sensor, radius = settings["simulate"], settings["sensor"], settings["label"]["tip_radius_mm"]
    recordings = [
        *touch.single_recordings(scene, sensor, radius),
        *touch.double_recordings(scene, sensor, radius),
        *touch.demonstration_recordings(scene, sensor, radius),
    ]
    target = paths.logs("touch")
    draft = target.with_name("logs.unfinished")
    shutil.rmtree(draft, ignore_errors=True)
    # Resets strike the first recordings; the others show the array undisturbed.
    resets = {recording.name for recording in recordings[: scene["faults"]["resets"]]}
    rows = []
    for recording in tqdm(recordings, desc="simulate touch", unit="recording"):
        folder = draft / recording.condition / recording.name
        folder.mkdir(parents=True)
        reset = recording.condition == "single" and recording.name in resets
        for name, (lines, faults) in touch.logs_of(recording, scene, sensor, radius, reset).items():
            (folder / name).write_text("\n".join(lines) + "\n", encoding="ascii")
            rows += [(recording.condition, recording.name, name, fault.line, fault.kind) for fault in faults]
    with open(draft / "faults.csv", "w", newline="", encoding="ascii") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["condition", "recording", "file", "line", "fault"])
        writer.writerows(rows)
    shutil.rmtree(target, ignore_errors=True)
    draft.rename(target)


def main() -> None:
    """Simulate the experiment named on the command line."""
    experiment = sys.argv[1] if len(sys.argv) == 2 else ""
    if experiment != "touch":
        raise InputError("usage: python -m pipeline.simulate touch")
    simulate_touch(params.load()["touch"])


if __name__ == "__main__":
    run_stage(main)
