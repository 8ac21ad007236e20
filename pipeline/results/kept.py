"""Keep what figures draw of what the stage evaluate predicted: a small table, which shards have, and the look in data/.

Figures show the first specimen alone (seed FIRST) and the protocols `drawn` of the experiment's facts; the counts of
confusions are of every seed and protocol. A row is of a protocol, a seed and a model; of the model LABEL it is the
truth, and of READING readings that no model was asked about. The columns by kind of input are in SCHEMAS:

* windows: `window`, a row of the dataset, and what of it is known, on the rows of LABEL alone. Of a prediction the
  largest value, the mean absolute and the mean squared error over its cells, of few windows the largest value in the
  element under each of two touches, and the whole map in half precision: 0.13 kPa off at 256 to 433 kPa. Of frames
  without a force readings, too, are of those with maps alone. A row of window WHOLE has the mean squared error over the
  whole test part of a condition.
* series: `window`, a row of the dataset, its time since the test part began, its readings (of LABEL) and its places;
  of presses that are known, the means over the second half of a press. A row of window WHOLE has the mean error in a
  tenth of the test part of a condition.
* images: how many images of an object were given a name; of READING the pictures and the frames that a paper's figures
  show. A failed run has no row.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from pipeline.results import shards
from tactile import experiments
from tactile.base import paths
from tactile.base.paths import Workspace
from tactile.datasets import images, labels, schemas, series, specimens
from tactile.experiments import glove
from tactile.scoring import classification
from tactile.scoring.estimates import read_tested, read_windows

FIRST = 0  # the seed that is drawn
LABEL, READING = "label", "reading"  # models of rows that are no model's
WHOLE = -1  # the window of a row that is of a whole test part, or of a part of it
LARGEST = 300_000  # bytes of a shard's file
PEAKS = 60  # windows of figure 4 of LoMP
PRESSES = 4  # of its figure 6
SPREAD = 400  # windows of a condition, evenly, of its figure 7
FRAMES = 300  # of a condition, evenly, of recordings without a force: 260 kB of 12 models
MAPPED = 4  # of these with maps, evenly
POINTS = 1200  # frames of its figure 5
LEAST_FRAMES = 3  # at a place of figure 5: fewer are the CNC on its way
COURSE_S = 15.0  # of a recording of one element, around its largest force
SHOWN_S = 120.0  # of a series from the start of its test part
THINNED = 5  # samples of a series to one reading of its drift
MOST_PRESSES = 300  # of a protocol, evenly over its test part
TIME_BINS = 10  # of a test part, equal numbers of samples in the order of time
GRASPED = "mobile_phone"  # of figure 10 of SP-ResNet, or the first object
SEQUENCE_FRAMES = 50  # of its figure 13
SOME, SEVERAL = "single", "double"  # conditions of LoMP's figures
BASE = {"protocol": schemas.NAME, "seed": pa.int16(), "model": schemas.NAME}
NUMBERS = pa.list_(pa.float32())
SCHEMAS = {
    "windows": pa.schema(
        BASE
        | {"window": pa.int32(), "condition": schemas.NAME, "recording": schemas.NAME, "press": pa.int32()}
        | {"t_s": pa.float64(), "force_n": NUMBERS, "x_mm": NUMBERS, "y_mm": NUMBERS, "counts": NUMBERS}
        | dict.fromkeys(("peak", "mean_absolute", "mean_square"), pa.float32())
        | {"at_touches": NUMBERS, "map": pa.list_(pa.float16()), "n": pa.int32()}
    ),
    "series": pa.schema(
        BASE
        | {"window": pa.int32(), "condition": schemas.NAME, "t_s": pa.float64(), "v": NUMBERS, "place_mm": NUMBERS}
        | {"error": pa.float64(), "n": pa.int32()}
    ),
    "images": pa.schema(
        BASE
        | {"object": schemas.NAME, "named": schemas.NAME, "images": pa.int32()}
        | {"recording": schemas.NAME, "values": pa.list_(pa.float16())}
    ),
}


def table(workspace: Workspace, experiment: str, settings: Mapping) -> pa.Table:
    """Return what figures draw of what the stage evaluate has predicted; settings: the experiment's block.

    Without a row of people's own logs, whose figures are drawn here and from all predictions.
    """
    if settings.get("source", "simulated") != "simulated":
        return none(experiment)
    parts = PARTS[experiments.module(experiment).KIND](workspace, experiment, settings)
    return pa.concat_tables([none(experiment), *parts]).unify_dictionaries().combine_chunks()


def read(path: Path, experiment: str) -> pa.Table:
    """Return a table that `write` wrote of an experiment. Raises InputError for a damaged file or another one."""
    return schemas.having(schemas.read(path), none(experiment).column_names, path)


def of_look(workspace: Workspace, experiment: str) -> pd.DataFrame:
    """Return what the stage `keep` kept here."""
    path = paths.require(workspace.kept(experiment), f"python -m pipeline.stages.keep {experiment}")
    return read(path, experiment).to_pandas()


def of_evidence(workspace: Workspace, experiment: str, budgets: Mapping[str, str]) -> pd.DataFrame:
    """Return what the shards of an experiment keep; budgets: protocol -> the one that is shown of it.

    Where several shards have the same model, or the truth, of one run, it is that of the first.
    """
    known, parts = set(), [none(experiment).to_pandas()]
    for line, path in shards.checked(workspace, shards.kept_file, experiment):
        rows = read(path, experiment).to_pandas()
        for run, part in rows.groupby(["protocol", "seed", "model"], observed=True, sort=False):
            if budgets.get(run[0]) == line["budget"] and run not in known:
                known.add(run)
                parts.append(part)
    return pd.concat(parts, ignore_index=True)


def none(experiment: str) -> pa.Table:
    """Return the table of an experiment without a row."""
    return SCHEMAS[experiments.module(experiment).KIND].empty_table()


def write(path: Path, rows: pa.Table) -> None:
    """Write a table of this module."""
    schemas.write(path, rows.schema, [rows])


def _rows(kind: str, count: int, /, **columns: Any) -> pa.Table:
    """Return rows of a kind of input; a column is one value of all, or has one for each: a name, number or array."""
    made = []
    for field in SCHEMAS[kind]:
        values = columns.pop(field.name, None)
        if values is None:
            made.append(pa.nulls(count, field.type))
        elif pa.types.is_list(field.type):
            flat = [np.asarray(row) for row in values]
            ends = np.cumsum([0, *map(len, flat)]).astype(np.int32)
            whole = np.concatenate([*flat, []])
            whole = whole.astype(np.float16 if field.type.value_type == pa.float16() else np.float32)
            made.append(pa.ListArray.from_arrays(pa.array(ends), pa.array(whole)))
        elif field.type == schemas.NAME:
            repeated = [values] * count if isinstance(values, str) else list(map(str, values))
            made.append(pa.array(repeated, pa.string()).dictionary_encode().cast(schemas.NAME))
        else:
            made.append(pa.array(np.broadcast_to(values, count)).cast(field.type))
    assert not columns, columns
    return pa.table(made, schema=SCHEMAS[kind])


def _spread(rows: np.ndarray, most: int) -> np.ndarray:
    """Return at most `most` of the rows, evenly spread, in their order."""
    return rows[np.unique(np.linspace(0, len(rows) - 1, min(most, len(rows))).astype(int))]


def _drawn(experiment: str, settings: Mapping) -> list[str]:
    """Return the protocols that are drawn, of those with a run of the seed FIRST."""
    drawn, protocols = experiments.facts(experiment).drawn, settings["protocols"]
    return [name for name in drawn if name in protocols and FIRST in protocols[name]["seeds"]]


def _tested(path: Path, protocol: str) -> np.ndarray:
    """Return the rows of a dataset that the run FIRST of a protocol tests on."""
    split = schemas.split_column(protocol, FIRST)
    return np.flatnonzero(schemas.names(schemas.read(path, [split])[split]) == "test")


def _windows(workspace: Workspace, experiment: str, settings: Mapping) -> Iterator[pa.Table]:
    """Yield the rows of windows; of a sensor of one element whose model gives one number, courses around a press."""
    path, label, drawn = workspace.dataset(experiment), settings["label"], _drawn(experiment, settings)
    for protocol in drawn:
        split = schemas.split_column(protocol, FIRST)
        whole = read_windows(workspace, experiment, where=pc.field(split).cast(pa.string()) == "test")
        pressed = "force_n" in whole.column_names
        test = _tested(path, protocol)
        truth = schemas.matrix(whole["y"])
        alone = truth.shape[1] == 1
        if alone:
            chosen, under_touches, mapped = _courses(whole)
        else:
            chosen, under_touches, mapped = _chosen(whole, settings) if pressed else _frames_of_conditions(whole)
        shown = whole.take(chosen)
        x, y = (schemas.matrix(shown[name]) for name in ("x_mm", "y_mm"))
        reading = schemas.matrix(shown["x"]).reshape(len(chosen), settings["window"]["frames"], -1)[:, -1]
        place = {"protocol": protocol, "seed": FIRST}
        described = {"condition": schemas.names(shown["condition"]), "recording": schemas.names(shown["recording"])}
        described |= {"press": shown["press"].to_numpy(), "t_s": shown["t_s"].to_numpy()}
        read = reading if pressed or alone else [row if keep else [] for row, keep in zip(reading, mapped, strict=True)]
        lists = {"counts": read} | ({} if alone else {"x_mm": x, "y_mm": y})
        lists |= {"force_n": schemas.matrix(shown["force_n"])} if pressed and not alone else {}
        cells = None if alone else _touched(x[:, :2], y[:, :2], settings["sensor"], label)

        def predicted(
            values: np.ndarray,
            chosen: np.ndarray = chosen,
            under: np.ndarray = under_touches,
            mapped: np.ndarray = mapped,
            cells: np.ndarray | None = cells,
            truth: np.ndarray = truth,
        ) -> dict:
            some = values[chosen]
            columns = {"peak": some.max(axis=1)}
            if cells is None:
                return columns
            off = some.astype(float) - truth[chosen]
            columns |= {"mean_absolute": np.abs(off).mean(axis=1), "mean_square": np.square(off).mean(axis=1)}
            columns["at_touches"] = [
                [row[cell].max() for cell in of] if keep else []
                for row, of, keep in zip(some, cells, under, strict=True)
            ]
            return columns | {"map": [row if keep else [] for row, keep in zip(some, mapped, strict=True)]}

        yield _rows("windows", len(chosen), **place, model=LABEL, window=test[chosen], **described, **lists,
                    **predicted(truth))  # fmt: skip
        condition = schemas.names(whole["condition"])
        pooled = experiments.facts(experiment).pooled
        for model in settings["models"]:
            values = read_tested(workspace, experiment, model, protocol, FIRST, test)
            yield _rows("windows", len(chosen), **place, model=model, window=test[chosen], **predicted(values))
            square = np.square(values.astype(float) - truth).mean(axis=1)
            parts = {name: condition == name for name in np.unique(condition)}
            parts |= {name: np.ones(len(test), bool) for name in pooled if len(parts) > 1}
            yield _rows("windows", len(parts), **place, model=model, window=WHOLE, condition=list(parts),
                        mean_square=[square[rows].mean() for rows in parts.values()],
                        n=[rows.sum() for rows in parts.values()])  # fmt: skip
    if drawn and experiments.facts(experiment).paper:
        yield _frames(workspace, experiment, settings, drawn[0])


def _courses(whole: pa.Table) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the windows around the largest force of each recording, of which no map is kept; as `_chosen`."""
    recording, force, time = (
        schemas.names(whole["recording"]),
        schemas.matrix(whole["y"])[:, 0],
        whole["t_s"].to_numpy(),
    )
    chosen = []
    for name in np.unique(recording):
        rows = np.flatnonzero(recording == name)
        chosen.append(rows[np.abs(time[rows] - time[rows[force[rows].argmax()]]) <= COURSE_S / 2])
    rows = np.concatenate([*chosen, np.zeros(0, int)]).astype(int)
    return rows, *np.zeros((2, len(rows)), bool)


