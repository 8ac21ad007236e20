"""Cut frames into windows, the inputs of the models of touch.

A window is `frames` frames, `frame_step` apart, of one press; it never spans a gap or a reset of the device. There are
two kinds, and a window may be of both: `apart` windows start every `stride` frames, `sliding` windows one step after
another, so that neighbours overlap.
"""

from collections.abc import Mapping

import numpy as np
import pyarrow as pa

from tactile.base.errors import InputError
from tactile.datasets import schemas

BRIEF_S = 0.1  # contacts closer than this are one press (the finger bounced, or a frame was lost)


def presses(total_force_n: np.ndarray, t_s: np.ndarray, threshold_n: float) -> np.ndarray:
    """Return the number of the press that each frame of a recording belongs to, (n,) from 0.

    total_force_n: force of all touches, t_s: time, both (n,) in the order of time. A press is a stretch above
    the threshold with the rest around it: the border between two presses lies in the middle of the rest.
    """
    edges = np.diff(np.concatenate([[0], (total_force_n > threshold_n).astype(np.int8), [0]]))
    starts, stops = t_s[np.flatnonzero(edges == 1)], t_s[np.flatnonzero(edges == -1) - 1]
    apart = starts[1:] - stops[:-1] > BRIEF_S
    borders = (stops[:-1][apart] + starts[1:][apart]) / 2
    return np.searchsorted(borders, t_s, side="right")


def window_rows(run: np.ndarray, frames: int, frame_step: int, stride: int) -> np.ndarray:
    """Return the frame numbers of every window, (windows, frames).

    run: (n,) a number that is the same for frames which follow one another without a gap in one press.
    Windows start every `stride` frames from the start of each run.
    """
    span = (frames - 1) * frame_step + 1
    edges = np.flatnonzero(np.diff(run)) + 1
    starts = [
        np.arange(first, stop - span + 1, stride) for first, stop in zip([0, *edges], [*edges, len(run)], strict=True)
    ]
    return np.concatenate(starts)[:, None] + np.arange(frames) * frame_step


def previous_windows(rows: np.ndarray, run: np.ndarray, frame_step: int) -> np.ndarray:
    """Return per window the number of the window that ends `frame_step` before its first frame, or -1, (windows,).

    rows: (windows, frames) frame numbers, rising; run: as for `window_rows`.
    """
    wanted = rows[:, 0] - frame_step
    before = np.minimum(np.searchsorted(rows[:, -1], wanted), len(rows) - 1)
    ends_there = (rows[before, -1] == wanted) & (run[rows[before, -1]] == run[rows[:, 0]])
    return np.where(ends_there, before, -1)


def stretches(windows: np.ndarray, size: int, share: float) -> np.ndarray:
    """Return a share of windows (n,) in the order of time: whole stretches of `size`, evenly spread over them.

    Of fewer windows drawn one by one, few would overlap: two windows of a stretch of as many as a window has frames do.
    """
    stretch = np.arange(len(windows)) // size
    return windows[np.floor((stretch + 1) * share) > np.floor(stretch * share)]


def windows_table(frames: pa.Table, rows: np.ndarray, press: np.ndarray, previous: np.ndarray) -> pa.Table:
    """Return the windows table: the columns of the last frame, its press, `previous`, and x.

    x is (frames * elements,) per window, frame-major. frames: a table of the schema `schemas.frames`; rows: (windows,
    frames) frame numbers; press: (n,) of each frame; previous: (windows,), as `previous_windows` returns it.
    """
    last = rows[:, -1]
    table = frames.drop_columns(["v", "gap_before"]).take(pa.array(last))
    table = table.add_column(2, "press", pa.array(press[last].astype(np.int32)))
    table = table.add_column(3, "previous", pa.array(previous.astype(np.int32)))
    kind = frames.schema.field("v").type
    x = schemas.matrix(frames["v"])[rows].reshape(len(rows), rows.shape[1] * kind.list_size)
    return table.append_column("x", schemas.lists(x, kind.value_type)).combine_chunks()


def windows_of(frames: pa.Table, settings: Mapping) -> pa.Table:
    """Cut a frames table into windows; settings: `<experiment>.window`. Returns a table as `windows_table`.

    Columns `apart` and `sliding` say of which kind a window is; `sliding` windows are made of the conditions and to the
    shares that the setting of this name gives, if it is there. Without a threshold of contact each frame is a press.
    Labels belong to a window's last frame, so all other columns are of that frame. Raises InputError if no frame is
    part of a window.
    """
    if frames.num_rows == 0:
        none = windows_table(frames, np.zeros((0, settings["frames"]), int), *np.zeros((2, 0), int))
        return _with_kinds(none, *np.zeros((2, 0), bool))
    codes = [frames[name].combine_chunks().indices.to_numpy() for name in ("condition", "recording")]
    changes = np.any([np.diff(code) != 0 for code in codes], axis=0)
    recording = np.cumsum(np.concatenate([[0], changes]))
    t_s = frames["t_s"].to_numpy()
    press = np.arange(len(t_s))
    if "contact_threshold_n" in settings:
        force = np.nansum(schemas.matrix(frames["force_n"]), axis=1)
        first = 0
        for number in range(recording[-1] + 1):
            inside = recording == number
            press[inside] = first + presses(force[inside], t_s[inside], settings["contact_threshold_n"])
            first = press[inside].max() + 1
    run = np.cumsum(frames["gap_before"].to_numpy()) + press * (len(t_s) + 1)
    size, step = settings["frames"], settings["frame_step"]
    apart = window_rows(run, size, step, settings["stride"])[:, 0]
    if not len(apart):
        raise InputError(f"no window of {size} frames fits into any press; record more slowly or lower window.frames")
    sliding, condition = [], schemas.names(frames["condition"])
    for name, share in settings.get("sliding", {}).items():
        all_of_it = window_rows(run, size, step, step)[:, 0]
        sliding.append(stretches(all_of_it[condition[all_of_it] == name], size, share))
    starts = np.unique(np.concatenate([apart, *sliding]))
    rows = starts[:, None] + np.arange(size) * step
    table = windows_table(frames, rows, press, previous_windows(rows, run, step))
    return _with_kinds(table, np.isin(starts, apart), np.isin(starts, np.concatenate([[-1], *sliding])))


def _with_kinds(table: pa.Table, apart: np.ndarray, sliding: np.ndarray) -> pa.Table:
    """Return the windows table with the columns `apart` and `sliding`, (windows,) bool."""
    return table.append_column("apart", pa.array(apart)).append_column("sliding", pa.array(sliding))
