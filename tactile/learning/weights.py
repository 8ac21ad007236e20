"""Save and load the tensors of a trained network: one safetensors file per model folder.

A tensor's name is `group.name` (`network.readout.weight`) for what was trained or drawn, and a plain name
(`input_mean`) for a constant that inputs or outputs are scaled by.
"""

from collections.abc import Mapping
from pathlib import Path

import torch
from safetensors.torch import load_file, save_file
from torch import nn

from tactile.base import foreign
from tactile.base.tensors import NETWORK_FILE, existing, other_settings


def grouped(group: str, tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Return the tensors by their names in the file: `group`, a dot, and the name that each has here."""
    return {f"{group}.{name}": value for name, value in tensors.items()}


def group_of(tensors: Mapping[str, torch.Tensor], group: str) -> dict[str, torch.Tensor]:
    """Return the tensors of one group of a file, by their names inside the group."""
    prefix = f"{group}."
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def constants(tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Return the tensors of a file that are in no group."""
    return {name: value for name, value in tensors.items() if "." not in name}


def save(folder: Path, tensors: Mapping[str, torch.Tensor]) -> None:
    """Write the tensors by name to NETWORK_FILE in `folder`, which exists."""
    save_file({name: value.contiguous() for name, value in tensors.items()}, Path(folder) / NETWORK_FILE)


def read(folder: Path) -> dict[str, torch.Tensor]:
    """Return the tensors of NETWORK_FILE in `folder` by name; InputError where the file is absent or damaged."""
    path = existing(Path(folder) / NETWORK_FILE)
    with foreign.reading(path, "a whole file of weights", "train the model again"):
        return load_file(path)


def load(module: nn.Module, tensors: Mapping[str, torch.Tensor], folder: Path) -> None:
    """Put tensors of the file read from `folder` into a module; InputError unless names and shapes are the module's."""
    if _shapes(tensors) != _shapes(module.state_dict()):
        raise other_settings(folder)
    module.load_state_dict(tensors)


def _shapes(tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Size]:
    return {name: value.shape for name, value in tensors.items()}