def _frames_of_conditions(whole: pa.Table) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return FRAMES windows of each condition, evenly, and where MAPPED of them have maps; as `_chosen`.

    For frames without a measured force, of which none is pressed hardest.
    """
    condition = schemas.names(whole["condition"])
    each = [np.flatnonzero(condition == name) for name in np.unique(condition)]
    chosen = np.concatenate([*(_spread(rows, FRAMES) for rows in each), np.zeros(0, int)]).astype(int)
    mapped = np.concatenate([*(_spread(_spread(rows, FRAMES), MAPPED) for rows in each), np.zeros(0, int)])
    order = np.argsort(chosen)
    return chosen[order], np.zeros(len(chosen), bool), np.isin(chosen[order], mapped)


def _chosen(whole: pa.Table, settings: Mapping) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the windows of a test part that are drawn, where their touches are, and where their maps, (n,) bool.

    In contact: the first PEAKS of SOME, and SPREAD of SOME and of SEVERAL; the first PRESSES of SEVERAL of the first
    recording in which they are; of each condition the window of `hardest`.
    """
    condition, recording, press = (schemas.names(whole["condition"]), schemas.names(whole["recording"]),
                                   whole["press"].to_numpy())  # fmt: skip
    force, x = schemas.matrix(whole["force_n"]), schemas.matrix(whole["x_mm"])
    contact = (np.nan_to_num(force) > settings["window"]["contact_threshold_n"]).any(axis=1)
    parts = [np.flatnonzero((condition == SOME) & contact)[:PEAKS]]
    parts += [_spread(np.flatnonzero((condition == name) & contact), SPREAD) for name in (SOME, SEVERAL)]
    both = np.flatnonzero((condition == SEVERAL) & ~np.isnan(x[:, :2]).any(axis=1))
    both = both[recording[both] == recording[both[0]]] if len(both) else both
    both = both[np.isin(press[both], np.unique(press[both])[:PRESSES])]
    mapped = list(hardest(condition, force).values())
    chosen = np.unique(np.concatenate([*parts, both, mapped]).astype(int))
    return chosen, np.isin(chosen, both), np.isin(chosen, mapped)


