"""Spread the load of tips over the elements of the array, and tell how the film differs where they press.

1. Contact. A rounded, silicone-covered tip touches on a circle whose radius grows with the cube root of the force
   (Hertz; Johnson, Contact Mechanics, 1985, eq. 4.22): a = r (P / P_full)^(1/3), P = F / (pi r^2) being the mean
   pressure that load cell and label give, and P_full the pressure at which all of the tip lies on the sensor.
2. Load. The contact pressure is taken as a Gaussian of standard deviation s = sqrt((a/2)^2 + silicone_spread^2), so
   the share of a touch at (x, y) on the element [p, q] x [u, v] is a product of two differences of the normal
   distribution function, (Phi((q - x) / s) - Phi((p - x) / s)) (Phi((v - y) / s) - Phi((u - y) / s)). Load on the gaps
   between elements is lost.
3. Places. Log gain and exponent of the film are smooth Gaussian random fields over the array with the correlation
   exp(-d^2 / (2 length^2)). Their spread is such that the places of one recorded taxel, on their raster of 4 x 4,
   differ as much as recorded (`velostat.json`): places that correlate differ less than the field does. An element has
   the gain and exponent at the centre of the load on it (the mean of the truncated Gaussian); several touches on one
   element count by their loads. In the recordings, places 3.25 and 3.75 mm apart correlate with 0.08 (24 pairs, so
   +-0.2), which a length of 2.5 mm, half this tip's radius, puts at 0.38: smoother fields than that are not recorded.
   The size of the recorded tip is not known.
4. Repeats. The contacts between film and electrodes form anew in every press, so that a press does not read as another
   one at the same place does: under every element the log gain of a press is off by a normal number of standard
   deviation `repeat_spread`. Source: between two repetitions of the recorded taxel's program, the readings of its 16
   places differ by 0.044 in log (median of five recordings, 0.027 to 0.124), those of a film that repeats, under the
   same forces, by 0.018. A spread of 0.032 makes up for it; recording by recording it is 0.024 (20 and 40 N) to 0.035,
   each from 16 places and so to about 18 %, and nothing at 5 N, where forces that differ explain all. One number stands
   for all forces. That elements are independent is assumed: the recordings have one.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.special import ndtr

from pipeline.scenes import material
from tactile.datasets.seeding import generator

GRID_MM = 0.5  # of the fields of places
EDGE_MM = 10.0  # that the fields reach beyond the array
LEAST_EXPONENT = 0.4  # more than three standard deviations below the mean; recorded: 0.65 to 1.22


class Touch(NamedTuple):
    """One contact along a recording; arrays of shape (steps,)."""

    force_n: np.ndarray  # force that acts on the array
    x_mm: np.ndarray  # where the force acts
    y_mm: np.ndarray
    logged_force_n: np.ndarray  # force that the load cell feels along its own axis
    logged_x_mm: np.ndarray  # place according to the CNC, or to the instruction to the operator
    logged_y_mm: np.ndarray
    radius_mm: float  # of the tip


class Loads(NamedTuple):
    """What the elements feel; arrays of shape (steps, rows * cols), row-major from the bottom row."""

    force_n: np.ndarray
    gain: np.ndarray | float
    exponent: np.ndarray | float


def steady(force: np.ndarray, x: np.ndarray | float, y: np.ndarray | float, radius_mm: float) -> Touch:
    """Return a touch whose devices log the true force and place."""
    x, y = np.broadcast_to(x, force.shape), np.broadcast_to(y, force.shape)
    return Touch(force, x, y, force, x, y, radius_mm)


def tip_area_m2(tip_radius_mm: float) -> float:
    """Return the area of the flat tip that turns force into the pressure of the labels."""
    return np.pi * (tip_radius_mm * 1e-3) ** 2


def spread_mm(touch: Touch, settings: Mapping) -> np.ndarray:
    """Return s of the contact pressure, (steps,) in mm; settings: the block touch.simulate."""
    contact, radius = settings["contact"], np.full(len(touch.force_n), touch.radius_mm)
    if settings["effects"]["contact_growth"]:
        share = touch.force_n / (tip_area_m2(touch.radius_mm) * contact["full_kpa"] * 1e3)
        radius = radius * np.cbrt(np.maximum(share, 0))
    return np.hypot(radius / 2, contact["silicone_spread_mm"])


def shares_along(
    position: np.ndarray, spread: np.ndarray, count: int, sensor: Mapping, load_sharing: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return shares of the load of a touch on `count` lines of elements, and its centre in mm, (steps, count) each.

    Without `load_sharing` all of the load is on the nearest line. position, spread: (steps,) in mm.
    """
    pitch, half = sensor["pitch_mm"], sensor["element_mm"] / 2
    middle = (np.arange(count) + 0.5) * pitch
    away = middle - position[:, None]
    if not load_sharing:
        return (np.abs(away) <= pitch / 2).astype(float), np.broadcast_to(position[:, None], away.shape)
    low, high = (away - half) / spread[:, None], (away + half) / spread[:, None]
    share = ndtr(high) - ndtr(low)
    density = (np.exp(-(low**2) / 2) - np.exp(-(high**2) / 2)) / np.sqrt(2 * np.pi)
    centre = position[:, None] + spread[:, None] * density / np.maximum(share, 1e-12)
    return share, np.clip(centre, middle - half, middle + half)


