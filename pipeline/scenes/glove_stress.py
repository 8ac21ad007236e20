"""Change the glove scene after training: other films, a glove or an object out of place, another grip.

Sessions, holds and noise are the same as in the simulated logs, so that nothing but the change differs.
"""

from collections.abc import Mapping

import numpy as np

from pipeline.base.errors import InputError
from pipeline.datasets import specimens
from pipeline.datasets.seeding import generator
from pipeline.scenes import glove

CHANGES = ("specimen", "shift", "turn", "grip")


def session(settings: Mapping, name: str, recording: str, change: str, severity: float) -> np.ndarray:
    """Return the counts of all frames of one session with object `name`, (frames, 270 + 135), as the scanner prints.

    settings: the block `glove` of params.yaml. Severity 0 is the log itself before its line faults. By change:

    * specimen: a glove of the same make that no seed trains on, spread even where training's is not.
    * shift: the object lies `severity` mm nearer to the fingers than the hand wants it to.
    * turn: the object's axis lies `severity` degrees further turned on the palm.
    * grip: the margin of the grip over the slip force, times 2^severity.
    """
    every, number = glove.scene_of(settings), specimens.number(recording)
    scene = specimens.drawn(every, number)
    names = (scene["seed"], name, recording)
    thing, film = glove.OBJECTS[name], scene
    hold = glove.held(glove.frames_per_session(scene), scene, generator(*names, "hold"), thing)
    if change == "specimen":
        effects = scene["effects"] | ({"element_spread": True} if severity else {})
        film = scene | {"specimen": scene["specimen"] + every["specimens"] * round(severity), "effects": effects}
    elif change == "shift":
        hold = hold._replace(along=hold.along + severity)
    elif change == "turn":
        hold = hold._replace(tilt=hold.tilt + np.radians(severity))
    elif change == "grip":
        hold = hold._replace(margin=hold.margin * 2.0**severity)
    else:
        raise InputError(f"glove scene: no change '{change}'; there are {', '.join(CHANGES)}")
    siemens = glove.conductances(thing, hold, film)
    return glove.scanned(siemens, scene, generator(*names, "noise"))
