"""Predictions have intervals that were calibrated on the validation part; without a calibration, nothing breaks."""

import io
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from builders import live_models

from tactile import models, tasks
from tactile.base.paths import Workspace
from tactile.datasets import schemas, series
from tactile.inference import calibration, consistent, intervals, predictions, predictor
from tactile.inference import card as cards
from tactile.inference.recordings import Predicted, Recording
from tactile.learning.trained import Trained
from tactile.live import outputs, server
from tactile.live.session import Prediction
from tactile.live.source import Reading
from tactile.tasks import series as series_task


def written(folder, model: predictor.Predictor, predicted: np.ndarray) -> tuple[dict, dict]:
    """Return the columns of predictions.parquet, and summary.json."""
    n, none = len(predicted), schemas.REJECTS.empty_table()
    recording = Recording(folder / "a.log", "a", "b", np.arange(n) / 50, np.zeros((n, 1)), np.zeros(n, int), 0, none)
    of_recording = Predicted(predicted, np.zeros(n, bool), [])
    with predictions.writing(folder, folder, model.card) as write:
        write(recording, of_recording, {})
    table = pq.read_table(folder / "predictions.parquet")
    return {name: table[name].to_pylist() for name in table.column_names}, predictions.read_summary(folder)


def test_a_map_has_intervals_of_force_and_peak(tmp_path):
    model = live_models.calibrated("linear", tmp_path / "model")
    maps = model.predict(live_models.press(20))
    columns, summary = written(tmp_path, model, maps)
    force, peak = np.array(columns["force_n"]), maps.max(axis=(1, 2))
    touched = peak >= model.card.outputs.touch_kpa
    assert touched.any() and (peak < model.card.outputs.touch_kpa).any() and np.isnan(peak).any()
    half = np.where(touched, 0.5 * np.sqrt(force + 1.0), 0.25)
    half[np.isnan(peak)] = np.nan
    np.testing.assert_allclose(columns["force_low_n"], force - half, rtol=1e-5)
    np.testing.assert_allclose(columns["force_high_n"], force + half, rtol=1e-5)
    np.testing.assert_allclose(np.array(columns["peak_high_kpa"])[touched], (peak + 2 * np.sqrt(peak + 20))[touched])
    assert np.isnan(np.array(columns["peak_low_kpa"])[~touched]).all()
    assert summary["interval"] == [
        "peak_kpa, touch: 90 % interval, +- 2 sqrt(prediction + 20) kPa; calibrated on 20 presses of the validation "
        "part",
        "force_n, touch: 90 % interval, +- 0.5 sqrt(prediction + 1) N; calibrated on 20 presses of the validation part",
        "force_n, no touch: 90 % interval, +- 0.25 N; calibrated on 20 presses of the validation part",
    ]


def test_a_bound_is_in_units_of_the_scale_of_its_own_prediction():
    """Errors that are three times the root of what was predicted, in every group, whatever their order."""
    predicted = np.arange(1.0, 41.0)
    truth = predicted + 3 * np.sqrt(predicted + 2)
    rows = calibration.Rows(
        np.full(40, calibration.CALIBRATED), np.full(40, "single"), np.full(40, "run0"), np.arange(40) // 2, "press",
        False, [],
    )  # fmt: skip
    held_out = calibration.HeldOut(intervals.FORCE, intervals.TOUCH, predicted, truth, 2.0, np.arange(40))
    assert calibration._bound(rows, held_out).value == pytest.approx(3.0)


def test_a_series_says_where_it_cannot_tell(tmp_path):
    model = live_models.calibrated("series", tmp_path / "model")
    predicted = np.array([[1.0, 2.0], [3.0, 4.0]], np.float32)
    columns, summary = written(tmp_path, model, predicted)
    assert (columns["x_low_mm"], columns["x_high_mm"]) == ([-0.5, 1.5], [2.5, 4.5])
    assert np.isnan(columns["y_low_mm"]).all() and np.isnan(columns["y_high_mm"]).all()
    assert summary["interval"][1] == (
        "y_mm: no interval; calibrated on 5 presses of the validation part, and 90 % need 9"
    )


def test_objects_have_a_set_with_the_likeliest_first(tmp_path):
    model = live_models.calibrated("images", tmp_path / "model")
    probabilities = np.array([[0.35, 0.6, 0.05], [0.2, 0.2, 0.6], [np.nan] * 3], np.float32)
    columns, _ = written(tmp_path, model, probabilities)
    assert columns["objects"] == [["can", "bottle"], ["cup"], []]


