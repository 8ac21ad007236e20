"""Fit the Velostat model to recordings and write `pipeline/scenes/velostat.json`.

The recordings are those of `tactile fetch velostat_recorded`.

One parameter set for four recordings (tip pike1 at 5, 10, 20 and 40 N), fitted on repetition `exp1` and
scored on `exp2`, driven by the recorded force alone. Both logs are put on one 100 Hz grid by linear
interpolation (of force and of the log of the reading) over the time that both cover. Nothing is rejected and
nothing is left out at the start: the model starts from rest in each recording.

The fit minimises sum_i (1 - R2_i)^16 over the four recordings, so that the worst one counts most.
`reports/material/` gets the figures and the table.
"""

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.experiments import velostat_recorded
from pipeline.logs import parse, sources
from pipeline.reporting import material as report
from pipeline.reporting.figures import material as figures
from pipeline.scenes.material import FITTED, Material, log_resistance

SOURCE = "velostat_recorded"
FITTED_ON = ("pike1_force_5", "pike1_force_10", "pike1_force_20", "pike1_force_40")
OTHERS = ("pike1_force_1", "pike1_force_30", "pike1", "pike5_force_20")
DT_S = 0.01  # one step of the grid; a release takes 10 to 20 ms
POWER = 16  # of 1 - R2 in the loss
ROUNDS = 8  # of reweighting, each one a least-squares fit
LAGS_S = (-0.006, -0.003, 0.0, 0.003, 0.006)  # tried for the clock lag; a parabola gives the minimum

# name: start, lowest, highest, whether the logarithm is fitted
VARIABLES = {
    "rest": (6.6, 5, 8, False),
    "onset_n": (0.1, 0.02, 5, True),
    "exponent": (0.7, 0.2, 3, False),
    "knee": (5.0, 0.2, 20, False),
    "onset_high_n": (20.0, 3, 1000, True),
    "creep_weight": (0.5, 0, 1, False),
    "creep_time_s": (0.05, 0.005, 5, True),
    "hysteresis_width": (0.15, 0, 3, False),
    "release_gain": (0.07, 0, 1, False),
    "release_time_s": (2.0, 0.3, 100, True),
}
# Fits push it to any bound above 2; 3 keeps the law tame above the recorded 45 N.
EXPONENT_HIGH = 3.0
# Effect -> the value that turns it off, and the variables that then mean nothing.
OFF = {
    "creep": ({"creep_weight": 0.0}, ("creep_weight", "creep_time_s")),
    "hysteresis": ({"hysteresis_width": 0.0}, ("hysteresis_width",)),
    "release": ({"release_gain": 0.0}, ("release_gain", "release_time_s")),
}


@dataclasses.dataclass(frozen=True)
class Recording:
    """Force (N) and log of the reading on the 100 Hz grid, both of shape (steps,)."""

    name: str
    force: np.ndarray
    log_reading: np.ndarray


def _recorded(path: Path) -> Path:
    """Return the path of a log; InputError with the command that downloads it where it is not there."""
    if not path.is_file():
        raise InputError(f"{path}: not found; run `tactile fetch {SOURCE}` first")
    return path


def load_recording(folder: Path, name: str, repetition: int, lag_s: float) -> Recording:
    """Read one recording onto the grid; `lag_s`: how much later the reading's clock is than the load cell's."""
    file = Path(name) / f"exp_{name}_sensor1_exp{repetition}.txt"
    cell, _ = parse.read_log(_recorded(folder / "futek_data" / file), velostat_recorded.LOAD_CELL)
    taxel, _ = parse.read_log(_recorded(folder / "velostat_data" / file), velostat_recorded.VELOSTAT)
    force, force_s = cell["fz_n"].to_numpy(), cell["unix_time_s"].to_numpy()
    reading, reading_s = taxel["reading"].to_numpy(), taxel["unix_time_s"].to_numpy() - lag_s
    grid = np.arange(max(force_s[0], reading_s[0]), min(force_s[-1], reading_s[-1]), DT_S)
    log_reading = np.interp(grid, reading_s, np.log(reading))
    return Recording(name, np.interp(grid, force_s, force), log_reading)


def r_squared(measured: np.ndarray, modelled: np.ndarray) -> float:
    """Return the coefficient of determination; both (steps,)."""
    return float(1 - np.sum((measured - modelled) ** 2) / np.sum((measured - measured.mean()) ** 2))


def scores(material: Material, recordings: list[Recording]) -> list[float]:
    """Return R2 of the log reading per recording, every sample counted."""
    return [r_squared(each.log_reading, log_resistance(material, each.force, DT_S)) for each in recordings]


def build(values: Mapping[str, float]) -> Material:
    """Return the material for one value per variable of VARIABLES."""
    return Material(exponent_high=EXPONENT_HIGH, **values)


