"""Model Velostat: the log resistance of a taxel from the history of the force on it, and nothing else.

The model is causal and starts from long rest. F is force in N, dt the step in s, r log resistance (up to a
constant: the recorded reading that the model was fitted to has an arbitrary scale).

1. Static law: a power law above a contact threshold, steeper at high force,

       g = gain ((F / F0)^(a e) + (F / F1)^(m e)),     x = ln(1 + g^k) / k,     r = r0 - x.

   x is the log conductance above rest. `gain` and `exponent` e are 1, or one number per element. Conductance
   as a power of pressure: Stassi et al., Sensors 14, 5296 (2014); k sharpens the knee where contact begins.
2. Creep (fading memory). Contact needs time to form but none to break, so the relaxation can only hold
   conductance back:

       x <- (1 - w) x + w min(x, L),     L <- L + (1 - exp(-dt / T)) (x - L),

   exact for a force that is constant within a step.
3. Hysteresis, rate-independent: a Prandtl-Ishlinskii mean of play operators (Brokate and Sprekels, Hysteresis
   and Phase Transitions, 1996) on ln x, so that the loop closes at rest:

       p_j <- min(max(p_j, x), (1 + h j / 3) x),     x <- (p_1 + p_2 + p_3) / 3.

4. Release overshoot: after release r lies above its rest value and creeps back over seconds. A memory P of
   the largest x that leaks with time constant T adds c (P - x) to r: P <- max(x, exp(-dt / T) P).
   A second, slower memory for a drift of the rest value over minutes was tried; it did not improve the fit.

Numbers come from `velostat.json`, written by `tactile fit-material`.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

FITTED = Path(__file__).with_name("velostat.json")
LEAST_FORCE_N = 1e-9  # stands for no force, so that logarithms exist; far below the threshold F0
PLAY_OPERATORS = 3


@dataclass(frozen=True)
class Material:
    """Parameters of the model; symbols as in the module's docstring."""

    rest: float  # r0, log of the reading
    onset_n: float  # F0
    exponent: float  # a
    knee: float  # k
    onset_high_n: float  # F1
    exponent_high: float  # m
    creep_weight: float  # w, 0..1
    creep_time_s: float  # T of equation 2
    hysteresis_width: float  # h
    release_gain: float  # c
    release_time_s: float  # T of equation 4


@cache
def load_material() -> Material:
    """Return the parameters fitted to the recordings (`velostat.json`)."""
    return Material(**json.loads(FITTED.read_text())["parameters"])


def static_conductance(
    material: Material, force: np.ndarray, gain: np.ndarray | float = 1.0, exponent: np.ndarray | float = 1.0
) -> np.ndarray:
    """Return x of equation 1: log conductance above rest (>= 0) at each force (N), without any memory."""
    log_force = np.log(np.maximum(force, LEAST_FORCE_N))
    low = material.exponent * exponent * (log_force - np.log(material.onset_n))
    high = material.exponent_high * exponent * (log_force - np.log(material.onset_high_n))
    return np.logaddexp(0, material.knee * (np.logaddexp(low, high) + np.log(gain))) / material.knee


def relaxed(x: np.ndarray, time_s: float, dt: float) -> np.ndarray:
    """Return L of equation 2, from rest: x (steps, ...) seen through an exponential memory of `time_s`."""
    keep = np.exp(-dt / time_s)
    return lfilter([1 - keep], [1, -keep], x, axis=0)


def play(x: np.ndarray, width: float) -> np.ndarray:
    """Return p of equation 3, from rest: the play operator on ln x, for x >= 0 of shape (steps, ...).

    Each step clamps p between x and (1 + width) x. Clamps compose to clamps, so a prefix scan of log2(steps)
    vectorised rounds replaces the loop over steps.
    """
    low, high = x.copy(), (1 + width) * x
    step = 1
    while step < len(x):
        last_low, last_high = low[step:].copy(), high[step:].copy()
        low[step:] = np.minimum(np.maximum(low[:-step], last_low), last_high)
        high[step:] = np.minimum(np.maximum(high[:-step], last_low), last_high)
        step *= 2
    return low


def leaking_peak(x: np.ndarray, time_s: float, dt: float) -> np.ndarray:
    """Return P of equation 4, from rest: the largest x so far, each x faded by exp(-age / time_s)."""
    age = (np.arange(len(x)) * (dt / time_s)).reshape(-1, *[1] * (x.ndim - 1))
    faded = np.log(np.maximum(x, np.finfo(float).tiny)) + age
    return np.exp(np.maximum.accumulate(faded, axis=0) - age)


def log_resistance(
    material: Material,
    force: np.ndarray,
    dt: float,
    *,
    gain: np.ndarray | float = 1.0,
    exponent: np.ndarray | float = 1.0,
    creep: bool = True,
    hysteresis: bool = True,
    release: bool = True,
) -> np.ndarray:
    """Return the log resistance, same shape as `force`: (steps,) or (steps, elements), N, sampled every `dt` seconds.

    `gain` and `exponent`, numbers or arrays that broadcast against `force`, such as (elements,), multiply the
    pressed part of the conductance and the power-law exponents. Each of the three effects can be switched
    off; with all off only the static law is left.
    Conductance is exp(-log resistance), up to a scale.
    """
    x = static_conductance(material, np.asarray(force, dtype=float), gain, exponent)
    if creep:
        x = x - material.creep_weight * (x - np.minimum(x, relaxed(x, material.creep_time_s, dt)))
    if hysteresis:
        widths = material.hysteresis_width * np.arange(1, PLAY_OPERATORS + 1) / PLAY_OPERATORS
        x = sum(play(x, width) for width in widths) / PLAY_OPERATORS
    result = material.rest - x
    if release:
        result += material.release_gain * (leaking_peak(x, material.release_time_s, dt) - x)
    return result