@pytest.mark.parametrize("kind", live_models.BOUNDS)
def test_live_and_the_exported_reader_give_the_intervals_of_predict(kind, tmp_path):
    model = live_models.calibrated(kind, tmp_path / "model")
    readings = {"linear": live_models.press(20), "series": np.full((20, 5), 2.0), "images": np.full((20, 405), 9.0)}[
        kind
    ]
    predicted = model.predict(readings)
    columns, _ = written(tmp_path, model, predicted)
    for name, values in model.intervals(predicted, readings).items():
        np.testing.assert_array_equal(values, columns[name])
    force_n = columns["force_n"][-1] if kind == "linear" else None
    last = Prediction(20, Reading(0.0, readings[-1], False), predicted[-1], [], force_n, 0.0, 0.0, False)
    said, text = outputs.fields(last, model.card), io.StringIO()
    outputs.Table(text, model.card).add(last)
    header, row = (line.split(",") for line in text.getvalue().splitlines())
    assert len(header) >= len(row) and json.dumps(said, allow_nan=False)
    for name in intervals.names(model.card):
        value = columns[name][-1]
        if kind == "images":
            assert said[name] == value and row[header.index(name)] == "|".join(value)
        elif np.isnan(value):
            assert said[name] is None and row[header.index(name)] == ""
        else:
            assert said[name] == pytest.approx(value, abs=1e-4) == float(row[header.index(name)])


def covered(output: str, case: str, condition: str, share: float, groups: int) -> cards.Coverage:
    return cards.Coverage(
        condition=condition, output=output, case=case, width=1.0, share=share, low=0.0, high=1.0, groups=groups,
        rows=10 * groups, reason="",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("tests", "words"),
    [
        ([("single", 0.9, 20)], ""),
        ([("single", 0.69, 20)], "; on held-out presses it held 69 % (single, 20 of them)"),
        (
            [("single", 0.9, 20), ("double", 0.7, 9), ("slide", 0.8, 30)],
            "; on held-out presses it held 70 % (double, 9 of them)",
        ),
        ([("single", 0.9, 20), ("double", 0.99, 9)], "; on held-out presses it held 99 % (double, 9 of them)"),
        ([("single", 0.9, 20), ("double", 0.0, 2)], ""),  # two presses tell nothing beside twenty
        ([("single", 0.5, 2)], "; on held-out presses it held 50 % (single, 2 of them)"),
    ],
)
def test_an_interval_carries_its_coverage_wherever_it_is_printed(tests, words, tmp_path):
    """In summary.json, in the model card, on the live page and in what live says; of the output and case it is of."""
    model = live_models.calibrated("linear", tmp_path / "model")
    coverage = [covered("force_n", "touch", *each) for each in tests]
    given = model.card.calibration.model_copy(update={"coverage": coverage})
    card = model.card.model_copy(update={"calibration": given})
    peak, touch, rest = intervals.sentences(card)
    assert touch == f"{intervals.sentences(model.card)[1]}{words}" and "held-out" not in peak + rest
    known = predictor.Predictor(model.model, card, None)
    assert server.description(card, known.interval_sentences)["intervals"] == [peak, touch, rest]
    _, summary = written(tmp_path, known, model.predict(live_models.press(20)))
    assert summary["interval"] == [peak, touch, rest]


@pytest.mark.parametrize("kind", live_models.BOUNDS)
def test_a_card_without_a_calibration_says_so(kind, tmp_path):
    model = predictor.load(live_models.KINDS[kind](tmp_path / "model"))
    assert '"calibration": null' in (tmp_path / "model" / cards.NAME).read_text()
    assert intervals.sentences(model.card) == ["no interval: this model's card has no calibration"]
    readings = np.zeros((2, model.card.inputs.columns))
    assert intervals.names(model.card) == [] and model.intervals(np.zeros((2, *model.output_shape)), readings) == {}


class Near:
    """A model that is off by the error that its first channel says, but nowhere in what it was fitted to."""

    def __init__(self):
        self.seen = 0

    def fit(self, records, **options):
        self.seen = len(records[0].x)

    def predict(self, x: np.ndarray) -> np.ndarray:
        return x[:, :2] * [1.0, 0.0] * (np.arange(len(x)) >= self.seen)[:, None]


def trained(model) -> Trained:
    """Return a model that was fitted to training and validation part."""
    model.seen = 2000
    return Trained(model, failed=False)