def fit(
    recordings: list[Recording],
    start: Mapping[str, float],
    free: list[str],
    rounds: int,
    evaluations: int = 25,
) -> dict[str, float]:
    """Find values of VARIABLES that minimise sum (1 - R2)^POWER, from `start`, with the names in `free` fitted.

    Each round is one least-squares fit in which recording i is weighted by (1 - R2_i)^(POWER - 1) of the
    previous round; with one recording, one round is the plain least-squares fit.
    """
    lengths = [len(recording.force) for recording in recordings]
    force = [np.pad(recording.force, (0, max(lengths) - len(recording.force))) for recording in recordings]
    force = np.stack(force, axis=1)
    measured = [recording.log_reading for recording in recordings]
    spread = np.array([np.linalg.norm(log_reading - log_reading.mean()) for log_reading in measured])
    is_log = np.array([VARIABLES[name][3] for name in free])

    def scaled(numbers: list[float]) -> np.ndarray:
        return np.where(is_log, np.log(np.where(is_log, numbers, 1)), numbers)

    low = scaled([VARIABLES[name][1] for name in free])
    high = scaled([VARIABLES[name][2] for name in free])

    def values(point: np.ndarray) -> dict[str, float]:
        natural = np.where(is_log, np.exp(np.where(is_log, point, 0)), point)
        return {**start, **dict(zip(free, natural.tolist(), strict=True))}

    def errors(point: np.ndarray) -> list[np.ndarray]:
        modelled = log_resistance(build(values(point)), force, DT_S)
        return [(measured[k] - modelled[: lengths[k], k]) / spread[k] for k in range(len(recordings))]

    weights = np.ones(len(recordings))
    point = scaled([start[name] for name in free])
    for _ in range(rounds):

        def weighted(point: np.ndarray, weights: np.ndarray = weights) -> np.ndarray:
            return np.concatenate([w * e for w, e in zip(weights, errors(point), strict=True)])

        inside = np.clip(point, low + 1e-6, high - 1e-6)
        best = least_squares(weighted, inside, bounds=(low, high), x_scale="jac", max_nfev=evaluations, diff_step=1e-4)
        point = best.x
        loss = np.array([np.sum(e**2) for e in errors(point)])
        weights = (loss / loss.mean()) ** ((POWER - 1) / 2)
    return values(point)


def clock_lag(folder: Path, start: Mapping[str, float]) -> float:
    """Fit how much later the reading's clock is than the load cell's (s), one constant fitted on exp1."""
    none, idle = OFF["hysteresis"]  # left out: hysteresis is the slowest part and does not change the result
    without, free = {**start, **none}, [name for name in VARIABLES if name not in idle]
    losses = []
    for lag in LAGS_S:
        recordings = [load_recording(folder, name, 1, lag) for name in FITTED_ON]
        values = fit(recordings, without, free, rounds=1)
        losses.append(len(recordings) - sum(scores(build(values), recordings)))
    square, linear, _ = np.polyfit(LAGS_S, losses, 2)
    if square <= 0:
        raise InputError(f"{folder}: no clock lag between the logs fits best; check the recordings")
    return float(np.clip(-linear / (2 * square), LAGS_S[0], LAGS_S[-1]))


def presses(force: np.ndarray) -> list[tuple[int, int]]:
    """Return per press the first step and the first step after it; force (steps,), N; presses last 0.3 s or more."""
    pressed = np.concatenate([[False], force > 0.4 * np.percentile(force, 97), [False]])
    starts, ends = np.flatnonzero(np.diff(pressed.astype(int))).reshape(-1, 2).T
    return [(int(s), int(e)) for s, e in zip(starts, ends, strict=True) if e - s >= 0.3 / DT_S]


def held_residuals(material: Material, recording: Recording) -> np.ndarray:
    """Return measured minus modelled log reading per press, (presses,): the mean 0.20 to 0.05 s before its end."""
    error = recording.log_reading - log_resistance(material, recording.force, DT_S)
    return np.array([error[end - 20 : end - 5].mean() for _, end in presses(recording.force)])


