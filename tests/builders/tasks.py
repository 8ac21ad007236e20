"""Define tasks for local processes, in a module that every process can import."""

import hashlib
import os
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np


def slow(folder: Path, report: Any) -> None:
    """Leave a file named after the process in `folder`, then take a minute."""
    (folder / str(os.getpid())).touch()
    time.sleep(60)


def killed(seed: int, report: Any) -> None:
    """Kill the process."""
    os.kill(os.getpid(), signal.SIGKILL)


def lost_once(folder: Path, report: Any) -> int:
    """Kill the worker that this process computes for, where no process was before; then return the process."""
    first = folder / "first"
    if not first.exists():
        first.touch()
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(60)
    return os.getpid()


def trained(seed: int, report: Any) -> str:
    """Train a small LSTM on noise for two epochs; return the digest of its weights."""
    import torch

    from tactile.datasets.series import Record
    from tactile.learning.lstm import LstmRegressor
    from tactile.learning.spec import Spec
    from tactile.settings.training import SequenceTraining

    torch.set_num_threads(1)
    rng, everywhere = np.random.default_rng(0), np.ones(400, bool)
    x, y = (rng.normal(size=(400, width)).astype(np.float32) for width in (6, 2))
    recipe = {"learning_rate": 5e-3, "epochs": 2, "drop_epoch": 1, "drop": 0.2, "clip": 1.0, "streams": 1, "batch": 1}
    model = LstmRegressor(Spec(10, 1, 6, 1, 2), 8, SequenceTraining(**recipe), transfer=False)
    record = Record(x, y, everywhere, everywhere, np.zeros(400, np.int32))
    model.fit([record], seed=seed, device="cpu", progress=report, base=None)
    weights = model.network.state_dict()
    return hashlib.sha256(b"".join(weights[name].numpy().tobytes() for name in sorted(weights))).hexdigest()
