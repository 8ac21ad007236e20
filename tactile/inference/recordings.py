"""Read logs as a trained model needs them: what the sensor said and when, with no ground truth beside it.

Lines are checked and ordered as in training (tactile/logs/parse.py), and what training left out is left out here.
"""

import contextlib
import itertools
import math
import mmap
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from tactile import experiments, tasks
from tactile.base import cards as base_cards
from tactile.base import correlation, files
from tactile.base.errors import InputError
from tactile.datasets import images, schemas
from tactile.datasets.series import Record
from tactile.experiments import log_name, sensor_format
from tactile.inference import timing
from tactile.inference.card import Card
from tactile.inference.predictor import Predictor
from tactile.logs import layout, packets, parse, sources, unmeasured
from tactile.logs.formats import second
from tactile.scoring import classification, metrics

OF_ONE_ELEMENT = ("load_cell.log",)  # which cannot tell a place
SIMULATED = "simulated"  # as a source of logs
TRAIN, TEST = "train", "test"  # parts of a split


LARGE = 200 << 20  # bytes of a recording's predictions, from which on they are held in a file
NOTHING = np.empty(0, int)


class Recording(NamedTuple):
    """One log: n readings in the order of time."""

    path: Path  # of the log
    name: str  # as of `names`
    condition: str  # folder above the recording's, or of recorded data what their names say; the object of a grasp
    t_s: np.ndarray  # (n,) on the sensor's clock
    x: np.ndarray  # (n, columns) in the unit of the card
    segment: np.ndarray  # (n,) rising; a new one after every restart of the device
    gaps: int  # times that readings are missing between two
    rejects: pa.Table  # lines that cannot be used, with their reasons
    unmeasured: np.ndarray = NOTHING  # rows of the readings that are no measurement
    notes: Sequence[str] = ()  # sentences on these, and on frames that were printed again


def logs(place: Path, experiment: str) -> list[Path]:
    """Return the sensor's logs in a folder, or the one log that is named; InputError where there is none.

    Public recordings are those that their experiment finds, in the folder or in one around or in it.
    """
    if not place.exists():
        wanted = f"{log_name(experiment)} in it" if log_name(experiment) else f"recordings of {experiment} in it"
        raise InputError(f"{place}: not found; name a log or a folder with {wanted}")
    if not log_name(experiment):
        return [place] if place.is_file() else _recorded(place, experiment)
    pattern = log_name(experiment)
    if place.is_file():
        if tasks.kind(experiment) == "images" and place.name != pattern:
            raise InputError(f"{place}: a log of {experiment} is called {pattern}; name such a log, or its folder")
        return [place]
    logs_ = sorted(files.finished(place.rglob(pattern)))
    if not logs_:
        raise InputError(f"{place}: no {pattern} in it or below; name a log of {experiment} or its folder")
    return logs_


def _recorded(place: Path, experiment: str) -> list[Path]:
    """Return the public recordings in a folder: all, some of them (an object's grasps), or those in a folder below."""
    module, whole, found = experiments.module(experiment), place.absolute(), []
    below = sorted(path for path in place.rglob("*") if path.is_dir())
    for folder in (place, *itertools.islice(whole.parents, 2), *below):
        with contextlib.suppress(InputError):  # it is not the folder that they lie in
            found += [path for path in module.recordings(folder) if path.absolute().is_relative_to(whole)]
    listed = [Path(one).name for path in sources.files(experiment) for one in sources.members(path)]
    if len(set(listed)) == len(listed):  # their names tell them apart, so they may lie side by side
        found += sorted(path for path in place.rglob("*") if path.name in listed)
    if not found:
        raise InputError(
            f"{place}: nothing in it is called and placed as recordings of {experiment} are; name one of them, or a "
            f"folder such as `tactile fetch {experiment}` makes"
        )
    return list(dict.fromkeys(path.absolute() for path in found))


def names(place: Path, logs_: Sequence[Path], experiment: str) -> list[str]:
    """Return a name for each of `logs_`, which `logs(place, experiment)` returned; place: as of `absolute`.

    It is the path below `place` of the recording's folder, or of a log that is named otherwise of the log without its
    suffix; of a recording that is `place` itself the last two parts of its path. Raises InputError for equal names.
    """
    found: dict[str, Path] = {}
    for path in logs_:
        whole = without_log(path, experiment)
        below = whole.relative_to(place).parts if place.is_dir() else ()
        name = "/".join(below or whole.parts[1:][-2:]) or path.stem
        if name in found:
            raise InputError(f"{found[name]} and {path} would both be called '{name}'; rename a folder of one of them")
        found[name] = path
    return list(found)


