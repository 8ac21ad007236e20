"""Simulate the glove: sixteen objects grasped in several sessions, as the raw log of the glove's scanner.

A chain of named effects, most of them with a switch in params.yaml (glove.simulate.effects):

    object -> posture of the hand -> grip force -> pressure on the pads -> Velostat -> virtual ground -> ADC -> log

Lengths in mm, forces in N. The object's axis lies across the hand; y is the place along it, s the way around the
object from the middle of the palm, towards the fingers (thumb: the other way round).

1. Object and grip. People grasp a thing by its size, shape and use; each object here has one of five grips that
   taxonomies of human grasps have (Feix et al., IEEE Transactions on Human-Machine Systems 46, 66, 2016): `wrap` (a
   power grasp, palm and all fingers), `handle` (the middle of the fingers hooks around it, the palm stays free),
   `pinch` (the thumb against four fingers, only pads touch), `tripod` (the thumb against index and middle finger),
   `key` (the thumb against the side of the bent index finger). A wrapped cross-section (the object's, or its
   handle's) is a rectangle, width w on the palm and depth d, with corners of radius c (a circle: w = d = 2 c), scaled
   along the axis by rho(y): 1 (prism), sqrt(1 - (2 y / length)^2) (ellipsoid) or 1 + taper y / length (cone). Beyond
   the object's length a finger closes around nothing.
2. Posture of `wrap` and `handle`. A finger of half thickness t that lies on the object has turned, up to the place s,
   by the corners that it has passed,

       Theta(s) = sum_k pi/2 clip((s - e_k) / (pi/2 (c + t)), 0, 1),     e_k: start of corner k,

   and a joint by what its two phalanges turn between their middles, Theta(s + l_next / 2) - Theta(s - l_last / 2), up
   to the joint's limit. A phalanx behind a joint at its limit loses contact. The hand is put where all four fingers
   find the object: it shifts along the axis by no more than the object is longer than the fingers are wide together,
   and not at all on a shorter one (a cup's handle is closed at both ends, a ball is held in the middle).
   Posture of `pinch`, `tripod` and `key`. The joints of a closed grip are constants. The pads of thumb and fingers
   stand w apart when they hold the object's smaller side; each gives way by w / 2, by turning its first two joints back
   through the same angle,

       angle = (w / 2) / ((l_1 + l_2 + l_3) + (l_2 + l_3)),

   the levers of the two joints to the tip. An object that lies deeper in the hand by `along` shortens them by it.
3. Grip force. Friction must carry the weight, F = margin m G / (2 mu) + F_least (Westling and Johansson, Experimental
   Brain Research 53, 277, 1984: a margin over the slip force, which grows with weight). Fingers take F, thumb
   and palm oppose it; shares of fingers and phalanges are constants of the grip times a factor of the finger and a
   factor of the phalanx, which all fingers have in common: one muscle bends the same joint of all of them
   (flexor digitorum profundus the last, superficialis the middle one).
4. Pressure. The skin is a bed of springs (Winkler foundation): under a force f it yields by
   delta = YIELD_MM sqrt(f) / min(1, k), k being the stiffness of the object relative to skin (without `softness`,
   k = 1), and a cell takes its share of f in proportion to max(0, 1 - gap / delta), gap being the distance of the
   object's surface from the highest point of the round finger (PULP_MM; in `pinch`, `tripod` and `key` around the
   place that the object's shift and tilt give it). Cloth, wires and film between skin and object fold anew in every
   grasp, so that a cell's share has a factor of its own (`seat_spread`).
5. Velostat: the static law fitted to the recorded taxel (pipeline/scenes/material.py); its memory of 0.04 s is shorter
   than a frame's 0.1 s and left out. A bent joint presses wires into the film: G = G_rest (1 + gain angle / 90 deg).
   Every cell has its own gain (`element_spread`), the same in all sessions: `specimen` numbers the first of
   `specimens` gloves, `seed` what is done with it.
6. Circuit: virtual ground, so without crosstalk. Equations 1 and 2 of the paper: ADC = 1024 R_ref / (R + R_ref).

A session is one grasp. Between sessions, placement on the palm, tilt, margin, shares, the cloth's folds and the fit of
the glove at every joint differ (`session`); within one, all of them wander slowly (`wander`), as a hand that holds and
re-adjusts does, with a memory of `wander_time_s`. `wander` is the share of each quantity's variance that lies within a
session, so that it leaves alone how much two frames of different sessions differ. None is exempt: one that stayed would
name the session, and with it the object. In the recordings none is either: within the last second of a grasp joints
have 0.003 of the variance between grasps (degrees within a grasp 0.02, between 0.54; medians of 36 objects) and the
pressure pattern 0.001, for that robot locks its joints. The fit is what a glove shows differently for the same posture,
as it sits on the hand. Instrumented gloves do so by some degrees a joint (Wise et al.,
Journal of Rehabilitation Research and Development 27, 411, 1990; Dipietro et al., the same 40, 179, 2003); 2.2 degrees
is chosen from that, not measured. The recorded robot hand, whose joints have encoders and no glove, repeats an object
to 0.4 to 0.7 degrees by joint (median over objects; 95 % below 2.0).

`along_mm` is set by the recorded grasps (reports/twins): how far the middle of the contact moves between them; so are
`share_spread` and `seat_spread`: how alike two grasps of one object are, how much of the variance lies between objects,
and in how many ways patterns differ.

Differs from paper: objects, hand and grips are simulated. The paper names 16 objects with no size or mass and shows how
they are held in photographs too small to measure; the numbers here are of common things of that name, chosen before
any model was trained. One number, `session.wander`, is then set by the yardstick (glove.yardstick).
Differs from paper: its pads (one of 3 x 4, others of 3 x 3, palm 12 x 9) cannot sum up to its 243 units; fifteen of
3 x 3 and the palm do. The object that its list of names leaves out is taken to be the roll of paper that the text
speaks of.
Differs from paper: it does not say in how many grasps the 950 frames of an object were taken, nor how fast. Here they
are 19 grasps of 50 frames (the length of its figure 13) at 10 Hz, the object being let go in between.
"""

