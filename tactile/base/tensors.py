"""Find the file of weights of a trained network, and read it without torch."""

from pathlib import Path

import numpy as np
from safetensors.numpy import load_file

from tactile.base import foreign
from tactile.base.errors import InputError

NETWORK_FILE = "network.safetensors"


def arrays(folder: Path) -> dict[str, np.ndarray]:
    """Return the tensors of NETWORK_FILE in `folder` by name; InputError where the file is absent or damaged."""
    path = existing(Path(folder) / NETWORK_FILE)
    with foreign.reading(path, "a whole file of weights", "train the model again"):
        return load_file(path)


def existing(path: Path) -> Path:
    """Return the path of a trained model's file; InputError where there is no such file."""
    if not path.exists():
        raise InputError(f"{path}: not found; train the model first")
    return path


def other_settings(folder: Path) -> InputError:
    """Return the error for a file in `folder` whose tensors do not fit the model that loads them."""
    path = Path(folder) / NETWORK_FILE
    return InputError(f"{path}: was saved by a model with other settings; train the model again")