def without_log(path: Path, experiment: str) -> Path:
    """Return the folder of a log that is called as the experiment's, else the log's path without its suffix."""
    return path.parent if path.name == log_name(experiment) else path.with_suffix("")


def absolute(place: Path) -> Path:
    """Return a path with no `..` in it, and where it had none with its links as they are."""
    return place.resolve() if ".." in place.parts else place.absolute()


def read(path: Path, name: str, card: Card) -> Recording:
    """Read the log of one recording of the sensor that a model was trained for.

    Errors as parse.read_log; of strands also as strain.check_clock.
    """
    experiment, settings = card.experiment, card.reading
    module = experiments.module(experiment)
    if not module.FACTS.stream:
        raise InputError(
            f"{path}: frames of {experiment} do not follow one another, so that they are not read as a log"
        )
    limit = f"{experiment}.ingest.max_reject_fraction"
    if not log_name(experiment) or module.KIND == "images":
        frames, rejects, _ = module.read_recording(path.parent if log_name(experiment) else path, settings)
        recording = _of_frames(path, name, frames, rejects, card)
        known = sensor_format(experiment, settings).names[1:] if log_name(experiment) else ()
        columns = known or [f"column {k}" for k in range(recording.x.shape[1])]
        return compared(looked_at(recording, columns), card, columns)
    fmt = sensor_format(experiment, settings)
    ingest, laid_out = settings["ingest"], layout.of(settings["ingest"], log_name(experiment))
    rows, rejects = parse.read_log(path, fmt, limit=ingest["max_reject_fraction"], key=limit, layout=laid_out)
    time = rows[fmt.time].to_numpy() / second(fmt)
    values = np.column_stack([rows[column].to_numpy() for column in fmt.names[1:]])
    condition = path.parent.parent.name
    if module.KIND == "series":
        module.check_clock(path, rows)
        nowhere = np.full((len(time), 3), np.nan)
        frames = module.resampled(condition, path.parent.name, time, values, nowhere, settings["ingest"])
        found = unmeasured.found(time, values)  # here, because interpolated readings no longer repeat
        none = unmeasured.resampled(unmeasured.rows(found, len(time)), time, frames["t_s"].to_numpy())
        said = unmeasured.sentences(found, time, fmt.names[1:])
        recording = _of_frames(path, name, frames, rejects, card)
        return compared(recording._replace(unmeasured=np.flatnonzero(none), notes=said), card, fmt.names[1:])
    values, segment = module.in_order(values, settings), rows["segment"].to_numpy()
    gaps = int(schemas.gaps(time, segment).sum())
    return looked_at(Recording(path, name, condition, time, values, segment, gaps, rejects), fmt.names[1:])


def looked_at(recording: Recording, channels: Sequence[str]) -> Recording:
    """Return a recording with what is no measurement in it; channels: their names."""
    found = unmeasured.found(recording.t_s, recording.x)
    none = np.flatnonzero(unmeasured.rows(found, len(recording.x)))
    return recording._replace(unmeasured=none, notes=unmeasured.sentences(found, recording.t_s, channels))


def compared(recording: Recording, card: Card, channels: Sequence[str]) -> Recording:
    """Return a recording with what is to be said of its channels beside each other; channels: their names."""
    begins = np.diff(recording.segment, prepend=recording.segment[:1]) != 0
    none = np.isin(np.arange(len(recording.x)), recording.unmeasured)
    parts = [*correlation.stretches(recording.x, begins, none)]
    said = correlation.sentences(card.correlation, parts, channels)
    return recording._replace(notes=[*recording.notes, *said])


def _of_frames(path: Path, name: str, frames: pa.Table, rejects: pa.Table, card: Card) -> Recording:
    condition, gaps = schemas.names(frames["condition"])[0], int(frames["gap_before"].to_numpy()[1:].sum())
    time, segment = (frames[column].to_numpy() for column in ("t_s", "segment"))
    return Recording(path, name, condition, time, _readings(frames, card), segment, gaps, rejects)


