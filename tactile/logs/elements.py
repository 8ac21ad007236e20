"""Find out from frames of an array whether its elements answer where they are pressed, and whether its rest stays."""

from collections.abc import Mapping

import numpy as np
import pyarrow as pa
from scipy.optimize import linear_sum_assignment

from tactile.datasets import schemas
from tactile.logs import no_measurement, rest

BETTER = 0.2  # share of contacts that another order of the elements must explain beyond the expected one
LEAST_RIGHT = 0.6  # share of firm contacts in which the pressed element is the strongest; simulated arrays have 0.9
STUCK = 0.05  # share of the time without a press in which an element is high; simulated arrays have 0
FEW = 3  # firm contacts that tell which column answers at one place
ORDER = "row by row from the bottom row, each from left to right"


def moved_rest(frames: pa.Table, contact: np.ndarray) -> list[str]:
    """Return findings: recordings in which the array's rest takes a step; contact: (n,) whether a tip touches it."""
    condition, recording = (np.asarray(schemas.names(frames[name]), str) for name in ("condition", "recording"))
    names = np.char.add(np.char.add(condition, "/"), recording)
    readings, time, said = schemas.matrix(frames["v"]), frames["t_s"].to_numpy(), []
    for name in dict.fromkeys(names.tolist()):
        here = names == name
        if no_measurement.stuck_channels(time[here], readings[here]):
            continue  # whose level is no rest
        resting = np.flatnonzero(here & ~contact)
        if found := rest.step(readings[resting], readings[here]):
            said.append(
                f"{name}: from {time[resting[found.first]]:.1f} s of load_cell.log on, elements at rest read "
                f"{found.after:.4g} on average, before {found.before:.4g}: the sensor was re-zeroed, or its gain "
                "changed; make two recordings of it"
            )
    return said


def order_of_elements(
    frames: pa.Table, force: np.ndarray, x: np.ndarray, y: np.ndarray, settings: Mapping
) -> tuple[list[str], list[str]]:
    """Return findings and problems: whether the pressed element is the strongest in firm contacts.

    A contact is firm in a single touch with more than half the highest force. force, x, y: (n, touches).
    """
    sensor = settings["sensor"]
    rows, cols = sensor["rows"], sensor["cols"]
    firm = (np.isfinite(force).sum(axis=1) == 1) & (force[:, 0] > np.nanmax(force[:, 0]) / 2)
    if not firm.any() or rows * cols == 1:
        return [], []
    counts = schemas.matrix(frames["v"]).astype(float)
    response = counts[firm] - np.median(counts, axis=0)
    at_row = np.clip(y[firm, 0] // sensor["pitch_mm"], 0, rows - 1).astype(int)
    at_col = np.clip(x[firm, 0] // sensor["pitch_mm"], 0, cols - 1).astype(int)
    pressed, strongest = at_row * cols + at_col, response.argmax(axis=1)
    row, col = np.divmod(np.arange(rows * cols), cols)
    orders = {  # column that is printed for each element
        ORDER: row * cols + col,
        "row by row from the top row, each from left to right": (rows - 1 - row) * cols + col,
        "row by row from the bottom row, each from right to left": row * cols + cols - 1 - col,
        "row by row from the top row, each from right to left": (rows - 1 - row) * cols + cols - 1 - col,
        "column by column from the left, each from the bottom": col * rows + row,
        "in another order": strongest_columns(response, pressed),
    }
    right = {name: float(np.mean(order[pressed] == strongest)) for name, order in orders.items()}
    said = [f"the pressed element is the strongest in {100 * right[ORDER]:.0f} % of firm contacts"]
    best = max(right, key=right.__getitem__)  # the first of those that are equal, which has a name in words
    printed = np.array(sensor.get("order") or range(rows * cols))
    if right[best] >= right[ORDER] + BETTER:
        return said, [
            f"v0, v1, ... seem to be printed {best} (the pressed element would be the strongest in "
            f"{100 * right[best]:.0f} %, not {100 * right[ORDER]:.0f} % of firm contacts); set touch.sensor.order: "
            f"{printed[orders[best]].tolist()}, or put the CNC's zero at the bottom left corner"
        ]
    if right[ORDER] < LEAST_RIGHT:
        return said, [
            f"the pressed element is the strongest in {100 * right[ORDER]:.0f} % of firm contacts, and no order of the "
            "elements explains many more: check the wiring, x_mm and y_mm of cnc.log, and touch.sensor.pitch_mm"
        ]
    answers = orders["in another order"]
    if moved := [k for k in range(rows * cols) if is_elsewhere(k, answers, pressed, strongest)]:
        exchanged = set(moved)
        for k in moved:  # and the elements that were not pressed, whose columns they have
            while (k := answers[k]) not in exchanged and (pressed == k).sum() < FEW:
                exchanged.add(k)
        idle = ~(np.nansum(force, axis=1) > settings["window"]["contact_threshold_n"])
        above = counts > (counts.min() + counts.max()) / 2  # of all: what hardly moves is not stuck high
        stuck = [k for k in sorted({*moved, *answers[moved]}) if np.mean(above[idle, k]) > STUCK]
        of = schemas.names(frames["condition"])[firm] + "/" + schemas.names(frames["recording"])[firm]
        unlike = [
            (k, name)
            for k in moved
            for name in np.unique(of[pressed == k])
            if np.mean(strongest[(pressed == k) & (of == name)] == answers[k]) < LEAST_RIGHT
        ]
        if stuck:
            high = ", ".join(f"v{printed[k]}" for k in stuck)
            return said, [
                f"{high} is high in {100 * np.mean(above[idle][:, stuck]):.0f} % of the time without a press, so that "
                "it is stronger than the pressed element: it is stuck; check its wiring and record again"
            ]
        if unlike or not exchanged.issuperset(answers[sorted(exchanged)]):
            names = ", ".join(f"v{printed[k]}" for k in moved)
            where = f", but not in {unlike[0][1]}" if unlike else ""
            return said, [
                f"another element is the strongest where {names} should be{where}, and no one order mends that: "
                "elements were exchanged in some recordings only, or one is stuck; check the wiring and record again"
            ]
        moved, order = sorted(exchanged), printed.copy()
        order[moved] = printed[answers[moved]]
        names = ", ".join(f"v{printed[k]}" for k in moved)
        return said, [
            f"{names} seem to have changed places: where one is pressed, another of them is the strongest; set "
            f"touch.sensor.order: {order.tolist()}"
        ]
    return said, []


def strongest_columns(response: np.ndarray, pressed: np.ndarray) -> np.ndarray:
    """Return for each element the column that answers where it is pressed, each column once, (elements,).

    response: (contacts, elements) in counts above rest; pressed: (contacts,) number of the element under the tip. An
    element that was not pressed keeps its column, where that is left.
    """
    answers = response / np.maximum(response.max(axis=0), 1)
    means = np.zeros((response.shape[1],) * 2)
    for element in np.unique(pressed):
        means[element] = answers[pressed == element].mean(axis=0)
    return linear_sum_assignment(means + 1e-6 * np.eye(len(means)), maximize=True)[1]


def is_elsewhere(element: int, order: np.ndarray, pressed: np.ndarray, strongest: np.ndarray) -> bool:
    """Tell whether another column than an element's own is mostly the strongest where the element is pressed."""
    here = strongest[pressed == element]
    return order[element] != element and len(here) >= FEW and np.mean(here == order[element]) >= LEAST_RIGHT
