"""Make recorded grasps as the device of the glove writes them: compressed XML."""

import bz2

import numpy as np

from tactile.experiments.glove_recorded import CELLS, JOINTS, MATRICES

NAME = "mug_000083-000147.dsa"
START_MS = 1_410_000_000_000
NOTHING = np.zeros(CELLS)


def pressed(seed=0):
    """Return the cells of a frame in contact: whole counts with runs of 0."""
    rng = np.random.default_rng(seed)
    return np.where(rng.random(CELLS) < 0.2, rng.integers(1, 4000, CELLS), 0).astype(float)


def words(cells):
    """Return cells as the device writes them: hex words of big-endian float32, -n for n cells of 0, ten per line."""
    values, zeros = [], 0
    for cell in [*cells, np.nan]:
        if cell == 0:
            zeros += 1
            continue
        values += [-zeros] * (zeros > 0) + [cell]
        zeros = 0
    text = np.array(values[:-1], ">f4").tobytes().hex().upper()
    return "\n        ".join(text[k : k + 80] for k in range(0, len(text), 80))


def frame(number, data, at=None):
    at = START_MS + 32 * number if at is None else at
    return f'<frame index="{number}"><time_stamp>{at}</time_stamp><frame_data>\n {data}\n </frame_data></frame>'


def angle(number, data=None, at=None):
    at = START_MS - 10 + 10 * number if at is None else at
    data = ", ".join(f"{10 * joint + number / 100:.5f}" for joint in range(JOINTS)) if data is None else data
    return f'<angle index="{number}"><time_stamp>{at}</time_stamp><angle_data>{data}</angle_data></angle>'


def xml(frames, angles=None, matrices=MATRICES, full_scale=4095, head='<?xml version="1.0" encoding="utf-8"?>'):
    """Return a recording; its angles go from 10 ms before the first frame to 990 ms after that frame."""
    angles = [angle(k) for k in range(101)] if angles is None else angles
    sensor = "".join(
        f'<matrix index="{k}"><cells_x>{cols}</cells_x><cells_y>{rows}</cells_y>'
        f"<fullscale>{full_scale}</fullscale></matrix>"
        for k, (rows, cols) in enumerate(matrices)
    )
    return (
        f"{head}\n<root><sensor>{sensor}</sensor><data><frame_count>{len(frames)}</frame_count>{''.join(frames)}</data>"
        f"<temperatures></temperatures><joint_angles>{''.join(angles)}</joint_angles></root>"
    )


def save(folder, content, name=NAME, condition="mug"):
    path = folder / condition / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(bz2.compress(content.encode() if isinstance(content, str) else content))
    return path


def grasp(before=3, contact=10, seed=0):
    """Return the frames of one grasp: `before` without contact, then `contact` of growing pressure."""
    cells = pressed(seed)
    empty = [frame(k, words(NOTHING)) for k in range(before)]
    growing = [np.ceil(cells * (k + 1) / contact) for k in range(contact)]
    assert (np.diff([0, *(of_frame.sum() for of_frame in growing)]) > 0).all(), "of growing pressure, in contact"
    return empty + [frame(before + k, words(of_frame)) for k, of_frame in enumerate(growing)]
