"""Change the strain scene after training: the same finger at another speed or another rate, or another finger.

Every change starts from one recording with a motion, drift and noise that no model has seen, as long as the test part
of the simulated recordings, so that severity 0, which changes nothing, is the reference of all others. The clocks of
DAQ and robot agree.
"""

from collections.abc import Mapping

from pipeline.base.errors import InputError
from pipeline.scenes import strain
from pipeline.scenes.faults import Fault

CHANGES = ("rate", "speed", "specimen")
OTHER_MOTION = 1_000_003  # added to the scene's seed for the motion alone: the finger must stay the same
SPEEDS = ("slide_slowest_mm_s", "slide_fastest_mm_s", "press_slowest_mm_s", "press_fastest_mm_s")


def changed(settings: Mapping, change: str, severity: float) -> dict:
    """Return the block `strain` of params.yaml after one change; raise InputError for an unknown one.

    * rate: DAQ and the grid of ingest at 2^severity times their rate, in the same time.
    * speed: all speeds of the arm times 2^severity; rests stay.
    * specimen: the finger, its drift and its noise with number `severity` of the scene's seeds; 0 is the trained one.
    """
    scene, ingest = settings["simulate"], settings["ingest"]
    devices = scene["devices"] | {"clock_offset_s": 0.0, "clock_drift_ppm": 0.0}
    samples = round(scene["samples"] * (1 - settings["split"]["train"]))
    scene = scene | {"devices": devices, "samples": samples}
    factor = 2.0**severity
    if change == "rate":
        devices["daq_hz"] *= factor
        scene["samples"] = round(samples * factor)
        ingest = ingest | {"rate_hz": ingest["rate_hz"] * factor}
    elif change == "speed":
        scene["motion"] = scene["motion"] | {name: scene["motion"][name] * factor for name in SPEEDS}
    elif change == "specimen":
        scene["seed"] += round(severity)
    else:
        raise InputError(f"strain scene: no change '{change}'; there are {', '.join(CHANGES)}")
    return {**settings, "simulate": scene, "ingest": ingest}


def logs_of(settings: Mapping, task: str, motion_seed: int) -> dict[str, tuple[list[str], list[Fault]]]:
    """Return the raw logs of one recording of a task, as strain.logs_of; settings: as `changed` returns them.

    motion_seed: the seed of the scene as trained, so that all changes follow the same path.
    """
    scene = settings["simulate"]
    recordings = strain.recordings({**scene, "seed": motion_seed + OTHER_MOTION})
    (recording,) = (recording for recording in recordings if recording.condition == task)
    return strain.logs_of(recording._replace(name="stress"), scene)
