"""Write what a model predicted for recordings: a table and a summary."""

import itertools
import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa

from tactile.base import files, foreign, ranges
from tactile.base.errors import InputError
from tactile.datasets import schemas
from tactile.inference import intervals, recordings, touches
from tactile.inference.card import Card
from tactile.inference.recordings import Predicted, Recording

TABLE, SUMMARY = "predictions.parquet", "summary.json"
LONGEST = 120  # characters of the name of a file: systems take 255 bytes


def schema(card: Card) -> pa.Schema:
    """Return the columns of the table of predictions, one row per reading."""
    fields = {"recording": schemas.NAME, "t_s": pa.float64()}
    if card.kind == "windows" and card.outputs.touch_kpa is not None:
        touch = pa.list_(pa.struct({"x_mm": pa.float32(), "y_mm": pa.float32(), "kpa": pa.float32()}))
        fields |= {"force_n": pa.float32(), "touches": touch}
        fields["map_kpa"] = pa.list_(pa.float32(), card.shapes.map_rows * card.shapes.map_cols)
    elif card.kind == "windows":
        fields["force_n"] = pa.float32()
    elif card.kind == "series":
        fields |= dict.fromkeys(card.outputs.names, pa.float32())
    else:
        fields |= {"object": schemas.NAME, "probability": pa.list_(pa.float32(), len(card.outputs.names))}
    kind = pa.list_(pa.string()) if card.kind == "images" else pa.float32()
    of_intervals = {name: pa.bool_() if name == intervals.OUTSIDE else kind for name in intervals.names(card)}
    return pa.schema(fields | of_intervals)


def rows(recording: Recording, predicted: Predicted, card: Card) -> Iterator[pa.Table]:
    """Yield the rows of one recording, some at a time."""
    wanted = schema(card)
    first = 0
    for part in recordings.parts(predicted.values):
        flat = part.reshape(len(part), -1)
        columns = {
            "recording": schemas.repeated(recording.name, len(part)),
            "t_s": recording.t_s[first : first + len(part)],
        }
        if "map_kpa" in wanted.names:
            columns["force_n"] = touches.force_n(part, card).astype(np.float32)
            columns["touches"] = [[touch._asdict() for touch in of_map] for of_map in touches.touches(part, card)]
            columns["map_kpa"] = schemas.lists(flat, pa.float32())
        elif card.kind == "windows":
            columns["force_n"] = flat[:, 0]
        elif card.kind == "series":
            columns |= dict(zip(card.outputs.names, flat.T, strict=True))
        else:
            columns["object"] = [card.outputs.names[k] for k in np.nan_to_num(flat, nan=-1).argmax(axis=1)]
            columns["probability"] = schemas.lists(flat, pa.float32())
        columns |= intervals.columns(part, predicted.outside[first : first + len(part)], card)
        yield pa.table(columns, schema=pa.schema([wanted.field(name) for name in columns])).select(wanted.names)
        first += len(part)


def summary(recording: Recording, of_recording: Predicted, card: Card, scored: Mapping) -> dict:
    """Return what one recording came to: readings, rejected lines by reason, gaps, and the range of the predictions.

    Where the card has the ranges of its training also the share of readings outside, with a sentence where there are
    any. scored: as of `recordings.scored`.
    """
    predicted, outside = of_recording.values, of_recording.outside
    flat = predicted.reshape(len(predicted), -1)
    known = np.concatenate([np.zeros(0, bool), *(~np.isnan(part).any(axis=1) for part in recordings.parts(flat))])
    steps = schemas.steps(recording.t_s)
    lasts = float(steps.sum())
    said = {
        "recording": recording.name,
        "log": str(recording.path),
        "readings": len(predicted),
        "seconds": round(lasts, 3),
        "readings_per_second": round(len(steps) / lasts, 2) if lasts else None,
        "gaps": recording.gaps,
        "rejected_lines": dict(Counter(recording.rejects["reason"].to_pylist())),
        "without_prediction": int((~known).sum()),
    }
    if known.any():
        said |= _range(predicted, known, card)
    if card.trained_on is not None:
        lacking = "set" if card.kind == "images" else "interval"
        by_range = outside  # a sentence on ranges counts no reading that is outside for want of a measurement
        if len(recording.unmeasured):
            by_range = outside & ranges.outside(recording.x, card.trained_on)
        said |= ranges.summary(recording.x, by_range, card.trained_on, card.inputs.unit, lacking)
        said["share_outside_training"] = float(outside.mean()) if len(outside) else 0.0
    if of_recording.notes:
        said["notes"] = list(of_recording.notes)
    return said | scored


