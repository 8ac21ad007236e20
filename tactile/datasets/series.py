"""Read the tables of experiments whose input is one long series (strain), as models see them."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute

from tactile.base.errors import InputError
from tactile.datasets import schemas


def frames(channels: int) -> pa.Schema:
    """Return the schema of aligned samples on a uniform time grid, in the order of time within a recording.

    channels: number of sensors, the largest of all recordings; v is NaN where a recording has fewer.
    """
    return pa.schema(
        {
            "condition": schemas.NAME,
            "recording": schemas.NAME,
            "segment": pa.int16(),  # a new one after every gap
            "t_s": pa.float64(),
            "gap_before": pa.bool_(),  # also the first sample of a segment
            "press": pa.int32(),  # number of the press, -1 outside presses
            "v": pa.list_(pa.float32(), channels),  # V
            "y_mm": pa.list_(pa.float32(), 3),  # x, y, z of the arm
        }
    )


class Task(NamedTuple):
    """The task that one protocol of a series experiment sets a model."""

    outputs: tuple[int, ...]  # columns of y_mm to predict
    channels: Mapping[str, list[int]]  # condition -> columns of v, in the order in which models see them
    pressed_only: bool  # only samples of a press count
    base: str  # the protocol whose LSTM is model-0 (section III-B); its own name if it is that protocol


class Record(NamedTuple):
    """One recording as a model sees it, T samples. State is carried over gaps: nothing better is known there."""

    x: np.ndarray  # (T, channels) float32, V
    y: np.ndarray  # (T, outputs) float32, mm
    counted: np.ndarray  # (T,) bool: counts in loss and scores
    training: np.ndarray  # (T,) bool: training part; in `fit` all other samples are the validation part
    press: np.ndarray  # (T,) int32


class Piece(NamedTuple):
    """A record, with the dataset's row and the part of the split for each sample."""

    condition: str
    rows: np.ndarray  # (T,)
    part: np.ndarray  # (T,) 'train', 'validation', 'test'
    time_s: np.ndarray  # (T,)
    record: Record


def read(path: Path, task: Task, protocol: str, seed: int) -> list[Piece]:
    """Read the recordings of a dataset that one run uses, in the order of the table.

    Raises InputError where its samples have fewer channels than the task has.
    """
    split = schemas.split_column(protocol, seed)
    table = schemas.read(path, ["condition", "recording", "t_s", "press", "v", "y", split])
    used = pyarrow.compute.not_equal(table[split], "unused").to_numpy()  # names of all samples would take 6 s
    numbers, table = np.flatnonzero(used), table.filter(pa.array(used))
    part = schemas.names(table[split])
    condition, recording = schemas.names(table["condition"]), schemas.names(table["recording"])
    v, y, press = schemas.matrix(table["v"]), schemas.matrix(table["y"]), table["press"].to_numpy()
    pieces = []
    most = 1 + max((channel for channels in task.channels.values() for channel in channels), default=-1)
    if most > v.shape[1]:
        raise InputError(f"{path}: its samples have {v.shape[1]} channels, and the settings ask for {most}")
    for name in task.channels:
        for recorded in np.unique(recording[condition == name]):
            rows = np.flatnonzero((condition == name) & (recording == recorded))
            record = Record(
                x=v[rows][:, task.channels[name]],
                y=y[rows][:, list(task.outputs)],
                counted=press[rows] >= 0 if task.pressed_only else np.ones(len(rows), dtype=bool),
                training=part[rows] == "train",
                press=press[rows],
            )
            pieces.append(Piece(name, numbers[rows], part[rows], table["t_s"].to_numpy()[rows], record))
    return pieces


def seen_in_training(pieces: list[Piece]) -> list[Record]:
    """Return the records that `fit` may see: every recording up to its last sample of training or validation."""
    records = []
    for piece in pieces:
        seen = np.flatnonzero(piece.part != "test")
        if len(seen):
            records.append(Record(*(column[: seen[-1] + 1] for column in piece.record)))
    return records


def chronological(samples: int, train: float, validation: float) -> np.ndarray:
    """Return (samples,) of 'train', 'validation', 'test' in the order of time.

    train: share of the samples before the test; validation: share of these, at their end, for validation.
    """
    edges = np.round(np.array([train * (1 - validation), train]) * samples).astype(int)
    return np.repeat(["train", "validation", "test"], np.diff([0, *edges, samples])).astype(object)
