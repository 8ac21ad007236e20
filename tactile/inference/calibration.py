"""Calibrate the intervals of a trained model on its validation part, and test them on its test part.

Networks of windows and images stop by their validation part and are not fitted to it, which makes its errors only a
little smaller than those of new data. Most models of series are fitted to it, as published: their errors there are
those of training. For these, the same model is fitted again without the validation part, and the errors of that one
count (cross-conformal prediction with a single fold, Vovk 2015); fitted to less, it errs rather more than the model
itself. It is fitted once: what it gave is kept.
"""

import json
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from tactile import experiments, models, tasks
from tactile.base import files, foreign, params
from tactile.base.paths import Workspace
from tactile.datasets import images, schemas, series
from tactile.inference import card as cards
from tactile.inference import intervals, touches
from tactile.learning.regressors import TorchRegressor
from tactile.learning.series_regressors import Windowed
from tactile.learning.spec import Spec
from tactile.learning.trained import Trained
from tactile.scoring import conformal, metrics
from tactile.tasks import series as tasks_series
from tactile.tasks import windows

CALIBRATED, TESTED = "validation", "test"
BLOCK_S = 10.0  # of a series without presses: longer than a press of the finger, whose samples resemble one another
TOGETHER = "all"  # the conditions that were calibrated on, where there are several


class HeldOut(NamedTuple):
    """What a model said of rows of the validation or test part, of one output in one case; m of the n rows."""

    output: str
    case: str
    predicted: np.ndarray  # (m,), of objects (m, classes)
    truth: np.ndarray  # (m,), of objects the number of the class
    floor: float | None  # as of cards.Bound
    row: np.ndarray  # (m,) numbers among the n rows


class Rows(NamedTuple):
    """The n rows of validation and test part of a run, in the order of the dataset."""

    part: np.ndarray  # (n,)
    condition: np.ndarray  # (n,)
    recording: np.ndarray  # (n,)
    group: np.ndarray  # (n,) numbers: rows of one press, grasp or block
    name: str  # of a group
    shared: bool  # as of cards.Calibration
    outputs: list[HeldOut]


def calibrated(workspace: Workspace, values: Mapping, card: cards.Card, refit: bool) -> cards.Card:
    """Return a card with the calibration of the run that it describes; values: params.yaml.

    Without one where the dataset is not here, or the training diverged, so that there is no prediction; of a model of
    series that was fitted to its validation part also where it starts from model-0, which was, too, and where a model
    without that part was not fitted yet and must not be now (`refit` is false). Raises InputError where the run has not
    been trained.
    """
    if not workspace.dataset(card.experiment).exists() or not experiments.facts(card.experiment).stream:
        return card
    kept = workspace.calibration(card.experiment, card.model, card.protocol, card.seed)
    if kept.exists():
        with foreign.reading(kept, "a kept calibration", "remove it, and the calibration is made again"):
            known = json.loads(kept.read_text(encoding="utf-8"))
            given = cards.Calibration.model_validate(known["calibration"])
            if known["sha256"] == card.weights_sha256:
                return card.model_copy(update={"calibration": given})
    run = tasks.load(
        workspace, values, card.experiment, card.model, card.protocol, card.seed, Spec(**card.shapes.model_dump())
    )
    if run.failed:
        return card
    refitted = card.kind == "series" and fitted_to_validation(run.model)
    if refitted and (not refit or params.transfers(card.model)):
        return card
    rows = ROWS[card.kind](workspace, values, card, run)
    bounds = [_bound(rows, held_out) for held_out in rows.outputs]
    pairs = zip(rows.outputs, bounds, strict=True)
    given = cards.Calibration(
        level=conformal.LEVEL,
        group=rows.name,
        shared=rows.shared,
        refitted=refitted,
        bounds=bounds,
        coverage=[each for held_out, of in pairs if of.value is not None for each in _coverage(rows, held_out, of)],
    )
    if refitted:
        files.write_text(
            kept, json.dumps({"sha256": card.weights_sha256, "calibration": given.model_dump()}, indent=1) + "\n"
        )
    return card.model_copy(update={"calibration": given})


def fitted_to_validation(model) -> bool:
    """Tell whether a model of series is fitted to its validation part; networks of windows alone stop by it."""
    return not (isinstance(model, Windowed) and isinstance(model.inner, TorchRegressor))


def _bound(rows: Rows, held_out: HeldOut) -> cards.Bound:
    """Return the bound of an output from the validation part."""
    chosen = rows.part[held_out.row] == CALIBRATED
    predicted, truth = held_out.predicted[chosen], held_out.truth[chosen]
    group = rows.group[held_out.row[chosen]]
    if held_out.output == intervals.OBJECT:
        value = conformal.class_threshold(predicted, truth, group)
    else:
        value = conformal.half_width(truth - predicted, group, intervals.scale(predicted, held_out.floor))
    groups = len(np.unique(group))
    return cards.Bound(
        output=held_out.output,
        case=held_out.case,
        value=value if groups >= conformal.least() else None,
        floor=held_out.floor,
        groups=groups,
        rows=int(chosen.sum()),
    )


