"""Say how the conductance of the recorded Velostat taxel drifts from press to press, for figure 8 of the glove.

The recorder presses 16 places of a taxel once each, in the same order in every recording: number and place of a press
cannot be told apart within a recording. A press is therefore compared with the press of the same place in the other
recordings of the same tip and force, which is 16 presses later in the next of these. Forces repeat to some percent:
the conductance is brought to the same force by one exponent, fitted to how both differ from recording to recording.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pipeline.datasets import schemas, windowing
from pipeline.reporting.words.markdown import interval, number
from pipeline.scoring.results import Estimate, estimate

TIP = "pike1"  # the other tip presses half of its places beside the taxel
PLACES = 16
PRESSED = 0.4  # of the 97th percentile of the force
HELD_S = (0.3, 0.6)  # since 90 % of a press's force were reached: the same part of the creep in every press
SAME_FORCE = 1.1  # a recording with a larger ratio to the next lower force is of another force
CYCLES = 600  # of the paper


class Repeated(NamedTuple):
    """Presses of the recordings of one force, in the order of time: (recordings, PLACES) each, and how long they took.

    conductance: 1 / reading, for the recorder prints a resistance in a unit of its own.
    """

    force_n: np.ndarray
    conductance: np.ndarray
    minutes: float


def read(path: Path) -> list[Repeated]:
    """Return the presses of TIP from the frames of velostat_recorded by rising force; none where there are no frames.

    A recording counts with PLACES whole presses; two or more of one force are needed.
    """
    table = schemas.read(path)
    names, time_s = schemas.names(table["recording"]), table["t_s"].to_numpy()
    force_n, reading = (schemas.matrix(table[column])[:, 0].astype(float) for column in ("force_n", "v"))
    rasters = []
    for name in sorted(set(names)):
        rows = np.flatnonzero(names == name)
        pressed = presses(time_s[rows], force_n[rows], 1 / reading[rows])
        if name.split("/")[0].split("_")[0] == TIP and len(pressed) == PLACES:
            force, conductance = np.transpose(pressed)
            rasters.append((np.median(force), time_s[rows], force, conductance))
    rasters.sort(key=lambda raster: raster[0])
    groups: list[list] = []
    for raster in rasters:
        if not groups or raster[0] > SAME_FORCE * groups[-1][-1][0]:
            groups.append([])
        groups[-1].append(raster)
    result = []
    for group in groups:
        group.sort(key=lambda raster: raster[1][0])
        minutes = (group[-1][1][-1] - group[0][1][0]) / 60
        if len(group) > 1:
            result.append(Repeated(*(np.array([raster[k] for raster in group]) for k in (2, 3)), minutes))
    return result


def presses(time_s: np.ndarray, force_n: np.ndarray, conductance: np.ndarray) -> list[tuple[float, float]]:
    """Return force (N) and conductance held in each press; all of (samples,).

    The mean of the force, and of the conductance's logarithm, over HELD_S. A press that is shorter, or that began
    before the recording, is left out.
    """
    threshold = PRESSED * np.percentile(force_n, 97)
    press, above = windowing.presses(force_n, time_s, threshold), force_n > threshold
    result = []
    for k in range(press[-1] + 1):
        on = np.flatnonzero((press == k) & above)
        if not len(on) or on[0] == 0:
            continue
        reached = on[force_n[on] >= 0.9 * np.percentile(force_n[on], 90)][0]
        since = time_s[on] - time_s[reached]
        if since[-1] >= HELD_S[1]:
            held = on[(since >= HELD_S[0]) & (since <= HELD_S[1])]
            result.append((force_n[held].mean(), np.exp(np.log(conductance[held]).mean())))
    return result


def changes(repeated: Sequence[Repeated]) -> tuple[list[np.ndarray], float]:
    """Return, by force, how places changed since the first recording, and the exponent of the force.

    A change is of the log conductance, brought to the same force: (recordings, PLACES), 0 in the first recording.
    """
    logs = [(np.log(each.force_n), np.log(each.conductance)) for each in repeated]
    force, conductance = (np.concatenate([apart(pair[k]).ravel() for pair in logs]) for k in (0, 1))
    exponent = float(force @ conductance / (force @ force))
    same_force = [conductance - exponent * force for force, conductance in logs]
    return [each - each[0] for each in same_force], exponent


def apart(values: np.ndarray) -> np.ndarray:
    """Return (recordings, places) less the means of recordings and of places."""
    return values - values.mean(axis=1, keepdims=True) - values.mean(axis=0) + values.mean()


def percent(change: np.ndarray) -> np.ndarray:
    """Return a change of a logarithm in percent."""
    return 100 * np.expm1(change)


def drift(repeated: Sequence[Repeated]) -> Estimate:
    """Return by how many percent the conductance of a place changes at the same force from one press to the next."""
    courses = [percent(each).mean(axis=1) for each in changes(repeated)[0]]
    return estimate([np.polyfit(np.arange(len(course)), course, 1)[0] for course in courses])


def findings(repeated: Sequence[Repeated]) -> str:
    """Return the sentence of the report on the recorded taxel."""
    if not repeated:
        return (
            "- Figure 8 has the scene's part only: the recordings of a Velostat taxel are not downloaded "
            "(`tactile fetch velostat_recorded`)."
        )
    change, exponent = changes(repeated)
    courses = [percent(each).mean(axis=1) for each in change]
    parts = [
        f"{number(np.median(each.force_n), 0)} N {number(course[-1])} % ({each.force_n.size} presses in "
        f"{number(each.minutes, 0)} min)"
        for each, course in zip(repeated, courses, strict=True)
    ]
    shift = drift(repeated)
    lowest, highest = min(each.force_n.min() for each in repeated), max(each.force_n.max() for each in repeated)
    return (
        f"- Figure 8, recorded: a Velostat taxel, another sensor than the glove's, under {number(lowest, 1)} to "
        f"{number(highest, 1)} N (the paper: 0 to 1 N). {PLACES} presses later, the conductance held at the same place "
        f"has changed by {interval(shift)} % at the same force (mean and interval over {len(repeated)} forces). From "
        f"the first recording to the last: {', '.join(parts)}; pauses and presses of other forces lie between. There "
        f"are at most {max(each.force_n.size for each in repeated)} presses of one force where the paper has {CYCLES} "
        f"cycles, so fatigue cannot be told. Number and place of a press go together within a recording: each place is "
        f"compared with itself in the other recordings, and brought to the same force by the exponent "
        f"{number(exponent)}, fitted to all of them."
    )


def panels(repeated: Sequence[Repeated]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return force -> conductance held and change of the same place in percent, (recordings, PLACES), for figure 8."""
    if not repeated:
        return {}
    return {
        f"{number(np.median(each.force_n), 0)} N": (each.conductance, percent(change))
        for each, change in zip(repeated, changes(repeated)[0], strict=True)
    }