def _readings(frames: pa.Table, card: Card) -> np.ndarray:
    """Return the sensor's columns of the frames of a recording, (n, columns), where the card says that they are.

    A card names the columns of the first day that its model was trained on; of recorded strands another day has others.
    Raises InputError for a day that the card's protocol does not use.
    """
    names = ["v"] if "v" in frames.column_names else images.reading_columns(frames.schema)
    readings = np.concatenate([schemas.matrix(frames[name]) for name in names], axis=1)
    module = experiments.module(card.experiment)
    if not hasattr(module, "channels"):
        return readings
    of_day = module.channels(card.protocol, schemas.names(frames["condition"])[0])
    placed = np.full_like(readings, np.nan)
    placed[:, card.inputs.chosen] = readings[:, of_day]
    return placed


class Predicted(NamedTuple):
    """What a model says of the n readings of a recording."""

    values: np.ndarray  # (n, *output_shape); NaN: none
    outside: np.ndarray  # (n,) bool, as of Predictor.outside
    notes: list[str]  # sentences on a rate unlike that of training, on what is no measurement, on why nothing is said


def room(recording: Recording, card: Card, folder: Path | None) -> np.ndarray:
    """Return an array for the predictions of a recording, (n, *output_shape) float32, whose values are yet to come.

    From LARGE on it is a file without a name in `folder`, so that it takes no memory; None: it is never one. Raises
    InputError where the disk has no room for it.
    """
    shape = (len(recording.x), *card.output_shape)
    needed = math.prod(shape) * np.dtype(np.float32).itemsize
    if folder is None or needed < LARGE:
        return np.empty(shape, np.float32)
    if needed > (free := shutil.disk_usage(folder).free):
        raise InputError(
            f"{recording.name}: the predictions of its {len(recording.x)} readings take {needed / 1e9:.3g} GB of the "
            f"disk, of which {free / 1e9:.3g} GB are free; divide the log, or free the disk"
        )
    with tempfile.TemporaryFile(dir=folder) as file:
        return np.memmap(file, np.float32, "w+", shape=shape)


def parts(values: np.ndarray) -> Iterator[np.ndarray]:
    """Yield some rows at a time of predictions: what is computed of a map takes several times its memory."""
    for first in range(0, len(values), schemas.GROUP_ROWS):
        yield values[first : first + schemas.GROUP_ROWS]
        release(values)


def release(values: np.ndarray) -> None:
    """Give the memory of predictions back that are in a file, which keeps them."""
    if isinstance(values, np.memmap) and hasattr(mmap, "MADV_DONTNEED"):
        values._mmap.madvise(mmap.MADV_DONTNEED)  # the one way to it


def predict(model: Predictor, recording: Recording, folder: Path | None = None) -> Predicted:
    """Return one prediction per reading; folder: where those of a long recording lie, see `room`.

    A model of windows is given a few lost readings by interpolation (timing.most_filled). Windows span no longer gap,
    so that the first predictions after one are NaN; a series goes on over it, as in training. Readings that are no
    measurement are outside, as are windows with such a frame.
    """
    x, t_s, segment = recording.x, recording.t_s, recording.segment
    none = np.isin(np.arange(len(x)), recording.unmeasured)
    if model.card.kind != "windows" or len(x) < 2:
        notes = [too_short(model.card, model.card.inputs.frame_step, len(x))] if model.card.kind == "windows" else []
        predicted = room(recording, model.card, folder)
        _put(predicted, np.arange(len(x)), model.in_parts(x))
        return Predicted(predicted, model.outside(x) | none, [*recording.notes, *notes])
    interval_s = packets.rate(t_s, segment).interval
    step = timing.frame_step(model.card, interval_s)
    lost = np.maximum(0, np.round(np.diff(t_s, prepend=t_s[0]) / interval_s).astype(int) - 1)
    begins = (np.diff(segment, prepend=segment[0]) != 0) | (lost > timing.most_filled(step))
    lost[begins] = 0
    predicted, outside = room(recording, model.card, folder), np.empty(len(x), bool)
    edges, longest = [0, *np.flatnonzero(begins), len(x)], 0
    for first, last in itertools.pairwise(edges):
        place = np.arange(last - first) + np.cumsum(lost[first:last])  # of the readings, with the lost ones in between
        every = np.arange(place[-1] + 1)
        longest = max(longest, len(every))
        whole = x[first:last]
        if len(every) > len(place):
            whole = np.empty((len(every), x.shape[1]), np.float32)  # as the model takes them
            for column, values in zip(whole.T, x[first:last].T, strict=True):
                column[:] = np.interp(every, place, values)
        _put(predicted[first:last], place, model.in_parts(whole, step))
        beside = np.interp(every, place, none[first:last]) > 0  # also a lost reading beside one that is none
        outside[first:last] = model.outside(whole, step, beside)[place]
    notes = timing.differences(model.card, interval_s, interval_s)
    notes += [too_short(model.card, step, longest)] if longest <= model.card.reach(step) else []
    return Predicted(predicted, outside, [*recording.notes, *notes])