def hardest(condition: np.ndarray, force_n: np.ndarray) -> dict[str, int]:
    """Return condition -> the window in which it is pressed hardest; condition: (n,), force_n: (n, touches), NaN there.

    Of two touches it is that of the largest force on the lighter one, of a slide one half way through it.
    """
    total, chosen = np.nansum(force_n, axis=1), {}
    both = np.nan_to_num(force_n[:, :2]).min(axis=1) if force_n.shape[1] > 1 else total
    for name in dict.fromkeys(condition):
        rows = np.flatnonzero(condition == name)
        strength = both if name == SEVERAL else total
        if name == "slide":
            rows = rows[total[rows] >= total[rows].max() / 2]
            chosen[name] = int(rows[len(rows) // 2])
        else:
            chosen[name] = int(rows[strength[rows].argmax()])
    return chosen


def _touched(x_mm: np.ndarray, y_mm: np.ndarray, sensor: Mapping, label: Mapping) -> np.ndarray:
    """Return the cells of a map that lie in the element under each touch, (n, touches, cells); none where NaN."""
    column, row = (axis.ravel() for axis in np.meshgrid(*labels.cell_centres(sensor, label)))
    cells = elements_at(column, row, sensor)
    there = np.where(np.isnan(x_mm), -1, elements_at(np.nan_to_num(x_mm), np.nan_to_num(y_mm), sensor))
    return cells == there[:, :, None]


def elements_at(x_mm: np.ndarray, y_mm: np.ndarray, sensor: Mapping) -> np.ndarray:
    """Return the number of the element under each place, row-major from the bottom row."""
    column = np.clip(x_mm // sensor["pitch_mm"], 0, sensor["cols"] - 1).astype(int)
    row = np.clip(y_mm // sensor["pitch_mm"], 0, sensor["rows"] - 1).astype(int)
    return row * sensor["cols"] + column


def middle_elements(sensor: Mapping) -> list[int]:
    """Return the elements of figure 5 of LoMP: the middle column from the middle row up, 12, 17 and 22 of its array."""
    return [row * sensor["cols"] + sensor["cols"] // 2 for row in range(sensor["rows"] // 2, sensor["rows"])]


def _frames(workspace: Workspace, experiment: str, settings: Mapping, protocol: str) -> pa.Table:
    """Return POINTS frames of single touches within the middle elements, in the row of places next to their centre."""
    path = paths.require(workspace.frames(experiment), f"python -m tactile.stages.ingest {experiment}")
    names = ["condition", "recording", "v", "force_n", "x_mm", "y_mm"]
    frames = schemas.read(path, names, pc.field("condition").cast(pa.string()) == SOME)
    frames = frames.filter(pa.array(specimens.of_seed(schemas.names(frames["recording"]), FIRST)))
    force, x, y = (schemas.matrix(frames[name])[:, 0] for name in ("force_n", "x_mm", "y_mm"))
    pressed, pitch = force > settings["window"]["contact_threshold_n"], settings["sensor"]["pitch_mm"]
    wanted = np.zeros(len(x), bool)
    for element in middle_elements(settings["sensor"]):
        centre_y, centre_x = ((place + 0.5) * pitch for place in divmod(element, settings["sensor"]["cols"]))
        inside = pressed & (np.abs(x - centre_x) < pitch / 2) & (np.abs(y - centre_y) < pitch / 2)
        rows = np.unique(np.round(y[inside], 1))
        if len(rows):
            inside &= np.round(y, 1) == rows[np.abs(rows - centre_y).argmin()]
        places, seen = np.unique(np.round(x[inside], 1), return_counts=True)
        wanted |= inside & np.isin(np.round(x, 1), places[seen >= LEAST_FRAMES])
    chosen = _spread(np.flatnonzero(wanted), POINTS)
    shown = frames.take(chosen)
    under = elements_at(x[chosen], y[chosen], settings["sensor"])
    counts = schemas.matrix(shown["v"])[np.arange(len(chosen)), under]
    columns = {"force_n": force[chosen, None], "x_mm": x[chosen, None], "y_mm": y[chosen, None]}
    return _rows("windows", len(chosen), protocol=protocol, seed=FIRST, model=READING, window=WHOLE,
                 counts=counts[:, None], **columns)  # fmt: skip


def _series(workspace: Workspace, experiment: str, settings: Mapping) -> Iterator[pa.Table]:
    """Yield the rows of series."""
    module = experiments.module(experiment)
    for protocol in _drawn(experiment, settings):
        task, predicted = module.task(protocol, settings), {}
        pieces = series.read(workspace.dataset(experiment), task, protocol, FIRST)
        test = _tested(workspace.dataset(experiment), protocol)
        for model in settings["models"]:
            predicted[model] = read_tested(workspace, experiment, model, protocol, FIRST, test)[:, list(task.outputs)]
        place = {"protocol": protocol, "seed": FIRST}
        for piece in pieces:
            tested = piece.part == "test"
            if not tested.any():
                continue
            record = series.Record(*(column[tested] for column in piece.record))
            rows, time = piece.rows[tested], piece.time_s[tested] - piece.time_s[tested][0]
            here, of = np.searchsorted(test, rows), {"condition": piece.condition, **place}
            guesses = {model: values[here] for model, values in predicted.items()}
            if (record.press[record.counted] >= 0).all():
                parts = _presses(record)
                at = np.array([part.start for part in parts], dtype=int)
                means = {model: [values[part].mean(axis=0) for part in parts] for model, values in guesses.items()}
                true = [record.y[part].mean(axis=0) for part in parts]
                yield _rows("series", len(at), **of, model=LABEL, window=rows[at], t_s=time[at], place_mm=true)
            else:
                shown = np.flatnonzero(time <= SHOWN_S)
                at = np.union1d(shown, np.arange(0, len(time), THINNED))
                yield _rows("series", len(at), **of, model=LABEL, window=rows[at], t_s=time[at], v=record.x[at],
                            place_mm=record.y[at])  # fmt: skip
                at, means = shown, {model: values[shown] for model, values in guesses.items()}
            for model, values in means.items():
                yield _rows("series", len(at), **of, model=model, window=rows[at], t_s=time[at], place_mm=values)
            bins = np.array_split(np.flatnonzero(record.counted), TIME_BINS)
            bins = [part for part in bins if len(part)]
            for model, values in guesses.items():
                off = values.astype(float) - record.y
                distance = np.abs(off[:, 0]) if off.shape[1] == 1 else np.linalg.norm(off, axis=1)
                times, errors = ([column[part].mean() for part in bins] for column in (time, distance))
                sizes = list(map(len, bins))
                yield _rows("series", len(bins), **of, model=model, window=WHOLE, t_s=times, error=errors, n=sizes)


def _presses(record: series.Record) -> list[slice]:
    """Return the second halves of the samples of MOST_PRESSES presses."""
    counted = np.flatnonzero(record.counted)
    _, first, size = np.unique(record.press[counted], return_index=True, return_counts=True)
    chosen = _spread(np.arange(len(first)), MOST_PRESSES)
    halves = [counted[first[k] + size[k] // 2 : first[k] + size[k]] for k in chosen]
    return [slice(int(half[0]), int(half[-1]) + 1) for half in halves]


def _images(workspace: Workspace, experiment: str, settings: Mapping) -> Iterator[pa.Table]:
    """Yield the counts of confusions, and what the figures of a paper show of its glove."""
    names = ["condition", "recording", "label"]
    runs = [(name, seed) for name, block in settings["protocols"].items() for seed in block["seeds"]]
    splits = [schemas.split_column(*run) for run in runs]
    whole = read_windows(workspace, experiment, [*names, *splits])
    objects = np.array(images.classes(whole))
    truth = np.eye(len(objects), dtype=int)[whole["label"].to_numpy()]
    for (protocol, seed), split in zip(runs, splits, strict=True):
        test = np.flatnonzero(schemas.names(whole[split]) == "test")
        place, there = {"protocol": protocol, "seed": seed}, truth[test].sum(axis=0)
        yield _rows("images", len(objects), **place, model=LABEL, object=objects, named=objects, images=there)
        for model in settings["models"]:
            predicted = read_tested(workspace, experiment, model, protocol, seed, test)
            if np.isfinite(predicted).all():
                counts = classification.confusion(truth[test], predicted)
                true, named = np.nonzero(counts)
                yield _rows("images", len(true), **place, model=model, object=objects[true], named=objects[named],
                            images=counts[true, named])  # fmt: skip
    if (drawn := _drawn(experiment, settings)) and experiments.facts(experiment).paper:
        yield from _grasp(workspace, experiment, settings, drawn[0], objects)


def _grasp(
    workspace: Workspace, experiment: str, settings: Mapping, protocol: str, objects: np.ndarray
) -> Iterator[pa.Table]:
    """Yield one grasp as an image of each dataset, and the last frames of each object's last session in mS."""
    place = {"protocol": protocol, "seed": FIRST, "model": READING}
    whole = read_windows(workspace, experiment, ["condition", "recording", *images.MODALITIES])
    of_first = specimens.of_seed(schemas.names(whole["recording"]), FIRST)
    name, sessions = schemas.names(whole["condition"]), schemas.names(whole["recording"])
    grasped = GRASPED if GRASPED in objects else objects[0]
    rows = np.flatnonzero((name == grasped) & of_first)
    rows = rows[sessions[rows] == sessions[rows[0]]]
    row = rows[len(rows) // 2]
    pictures = [schemas.matrix(whole[each])[row] for each in images.MODALITIES]
    yield _rows("images", len(pictures), **place, object=str(grasped), named=images.MODALITIES,
                recording=str(sessions[row]), values=pictures)  # fmt: skip
    path = paths.require(workspace.frames(experiment), f"python -m tactile.stages.ingest {experiment}")
    frames = schemas.read(path, ["condition", "recording"])
    name, sessions = schemas.names(frames["condition"]), schemas.names(frames["recording"])
    of_first = specimens.of_seed(sessions, FIRST)
    last = {each: np.flatnonzero((name == each) & of_first) for each in objects}
    last = {each: rows[sessions[rows] == max(sessions[rows])][-SEQUENCE_FRAMES:] for each, rows in last.items()}
    chosen = np.concatenate(list(last.values()))
    shown, areas = schemas.read(path, ["pressure", "strain"]).take(chosen), images.areas(settings)
    ohm = settings["sensor"]["reference_ohm"]
    pressure, strain = (glove.conductance(schemas.matrix(shown[each]), ohm) for each in ("pressure", "strain"))
    area = areas["strain"]
    joints = glove.joint_means(strain.reshape(-1, area.rows, area.cols), area.joint).reshape(len(chosen), -1)
    values = 1e3 * np.column_stack([pressure, joints[:, joints.any(axis=0)]])
    yield _rows("images", len(chosen), **place, object=name[chosen], recording=sessions[chosen], values=values)


PARTS = {"windows": _windows, "series": _series, "images": _images}  # by kind of input
