"""Make logs of touch with known presses and clocks, so that a test can check every frame made of them."""

import numpy as np

SETTINGS = {
    "source": "simulated",
    "sensor": {"rows": 2, "cols": 3, "pitch_mm": 12.0, "element_mm": 11.5},
    "ingest": {
        "max_reject_fraction": 0.05,
        "max_clock_offset_s": 5.0,
        "min_correlation": 0.5,
        "max_touches": 3,
        "highest_count": 1023,
    },
}


def presses(seconds, seed):
    """Return times on a grid of 5 ms, in s, and forces in N: trapezoid presses of varying depth."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 0.005)
    force, start, peaks = np.zeros(len(t)), 1.5, []
    while start < seconds - 1.5:
        knots = start + np.cumsum([0, 0.2, 0.3, 0.2]) * rng.uniform(0.8, 1.2)
        peaks.append(rng.uniform(4, 40))
        force += peaks[-1] * np.interp(t, knots, [0, 1, 1, 0])
        start = knots[-1] + rng.uniform(0.2, 0.4)
    assert np.diff(np.sort(peaks)).min(initial=1) > 1e-3, "no press is as deep as another, so that a shift is seen"
    return t, force


def lines(t, columns, start, stop, hz, boot_us, pattern):
    """Return the lines that a device prints between two true times."""
    at = np.arange(start, stop, 1 / hz)
    values = [np.interp(at, t, column) for column in columns]
    stamps = boot_us + np.round((at - start) * 1e6).astype(int)
    return [f"{s}," + ",".join(pattern % v for v in row) for s, row in zip(stamps, np.transpose(values), strict=True)]


def logs_of(seconds=20.0, seed=0, touches=1, reset_at=None, shared=True):
    """Return the lines of every log; x is 2 t and y is 3 t, so that interpolated positions tell the true time."""
    t, force = presses(seconds, seed)
    counts = [10 + 20 * force**0.7 * share for share in (0.2, 0.4, 1.0, 0.5, 0.1, 0.05)]
    logs = {}
    for k in range(1, touches + 1):
        suffix, second = ("", 0.0) if k == 1 else (f"_{k}", presses(seconds, seed + k)[1])
        mine = force if k == 1 else second
        start, boot = (0.5, 8_000_000) if k == 1 or shared else (1.0, 60_000_000)
        if k > 1:
            counts = [c + 20 * mine**0.7 * share for c, share in zip(counts, (1.0, 0.3, 0.1, 0, 0, 0.1), strict=True)]
        logs[f"load_cell{suffix}.log"] = lines(t, [mine], start, seconds, 100, boot, "%.3f")
        place = [2 * t, 3 * t, -(mine ** (2 / 3))]
        if k == 1:
            start, boot = 0.0, 500_000
        logs[f"cnc{suffix}.log"] = lines(t, place, start, seconds, 50, boot, "%.3f")
    whole = [1.0, seconds] if reset_at is None else [1.0, reset_at, reset_at + 1.2, seconds]
    logs["array.log"] = []
    for k in range(0, len(whole), 2):
        boot = 3_000_000 if k == 0 else 350_000
        logs["array.log"] += ["array ready", *lines(t, counts, whole[k], whole[k + 1], 50, boot, "%d")]
    return logs


def save(folder, logs):
    folder.mkdir(parents=True)
    for name, content in logs.items():
        (folder / name).write_text("\n".join(content) + "\n")
    return folder
