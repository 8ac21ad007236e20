"""Change the strain scene after training: the same finger at another speed or another rate, or another finger.

Every change starts from one recording with a motion, drift and noise that no model has seen, as long as the test part
of the simulated recordings, so that severity 0, which changes nothing, is the reference of all others. The clocks of
DAQ and robot agree.
"""

from collections.abc import Mapping

from pipeline.scenes import strain
from pipeline.scenes.faults import Fault
from tactile.base.stress_tests import of_scene, stress_test

SPEEDS = ("slide_slowest_mm_s", "slide_fastest_mm_s", "press_slowest_mm_s", "press_fastest_mm_s")


@stress_test("strain", unit="factor, as a power of 2", acts_on="scene")
def rate(settings: Mapping, severity: float) -> dict:
    """Sample DAQ and the grid of ingest at 2^severity times their rate, in the same time."""
    scene, ingest, factor = settings["simulate"], settings["ingest"], 2.0**severity
    devices = scene["devices"] | {"daq_hz": scene["devices"]["daq_hz"] * factor}
    scene = scene | {"devices": devices, "samples": round(scene["samples"] * factor)}
    return {**settings, "simulate": scene, "ingest": ingest | {"rate_hz": ingest["rate_hz"] * factor}}


@stress_test("strain", unit="factor, as a power of 2", acts_on="scene")
def speed(settings: Mapping, severity: float) -> dict:
    """Multiply all speeds of the arm by 2^severity; rests stay."""
    scene = settings["simulate"]
    motion = scene["motion"] | {name: scene["motion"][name] * 2.0**severity for name in SPEEDS}
    return {**settings, "simulate": scene | {"motion": motion}}


@stress_test("strain", unit="other sensor, number", acts_on="scene")
def specimen(settings: Mapping, severity: float) -> dict:
    """Take the finger whose number is higher by `severity`, with the same motion, drift and noise."""
    scene = settings["simulate"]
    return {**settings, "simulate": scene | {"specimen": scene["specimen"] + round(severity)}}


def changed(settings: Mapping, name: str, severity: float) -> dict:
    """Return the block `strain` of params.yaml after a stress test; raise InputError for an unknown one."""
    scene = settings["simulate"]
    devices = scene["devices"] | {"clock_offset_s": 0.0, "clock_drift_ppm": 0.0}
    samples = round(scene["samples"] * (1 - settings["split"]["train"]))
    scene = scene | {"devices": devices, "samples": samples}
    return of_scene("strain", name)({**settings, "simulate": scene}, severity)


def logs_of(settings: Mapping, task: str, run: int) -> dict[str, tuple[list[str], list[Fault]]]:
    """Return the raw logs of one recording of a task, as strain.logs_of; settings: as `changed` returns them.

    run: the number of the recording that the model was trained on, whose finger is the one that changes start from.
    All changes follow the same path.
    """
    scene = settings["simulate"]
    recording = strain.recording_of(scene, task, f"stress{run:03d}", scene["specimen"] + run)
    return strain.logs_of(recording, scene, settings["sensor"]["channels"])