def _coverage(rows: Rows, held_out: HeldOut, of: cards.Bound) -> Iterator[cards.Coverage]:
    """Yield the coverage on the test part: of all conditions that were calibrated on, and of each other condition."""
    seen = np.unique(rows.condition[rows.part == CALIBRATED])
    condition, tested = rows.condition[held_out.row], rows.part[held_out.row] == TESTED
    known = np.isin(condition, seen)
    parts = {TOGETHER if len(seen) > 1 else str(seen[0]): known}
    parts |= {str(name): condition == name for name in np.unique(condition[tested & ~known])}
    if of.output == intervals.OBJECT:
        sets = conformal.class_sets(held_out.predicted, of.value)
        inside, width = sets[np.arange(len(sets)), held_out.truth], sets.sum(axis=1)
    else:
        low, high = intervals.limits(held_out.predicted, of)
        inside, width = (low <= held_out.truth) & (held_out.truth <= high), high - low
    for name, chosen in parts.items():
        chosen = chosen & tested
        if not chosen.any():
            continue
        found = conformal.coverage(inside[chosen], rows.group[held_out.row[chosen]])
        yield cards.Coverage(
            condition=name,
            output=of.output,
            case=of.case,
            width=float(np.mean(width[chosen], dtype=float)),
            **found._asdict(),
            reason=_reason(found, rows, name in seen or name == TOGETHER, width[chosen], of) if found.flagged else "",
        )


def _reason(found: conformal.Coverage, rows: Rows, known: bool, size: np.ndarray, of: cards.Bound) -> str:
    """Say why a coverage lies outside what is plausible, from what differs between validation and test part.

    known: the condition was calibrated on; size: (m,) width of each interval, or size of each set.
    """
    if of.output == intervals.OBJECT and of.value == 0:
        return "the true object too often has a probability of 0, so that sets hold all objects"
    if of.output == intervals.OBJECT and found.share > conformal.LEVEL and (size == 1).mean() > conformal.LEVEL:
        return "the likeliest object alone is right more often"
    low, high = conformal.expected(of.groups, found.groups)
    if low <= found.share <= high:
        groups = f"{of.groups} calibrating and {found.groups} test groups"
        return f"chance: {groups} give {100 * low:.0f} to {100 * high:.0f} %"
    if not known:
        return "not exchangeable: another condition than that of the calibration"
    if rows.shared:
        return "groups of the calibration were trained on"
    held, tested = (np.flatnonzero(rows.part == name) for name in (CALIBRATED, TESTED))
    alone = len(np.unique(rows.recording[held])) == len(np.unique(rows.group[held]))  # a group is a recording
    if not alone and not np.isin(rows.recording[held], rows.recording[tested]).any():
        return "not exchangeable: other recordings than those of the calibration"
    if not alone and all(
        (held[rows.recording[held] == name] < at).all() for name, at in _first(rows.recording, tested)
    ):
        return "not exchangeable: later in the recording than the calibration"
    return f"the {of.groups} groups of the calibration are unlike those of the test"


def _first(recording: np.ndarray, tested: np.ndarray) -> Iterator[tuple[str, int]]:
    """Yield each recording of the test rows with its first one; recording: (n,) of all rows."""
    for name, place in zip(*np.unique(recording[tested], return_index=True), strict=True):
        yield name, int(tested[place])


def _of_windows(workspace: Workspace, values: Mapping, card: cards.Card, run: Trained) -> Rows:
    settings = values[card.experiment]
    data = windows.read(workspace.dataset(card.experiment), settings, (card.protocol, card.seed))
    part, press = data.part(card.protocol, card.seed), data.rows["press"].to_numpy()
    recording = schemas.names(data.rows["recording"])
    _, group = np.unique(np.char.add(np.char.add(recording, "/"), press.astype(str)), return_inverse=True)
    rows = np.flatnonzero(np.isin(part, (CALIBRATED, TESTED)))
    predicted = np.empty((len(rows), data.y.shape[1]), np.float32)
    for name in (CALIBRATED, TESTED):  # a model of streams starts a window from the one before of the same part
        chosen = part[rows] == name
        predicted[chosen] = windows.predict(run.model, data.x[rows[chosen]], data, rows[chosen])
    force_n = np.nansum(schemas.matrix(data.rows["force_n"])[rows], axis=1, dtype=float)
    return Rows(
        part[rows],
        schemas.names(data.rows["condition"])[rows],
        recording[rows],
        group[rows],
        "press",
        bool(np.isin(group[part == CALIBRATED], group[part == "train"]).any()),
        _of_maps(
            metrics.as_maps(predicted, settings), metrics.as_maps(data.y[rows], settings), force_n, settings, card
        ),
    )