import functools
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter

from pipeline.scenes import material, readout
from pipeline.scenes.faults import Fault, inject
from tactile.base.errors import InputError
from tactile.datasets import specimens
from tactile.datasets.seeding import generator

# Arrays over fingers are in the order thumb, index, middle, ring, little.
ACROSS_MM = np.array([12.0, 30.0, 10.0, -10.0, -30.0])  # y of each finger
KNUCKLE_MM = np.array([30.0, 40.0, 42.0, 40.0, 36.0])  # from the middle of the palm to the first joint
PHALANGES_MM = np.array([[40.0, 33, 27], [45, 26, 22], [50, 30, 23], [46, 28, 23], [36, 20, 20]])
LIMITS_DEG = np.array([90.0, 105.0, 80.0])  # of flexion, from the knuckle outwards
THUMB_LIMITS_DEG = np.array([30.0, 60.0, 80.0])  # the first is the saddle joint, which carries no strain sensor
ON_HANDLE_DEG = np.array([15.0, 20.0, 30.0])  # the thumb, on top of a handle
OPEN_DEG = 25.0  # of every joint of an empty, relaxed hand
FINGER_MM = 8.0  # half thickness
HAND_MM = 76.0  # width of the four fingers together
REACH_DEG = 25.0  # beyond its limit a joint lifts the phalanx off the object

PULP_MM = 30.0  # radius of a finger's skin under load: 2 N on a pad flatten 12 mm of it
PAD_MM, PALM_MM = 6.0, 7.5  # pitch of the cells
CELL_MM = PAD_MM * np.array([-1.0, 0.0, 1.0])  # of a pad, from its middle
WAY = np.array([1.0, -1.0, -1.0, -1.0, -1.0])  # a shift towards the fingers lengthens the thumb's way
PALM_ROWS, PALM_COLS = 12, 9
YIELD_MM = 0.4  # of the skin under 1 N on a pad
SKIN = 5.0  # stiffness (N/mm) at which an object yields as much as skin does

GRAVITY = 9.81
LEVELS = 1024  # of the converter
PRESSURE = (15, 18)  # rows, columns of area (a) of the scan
STRAIN = (15, 9)  # of area (b)