def _put(predicted: np.ndarray, place: np.ndarray, given: Iterator[np.ndarray]) -> None:
    """Put predictions that come in parts to the readings that there were; place (k,): of these among all, rising."""
    after = 0
    for part in given:
        first, last = np.searchsorted(place, [after, after + len(part)])
        predicted[first:last] = part[place[first:last] - after]
        after += len(part)
        release(predicted)


def too_short(card: Card, step: int, longest: int) -> str:
    """Say why no reading of a log has a prediction: no stretch without a gap, of `longest` readings, holds a window.

    step: readings from one frame of a window to the next.
    """
    span_s = card.reach() * card.inputs.interval_s
    return (
        f"no reading has a prediction, since a window spans {span_s:.3g} s, by the times of this log "
        f"{card.reach(step) + 1} readings, and its longest stretch without a gap has {longest}: record for longer, "
        "or write times in the unit that their column names"
    )


def has_truth(recording: Recording, card: Card) -> bool:
    """Tell whether the ground truth lies beside a log, so that predictions can be scored.

    That of public recordings is read with them. A log beside which its folder has the log that is called as the
    experiment's is another one than the truth is of.
    """
    if card.kind == "images":
        return recording.condition in card.outputs.names
    if not log_name(card.experiment):
        return True
    if recording.path.name != log_name(card.experiment):
        return False
    wanted = experiments.facts(card.experiment).truth
    if card.kind == "windows" and card.shapes.rows * card.shapes.cols == 1:
        wanted = OF_ONE_ELEMENT
    return all((recording.path.parent / name).is_file() for name in wanted)


def scored(model: Predictor, recording: Recording) -> dict:
    """Return what the summary of a recording says of scores: {} without ground truth, else `scores`, metric -> value.

    A recording that was in the training or validation part has none, but the reason as `not_scored`, and as `held_out`
    the card's scores of the test part in its condition. `held_out_of` says which test that is, or that it is of this
    very recording. Errors as `scores`.
    """
    card = model.card
    digest = files.content_sha256(recording.path) if card.logs else ""
    known = [log for log in card.logs or [] if log.sha256 == digest]
    parts = {part for log in known for part in log.parts}
    test = f"test part of `{card.protocol}`, seed {card.seed}"
    if parts - {TEST}:
        said = {"scores": None, "not_scored": base_cards.SEEN if TRAIN in parts else base_cards.VALIDATED}
        held_out = named(_of_test(card, known[0].name.partition("/")[0]), card)
        return said | ({"held_out": held_out, "held_out_of": test} if held_out else {})
    if not has_truth(recording, card):
        return {}
    found = {"scores": named(scores(model, recording.path), card)}
    return found | {"held_out_of": test} if parts else found


class Tips(NamedTuple):
    """Where a touch sensor was pressed, at the n readings of a recording; NaN: by no tip, or nobody knows."""

    known: np.ndarray  # (n,) bool: of the readings with a ground truth
    force_n: np.ndarray  # (n, tips), on the load cells
    x_mm: np.ndarray  # (n, tips), from the array's lower left corner
    y_mm: np.ndarray