def _of_maps(
    maps: np.ndarray, truth: np.ndarray, force_n: np.ndarray, settings: Mapping, card: cards.Card
) -> list[HeldOut]:
    """Return the outputs of maps (n, rows, cols): the force with and without a touch, and the peak where there is one.

    A peak is the highest pressure of a map, compared with the highest of the label, wherever the two lie.
    """
    of_pressure = card.outputs.touch_kpa is not None
    said_n = touches.force_n(maps, card) if of_pressure else maps.sum(axis=(1, 2), dtype=float)
    peak, true_peak = (values.max(axis=(1, 2)).astype(float) for values in (maps, truth))
    touched, outputs = intervals.touched(peak, card), []
    for case, which in ((intervals.TOUCH, touched), (intervals.REST, ~touched)):
        at, pressed = np.flatnonzero(which), case == intervals.TOUCH
        floor_n = settings["window"]["contact_threshold_n"] if pressed else None
        if of_pressure and pressed:
            outputs.append(HeldOut(intervals.PEAK, case, peak[at], true_peak[at], card.outputs.touch_kpa, at))
        outputs.append(HeldOut(intervals.FORCE, case, said_n[at], force_n[at], floor_n, at))
    return outputs


def _of_series(workspace: Workspace, values: Mapping, card: cards.Card, run: Trained) -> Rows:
    task = experiments.module(card.experiment).task(card.protocol, values[card.experiment])
    columns, pressed = [], False
    pieces = series.read(workspace.dataset(card.experiment), task, card.protocol, card.seed)
    calibrating = _without_validation(values, card, pieces) if fitted_to_validation(run.model) else run.model
    for piece in pieces:
        record, part = piece.record, piece.part
        pressed |= bool((record.press >= 0).any())
        chosen = np.isin(part, (CALIBRATED, TESTED)) & record.counted
        if chosen.any():
            group = np.array(
                [f"{len(columns)}/{name}/{number}" for name, number in zip(part, _blocks(piece), strict=True)]
            )
            condition = np.full(len(part), piece.condition)
            recording = np.full(len(part), f"{piece.condition}/{len(columns)}")
            said = np.where((part == CALIBRATED)[:, None], calibrating.predict(record.x), run.predict(record.x))
            columns.append([each[chosen] for each in (part, condition, recording, group, said, record.y)])
    part, condition, recording, group, said, truth = (np.concatenate(each) for each in zip(*columns, strict=True))
    _, group = np.unique(group, return_inverse=True)
    everything = np.arange(len(part))
    outputs = [
        HeldOut(name, intervals.ALWAYS, said[:, k].astype(float), truth[:, k].astype(float), None, everything)
        for k, name in enumerate(card.outputs.names)
    ]
    name = "press" if pressed else f"block of {BLOCK_S:g} s"
    return Rows(part, condition, recording, group, name, False, outputs)


def _without_validation(values: Mapping, card: cards.Card, pieces: list[series.Piece]):
    """Return the model of a run, fitted again to its training part alone."""
    spec = Spec(**card.shapes.model_dump())
    block = params.run_settings(values, card.experiment, card.model, card.protocol)
    built = models.build(card.model, spec, block, f"{card.experiment}.models.{card.model}")
    model, records = tasks.of(card.experiment).adapted(built, spec), []
    for piece in pieces:
        if (trained := np.flatnonzero(piece.part == "train")).size:
            record = series.Record(*(column[: trained[-1] + 1] for column in piece.record))
            training = record.training.copy()
            training[np.flatnonzero(record.counted)[-1]] = False  # fit() wants a sample to report a loss of
            records.append(record._replace(training=training))
    known = tasks_series.known(model, records, values[card.experiment])
    model.fit(records, seed=card.seed, device=values["device"], base=None, **known)
    return model


def _blocks(piece: series.Piece) -> np.ndarray:
    """Return the number of the press that each sample belongs to or comes before, or of its block of BLOCK_S, (T,)."""
    press = piece.record.press
    if (press >= 0).any():
        ended = (press[:-1] >= 0) & (press[1:] != press[:-1])
        return np.cumsum(np.concatenate([[False], ended]))
    return ((piece.time_s - piece.time_s[0]) // BLOCK_S).astype(int)


def _of_images(workspace: Workspace, values: Mapping, card: cards.Card, run: Trained) -> Rows:
    path = workspace.dataset(card.experiment)
    data, table = images.read(path, card.protocol, card.seed), schemas.read(path, ["condition", "recording"])
    condition, recording = (schemas.names(table[name]) for name in ("condition", "recording"))
    _, group = np.unique(np.char.add(np.char.add(condition, "/"), recording), return_inverse=True)
    rows = np.flatnonzero(np.isin(data.part, (CALIBRATED, TESTED)))
    said, labels = run.predict(data.x[rows]), data.y[rows].argmax(axis=1)
    shared = bool(np.isin(group[data.part == CALIBRATED], group[data.part == "train"]).any())
    output = HeldOut(intervals.OBJECT, intervals.ALWAYS, said, labels, None, np.arange(len(rows)))
    return Rows(data.part[rows], condition[rows], recording[rows], group[rows], "grasp", shared, [output])


ROWS = {"windows": _of_windows, "series": _of_series, "images": _of_images}