@pytest.fixture
def strain(tmp_path, monkeypatch):
    """Return workspace, settings and card of a model of strain, and the errors of its validation part in mm."""
    rng, n = np.random.default_rng(0), 3000
    press = np.where(np.arange(n) % 10 >= 5, np.arange(n) // 10, -1)
    error = rng.lognormal(0, 1, n // 10)[np.arange(n) // 10]  # of a press and the samples before it
    part = np.repeat(["train", "validation", "test"], n // 3)
    v = np.column_stack([error, error, error]).astype(np.float32)
    columns = {
        "condition": ["task_2"] * n,
        "recording": ["run"] * n,
        "segment": np.zeros(n, np.int16),
        "t_s": np.arange(n) / 5,
        "gap_before": np.zeros(n, bool),
        "press": press.astype(np.int32),
        "v": schemas.lists(v, pa.float32()),
        "y_mm": schemas.lists(np.zeros((n, 3)), pa.float32()),
    }
    table = pa.table(columns).cast(series.frames(3)).rename_columns({"y_mm": "y"})
    table = table.append_column(schemas.split_column("task_2", 0), pa.array(part).dictionary_encode())
    workspace = Workspace(tmp_path)
    workspace.dataset("strain").parent.mkdir(parents=True)
    schemas.write(workspace.dataset("strain"), table.schema, [table])
    card = consistent.read(live_models.series(tmp_path / "model"))
    monkeypatch.setattr(tasks, "load", lambda *given: trained(Near()))
    monkeypatch.setattr(models, "build", lambda *given: None)
    monkeypatch.setattr(series_task, "adapted", lambda *given: Near())
    card = card.model_copy(update={"protocol": "task_2", "inputs": card.inputs.model_copy(update={"columns": 3})})
    settings = {"sensor": {"channels": 3}, "window": {"frames": 2}, "budget": 1.0}
    settings |= {"protocols": {"task_2": {"seeds": [0]}}, "models": {"esn": {}}}
    return workspace, {"strain": settings, "device": "cpu"}, card, error[part == "validation"]


def test_a_model_is_calibrated_on_the_presses_of_its_validation_part_alone(strain, tmp_path, monkeypatch):
    workspace, values, card, errors = strain
    given = calibration.calibrated(workspace, values, card, refit=True).calibration
    x, y = given.bounds
    assert (x.output, y.output, x.groups, x.rows, given.group) == ("x_mm", "y_mm", 100, 1000, "press")
    by_hand = np.sort(errors)[int(np.ceil(0.9 * 101 * 10)) - 1]  # 100 presses of 10 samples, of which each weighs 1/101
    assert x.value == pytest.approx(by_hand) and y.value == 0
    (covered,) = [each for each in given.coverage if each.output == "x_mm"]
    assert covered.condition == "task_2" and covered.groups == 100 and covered.rows == 1000
    assert 0.75 < covered.share < 0.99 and covered.low < covered.share < covered.high
    assert covered.width == pytest.approx(2 * x.value)
    monkeypatch.undo()
    package = tmp_path / "model"
    cards.write(package, consistent.read(package).model_copy(update={"calibration": given}))
    said = predictor.load(package).intervals(np.array([[4.0, 7.0]]), np.full((1, 5), 2.0))
    wanted = {"x_low_mm": 4 - by_hand, "x_high_mm": 4 + by_hand, "y_low_mm": 7, "y_high_mm": 7}
    assert {name: float(values[0]) for name, values in said.items()} == pytest.approx(wanted)


def test_a_model_that_was_fitted_to_its_validation_part_is_fitted_again_without_it_once(strain, monkeypatch):
    workspace, values, card, errors = strain
    assert calibration.calibrated(workspace, values, card, refit=False) == card
    given = calibration.calibrated(workspace, values, card, refit=True)
    assert given.calibration.refitted and given.calibration.bounds[0].value > 0
    monkeypatch.setattr(Near, "fit", None)  # not again
    assert calibration.calibrated(workspace, values, card, refit=False) == given
    other = card.model_copy(update={"files": dict.fromkeys(card.files, "0" * 64)})
    assert calibration.calibrated(workspace, values, other, refit=False) == other


def test_a_drift_in_the_test_part_is_flagged_with_its_reason(strain, monkeypatch):
    workspace, values, card, *_ = strain

    class Drifting(Near):
        def predict(self, x):
            return super().predict(x) * np.where(np.arange(len(x)) < 2000, 1.0, 20.0)[:, None]

    monkeypatch.setattr(tasks, "load", lambda *given: trained(Drifting()))
    given = calibration.calibrated(workspace, values, card, refit=True).calibration
    (covered,) = [each for each in given.coverage if each.output == "x_mm"]
    assert covered.share < 0.6 and covered.reason == "not exchangeable: later in the recording than the calibration"


def test_a_failed_training_or_a_missing_dataset_gives_no_calibration(strain, monkeypatch, tmp_path):
    workspace, values, card, *_ = strain
    assert calibration.calibrated(Workspace(tmp_path / "empty"), values, card, refit=True) == card
    monkeypatch.setattr(tasks, "load", lambda *given: Trained(Near(), failed=True))
    assert calibration.calibrated(workspace, values, card, refit=True) == card