class Grip(NamedTuple):
    """How the hand holds an object: who carries what, and the joints of the closed grip where it is no wrap."""

    fingers: tuple[float, ...]  # (5,) shares of the grip force; the thumb's opposes the others'
    phalanges: tuple[float, ...]  # (3,) shares of a finger's force, from the palm outwards
    palm: float = 0.0  # share of the grip force: the thumb opposes the rest
    closed_deg: tuple[tuple[float, ...], ...] | None = None  # (5, 3) of pads that meet; None: fingers wrap the object
    beside_mm: float = 0.0  # place of the contact on the fingers' pads, towards the thumb
    hooked_mm: float = 0.0  # how far from the palm's middle, towards the fingertips, what fingers wrap lies


CURLED = (50.0, 70.0, 35.0)  # fingers that take no part
GRIPS = {
    "wrap": Grip((0.45, 0.3, 0.3, 0.25, 0.15), (0.3, 0.25, 0.45), 0.55),
    "handle": Grip((1.0, 0.3, 0.3, 0.25, 0.15), (0.25, 0.6, 0.15), hooked_mm=60.0),
    "pinch": Grip((1.0, 0.3, 0.3, 0.25, 0.15), (0.0, 0.1, 0.9), 0.0, ((15, 20, 20), *[(55, 25, 10)] * 4)),
    "tripod": Grip((1.0, 0.55, 0.45, 0, 0), (0.0, 0.1, 0.9), 0.0, ((20, 25, 30), *[(50, 50, 25)] * 2, *[CURLED] * 2)),
    "key": Grip((1.0, 1.0, 0, 0, 0), (0.0, 0.7, 0.3), 0.0, ((10, 15, 25), (40, 75, 40), *[CURLED] * 3), PAD_MM),
}


class Thing(NamedTuple):
    """An object's attributes, or those of the part that is held; profile: prism, ellipsoid, cone."""

    width_mm: float
    depth_mm: float
    corner_mm: float
    length_mm: float
    mass_g: float
    stiffness: float  # N/mm
    friction: float
    profile: str = "prism"
    taper: float = 0.0
    grip: str = "wrap"  # of GRIPS


OBJECTS: dict[str, Thing | None] = {
    "art_knife": Thing(24, 14, 6, 150, 60, 100, 0.5, grip="key"),
    "book": Thing(150, 26, 2, 210, 420, 20, 0.4, grip="pinch"),
    "can": Thing(66, 66, 33, 115, 350, 40, 0.4),
    "cup_1": Thing(14, 26, 6, 75, 320, 100, 0.5, grip="handle"),  # its handle
    "cup_2": Thing(76, 76, 38, 110, 180, 60, 0.5, "cone", 0.25),
    "empty_bottle": Thing(65, 65, 32.5, 210, 25, 3, 0.4),
    "empty_hand": None,
    "full_bottle_1": Thing(65, 65, 32.5, 210, 575, 20, 0.4),
    "full_bottle_2": Thing(62, 62, 31, 200, 530, 20, 0.4),
    "magic_cube": Thing(57, 57, 3, 57, 95, 60, 0.4, grip="tripod"),
    "mobile_phone": Thing(74, 9, 4, 155, 190, 100, 0.4),
    "mouse": Thing(60, 38, 18, 110, 90, 60, 0.4),
    "paper_roll": Thing(105, 105, 52.5, 100, 120, 4, 0.5),
    "tape": Thing(48, 8, 1, 70, 140, 30, 0.5, grip="pinch"),  # the wall of its ring
    "tennis_ball": Thing(67, 67, 33.5, 67, 58, 12, 0.6, "ellipsoid"),
    "toy": Thing(90, 80, 40, 120, 120, 1, 0.6, "ellipsoid"),
}


class Recording(NamedTuple):
    """One session with one object."""

    condition: str
    name: str


class Hold(NamedTuple):
    """The quantities that differ between sessions and wander within one, (frames, ...)."""

    along: np.ndarray  # (n,) mm, shift of the object towards the fingers
    across: np.ndarray  # (n,) mm, shift along its axis
    tilt: np.ndarray  # (n,) rad, of the axis on the palm
    margin: np.ndarray  # (n,) over the slip force
    share: np.ndarray  # (n, 5, 3) factor of each phalanx's share
    fit: np.ndarray  # (n, 5, 3) deg, by which the glove shows each joint wrongly
    seat: np.ndarray  # (n, 15, 18) factor of each cell's share