def place_scores(material: Material, learned: list[Recording], recordings: list[Recording]) -> list[float]:
    """Return R2 as `scores`, with one gain per press, taken from the press of the same number in `learned`."""
    result = []
    for source, recording in zip(learned, recordings, strict=True):
        gains = np.exp(-held_residuals(material, source))
        spans = presses(recording.force)
        if len(spans) != len(gains):
            raise InputError(
                f"{recording.name}: exp1 has {len(gains)} presses, exp2 {len(spans)}; check the recordings"
            )
        middles = [(end + start) // 2 for (_, end), (start, _) in zip(spans, spans[1:], strict=False)]
        number = np.searchsorted(middles, np.arange(len(recording.force)), side="right")
        modelled = log_resistance(material, recording.force, DT_S, gain=gains[number])
        result.append(r_squared(recording.log_reading, modelled))
    return result


def course(material: Material, recording: Recording) -> figures.Course:
    """Return a recording beside the model, as the figures draw it."""
    modelled = log_resistance(material, recording.force, DT_S)
    return figures.Course(
        name=recording.name,
        force_n=recording.force,
        measured=np.exp(recording.log_reading),
        modelled=np.exp(modelled),
        r_squared=r_squared(recording.log_reading, modelled),
        press_s=[start * DT_S for start, _ in presses(recording.force)],
    )


def above_after_release(recordings: list[Recording], reading: float, within_s: float) -> float:
    """Return the fraction of the samples above `reading` that come within `within_s` after a load."""
    after = total = 0
    for recording in recordings:
        step = np.arange(len(recording.force))
        loaded = np.maximum.accumulate(np.where(recording.force > 1, step, -(10**9)))
        high = np.exp(recording.log_reading) > reading
        after += np.sum(high & (step - loaded < within_s / DT_S))
        total += np.sum(high)
    return float(after / total)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add nothing to the parser of this command."""


def main(given: argparse.Namespace) -> None:
    """Fit, score, and write `velostat.json` and `reports/material/`."""
    if not sources.is_complete(SOURCE):
        raise InputError(f"data/sources/{SOURCE}: no recordings; run `tactile fetch {SOURCE}`")
    folder = sources.folder(SOURCE)
    began = time.perf_counter()

    def say(text: str) -> None:
        """Print a line of progress."""
        print(f"{time.perf_counter() - began:5.0f} s  {text}", file=sys.stderr, flush=True)

    start = {name: first for name, (first, *_) in VARIABLES.items()}
    every = list(VARIABLES)
    lag = clock_lag(folder, start)
    say(f"clock lag {1e3 * lag:.2f} ms")

    def load(name: str, repetition: int) -> Recording:
        return load_recording(folder, name, repetition, lag)

    exp1 = [load(name, 1) for name in FITTED_ON]
    exp2 = [load(name, 2) for name in FITTED_ON]
    values = fit(exp1, start, every, ROUNDS)
    material = build(values)
    say(f"one set: exp1 {np.round(scores(material, exp1), 4)}")

    ablation = {}

    def judge(label: str, judged: Material) -> None:
        """Score one fit in the ablation."""
        ablation[label] = {
            "exp1": scores(judged, exp1),
            "exp2": scores(judged, exp2),
            "exp2_places": place_scores(judged, exp1, exp2),
        }
        say(f"{label}: exp2 {np.round(ablation[label]['exp2'], 4)}")

    judge("all effects", material)
    judge("equal weights", build(fit(exp1, start, every, rounds=1, evaluations=60)))
    for effect, (none, idle) in OFF.items():
        free = [name for name in every if name not in idle]
        judge(f"without {effect}", build(fit(exp1, {**values, **none}, free, ROUNDS)))

    compared = {}
    for name in FITTED_ON + OTHERS:
        pair = [load(name, 1), load(name, 2)]
        alone = build(fit(pair[:1], values, every, rounds=1))
        compared[name] = {
            label: dict(zip(("exp1", "exp2"), scores(judged, pair), strict=True))
            for label, judged in (("one_set", material), ("own_set", alone))
        }
        exp2_scores = compared[name]["one_set"]["exp2"], compared[name]["own_set"]["exp2"]
        say(f"{name}: exp2 {exp2_scores[0]:.4f}, own set {exp2_scores[1]:.4f}")

    first, second = (
        np.concatenate([held_residuals(material, recording) for recording in recordings]) for recordings in (exp1, exp2)
    )
    residual = {
        "held_std_exp1": float(np.std(first)),
        "held_correlation_exp1_exp2": float(np.corrcoef(first, second)[0, 1]),
        "above_1300_after_release": above_after_release(exp1 + exp2, 1300, 3.0),
    }
    fitted = {"clock_lag_s": lag, "dt_s": DT_S, "fitted_on": list(FITTED_ON), "recordings": compared}
    result = {
        "source": {"name": SOURCE, "commit": sources.source(SOURCE).commit},
        "parameters": dataclasses.asdict(material),
        "fit": fitted,
        "ablation": ablation,
        "residual": residual,
    }
    FITTED.write_text(json.dumps(result, indent=1) + "\n")
    reports = paths.REPORTS / "material"
    reports.mkdir(parents=True, exist_ok=True)
    (reports / "fit.md").write_text(report.table(result))
    courses = [course(material, recording) for recording in exp2]
    figures.draw_loops(reports / "fit.png", courses)
    figures.draw_courses(reports / "courses.png", courses, DT_S)
    say(f"wrote {FITTED.name} and {reports.relative_to(paths.ROOT)}/")