def tips(recording: Recording, card: Card) -> Tips | None:
    """Return the ground truth beside the log of a touch sensor of several elements, None where there is none.

    Errors as the experiment's read_recording.
    """
    if card.kind != "windows" or not log_name(card.experiment) or not has_truth(recording, card):
        return None
    frames, _, _ = experiments.module(card.experiment).read_recording(recording.path.parent, card.reading)
    force, x_mm, y_mm = (schemas.matrix(frames[name]) for name in ("force_n", "x_mm", "y_mm"))
    rows, numbered = [], enumerate(recording.x)  # frames, on the load cell's clock, are these readings in their order
    for reading in schemas.matrix(frames["v"]):
        rows += [next((k for k, values in numbered if (values == reading).all()), len(recording.x))]
    if not rows or rows[-1] == len(recording.x):  # they are not
        return None
    known = np.zeros(len(recording.x), bool)
    known[rows] = True
    pressed = force > card.reading["window"]["contact_threshold_n"]
    columns = [np.full((len(known), force.shape[1]), np.nan) for _ in range(3)]
    for column, values in zip(columns, (force, x_mm, y_mm), strict=True):
        column[rows] = np.where(pressed, values, np.nan)
    return Tips(known, *columns)


def unknown(card: Card) -> str:
    """Say what nobody knows of the logs that a model was trained on; empty where its card has them."""
    if card.logs is not None:
        return ""
    if card.source == SIMULATED:
        return f"{base_cards.UNKNOWN.replace('logs', 'simulated logs', 1)}; logs of a real sensor are none of them"
    return base_cards.UNKNOWN


def _of_test(card: Card, condition: str) -> list[metrics.Row]:
    """Return the scores of the test part in a condition; where it has none, in the first that has some."""
    rows = [each for each in card.scores if each.value is not None and each.metric != "force_gain"]
    chosen = condition if any(each.condition == condition for each in rows) else rows[0].condition if rows else ""
    return [(each.metric, each.unit, each.value, each.n) for each in rows if each.condition == chosen]


def named(rows: Sequence[metrics.Row], card: Card) -> dict[str, float]:
    """Return scores by metric and unit, without those that nothing tells.

    Of one element, whose map is a force, those of the force come first.
    """
    found = {f"{metric} ({unit})" if unit != "1" else metric: value for metric, unit, value, _ in rows}
    found = {name: value for name, value in found.items() if np.isfinite(value)}
    if card.kind == "windows" and card.shapes.rows * card.shapes.cols == 1:
        first = ("force_rmse (N)", "force_r2")
        return {name: found[name] for name in first if name in found} | found
    return found


def scores(model: Predictor, path: Path) -> list[metrics.Row]:
    """Return (metric, unit, value, n) of a model on a recording whose ground truth is known.

    The recording is read, cut and labelled as for training. Errors as the experiment's read_recording.
    """
    card, settings = model.card, model.card.reading
    module, task = experiments.module(card.experiment), tasks.of(card.experiment)
    place = path.parent if log_name(card.experiment) else path
    frames, _, _ = module.read_recording(place, settings)
    if card.kind == "windows":
        return _scores_of_windows(model, module, task, frames, settings)
    if card.kind == "series":
        asked = module.task(card.protocol, settings)
        y, press = schemas.matrix(frames["y_mm"])[:, list(asked.outputs)], frames["press"].to_numpy()
        counted = press >= 0 if asked.pressed_only else np.ones(len(y), bool)
        record = Record(_readings(frames, card), y, counted, np.zeros(len(y), bool), press)
        return metrics.series(record, model.predict(record.x), asked.outputs)
    chosen = frames.take(pa.array(module.chosen(frames, settings)))
    object_ = schemas.names(frames["condition"])[0]
    truth = np.eye(len(card.outputs.names))[[card.outputs.names.index(object_)] * chosen.num_rows]
    # Of one object alone, macro precision says nothing.
    return classification.scores(truth, model.predict(_readings(chosen, card)))[:1]


def _scores_of_windows(model: Predictor, module, task, frames: pa.Table, settings: Mapping) -> list[metrics.Row]:
    apart = {name: value for name, value in settings["window"].items() if name != "sliding"}
    windows = task.inputs(frames, {**settings, "window": apart})
    x = schemas.matrix(windows["x"]).astype(np.float32).reshape(windows.num_rows, model.card.shapes.frames, -1)
    previous = windows["previous"].to_numpy() if model.streams else None
    predicted, truth = model.of_windows(x, previous), module.labels(windows, settings)
    rows = task.score(module, truth, predicted, settings)
    if model.card.outputs.force_gain is not None:
        contact = metrics.in_contact(truth, settings)
        force_n = np.nansum(schemas.matrix(windows["force_n"]), axis=1)[contact]
        rows += metrics.force(force_n, predicted[contact], model.card.outputs.force_gain, settings)
    return rows