def plan(settings: Mapping) -> tuple[list[Recording], Callable[[Recording], dict]]:
    """Return all recordings, and the function that gives the log of one (`logs_of`); settings: the block `glove`.

    Raises InputError for areas of another sensor: the scene is of the paper's glove.
    """
    if settings["sensor"].get("areas"):
        raise InputError(
            "params/glove.yaml, glove.sensor.areas: the simulated glove has the paper's areas; set areas: {}, or "
            "glove.source to logs of your own"
        )
    scene = scene_of(settings)
    sessions = [
        specimens.named(specimen, f"{name}{number:02d}")
        for specimen in range(scene["specimens"])
        for name, count in (("session", scene["sessions"]), ("test", scene["test_sessions"]))
        for number in range(count)
    ]
    recordings = [Recording(name, session) for name in OBJECTS for session in sessions]
    return recordings, functools.partial(logs_of, settings=scene)


def scene_of(settings: Mapping) -> dict:
    """Return the block glove.simulate with the sensor in its circuit; settings: the block `glove`."""
    scene = settings["simulate"]
    return scene | {"circuit": scene["circuit"] | settings["sensor"]}


def frames_per_session(settings: Mapping) -> int:
    """Return the number of frames of a session, rounded up; settings: the block glove.simulate."""
    return -(-settings["frames_per_object"] // settings["sessions"])


def logs_of(recording: Recording, settings: Mapping) -> dict[str, tuple[list[str], list[Fault]]]:
    """Return the scanner's log of one recording: lines `t_us,p0..p269,s0..s134` and the injected faults.

    settings: the block glove.simulate with the sensor (`scene_of`).
    """
    frames = frames_per_session(settings)
    settings = specimens.drawn(settings, specimens.number(recording.name))
    names = (settings["seed"], recording.condition, recording.name)
    thing = OBJECTS[recording.condition]
    siemens = conductances(thing, held(frames, settings, generator(*names, "hold"), thing), settings)
    t_us = np.round((np.arange(frames) + 1) * 1e6 / settings["frame_hz"]).astype(np.int64)
    rows = np.column_stack([t_us, scanned(siemens, settings, generator(*names, "noise"))]).tolist()
    lines = [",".join(map(str, row)) for row in rows]
    if not settings["effects"]["line_faults"]:
        return {"scanner.log": (lines, [])}
    return {"scanner.log": inject(lines, settings["faults"], generator(*names, "faults"))}


def scanned(areas: Iterable[np.ndarray], settings: Mapping, rng: np.random.Generator) -> np.ndarray:
    """Return the counts of all cells, (frames, 270 + 135), for the siemens of areas (a) and (b), as `conductances`.

    Cells row by row; unwired cells read 0. settings: the block glove.simulate with the sensor (`scene_of`).
    """
    circuit, columns = settings["circuit"], []
    for siemens in areas:
        volts = circuit["supply_v"] * siemens / (siemens + 1 / circuit["reference_ohm"])
        error = rng.normal(0, circuit["noise_counts"], volts.shape) if settings["effects"]["noise"] else 0.0
        read = readout.counts(np.nan_to_num(volts), supply_v=circuit["supply_v"], levels=LEVELS, noise=error)
        columns.append(np.where(np.isnan(siemens), 0, read).reshape(len(read), -1))
    return np.column_stack(columns)


def held(frames: int, settings: Mapping, rng: np.random.Generator, thing: Thing | None = None) -> Hold:
    """Draw the hold of a session and its wandering; settings: the block glove.simulate.

    thing: whose length bounds the shift along its axis where fingers wrap it; None: nothing does.
    """
    session, effects = settings["session"], settings["effects"]
    keep = np.exp(-1 / (settings["frame_hz"] * session["wander_time_s"]))

    share = session["wander"]

    def course(spread: float, *shape: int) -> np.ndarray:
        """Draw a constant of the session plus a stationary first-order process, (frames, *shape), of one variance."""
        constant, start = rng.normal(0, spread, (2, *shape))
        steps = rng.normal(0, spread * np.sqrt(1 - keep**2), (frames, *shape))
        steps[0] = start
        slow = lfilter([1], [1, -keep], steps, axis=0)
        return effects["session"] * np.sqrt(1 - share) * constant + effects["wander"] * np.sqrt(share) * slow

    along, across = course(session["along_mm"]), course(session["across_mm"])
    if thing is not None and not GRIPS[thing.grip].closed_deg:
        room = max(thing.length_mm / 2 - HAND_MM / 2, 0.0)
        across = np.clip(across, -room, room)
    return Hold(
        along=along,
        across=across,
        tilt=np.radians(course(session["tilt_deg"])),
        margin=session["margin"] * np.exp(course(session["margin_spread"])),
        share=np.exp(course(session["share_spread"], 5, 1) + course(session["share_spread"], 1, 3)),
        fit=course(session["fit_deg"], 5, 3),
        seat=np.exp(course(session["seat_spread"], *PRESSURE)),
    )


def conductances(thing: Thing | None, hold: Hold, settings: Mapping) -> tuple[np.ndarray, np.ndarray]:
    """Return the siemens of every cell, (frames, 15, 18) and (frames, 15, 9), NaN where no cell is wired.

    Area (a): columns 1 to 9 are the pads (3 rows per finger, phalanges from the palm outwards), columns 10 to 18 of
    rows 4 to 15 the palm. Area (b): the joints likewise; the first joint of the thumb is not wired.
    """
    frames = len(hold.along)
    angles, contact = posture(thing, hold)
    force = np.zeros((frames, *PRESSURE))
    if thing is not None:
        force[:] = pressed(thing, hold, contact, settings)
    wired = np.ones(PRESSURE, dtype=bool)
    wired[:3, 9:] = False
    film, spread = settings["film"], settings["effects"]["element_spread"]
    gains = generator(settings["specimen"], "film")
    gain = np.exp(spread * film["gain_spread"] * gains.normal(size=PRESSURE))
    bend_gain = np.exp(spread * film["gain_spread"] * gains.normal(size=STRAIN))
    pressure = np.where(wired, gain * pressed_film(force, film), np.nan)
    bent_deg = np.repeat(np.repeat(np.maximum(angles + hold.fit, 0), 3, axis=1), 3, axis=2)
    strain = bend_gain * bent_film(bent_deg, film)
    strain[:, :3, :3] = np.nan
    return pressure, strain


def pressed_film(force: np.ndarray, film: Mapping) -> np.ndarray:
    """Return the siemens of a pressure cell of gain 1 under `force` (N, any shape); film: glove.simulate.film."""
    return np.exp(material.static_conductance(material.load_material(), film["force_scale"] * force)) / film["rest_ohm"]


def bent_film(bent_deg: np.ndarray, film: Mapping) -> np.ndarray:
    """Return the siemens of a cell of gain 1 on a joint bent by `bent_deg` (any shape); film: glove.simulate.film."""
    return (1 + film["bend_gain"] * bent_deg / 90) / film["rest_bend_ohm"]


def turning(s: np.ndarray, thing: Thing, size: np.ndarray) -> np.ndarray:
    """Return Theta of equation 2 in degrees at the places s (any shape) around the cross-section scaled by `size`."""
    corner = thing.corner_mm * size
    arc = np.pi / 2 * (corner + FINGER_MM)
    flats = (thing.width_mm / 2 - thing.corner_mm, thing.depth_mm - 2 * thing.corner_mm)
    flats = (*flats, thing.width_mm - 2 * thing.corner_mm, flats[1])
    total, start = 0.0, 0.0
    for k, flat in enumerate(flats):
        start = start + flat * size + (arc if k else 0.0)
        total = total + 90 * np.clip((s - start) / arc, 0, 1)
    return total


def scale(y: np.ndarray, thing: Thing) -> np.ndarray:
    """Return rho of equation 1 at the places y along the axis; 0 beyond the object."""
    inside = np.abs(y) < thing.length_mm / 2
    if thing.profile == "ellipsoid":
        return np.sqrt(np.maximum(0, 1 - (2 * y / thing.length_mm) ** 2))
    return inside * (1 + thing.taper * y / thing.length_mm)


def posture(thing: Thing | None, hold: Hold) -> tuple[np.ndarray, np.ndarray]:
    """Return joint angles (frames, 5, 3) in degrees and how well each phalanx touches (frames, 5, 3), 0 to 1."""
    frames = len(hold.along)
    limits = np.vstack([THUMB_LIMITS_DEG, *[LIMITS_DEG] * 4])
    if thing is None:
        return np.full((frames, 5, 3), OPEN_DEG), np.zeros((frames, 5, 3))
    if GRIPS[thing.grip].closed_deg:
        return opened(thing, hold)
    size = scale(ACROSS_MM - hold.across[:, None], thing)[:, :, None]  # (frames, 5, 1)
    ends = np.column_stack([np.zeros(5), np.cumsum(PHALANGES_MM, axis=1)])
    joints = KNUCKLE_MM[:, None] + ends[:, :3] + moved(thing, hold)  # (frames, 5, 3)
    before = np.column_stack([KNUCKLE_MM, PHALANGES_MM[:, :2]]) / 2
    there = np.maximum(size, 1e-3)
    wanted = turning(joints + PHALANGES_MM / 2, thing, there) - turning(joints - before, thing, there)
    excess = np.cumsum(np.maximum(wanted - limits, 0), axis=2)
    contact = np.where(size > 0.05, np.exp(-excess / REACH_DEG), 0.0)
    angles = np.where(size > 0.05, np.minimum(wanted, limits), 0.85 * limits)
    if GRIPS[thing.grip].hooked_mm:
        angles[:, 0], contact[:, 0] = ON_HANDLE_DEG, 1.0
    return angles, contact


def moved(thing: Thing, hold: Hold) -> np.ndarray:
    """Return how much longer the way around the object is to every finger, (frames, 5, 1), in mm."""
    hooked = GRIPS[thing.grip].hooked_mm * (np.arange(5) > 0)  # the thumb lies on the handle
    return (WAY * hold.along[:, None] - hooked)[..., None]


def opened(thing: Thing, hold: Hold) -> tuple[np.ndarray, np.ndarray]:
    """Return `posture` of a grip between pads: the closed grip, opened by the object's smaller side."""
    closed = np.array(GRIPS[thing.grip].closed_deg, dtype=float)
    lever = PHALANGES_MM.sum(axis=1) + PHALANGES_MM[:, 1:].sum(axis=1) - 2 * np.maximum(hold.along, -20)[:, None]
    back = np.degrees(min(thing.width_mm, thing.depth_mm) / 2 / np.maximum(lever, 20.0))  # (frames, 5)
    used = np.array(GRIPS[thing.grip].fingers) > 0
    angles = closed - (back * used)[..., None] * np.array([1.0, 1.0, 0.0])
    touched = used & (scale(ACROSS_MM - hold.across[:, None], thing) > 0)
    touched[:, 0] = True  # the thumb lies opposite the fingers, wherever these are
    return np.maximum(angles, 0), np.repeat(touched[..., None], 3, axis=2).astype(float)


def pressed(thing: Thing, hold: Hold, contact: np.ndarray, settings: Mapping) -> np.ndarray:
    """Return the force on every cell of area (a), (frames, 15, 18), in N."""
    session, grip = settings["session"], GRIPS[thing.grip]
    grasp = hold.margin * thing.mass_g / 1000 * GRAVITY / (2 * thing.friction) + session["least_grip_n"]
    yields = YIELD_MM / min(1.0, thing.stiffness / SKIN) if settings["effects"]["softness"] else YIELD_MM
    result = np.zeros((len(grasp), *PRESSURE))

    share = np.outer(grip.fingers, grip.phalanges) * hold.share * contact
    share[:, 1:] /= np.maximum(share[:, 1:].sum(axis=(1, 2), keepdims=True), 1e-6)  # the fingers together take all
    force = grasp[:, None, None] * share  # (frames, 5, 3)
    surface = tip_gap(hold, grip) if grip.closed_deg else wrapped_gap(thing, hold)
    delta = np.maximum(yields * np.sqrt(force), 1e-6)[..., None, None]
    seat = hold.seat[:, :, :9].reshape(len(grasp), 5, 3, 3, 3).transpose(0, 1, 3, 2, 4)  # as in `cells`
    weight = np.maximum(0, 1 - surface / delta) * seat
    cells = force[..., None, None] * weight / weight.sum(axis=(3, 4), keepdims=True)  # (frames, 5, 3, 3, 3)
    result[:, :, :9] = cells.transpose(0, 1, 3, 2, 4).reshape(len(grasp), 15, 9)
    if not grip.palm:
        return result

    gap = palm_gap(thing, hold)
    load = grip.palm * grasp
    delta = (3 * yields * np.sqrt(load))[:, None, None]  # the palm is three times as soft as a finger's pad
    weight = np.maximum(0, 1 - gap / delta) * hold.seat[:, 3:, 9:]
    total = np.maximum(weight.sum(axis=(1, 2), keepdims=True), 1e-6)
    result[:, 3:, 9:] = load[:, None, None] * weight / total
    return result


def wrapped_gap(thing: Thing, hold: Hold) -> np.ndarray:
    """Return the gaps (mm) between a wrapped object and the cells of every pad, (frames, 5, 3, 3 across, 3 along)."""
    size = np.maximum(scale(ACROSS_MM - hold.across[:, None], thing), 0.05)[:, :, None]
    middle = KNUCKLE_MM[:, None] + np.cumsum(PHALANGES_MM, axis=1) - PHALANGES_MM / 2
    middle = middle + moved(thing, hold)
    edge = PAD_MM / 2
    bend = turning(middle + edge, thing, size) - turning(middle - edge, thing, size)  # deg over a cell
    curvature = np.radians(bend) / PAD_MM  # (frames, 5, 3) per mm, along the finger
    across = 2 / thing.length_mm if thing.profile == "ellipsoid" else 0.0
    across += 1 / PULP_MM  # the finger is round too
    return curvature[..., None, None] * CELL_MM[None, :] ** 2 / 2 + across * CELL_MM[:, None] ** 2 / 2


def tip_gap(hold: Hold, grip: Grip) -> np.ndarray:
    """Return the gaps (mm) of a grip between pads, (frames, 5, 1, 3 across, 3 along): alike on a finger's phalanges.

    The finger is round along its length (PULP_MM) and touches where the object's shift and tilt take it.
    """
    place = WAY * hold.along[:, None] + np.tan(hold.tilt)[:, None] * ACROSS_MM  # (frames, 5)
    place = np.clip(place, -1.5 * PAD_MM, 1.5 * PAD_MM)[..., None, None]
    beside = np.where(np.arange(5) > 0, grip.beside_mm, 0.0)[:, None, None]
    gap = ((CELL_MM[None, :] - place) ** 2 + (CELL_MM[::-1, None] - beside) ** 2) / (2 * PULP_MM)
    return (gap - gap.min(axis=(2, 3), keepdims=True))[:, :, None]


def palm_gap(thing: Thing, hold: Hold) -> np.ndarray:
    """Return the gaps (mm) between the object and the cells of the palm, (frames, 12, 9)."""
    along = (np.arange(PALM_ROWS) - (PALM_ROWS - 1) / 2) * PALM_MM
    beside = (np.arange(PALM_COLS) - (PALM_COLS - 1) / 2) * PALM_MM
    s, y = np.meshgrid(along, beside, indexing="ij")
    s, y = s - hold.along[:, None, None], y - hold.across[:, None, None]
    turn = hold.tilt[:, None, None]
    s, y = s * np.cos(turn) - y * np.sin(turn), s * np.sin(turn) + y * np.cos(turn)
    rho = scale(y, thing)
    corner = np.maximum(thing.corner_mm * rho, 1e-3)
    beyond = np.clip(np.abs(s) - (thing.width_mm / 2 - thing.corner_mm) * rho, 0, None)
    drop = corner - np.sqrt(np.maximum(corner**2 - beyond**2, 0))
    higher = drop + thing.depth_mm / 2 * (1 - np.minimum(rho, 1))
    return np.where((beyond < corner) & (rho > 0), higher, np.inf)
