"""Readings outside those of a model's training have a prediction, but no interval; all others keep theirs."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders import live_models
from builders.project import ROOT

from pipeline import scenes
from tactile.base import cards as base_cards
from tactile.base import params, ranges
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.commands import predict
from tactile.datasets import schemas
from tactile.experiments import glove
from tactile.inference import card as cards
from tactile.inference import consistent, intervals, predictions, predictor, recordings, training
from tactile.live import outputs
from tactile.live.session import Session
from tactile.live.source import Lines, line_format

VALUES = params.load(ROOT / "params.yaml")
PRETRAINED = {"touch": "lomp_stream", "strain": "lstm_direct", "glove": "sp_resnet"}
MOST = 2000  # readings of a recording
BOUNDS = {  # where the pretrained model has no calibration
    "strain": [cards.Bound(output=f"{axis}_mm", case="always", value=2.0, groups=20, rows=200) for axis in "xyz"]
}


@pytest.fixture(scope="module", params=PRETRAINED)
def known(request, tmp_path_factory) -> tuple[predictor.Predictor, recordings.Recording]:
    """Return a pretrained model with intervals, and a recording of the sensor that it was trained on."""
    experiment, folder = request.param, tmp_path_factory.mktemp(request.param)
    model = predictor.load(ROOT / "pretrained" / experiment / PRETRAINED[experiment])
    if experiment == "touch":
        log = ROOT / "data" / "sample" / "double" / "two_touches" / "array.log"
    else:
        planned, logs_of = scenes.plan(experiment, VALUES[experiment])
        wanted = next(each for each in planned if each.condition in (model.card.protocol, *(model.card.outputs.names)))
        scenes.write_logs(folder, [wanted], logs_of)
        (log,) = recordings.logs(folder, experiment)
    if experiment in BOUNDS:
        given = cards.Calibration(
            level=0.9, group="press", shared=False, refitted=False, bounds=BOUNDS[experiment], coverage=[]
        )
        model = predictor.Predictor(model.model, model.card.model_copy(update={"calibration": given}))
    read = recordings.read(log, "run", model.card)
    return model, read._replace(**{name: getattr(read, name)[:MOST] for name in ("t_s", "x", "segment")})


def test_a_recording_of_the_trained_sensor_keeps_its_intervals_and_a_shifted_one_has_none(known, tmp_path):
    model, recording = known
    half, n = len(recording.x) // 2, len(recording.x)
    third = np.zeros(recording.x.shape[1])
    for kind in model.card.trained_on:
        third[kind.first + np.array(kind.columns)] = (np.array(kind.high) - np.array(kind.low)) / 3
    shifted = recording.x + third * (np.arange(n) >= half)[:, None]
    tables, summaries = [], []
    for k, x in enumerate((recording.x, shifted)):
        of_log = recording._replace(x=x)
        (tmp_path / str(k)).mkdir()
        predicted = recordings.predict(model, of_log)
        with predictions.writing(tmp_path / str(k), tmp_path, model.card) as write:
            summaries.append(write(of_log, predicted, {}))
        tables.append(pq.read_table(tmp_path / str(k) / "predictions.parquet").to_pandas())
    before, after = tables
    assert before["outside_training"].mean() == summaries[0]["share_outside_training"] < 0.01
    out = after["outside_training"].to_numpy()
    assert out[half:].mean() > 0.5 and out[:half].tolist() == before["outside_training"][:half].tolist()
    assert f"{out.sum()} of {n} readings lie outside" in predict.outside(summaries[1])[0]
    ends = [name for name in intervals.names(model.card) if name != intervals.OUTSIDE]
    assert ends and after[ends][out].isna().all(axis=None)
    for name in ends:
        assert after[name][:half].notna().any() and after[name][:half].equals(before[name][:half])
    for name in set(after) - {*ends, "recording", "t_s", "touches", "outside_training"}:
        assert not after[name][half:].isna().any(), "predictions stay"


def test_a_window_is_outside_where_any_of_its_frames_is_and_live_says_the_same(tmp_path):
    readings = live_models.press(200)
    model = live_models.calibrated(
        "linear", tmp_path / "model", trained_on=[ranges.of(readings, "v", 0, range(6), ranges.MEAN_MARGIN)]
    )
    readings[150, 3] = 1000
    out = model.outside(readings)
    reach = (live_models.FRAMES - 1) * live_models.STEP
    assert np.flatnonzero(out).tolist() == list(range(150, 151 + reach, live_models.STEP))
    found = model.intervals(model.predict(readings), readings)
    assert np.isnan(found["force_low_n"]).tolist() == (out | (np.arange(200) < reach)).tolist()
    session = Session(model, Lines(line_format(model.card), "array.log", "the model"), lambda words: None)
    session._step_s = 1e-4
    came = [*session.take(live_models.printed(readings), 0.0), *session.finish()]
    assert [each.outside for each in came] == out.tolist()
    said = [json.loads(json.dumps(outputs.fields(each, model.card))) for each in came[reach:]]
    assert [each["outside_training"] for each in said] == out[reach:].tolist()
    assert [each["force_low_n"] is None for each in said] == out[reach:].tolist()
    assert all(each["force_n"] is not None for each in said)


def test_a_card_of_before_has_intervals_and_tells_nothing(tmp_path):
    model = live_models.calibrated("linear", tmp_path / "model")
    path = tmp_path / "model" / cards.NAME
    card = json.loads(path.read_text())
    assert card.pop("trained_on") is None
    path.write_text(base_cards.sealed(json.dumps(card), cards.NAME))
    model, readings = predictor.load(tmp_path / "model"), live_models.press(20) + 5000
    found = model.intervals(model.predict(readings), readings)
    assert intervals.OUTSIDE not in found and np.isfinite(found["force_low_n"][-1])
    assert not model.outside(readings).any() and intervals.OUTSIDE not in predictions.schema(model.card).names


def dataset(workspace: Workspace, experiment: str, protocol: str, part: np.ndarray, columns: dict) -> None:
    """Write a dataset with the part (n,) of each row."""
    split = {schemas.split_column(protocol, 0): pa.array(part).dictionary_encode()}
    table = pa.table(columns | split)
    workspace.dataset(experiment).parent.mkdir(parents=True)
    schemas.write(workspace.dataset(experiment), table.schema, [table])


def test_ranges_of_windows_and_series_are_of_the_training_part(tmp_path):
    workspace, n = Workspace(tmp_path), 60
    part = np.repeat(["train", "validation", "test"], n // 3)
    x = np.random.default_rng(0).uniform(0, 1, (n, 18)).astype(np.float32) + 5 * (part != "train")[:, None]
    windows = consistent.read(live_models.linear(tmp_path / "windows"))
    assert training.trained_on(workspace, {}, windows) is None, "no dataset"
    dataset(workspace, "touch", "press", part, {"x": schemas.lists(x, pa.float32())})
    (found,) = training.trained_on(workspace, {}, windows)
    frames = x[:20].reshape(-1, 6)
    assert (found.low, found.high) == (frames.min(axis=0).tolist(), frames.max(axis=0).tolist())
    assert found.mean_high == pytest.approx(frames.mean(axis=1).max()) and found.columns == list(range(6))

    names = pa.array(["task_2"] * n).dictionary_encode()
    columns = {"condition": names, "recording": names, "t_s": np.arange(n) / 5, "press": np.zeros(n, np.int32)}
    columns |= {"v": schemas.lists(x[:, :5], pa.float32()), "y": schemas.lists(x[:, :3], pa.float32())}
    dataset(workspace, "strain", "task_2", part, columns)
    card = consistent.read(live_models.series(tmp_path / "series"))
    inputs = card.inputs.model_copy(update={"chosen": list(range(5))})
    card = card.model_copy(update={"protocol": "task_2", "inputs": inputs})
    (found,) = training.trained_on(workspace, {"sensor": {"channels": 5}}, card)
    assert found.high == x[:20, :5].max(axis=0).tolist()


@pytest.mark.parametrize(("protocol", "areas"), [("session_strain", "s"), ("session_combined", "ps")])
def test_ranges_of_images_are_of_the_readings_of_the_areas_that_the_model_sees(protocol, areas, tmp_path):
    workspace, settings, n = Workspace(tmp_path), VALUES["glove"], 200
    schema, rng = glove.frames_schema(settings), np.random.default_rng(0)
    x = rng.integers(0, 1000, (n, 405))
    names = pa.array(["can"] * n).dictionary_encode()
    columns = {"condition": names, "recording": names, "segment": np.zeros(n), "t_s": np.arange(n) / 7}
    columns |= {"gap_before": np.zeros(n, bool), "pressure": schemas.lists(x[:, :270], pa.int16())}
    frames = pa.table(columns | {"strain": schemas.lists(x[:, 270:], pa.int16())}).select(schema.names).cast(schema)
    chosen = glove.chosen(frames, settings)
    part = np.where(np.arange(len(chosen)) % 2, "test", "train")
    dataset(workspace, "glove", protocol, part, {"t_s": frames["t_s"].to_numpy()[chosen]})
    schemas.write(workspace.frames("glove"), schema, [frames])
    card = consistent.read(live_models.images(tmp_path / "model")).model_copy(update={"protocol": protocol})
    found = training.trained_on(workspace, settings, card)
    assert "".join(kind.name for kind in found) == areas
    trained = x[chosen[::2]]
    for kind in found:
        places = slice(0, 270) if kind.name == "p" else slice(270, 405)
        assert kind.high == trained[:, places].max(axis=0).tolist()
        beyond = trained[:1].astype(float)
        assert not ranges.outside(beyond, found).any()
        beyond[0, places.stop - 1] = 9999
        assert ranges.outside(beyond, found).all()
        number = places.stop - 1 - places.start
        assert f"column {kind.name}{number}: 9999 levels" in ranges.sentence(
            beyond, np.array([True]), found, "levels", "set"
        )
    schemas.write(workspace.frames("glove"), schema, [frames.slice(30)])
    with pytest.raises(InputError, match="run `dvc repro`"):
        training.trained_on(workspace, settings, card)


def test_a_column_that_was_constant_has_a_margin():
    readings = np.column_stack([np.full(50, 7.0), np.arange(50.0)])
    (kind,) = trained_on = [ranges.of(readings, "v", 0, range(2), ranges.MEAN_MARGIN)]
    moved = readings[:1] + [[0.9 * kind.margin, 0], [1.1 * kind.margin, 0]]
    assert ranges.outside(moved, trained_on).tolist() == [False, True]
    rest = [ranges.of(np.full((50, 2), 7.0), "v", 0, range(2), ranges.MEAN_MARGIN)]
    assert ranges.outside(np.array([[7.0, 7.0], [7.0, 7.001]]), rest).tolist() == [False, True]