def _range(predicted: np.ndarray, known: np.ndarray, card: Card) -> dict:
    """Return the figures that sum up the predictions (n, *output_shape) of one recording that are known, (n,) bool."""
    if card.kind == "series":
        return {
            name: {"least": float(values.min()), "most": float(values.max())}
            for name, values in zip(card.outputs.names, predicted[known].T, strict=True)
        }
    if card.kind == "images":
        predicted = predicted[known]
        best = Counter(card.outputs.names[k] for k in predicted.argmax(axis=1))
        return {"objects": dict(best.most_common()), "mean_probability": float(predicted.max(axis=1).mean())}
    highest, forces, counts = [], [], []
    for part, inside in zip(recordings.parts(predicted), recordings.parts(known), strict=True):
        if inside.any():
            maps = part[inside]
            highest.append(float(maps.max()))
            if card.outputs.touch_kpa is not None:
                forces.append(float(touches.force_n(maps, card).max()))
                counts += [len(of_map) for of_map in touches.touches(maps, card)]
    if card.outputs.touch_kpa is None:
        return {"highest_force_n": max(highest)}
    return {
        "highest_pressure_kpa": max(highest),
        "highest_force_n": max(forces),
        "share_of_readings_by_touches": {str(k): float(np.mean(np.equal(counts, k))) for k in np.unique(counts)},
    }


def file_names(names: Iterable[str]) -> list[str]:
    """Return a name of a file for each name of a recording, no two alike, not even where case does not count."""
    chosen: dict[str, str] = {}
    for name in names:
        plain = re.sub(r"[^\w.-]+", "-", name).strip(".-")[-LONGEST:] or "recording"
        numbered = (f"{plain}-{k}" for k in itertools.count(2))
        free = next(each for each in itertools.chain([plain], numbered) if each.casefold() not in chosen)
        chosen[free.casefold()] = free
    return list(chosen.values())


def read_summary(folder: Path) -> dict:
    """Return summary.json of a folder of predictions; InputError for one that is absent or damaged."""
    with foreign.reading(folder / SUMMARY, "a summary of predictions", "predict again"):
        return json.loads((folder / SUMMARY).read_text(encoding="utf-8"))


def held(folder: Path) -> str | None:
    """Say what the predictions in a folder are of, as `origin`; None for a folder that holds none."""
    try:
        summary_ = read_summary(folder)
        return origin(summary_["model"], summary_.get("logs", "unknown logs"))
    except (InputError, LookupError, TypeError):
        return None


def origin(model: Mapping, logs: Path | str) -> str:
    """Say which model and which logs predictions are of; model: as `model_of`, logs: the absolute path of LOGS."""
    return f"{model['experiment']}/{model['model']}/{model['protocol']}/{model['seed']} for {logs}"


def model_of(card: Card) -> dict:
    """Return what tells a model from others."""
    return {"experiment": card.experiment, "model": card.model, "protocol": card.protocol, "seed": card.seed}


@contextmanager
def writing(folder: Path, logs: Path, card: Card) -> Iterator[Callable[[Recording, Predicted, Mapping], dict]]:
    """Give the block a function that writes what one more recording came to, and returns its summary.

    It takes the recording, its predictions, and its scores as of `summary`, and keeps nothing of them: of an hour, maps
    take 0.3 GB. The folder then has predictions.parquet and summary.json. logs: the absolute path of LOGS.
    """
    said = []
    with schemas.writing(folder / TABLE, schema(card)) as write_part:

        def add(recording: Recording, predicted: Predicted, scored: Mapping) -> dict:
            for part in rows(recording, predicted, card):
                write_part(part)
            said.append(summary(recording, predicted, card, scored))
            return said[-1]

        yield add
    write_summary(folder, model_of(card), logs, intervals.sentences(card), said, recordings.unknown(card))


def write_summary(
    folder: Path, model: Mapping, logs: Path, interval: list[str], said: list[dict], unknown: str
) -> None:
    """Write summary.json; model: as `model_of`; interval: sentences on it; said: the summaries of recordings.

    unknown: what nobody knows of the logs that the model was trained on, which is added where there are scores.
    """
    content = {"model": model, "logs": str(logs), "interval": interval}
    if unknown and any(each.get("scores") for each in said):
        content["warning"] = unknown
    content["recordings"] = said
    files.write_text(folder / SUMMARY, json.dumps(content, indent=1) + "\n")
