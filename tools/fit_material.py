"""Fit the Velostat model to recordings and write `pipeline/scenes/velostat.json`.

The recordings are those of `tactile fetch velostat_recorded`.

One parameter set for four recordings (tip pike1 at 5, 10, 20 and 40 N), fitted on repetition `exp1` and
scored on `exp2`, driven by the recorded force. Both logs are put on one 100 Hz grid by linear
interpolation (of force and of the log of the reading) over the time that both cover. Nothing is rejected and
nothing is left out at the start: the model starts from rest in each recording.

Places. A recording is 16 presses, each at another place of the taxel: the recorder's program
(`sensor_point_load` in src/scripts/ur5e.py of the source's repository) goes through the 4 x 4 middles of a raster on
13 x 15 mm, row by row. Force alone cannot say where the tip is, so every place has a gain and an exponent of its own,
the same in all four recordings, fitted with the parameters; their mean is that of the model.

Slow creep. Most presses are held for 1.5 s, in which force and places explain as much without it: its weight then falls
to 0. Weight and time constant are therefore fitted where it can be seen, on the courses (not the levels) of all holds
of more than 3 s, three presses, one of them of exp1; of the other two presses exp2 is not held back. All other
parameters are fitted once without it and once more with it.

The fit minimises the sum of 1 - R2 over the four recordings. `reports/material/` gets the figures and the table.
"""

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from pipeline.reporting import texts
from pipeline.scenes.material import FITTED, Material, log_resistance
from tactile.base import arguments, params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.experiments import velostat_recorded
from tactile.experiments.velostat_recorded import RASTER, STEP_MM
from tactile.logs import layout, parse, sources
from tools import material_figures as figures

SOURCE = "velostat_recorded"
FITTED_ON = ("pike1_force_5", "pike1_force_10", "pike1_force_20", "pike1_force_40")
OTHERS = ("pike1_force_30", "pike1", "pike1_force_1", "pike5_force_20")
SAME_PLACES = (*FITTED_ON, "pike1_force_30", "pike1")  # recorded with the same tip at the same places
DT_S = 0.01  # one step of the grid; a release takes 10 to 20 ms
LAGS_S = (-0.006, -0.003, 0.0, 0.003, 0.006)  # tried for the clock lag; a parabola gives the minimum
LONG_S = 3.0  # a longer hold shows slow creep
SETTLED_S = 1.0  # from when a press began, until the force stays the same
PRIOR = 0.02  # weight that holds places without information together; 1 - R2 of a recording is about 0.005

# name: start, lowest, highest, whether the logarithm is fitted
VARIABLES = {
    "rest": (6.6, 5, 8, False),
    "onset_n": (0.12, 0.005, 5, True),
    "exponent": (0.8, 0.2, 3, False),
    "contact_weight": (0.5, 0, 1, False),
    "contact_time_s": (0.03, 0.002, 0.1, True),
    "creep_weight": (0.1, 0, 1, False),
    "creep_time_s": (0.3, 0.1, 3, True),
    "slow_weight": (0.05, 0, 1, False),
    "slow_time_s": (9.0, 2, 60, True),
    "hysteresis_width": (0.1, 0, 3, False),
    "release_gain": (0.07, 0, 1, False),
    "release_time_s": (2.0, 0.3, 100, True),
}
# Effect -> the values that turn it off, and the variables that then mean nothing.
OFF = {
    "creep": (
        {"contact_weight": 0.0, "creep_weight": 0.0},
        ("contact_weight", "contact_time_s", "creep_weight", "creep_time_s"),
    ),
    "slow_creep": ({"slow_weight": 0.0}, ("slow_weight", "slow_time_s")),
    "hysteresis": ({"hysteresis_width": 0.0}, ("hysteresis_width",)),
    "release": ({"release_gain": 0.0}, ("release_gain", "release_time_s")),
}


@dataclasses.dataclass(frozen=True)
class Recording:
    """Force (N), log of the reading and number of the press on the 100 Hz grid, all of shape (steps,)."""

    name: str
    force: np.ndarray
    log_reading: np.ndarray
    press: np.ndarray


SLOW = ("slow_weight", "slow_time_s")


class Fit(NamedTuple):
    """Fitted values of VARIABLES, and log gain and exponent of each place, (places,)."""

    values: dict[str, float]
    log_gain: np.ndarray
    exponent: np.ndarray


