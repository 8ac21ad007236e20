"""Write logs of sensors with a target of their own: an angle, an object, a slip."""

from pathlib import Path

import numpy as np
import yaml

from builders.own_logs import scanned, stamped

STRAIN = {"strain.sensor": {"channels": 2, "unit": "V"}}
MAT = {"glove.sensor.areas": {"pressure": {"rows": 2, "cols": 2}}, "glove.sensor.scale": "range"}
ANGLE = {"name": "angle", "unit": "deg", "kind": "continuous", "file": "arm.log", "column": 2}
PERSON = {"by": "person", "pattern": "/(.*)_"}


def settings(folder: Path, of_sensor, target, split):
    """Write settings.yaml."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "settings.yaml").write_text(yaml.safe_dump({**of_sensor, "target": target, "split": split}))
    return folder


def angles(folder: Path, people=("anna", "ben", "cleo"), seconds=40.0, split=PERSON, target=ANGLE):
    """Write a joint's logs: two strands follow the angle, from another rest on each person; arm.log is slower."""
    for number, person in enumerate(people):
        for run in range(2):
            rng = np.random.default_rng([number, run])
            at = np.arange(0, seconds, 0.1)
            angle = 45 * np.sin(2 * np.pi * at / 3.1) + 5 * np.sin(2 * np.pi * at / 0.9 + run)
            volts = 2 + number + np.outer(angle, [0.01, -0.006]) + rng.normal(0, 0.002, (len(at), 2))
            assert np.ptp(volts, axis=0).max() < 1.1 and (np.abs(np.corrcoef(angle, volts.T)[0, 1:]) > 0.99).all()
            place = folder / "bend" / f"{person}_{run}"
            place.mkdir(parents=True)
            rows = [f"{t:.1f},{u:.4f},{v:.4f}" for t, (u, v) in zip(at, volts, strict=True)]
            (place / "daq.log").write_text("\n".join(rows) + "\n")
            rows = [f"{t:.1f},{a:.3f},0" for t, a in zip(at[3:-3:2], angle[3:-3:2], strict=True)]
            (place / "arm.log").write_text("\n".join(rows) + "\n")
    return settings(folder, STRAIN, target, split)


def objects(folder: Path, days=2, grasps=6, first=0):
    """Write a mat's logs, <object>/<day>_<grasp>: three objects, grasps from `first` on; a frame alone is noisy."""
    taken = []  # of all frames: whether it is nearer to another object
    for number, name in enumerate(("ball", "cup", "plate")):
        pattern = 400 + 60 * np.roll([3, 1, 0, 0], number)
        for k in range(first, first + days * grasps):
            rng = np.random.default_rng([number, k])
            counts = pattern + rng.normal(0, 90, (30, 4))
            others = np.stack([400 + 60 * np.roll([3, 1, 0, 0], other) for other in range(3)])
            nearest = np.linalg.norm(counts[:, None] - others, axis=2).argmin(axis=1)
            taken += [*(nearest != number)]
            assert np.linalg.norm(counts.mean(axis=0) - others, axis=1).argmin() == number, (
                "all frames together are not"
            )
            scanned(folder / name / f"day{k % days}_{k}", counts, "%.1f")
    assert 0.05 < np.mean(taken) < 0.3, "a frame alone is often taken for another object's"
    split = {"by": "day", "pattern": "(day.)"}
    return settings(folder, MAT, {"name": "object", "kind": "class", "folder": 1}, split)


def slips(folder: Path, seconds=40.0):
    """Write a mat's logs that tremble while something slips, for 0.6 s every 4 s, as slip.log says."""
    for number in range(2):
        rng = np.random.default_rng(number)
        at = np.arange(0, seconds, 0.05)
        slip = (at % 4) < 0.6
        counts = 500 + rng.normal(0, 1, (len(at), 4)) * np.where(slip, 60, 5)[:, None]
        assert counts[slip].std() > 8 * counts[~slip].std() and abs(counts[slip].mean() - counts[~slip].mean()) < 10
        place = folder / "hold" / f"run{number}"
        scanned(place, counts, "%.1f", start_us=0)
        (place / "slip.log").write_text("\n".join(stamped(at, slip[:, None], "%d")) + "\n")
    target = {"name": "slip", "kind": "event", "file": "slip.log", "column": 2, "window_s": 0.3}
    return settings(folder, MAT, target, {"by": "recording"})
