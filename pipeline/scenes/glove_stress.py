"""Change the glove scene after training: other films, a glove or an object out of place, another grip.

Sessions, holds and noise are the same as in the simulated logs, so that nothing but the change differs.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from pipeline.scenes import glove
from tactile.base.stress_tests import of_scene, stress_test
from tactile.datasets import specimens
from tactile.datasets.seeding import generator


class Held(NamedTuple):
    """How an object is held, and the settings of the scene that the glove's films have."""

    hold: glove.Hold
    film: dict


@stress_test("glove", unit="other sensor, number", acts_on="scene")
def specimen(held: Held, severity: float) -> Held:
    """Take a glove of the same make that no seed trains on, spread even where training's is not."""
    film = held.film
    effects = film["effects"] | ({"element_spread": True} if severity else {})
    unknown = film["specimen"] + film["specimens"] * round(severity)
    return held._replace(film=film | {"specimen": unknown, "effects": effects})


@stress_test("glove", unit="mm", acts_on="scene")
def shift(held: Held, severity: float) -> Held:
    """Lay the object `severity` mm nearer to the fingers than the hand wants it to lie."""
    return held._replace(hold=held.hold._replace(along=held.hold.along + severity))


@stress_test("glove", unit="degrees", acts_on="scene")
def turn(held: Held, severity: float) -> Held:
    """Turn the object's axis on the palm by `severity` degrees more."""
    return held._replace(hold=held.hold._replace(tilt=held.hold.tilt + np.radians(severity)))


@stress_test("glove", unit="factor, as a power of 2", acts_on="scene")
def grip(held: Held, severity: float) -> Held:
    """Multiply the margin of the grip over the slip force by 2^severity."""
    return held._replace(hold=held.hold._replace(margin=held.hold.margin * 2.0**severity))


def session(settings: Mapping, name: str, recording: str, change: str, severity: float) -> np.ndarray:
    """Return the counts of all frames of one session with object `name`, (frames, 270 + 135), as the scanner prints.

    settings: the block `glove` of params.yaml; change: the name of a test. Severity 0 is the log itself before its line
    faults.
    """
    every, number = glove.scene_of(settings), specimens.number(recording)
    scene = specimens.drawn(every, number)
    names = (scene["seed"], name, recording)
    thing = glove.OBJECTS[name]
    hold = glove.held(glove.frames_per_session(scene), scene, generator(*names, "hold"), thing)
    hold, film = of_scene("glove", change)(Held(hold, scene), severity)
    siemens = glove.conductances(thing, hold, film)
    return glove.scanned(siemens, scene, generator(*names, "noise"))
