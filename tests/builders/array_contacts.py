"""Make readings of an array under one contact or two, of which every effect is known."""

from pathlib import Path

import numpy as np
import pyarrow as pa

from tactile.datasets import schemas

COUNTS = 400.0  # under a contact of size 1
SCENE = (5, 5), 12.0  # rows and columns, and the pitch in mm
EXPONENT = 0.5  # of the reading in the size


def places(n, shape, pitch_mm, rng, fixed=False):
    """Places (n, 2, 2) in mm near middles of elements, every third frame of one contact; pairs 30 mm apart or more."""
    middle = rng.integers(0, shape, (4 * n, 2, 2)) + 0.5
    off = rng.choice([-0.125, 0.125], middle.shape) if fixed else rng.uniform(-0.2, 0.2, middle.shape)
    for line in (0, 1):  # a share of pairs on one row, and on one column
        middle[line::8, 1, line] = middle[line::8, 0, line]
    made = (middle + off) * pitch_mm
    made = made[np.linalg.norm(made[:, 0] - made[:, 1], axis=1) > 30][:n]
    assert len(made) == n
    made[::3, 1] = np.nan
    return made


def respond(
    place_mm,
    size,
    shape,
    pitch_mm,
    rng,
    gains=0.0,
    noise=0.0,
    beside=0.0,
    line=0.0,
    crossing=0.0,
    two=0.0,
    row=0.0,
    col=0.0,
):
    """Readings (n, rows, cols) above rest; gains: (rows, cols) of the log; other effects are those of STATISTICS."""
    n, (rows, cols) = len(place_mm), shape
    gains = np.zeros(shape) + gains
    y, x = np.meshgrid(*((np.arange(count) + 0.5) * pitch_mm for count in shape), indexing="ij")
    element = np.floor(np.nan_to_num(place_mm) / pitch_mm).astype(int)
    rise = np.zeros((n, rows, cols))
    for k in range(n):
        there = np.flatnonzero(np.isfinite(place_mm[k, :, 0]))
        at = [tuple(element[k, one]) for one in there]
        change = 0.0
        if len(at) == 2:
            change = two + row * (at[0][0] == at[1][0]) + col * (at[0][1] == at[1][1])
        peaks = [
            COUNTS * size[k, one] ** EXPONENT * np.exp(gains[e] + change) for one, e in zip(there, at, strict=True)
        ]
        away = [np.hypot(y - place_mm[k, one, 0], x - place_mm[k, one, 1]) for one in there]
        far = np.min(away, axis=0) > 20
        for distance, peak, (r, c) in zip(away, peaks, at, strict=True):
            rise[k] += beside * peak * ((distance > 9) & (distance < 15))
            on_line = np.zeros(shape, bool)
            on_line[r], on_line[:, c] = True, True
            rise[k] += line * peak * (on_line & far)
        if len(at) == 2 and at[0][0] != at[1][0] and at[0][1] != at[1][1]:
            for crossed in ((at[0][0], at[1][1]), (at[1][0], at[0][1])):
                rise[k][crossed] += crossing * np.mean(peaks)
        for peak, e in zip(peaks, at, strict=True):
            rise[k][e] = peak
    return rise + rng.normal(0, noise * COUNTS, rise.shape)


def presses(condition, names, place_mm, size, rise, rest=30.0) -> pa.Table:
    """Frames of touch in which every contact is pressed for 0.6 s after 0.4 s at rest, at 50 Hz.

    names: (presses,) of the recordings, each in one piece; rest: counts that are always there.
    """
    course = np.concatenate([np.zeros(20), np.ones(30)])
    at, parts = np.tile(course, len(rise))[:, None], []
    number = np.arange(len(rise)).repeat(len(course))
    for name in np.unique(names):
        rows = np.flatnonzero(names[number] == name)
        tips = np.isfinite(place_mm[number[rows][0], :, 0]).sum()
        of = number[rows]
        parts.append(
            schemas.frame_rows(
                schemas.frames(rise[0].size, 2, pa.float32()),
                condition,
                name,
                segment=np.zeros(len(rows), dtype=int),
                t_s=np.arange(len(rows)) / 50,
                v=(rest + at[rows] * rise[of].reshape(len(rows), -1)),
                force_n=at[rows] * size[of, :tips],
                x_mm=place_mm[of, :tips, 1],
                y_mm=place_mm[of, :tips, 0],
            )
        )
    return pa.concat_tables(parts)


def scene(path: Path, rng: np.random.Generator, gains=0.0, specimens: int = 1, **effects) -> None:
    """Write frames of touch: two places in each direction of an element are pressed alone by five forces, and in pairs.

    The effects, those of `respond`, are of the first array; others read nothing.
    """
    tables, (shape, pitch) = [], SCENE
    each = (np.arange(10) // 2 + 0.5 + np.where(np.arange(10) % 2, 0.125, -0.125)) * pitch
    for specimen in range(specimens):
        alone = np.full((500, 2, 2), np.nan)
        alone[:, 0] = np.repeat(np.stack(np.meshgrid(each, each, indexing="ij"), axis=-1).reshape(-1, 2), 5, axis=0)
        force = np.tile(np.linspace(3, 30, 5), 100)[:, None] * [1.0, np.nan]
        pairs = places(1200, *SCENE, rng, fixed=True)
        pairs = pairs[np.isfinite(pairs[:, 1, 0])][:800]
        for condition, place, size in (("single", alone, force), ("double", pairs, rng.uniform(3, 30, (800, 2)))):
            rise = np.zeros((len(place), *shape))
            if specimen == 0:
                rise = respond(place, size, *SCENE, rng, gains=gains, **effects)
            names = np.array([f"specimen{specimen}-run{k * 20 // len(place):03d}" for k in range(len(place))])
            tables.append(presses(condition, names, place, size, rise))
    schemas.write(path, tables[0].schema, tables)
