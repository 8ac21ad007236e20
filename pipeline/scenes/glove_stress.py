"""The glove scene changed after training: other films, a glove or an object out of place, another grip.

The sessions, their holds and their noise are those of the simulated logs, so that a change is all that differs.
"""

from collections.abc import Mapping

import numpy as np

from pipeline.base.errors import InputError
from pipeline.datasets.seeding import generator
from pipeline.scenes import glove, readout

CHANGES = ("specimen", "shift", "turn", "grip")


def session(settings: Mapping, name: str, recording: str, change: str, severity: float) -> np.ndarray:
    """Counts of all frames of one session with object `name`, (frames, 270 + 135), as the scanner prints them.

    settings: the block `glove` of params.yaml. Severity 0 is the log itself before its line faults. By change:

    * specimen: films with the gains of number `severity` of the scene's seeds, spread even where training's are not.
    * shift: the object lies `severity` mm nearer to the fingers than the hand wants it to.
    * turn: its axis lies `severity` degrees further turned on the palm.
    * grip: the margin of the grip over the slip force, times 2^severity.
    """
    scene = settings["simulate"]
    scene = scene | {"circuit": scene["circuit"] | settings["sensor"]}
    names = (scene["seed"], name, recording)
    frames = -(-scene["frames_per_object"] // scene["sessions"])
    hold, film = glove.held(frames, scene, generator(*names, "hold")), scene
    if change == "specimen":
        effects = scene["effects"] | ({"element_spread": True} if severity else {})
        film = scene | {"seed": scene["seed"] + round(severity), "effects": effects}
    elif change == "shift":
        hold = hold._replace(along=hold.along + severity)
    elif change == "turn":
        hold = hold._replace(tilt=hold.tilt + np.radians(severity))
    elif change == "grip":
        hold = hold._replace(margin=hold.margin * 2.0**severity)
    else:
        raise InputError(f"glove scene: no change '{change}'; there are {', '.join(CHANGES)}")
    circuit, noise = scene["circuit"], generator(*names, "noise")
    columns = []
    for siemens in glove.conductances(glove.OBJECTS[name], hold, film):
        volts = circuit["supply_v"] * siemens / (siemens + 1 / circuit["reference_ohm"])
        error = noise.normal(0, circuit["noise_counts"], volts.shape) if scene["effects"]["noise"] else 0.0
        read = readout.counts(np.nan_to_num(volts), supply_v=circuit["supply_v"], levels=glove.LEVELS, noise=error)
        columns.append(np.where(np.isnan(siemens), 0, read).reshape(frames, -1))
    return np.column_stack(columns)