def places(settings: Mapping, sensor: Mapping, length_mm: float) -> np.ndarray:
    """Draw two independent fields of variance 1, (2, rows, columns) on a grid of GRID_MM; one array per `specimen`.

    settings: the block touch.simulate. The field starts EDGE_MM below and left of the array.
    """
    size = [round((sensor[key] * sensor["pitch_mm"] + 2 * EDGE_MM) / GRID_MM) + 1 for key in ("rows", "cols")]
    white = generator(settings["specimen"], "specimen").normal(size=(2, *size))
    sigma = length_mm / np.sqrt(2) / GRID_MM  # white noise seen through exp(-d^2 / (2 s^2)) correlates over sqrt(2) s
    smooth = np.stack([gaussian_filter(layer, sigma, mode="wrap") for layer in white])
    return smooth * 2 * np.sqrt(np.pi) * sigma  # over the standard deviation of the filtered noise


def field_spread(length_mm: float) -> tuple[float, float]:
    """Return the standard deviations of log gain and exponent over the array.

    Those within the recorded raster, over the root of 1 less the mean correlation of its places with one another.
    """
    film = material.load_places()
    raster = [np.arange(count) * step for count, step in zip(film.raster, film.step_mm, strict=True)]
    points = np.stack(np.meshgrid(*raster), axis=-1).reshape(-1, 2)
    apart = np.linalg.norm(points[:, None] - points, axis=-1)
    within = np.sqrt(1 - np.exp(-(apart**2) / (2 * length_mm**2)).mean())
    return film.gain_std / within, film.exponent_std / within


def film_at(fields: np.ndarray, length_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Return gain and exponent, (...) each, for values (2, ...) of the two fields."""
    gain_std, exponent_std = field_spread(length_mm)
    return np.exp(gain_std * fields[0]), np.maximum(1 + exponent_std * fields[1], LEAST_EXPONENT)


def anew(force_n: np.ndarray, elements: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Draw a normal number for every press and element: (steps, rows, cols) for the force (steps,) of one touch.

    A press begins where the force rises from 0, and its numbers stay until the next one begins.
    """
    pressed = force_n > 0
    press = np.cumsum(pressed & ~np.concatenate([[False], pressed[:-1]]))
    return rng.normal(size=(press[-1] + 1, *elements))[press]


def element_loads(touches: Sequence[Touch], settings: Mapping, sensor: Mapping, rng: np.random.Generator) -> Loads:
    """Return force, gain and exponent of every element for the touches of a recording; settings: touch.simulate.

    rng: draws how a press differs from others at its place.
    """
    effects, length_mm = settings["effects"], settings["material"]["correlation_mm"]
    fields = places(settings, sensor, length_mm) if effects["places"] else None
    total, weighted = 0.0, 0.0
    for touch in touches:
        spread = spread_mm(touch, settings)
        share_y, y = shares_along(touch.y_mm, spread, sensor["rows"], sensor, effects["load_sharing"])
        share_x, x = shares_along(touch.x_mm, spread, sensor["cols"], sensor, effects["load_sharing"])
        load = touch.force_n[:, None, None] * share_y[:, :, None] * share_x[:, None, :]
        total = total + load
        here = np.zeros((3, *load.shape))
        if fields is not None:
            at = np.broadcast_arrays((y[:, :, None] + EDGE_MM) / GRID_MM, (x[:, None, :] + EDGE_MM) / GRID_MM)
            here[:2] = [map_coordinates(field, at, order=1) for field in fields]
        if effects["repeats"]:
            here[2] = anew(touch.force_n, load.shape[1:], rng)
        weighted = weighted + (load + material.LEAST_FORCE_N) * here
    mean = (weighted / (total + len(touches) * material.LEAST_FORCE_N)).reshape(3, len(total), -1)
    gain, exponent = film_at(mean[:2], length_mm)
    gain = gain * np.exp(settings["material"]["repeat_spread"] * mean[2])
    return Loads(total.reshape(len(total), -1), gain, exponent)
