"""Measure the same model-free statistics of recorded strain sensors and of the simulated finger.

The recorded program presses at random places, one press in 2.8 s. The simulated finger runs a program with the same
timing: it is put down on one place and dragged from there to a random place while it is pressed, by less than it
sticks, so that a strand's reading depends on the place as it does in the recordings. Statistics are those of stretches
of STRETCH_S; a value is the median over strands where it is not said otherwise.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from sklearn.ensemble import ExtraTreesRegressor

from pipeline.scenes import strain
from tactile.base.paths import Workspace
from tactile.datasets import schemas
from tactile.datasets.seeding import generator
from tactile.experiments import strain_recorded
from tactile.sheet import cycles

STATISTICS = {
    "response": ("mV", "Standard deviation of the voltage around its means over 150 s."),
    "noise": ("mV", "Noise of a reading while the finger is held still, from second differences in time."),
    "drift_over_response": ("1", "Standard deviation of the means over 150 s, over that of the voltage around them."),
    "drift_growth": (
        "1",
        "Difference of means over 150 s that are 20 min apart, over that of neighbours (random walk: 2.8).",
    ),
    "drift_correlation": ("1", "Mean correlation of the means over 150 s of two strands."),
    "time_share": ("1", "Share of the voltage's variance that a cubic polynomial of elapsed time explains."),
    "rest_over_response": ("1", "Standard deviation of the voltage before a press, over the mean size of a response."),
    "rest_correlation": ("1", "Mean size of the correlation of two strands' voltages before a press."),
    "rest_memory_near": ("1", "Correlation of the voltage before a press with that before the previous press."),
    "rest_memory_far": ("1", "Correlation of the voltage before a press with that before the 20th press earlier."),
    "history_share": (
        "1",
        "R2 of the voltage before a press from the sizes of the same strand's earlier responses.",
    ),
    "hold_change": ("1", "Change of the voltage while a press is held, over the mean size of a response."),
    "place_r2_absolute": ("1", "R2 of the place of a press from voltages (extra trees, last 30 % after first 70 %)."),
    "place_r2_difference": ("1", "R2 of the place of a press from voltages less those before the press (extra trees)."),
    "effective_rank": ("1", "Effective number of independent strands among six, of their responses to a press."),
}
NOTES = {
    "rest_over_response": (
        "Left as it is: more broken paths would raise it, and with it the change while a press is held, which is too "
        "large as it is."
    ),
    "hold_change": (
        "Left as it is: what falls back during a hold is what drifts between presses, and with fewer broken paths the "
        "voltage before a press would vary still less."
    ),
    "effective_rank": (
        "Left as it is: strands that answer to stretch alone hardly overlap in the finger; with less slack they would "
        "tell the place of a press better than recorded ones."
    ),
}

STRANDS = 6  # channels of both recorded days that work all the time
BLOCK_S = 150.0
APART = 8  # blocks: 20 min
STRETCH_S = 5500.0  # 4 stretches of the first day, 2 of the second
MEMORY_S = (3.0, 10.0, 30.0, 100.0)
FAR = 20  # presses
FITTED = 0.7  # share of the presses that a predictor is fitted to; it is tested on the later ones
TREES = {"n_estimators": 50, "min_samples_leaf": 2, "random_state": 0}

CYCLE_S, SAMPLE_S = 2.82, 0.212  # of the recordings, with every third sample
RAMP_S = 0.25  # the recorded readings need this to follow a command
LIFTED_MM, PRESSED_MM = 5.0, 5.0
DRAG_MM = 5.0  # largest in x and in y; the finger sticks up to 12 mm


class Presses(NamedTuple):
    """One reading per press and strand, in V."""

    rest: np.ndarray  # (presses, strands): before the press
    mid: np.ndarray  # (presses, strands): in the first half of the hold, without the ramp
    late: np.ndarray  # (presses, strands): in the second half
    place: np.ndarray  # (presses, 2) mm


def recorded(workspace: Workspace, settings: Mapping) -> pd.DataFrame:
    """Return recording, statistic and value of each stretch of both recorded days; settings: the whole params."""
    table = schemas.read(workspace.frames("strain_recorded"))
    condition = schemas.names(table["condition"])
    volts, place = schemas.matrix(table["v"])[:, :STRANDS].astype(float), schemas.matrix(table["y_mm"])[:, :2]
    time_s, press = table["t_s"].to_numpy(), table["press"].to_numpy()
    rows = []
    for day in strain_recorded.FILES:
        on = np.flatnonzero(condition == day)
        stretch = np.minimum((time_s[on] - time_s[on[0]]) // STRETCH_S, np.ptp(time_s[on]) // STRETCH_S - 1)
        for k in np.unique(stretch):
            at = on[stretch == k]
            values = statistics(time_s[at], volts[at], press[at], place[at])
            rows += [(f"{day}, stretch {k + 1:.0f}", name, value) for name, value in values.items()]
    return pd.DataFrame(rows, columns=["recording", "statistic", "value"])


def simulated(workspace: Workspace | None, settings: Mapping) -> pd.DataFrame:
    """Return the same of each specimen of the scene, running the recorded program; no file is read."""
    scene, rows = settings["strain"]["simulate"], []
    for specimen in range(scene["specimen"], scene["specimen"] + scene["specimens"]):
        values = statistics(*program(scene, specimen))
        rows += [(f"specimen {specimen}", name, value) for name, value in values.items()]
    return pd.DataFrame(rows, columns=["recording", "statistic", "value"])


def program(scene: Mapping, specimen: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return time (n,), voltages (n, STRANDS), press (n,) and place (n, 2) of a finger that runs the program.

    scene: the block strain.simulate. The readings have the scene's drift and noise, but no jitter and no line faults.
    """
    presses = round(STRETCH_S / CYCLE_S)
    target = generator(scene["seed"], "twin", specimen, "motion").uniform(-DRAG_MM, DRAG_MM, (presses, 2))
    start = CYCLE_S * np.arange(presses)[:, None] + CYCLE_S / 2
    # Lifted above one place, put down and dragged, held, lifted again.
    turns = start + np.array([0, RAMP_S, CYCLE_S / 2, CYCLE_S / 2 + RAMP_S])
    grid = np.arange(0, STRETCH_S, strain.STEP_S)
    pressed = np.interp(grid, turns.ravel(), np.tile([0.0, 1.0, 1.0, 0.0], presses))
    cycle = np.minimum((grid // CYCLE_S).astype(int), presses - 1)
    # After the last line of a press the arm is lifted in the following cycle.
    holder = np.maximum(cycle - (grid % CYCLE_S < CYCLE_S / 2), 0)
    height = -PRESSED_MM * pressed + LIFTED_MM * (pressed == 0)
    path = np.column_stack([target[holder] * pressed[:, None], height])
    recording = strain.Recording("program", f"run{specimen:03d}", specimen, path)
    drift = strain.drifts(len(grid), STRANDS, scene, generator(scene["seed"], "twin", specimen, "drift"))
    change = strain.responses(strain.strains(recording, scene, STRANDS), recording, scene)
    volts = strain.voltages(change + drift, scene["circuit"])
    time_s = np.arange(SAMPLE_S, STRETCH_S - SAMPLE_S, SAMPLE_S)
    read = np.column_stack([np.interp(time_s, grid, column) for column in volts.T])
    if scene["effects"]["noise"]:
        noise = generator(scene["seed"], "twin", specimen, "noise")
        read += noise.normal(0, scene["circuit"]["noise_v"], read.shape)
    number = np.minimum((time_s // CYCLE_S).astype(int), presses - 1)
    press = np.where(time_s % CYCLE_S >= CYCLE_S / 2, number, -1)
    return time_s, read, press, target[number]


def statistics(time_s: np.ndarray, volts: np.ndarray, press: np.ndarray, place: np.ndarray) -> dict[str, float]:
    """Return every one of STATISTICS of one stretch.

    time_s (n,); volts (n, strands); press (n,): number of the press, -1 outside presses; place (n, 2) in mm.
    """
    means, fast = slow_and_fast(time_s, volts)
    response, drift = fast.std(axis=0), means.std(axis=0)
    each = presses(volts, press, place)
    answer = each.late - each.rest
    size = np.abs(answer).mean(axis=0)
    absolute, difference = (place_r2(given, each.place) for given in (each.late, answer))
    values = {
        "response": 1e3 * response,
        "noise": 1e3 * held_noise(volts, press),
        "drift_over_response": drift / response,
        "drift_growth": growth(means),
        "drift_correlation": correlations(means).mean(),
        "time_share": 1 - residual(elapsed(time_s), volts) / volts.var(axis=0),
        "rest_over_response": each.rest.std(axis=0) / size,
        "rest_correlation": np.abs(correlations(each.rest)).mean(),
        "rest_memory_near": remembered(each.rest, 1),
        "rest_memory_far": remembered(each.rest, FAR),
        "history_share": history_r2(each.rest, answer),
        "hold_change": (each.late - each.mid).mean(axis=0) / size,
        "place_r2_absolute": absolute,
        "place_r2_difference": difference,
        "effective_rank": effective_rank(answer),
    }
    return {name: float(np.median(value)) for name, value in values.items()}


def slow_and_fast(time_s: np.ndarray, volts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the means (blocks, strands) over BLOCK_S, whole blocks alone, and what (n, strands) deviates from them."""
    block = ((time_s - time_s[0]) // BLOCK_S).astype(int)
    count = np.bincount(block)
    means = np.column_stack([np.bincount(block, column) / count for column in volts.T])
    return means[count > count.max() / 2], volts - means[block]


def growth(means: np.ndarray) -> np.ndarray:
    """Return, by strand, the difference of means (blocks, strands) APART blocks apart over that of neighbours."""
    apart, near = ((means[lag:] - means[:-lag]).std(axis=0) for lag in (APART, 1))
    return apart / near


def correlations(columns: np.ndarray) -> np.ndarray:
    """Return the correlations (pairs,) of all pairs of columns (n, strands)."""
    return np.corrcoef(columns.T)[np.triu_indices(columns.shape[1], 1)]


def held_noise(volts: np.ndarray, press: np.ndarray) -> np.ndarray:
    """Return the standard deviation of white noise, by strand, from second differences late in presses."""
    held = (press[4:] >= 0) & (press[4:] == press[:-4])  # the last three of five samples of one press
    return np.sqrt(cycles.second_difference_squares(volts[2:])[held].mean(axis=0) / 6)


def presses(volts: np.ndarray, press: np.ndarray, place: np.ndarray) -> Presses:
    """Return a row per press that has three samples before it and five in it."""
    on = press >= 0
    first = np.flatnonzero(on & np.r_[True, press[1:] != press[:-1]])
    last = np.flatnonzero(on & np.r_[press[1:] != press[:-1], True])
    whole = (first >= 3) & (last - first >= 4)
    first, last = first[whole], last[whole]
    rest = np.mean([volts[first - k] for k in (1, 2)], axis=0)
    mid = np.mean([volts[first + k] for k in (2, 3)], axis=0)
    late = np.mean([volts[last - k] for k in (0, 1)], axis=0)
    return Presses(rest, mid, late, place[last])


def elapsed(time_s: np.ndarray) -> np.ndarray:
    """Return 1, t, t^2 and t^3 of times (n,), t from -1 to 1: (n, 4)."""
    return np.vander(2 * (time_s - time_s[0]) / np.ptp(time_s) - 1, 4)


def residual(given: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the variance, by column, that least squares from `given` (n, inputs) leaves of `wanted` (n, columns)."""
    weights, *_ = np.linalg.lstsq(given, wanted, rcond=None)
    return np.square(wanted - given @ weights).mean(axis=0)


def remembered(rest: np.ndarray, lag: int) -> np.ndarray:
    """Return the correlation, by strand, of `rest` (presses, strands) with itself `lag` presses earlier."""
    deviation = rest - rest.mean(axis=0)
    return (deviation[lag:] * deviation[:-lag]).mean(axis=0) / deviation.var(axis=0)


def history_r2(rest: np.ndarray, answer: np.ndarray) -> np.ndarray:
    """Return R2, by strand, of `rest` from fading means of the sizes of earlier answers, on the last presses.

    rest, answer: (presses, strands). The means fade with MEMORY_S.
    """
    keep = np.exp(-CYCLE_S / np.array(MEMORY_S))[:, None]
    means = np.empty((len(answer), len(MEMORY_S), answer.shape[1]))
    state = np.tile(np.abs(answer).mean(axis=0), (len(MEMORY_S), 1))
    for k, size in enumerate(np.abs(answer)):
        means[k] = state  # before this press
        state = keep * state + (1 - keep) * size
    fitted = round(FITTED * len(rest))
    r2 = []
    for strand in range(rest.shape[1]):
        given = np.column_stack([means[:, :, strand], np.ones(len(rest))])
        weights, *_ = np.linalg.lstsq(given[:fitted], rest[:fitted, strand], rcond=None)
        left = rest[fitted:, strand] - given[fitted:] @ weights
        r2.append(1 - np.square(left).mean() / rest[fitted:, strand].var())
    return np.array(r2)


def place_r2(given: np.ndarray, place: np.ndarray) -> float:
    """Return R2, mean of x and y, of extra trees from `given` (presses, strands) to `place`, on the last presses."""
    fitted = round(FITTED * len(place))
    trees = ExtraTreesRegressor(**TREES).fit(given[:fitted], place[:fitted])
    left = place[fitted:] - trees.predict(given[fitted:])
    return float(np.mean(1 - np.square(left).mean(axis=0) / place[fitted:].var(axis=0)))


def effective_rank(answer: np.ndarray) -> float:
    """Return the exponential of the entropy of the eigenvalues of the strands' correlations; answer: (n, strands)."""
    share = np.maximum(np.linalg.eigvalsh(np.corrcoef(answer.T)), 1e-12) / answer.shape[1]
    return float(np.exp(-(share * np.log(share)).sum()))