def load_recording(folder: Path, settings: Mapping, name: str, repetition: int, lag_s: float) -> Recording:
    """Read one recording onto the grid.

    settings: the block of SOURCE; lag_s: how much later the reading's clock is than the load cell's.
    """
    files = velostat_recorded.logs(folder / "velostat_data" / name / f"exp_{name}_sensor1_exp{repetition}.txt")
    rows = {
        log: parse.read_log(files[log], fmt, layout=layout.of(settings["ingest"], log))[0]
        for log, fmt in velostat_recorded.formats(settings).items()
    }
    (reading, reading_s), (force, force_s) = (
        (rows[log][column].to_numpy(), rows[log]["t_us"].to_numpy() / 1e6)
        for log, column in (("array.log", "v0"), ("load_cell.log", "fz_n"))
    )
    reading_s = reading_s - lag_s
    grid = np.arange(max(force_s[0], reading_s[0]), min(force_s[-1], reading_s[-1]), DT_S)
    force = np.interp(grid, force_s, force)
    spans = presses(force)
    middles = [(end + start) // 2 for (_, end), (start, _) in zip(spans, spans[1:], strict=False)]
    number = np.searchsorted(middles, np.arange(len(force)), side="right")
    return Recording(name, force, np.interp(grid, reading_s, np.log(reading)), number)


def presses(force: np.ndarray) -> list[tuple[int, int]]:
    """Return per press the first step and the first step after it; force (steps,), N; presses last 0.3 s or more."""
    pressed = np.concatenate([[False], force > 0.4 * np.percentile(force, 97), [False]])
    starts, ends = np.flatnonzero(np.diff(pressed.astype(int))).reshape(-1, 2).T
    return [(int(s), int(e)) for s, e in zip(starts, ends, strict=True) if e - s >= 0.3 / DT_S]


def r_squared(measured: np.ndarray, modelled: np.ndarray) -> float:
    """Return the coefficient of determination; both (steps,)."""
    return float(1 - np.sum((measured - modelled) ** 2) / np.sum((measured - measured.mean()) ** 2))


def modelled(fitted: Fit, recording: Recording, places: bool = True) -> np.ndarray:
    """Return the modelled log reading of a recording, (steps,), from its force and, with `places`, where it is pressed.

    Raises InputError where the recording has other places than the fit.
    """
    material = Material(**fitted.values)
    if not places:
        return log_resistance(material, recording.force, DT_S)
    if recording.press.max() >= len(fitted.log_gain):
        raise InputError(
            f"{recording.name}: {recording.press.max() + 1} presses, not {len(fitted.log_gain)}; check the recordings"
        )
    gain, exponent = np.exp(fitted.log_gain)[recording.press], fitted.exponent[recording.press]
    return log_resistance(material, recording.force, DT_S, gain=gain, exponent=exponent)


def scores(fitted: Fit, recordings: list[Recording], places: bool = True) -> list[float]:
    """Return R2 of the log reading per recording, every sample counted; `places` as for `modelled`."""
    return [r_squared(each.log_reading, modelled(fitted, each, places)) for each in recordings]


def fit(
    recordings: list[Recording],
    start: Mapping[str, float],
    free: list[str],
    *,
    exponents: bool = True,
    evaluations: int = 40,
) -> Fit:
    """Minimise the sum of 1 - R2 of `recordings`, from `start`, over the names in `free` and what places differ in.

    Places: a gain for each press number, and with `exponents` an exponent. A weak pull of all of them towards their
    mean (PRIOR) settles what the recordings leave open.
    """
    lengths = [len(recording.force) for recording in recordings]
    longest = max(lengths)
    force = np.stack([np.pad(each.force, (0, longest - len(each.force))) for each in recordings], axis=1)
    place = np.stack([np.pad(each.press, (0, longest - len(each.press)), "edge") for each in recordings], axis=1)
    count = int(place.max()) + 1
    spread = [np.linalg.norm(each.log_reading - each.log_reading.mean()) for each in recordings]
    is_log = np.array([VARIABLES[name][3] for name in free])

    def scaled(numbers: list[float]) -> np.ndarray:
        return np.where(is_log, np.log(np.where(is_log, numbers, 1)), numbers)

    def fitted(point: np.ndarray) -> Fit:
        variables, log_gain, exponent = np.split(point, [len(free), len(free) + count])
        natural = np.where(is_log, np.exp(np.where(is_log, variables, 0)), variables)
        exponent = 1 + exponent - exponent.mean() if exponents else np.ones(count)
        values = {**start, **dict(zip(free, natural.tolist(), strict=True))}
        return Fit(values, log_gain - log_gain.mean(), exponent)

    def errors(point: np.ndarray) -> np.ndarray:
        values, log_gain, exponent = fitted(point)
        result = log_resistance(Material(**values), force, DT_S, gain=np.exp(log_gain)[place], exponent=exponent[place])
        misses = [
            (each.log_reading - result[:length, k]) / size
            for k, (each, length, size) in enumerate(zip(recordings, lengths, spread, strict=True))
        ]
        return np.concatenate([*misses, PRIOR * point[len(free) :] / np.sqrt(count)])

    others = count * (2 if exponents else 1)
    low = np.concatenate([scaled([VARIABLES[name][1] for name in free]), np.full(others, -5.0)])
    high = np.concatenate([scaled([VARIABLES[name][2] for name in free]), np.full(others, 5.0)])
    point = np.concatenate([scaled([start[name] for name in free]), np.zeros(others)])
    inside = np.clip(point, low + 1e-6, high - 1e-6)
    best = least_squares(errors, inside, bounds=(low, high), x_scale="jac", max_nfev=evaluations, diff_step=1e-4)
    return fitted(best.x)


def lowest_of_parabola(at: np.ndarray, losses: list[float], what: str) -> float:
    """Return where a parabola through the losses is lowest; InputError where that is not inside `at`."""
    square, linear, _ = np.polyfit(at, losses, 2)
    lowest = -linear / (2 * square) if square > 0 else np.nan
    if not min(at) < lowest < max(at):
        raise InputError(f"{what} does not show in the recordings: no value inside {list(at)} fits best")
    return float(lowest)


def clock_lag(folder: Path, settings: Mapping, start: Mapping[str, float]) -> float:
    """Fit how much later the reading's clock is than the load cell's (s), one constant fitted on exp1."""
    none, idle = OFF["hysteresis"]  # left out: hysteresis is the slowest part and does not change the result
    without, free = {**start, **none, "slow_weight": 0.0}, [name for name in VARIABLES if name not in (*idle, *SLOW)]
    losses = []
    for lag in LAGS_S:
        recordings = [load_recording(folder, settings, name, 1, lag) for name in FITTED_ON]
        losses.append(-sum(scores(fit(recordings, without, free, exponents=False), recordings)))
    return lowest_of_parabola(np.array(LAGS_S), losses, "the clock lag")


def holds(recordings: list[Recording]) -> list[tuple[Recording, slice]]:
    """Return every hold of more than LONG_S with its recording, from SETTLED_S after the press began."""
    long = []
    for recording in recordings:
        for first, stop in presses(recording.force):
            if stop - first > LONG_S / DT_S:
                long.append((recording, slice(first + round(SETTLED_S / DT_S), stop - round(0.1 / DT_S))))
    return long


def hold_errors(fitted: Fit, long: list[tuple[Recording, slice]]) -> list[np.ndarray]:
    """Return the error of the log reading's course in each hold, (steps,) each, of mean 0."""
    errors = [(recording.log_reading - modelled(fitted, recording))[hold] for recording, hold in long]
    return [error - error.mean() for error in errors]


def with_slow_creep(fitted: Fit, long: list[tuple[Recording, slice]]) -> Fit:
    """Return the fit with weight and time constant of the slow creep fitted to the courses of the holds."""

    def changed(point: np.ndarray) -> Fit:
        return fitted._replace(values={**fitted.values, SLOW[0]: float(point[0]), SLOW[1]: float(np.exp(point[1]))})

    def errors(point: np.ndarray) -> np.ndarray:
        return np.concatenate([error / np.sqrt(len(error)) for error in hold_errors(changed(point), long)])

    (first, low, high, _), (time_s, shortest, longest, _) = (VARIABLES[name] for name in SLOW)
    bounds = (low, np.log(shortest)), (high, np.log(longest))
    return changed(least_squares(errors, (first, np.log(time_s)), bounds=bounds, diff_step=1e-4).x)


def bounded(values: Mapping[str, float]) -> list[str]:
    """Return the names of the values within a thousandth of the range of VARIABLES of one of its ends."""
    names = []
    for name, (_, low, high, is_log) in VARIABLES.items():
        part = np.log(values[name] / low) / np.log(high / low) if is_log else (values[name] - low) / (high - low)
        if not 1e-3 < part < 1 - 1e-3:
            names.append(name)
    return names


def neighbour_correlation(log_gain: np.ndarray) -> float:
    """Return the mean product of neighbours on the raster over the variance of all; log_gain (places,), mean 0."""
    raster = log_gain.reshape(RASTER)
    pairs = np.concatenate([(raster[1:] * raster[:-1]).ravel(), (raster[:, 1:] * raster[:, :-1]).ravel()])
    return float(pairs.mean() / raster.var())


def course(fitted: Fit, recording: Recording) -> figures.Course:
    """Return a recording beside the model, as the figures draw it."""
    result = modelled(fitted, recording)
    return figures.Course(
        name=recording.name,
        force_n=recording.force,
        measured=np.exp(recording.log_reading),
        modelled=np.exp(result),
        r_squared=r_squared(recording.log_reading, result),
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


def table(result: Mapping) -> str:
    """Return the report `fit.md`; result: the content of `velostat.json`, which the report rounds."""
    places = {key: np.reshape(result["places"][key], (4, 4)).tolist() for key in ("log_gain", "exponent")}
    ablation = {
        name: [summary(scores[key]) for key in ("exp1", "exp2") for summary in (min, np.mean)]
        for name, scores in result["ablation"].items()
    }
    return texts.render("material", result=result, fitted=result["fit"], grid=places, ablation=ablation)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Fit, score, and write `velostat.json` and `reports/material/`."""
    if not sources.is_complete(workspace, SOURCE):
        raise InputError(f"data/sources/{SOURCE}: no recordings; run `tactile fetch {SOURCE}`")
    folder, settings = sources.folder(workspace, SOURCE), params.load(workspace.params)[SOURCE]
    began = time.perf_counter()

    def say(text: str) -> None:
        """Print a line of progress."""
        print(f"{time.perf_counter() - began:5.0f} s  {text}", file=sys.stderr, flush=True)

    start = {name: first for name, (first, *_) in VARIABLES.items()}
    lag = clock_lag(folder, settings, start)
    say(f"clock lag {1e3 * lag:.2f} ms")

    def load(name: str, repetition: int) -> Recording:
        return load_recording(folder, settings, name, repetition, lag)

    exp1 = [load(name, 1) for name in FITTED_ON]
    exp2 = [load(name, 2) for name in FITTED_ON]
    long, free = holds(exp1 + exp2), [name for name in VARIABLES if name not in SLOW]
    without = fit(exp1, {**start, "slow_weight": 0.0}, free)
    slow = {name: with_slow_creep(without, long).values[name] for name in SLOW}
    say(f"slow creep {slow}")
    best = fit(exp1, {**without.values, **slow}, free)
    if stuck := bounded(best.values):
        raise InputError(f"{', '.join(stuck)}: fitted to an end of the range in VARIABLES; change the model")
    say(f"one set: exp1 {np.round(scores(best, exp1), 4)}")

    ablation = {}

    def judge(label: str, judged: Fit, places: bool = True) -> None:
        """Score one fit in the ablation."""
        ablation[label] = {"exp1": scores(judged, exp1, places), "exp2": scores(judged, exp2, places)}
        say(f"{label}: exp2 {np.round(ablation[label]['exp2'], 4)}")

    judge("all effects", best)
    for effect, (none, idle) in OFF.items():
        refitted = [name for name in free if name not in idle]
        judge(f"without {effect}", fit(exp1, {**best.values, **none}, refitted))
    judge("places with gains only", fit(exp1, best.values, free, exponents=False))
    judge("force alone", best, places=False)

    compared = {}
    for name in FITTED_ON + OTHERS:
        pair = [load(name, 1), load(name, 2)]
        compared[name] = {"force": scores(best, pair, places=False)}
        compared[name]["places"] = [
            scores(best, [each])[0] if name in SAME_PLACES and each.press.max() + 1 == len(best.log_gain) else None
            for each in pair
        ]
        say(f"{name}: {compared[name]}")

    result = {
        "source": {"name": SOURCE, "commit": velostat_recorded.FACTS.source.commit},
        "parameters": best.values,
        "places": {
            "gain_std": float(best.log_gain.std()),
            "exponent_std": float(best.exponent.std()),
            "neighbour_correlation": neighbour_correlation(best.log_gain),
            "raster": list(RASTER),
            "step_mm": list(STEP_MM),
            "log_gain": best.log_gain.tolist(),
            "exponent": best.exponent.tolist(),
        },
        "fit": {
            "clock_lag_s": lag,
            "dt_s": DT_S,
            "fitted_on": list(FITTED_ON),
            "holds": [
                {
                    "recording": recording.name,
                    "seconds": (hold.stop - hold.start) * DT_S,
                    "creep": float(recording.log_reading[hold][:20].mean() - recording.log_reading[hold][-20:].mean()),
                    "rms": float(np.std(error)),
                    "rms_without": float(np.std(error_without)),
                }
                for (recording, hold), error, error_without in zip(
                    long, hold_errors(best, long), hold_errors(without, long), strict=True
                )
            ],
            "residual_rms": [float(np.std(each.log_reading - modelled(best, each))) for each in exp2],
            "recordings": compared,
        },
        "ablation": ablation,
        "above_1300_after_release": above_after_release(exp1 + exp2, 1300, 3.0),
    }
    FITTED.write_text(json.dumps(result, indent=1) + "\n")
    reports = workspace.reports / "material"
    reports.mkdir(parents=True, exist_ok=True)
    (reports / "fit.md").write_text(table(result))
    courses = [course(best, recording) for recording in exp2]
    figures.draw_loops(reports / "fit.png", courses, DT_S)
    figures.draw_courses(reports / "courses.png", courses, DT_S)
    say(f"wrote {FITTED.name} and {reports.relative_to(workspace.root)}/")


if __name__ == "__main__":
    arguments.run_tool(__doc__, main)
