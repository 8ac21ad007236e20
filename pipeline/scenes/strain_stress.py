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
SPEEDS = ("slide_slowest_mm_s", "slide_fastest_mm_s", "press_slowest_mm_s", "press_fastest_mm_s")


def changed(settings: Mapping, change: str, severity: float) -> dict:
    """Return the block `strain` of params.yaml after one change; raise InputError for an unknown one.

    * rate: DAQ and the grid of ingest at 2^severity times their rate, in the same time.
    * speed: all speeds of the arm times 2^severity; rests stay.
    * specimen: the finger whose number is higher by `severity`, with the same motion, drift and noise.
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
        scene["specimen"] += round(severity)
    else:
        raise InputError(f"strain scene: no change '{change}'; there are {', '.join(CHANGES)}")
    return {**settings, "simulate": scene, "ingest": ingest}


def logs_of(settings: Mapping, task: str, run: int) -> dict[str, tuple[list[str], list[Fault]]]:
    """Return the raw logs of one recording of a task, as strain.logs_of; settings: as `changed` returns them.

    run: the number of the recording that the model was trained on, whose finger is the one that changes start from.
    All changes follow the same path.
    """
    scene = settings["simulate"]
    recording = strain.recording_of(scene, task, f"stress{run:03d}", scene["specimen"] + run)
    return strain.logs_of(recording, scene, settings["sensor"]["channels"])
