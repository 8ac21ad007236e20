"""Small models in packages of their own, and the lines of their sensors."""

from pathlib import Path

import numpy as np
import torch

from tactile import models, tasks
from tactile.base import files, ranges
from tactile.datasets.series import Record
from tactile.inference import card as cards
from tactile.inference import consistent, predictor
from tactile.learning.regressors import Scaled
from tactile.learning.spec import Spec
from tactile.learning.window_statistics import KINDS as KINDS_OF_STATISTICS
from tactile.settings.targets import Target
from tactile.targets import kept
from tactile.targets import models as target_models
from tactile.targets.features import Windows
from tactile.targets.validate import Final

ROWS, COLS, MAP = 2, 3, (8, 12)
FRAMES, STEP, INTERVAL_S = 3, 2, 0.02
LOMP = dict(hidden=8, readout=[6], neighbours=4, alpha=1.0, training=dict(learning_rate=1e-3, batch_size=8, epochs=1))
INGEST = {"max_reject_fraction": 0.1, "max_clock_offset_s": 5.0, "min_correlation": 0.5}
TOUCH = {
    "sensor": {"rows": ROWS, "cols": COLS, "pitch_mm": 12.0, "element_mm": 11.5},
    "ingest": INGEST | {"highest_count": 1023, "max_touches": 2},
    "window": {
        "frames": FRAMES,
        "frame_step": STEP,
        "stride": 4,
        "contact_threshold_n": 1.0,
        "sliding": {"single": 0.1},
    },
    "label": {"tip_radius_mm": 5.0, "map_rows": MAP[0], "map_cols": MAP[1]},
}
SERIES = {
    "sensor": {"channels": 5},
    "ingest": INGEST | {"rate_hz": 5, "max_gap_s": 2.0},
    "window": {"frames": 2},
}
IMAGES = {"sensor": {"reference_ohm": 1000.0}, "ingest": {"max_reject_fraction": 0.1}, "window": {"stride": 1}}
COUNT_KPA = 0.4  # of the linear model: pressure over an element is its count times this


def map_over(reading: np.ndarray) -> np.ndarray:
    """Return the pressure map of the linear model, (rows, cols) in kPa: as high over each element as its count says."""
    rows, cols = MAP
    over = np.kron(reading.reshape(ROWS, COLS), np.ones((rows // ROWS, cols // COLS)))
    middle = np.kron(np.ones((ROWS, COLS)), np.outer([0.5, 0.8, 1.0, 0.6], [0.5, 0.8, 1.0, 0.6]))
    return COUNT_KPA * over * middle


def saved(folder: Path, model, key: str, spec: Spec, **changed) -> Path:
    """Save a model with its card into a folder, and return it; changed: what of the card is not touch's."""
    folder.mkdir(parents=True, exist_ok=True)
    model.save(folder)
    weights = cards.weights_file(folder)
    inputs = dict(columns=spec.elements, unit="counts", order="row by row", interval_s=INTERVAL_S, frame_step=STEP)
    known = dict(
        experiment="touch",
        kind="windows",
        model=key,
        protocol="press",
        seed=0,
        commit="0" * 40,
        settings={},
        reading=TOUCH,
        shapes=cards.Shapes(**spec._asdict()),
        inputs=cards.Inputs(**inputs | changed.pop("inputs", {})),
        outputs=cards.Outputs(unit="kPa", touch_kpa=20.0, force_gain=2.0),
        precision=None,
        best_epoch=1,
        scores=[],
        files={weights.name: files.sha256(weights)},
    )
    cards.write(folder, cards.Card(**known | changed))
    return folder


def linear(folder: Path) -> Path:
    """Save a linear model of touch whose map is `map_over` of the newest frame."""
    spec = Spec(FRAMES, ROWS, COLS, *MAP)
    x = np.random.default_rng(0).uniform(0, 1023, (200, FRAMES, ROWS * COLS)).astype(np.float32)
    part = x, np.stack([map_over(window[-1]).ravel() for window in x]).astype(np.float32)
    model = tasks.of("touch").adapted(models.build("linear", spec, {}, "test"), spec)
    model.fit(part, part, seed=0)
    np.testing.assert_allclose(model.predict(x[:5]), part[1][:5], atol=0.1)
    return saved(folder, model, "linear", spec)


def stream(folder: Path) -> Path:
    """Save an untrained model of touch that carries a state, its read-out drawn so that its maps are not 0."""
    spec = Spec(FRAMES, ROWS, COLS, *MAP)
    model = models.build("lomp_stream", spec, LOMP, "test")
    model.scaled = Scaled(model.network, torch.full((6,), 200.0), torch.full((6,), 100.0), torch.tensor(250.0))
    drawn = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for name, weights in model.network.named_parameters():
            if name.startswith("readout."):
                weights.normal_(0, 0.5, generator=drawn)
    assert np.ptp(model.predict(np.full((1, FRAMES, ROWS * COLS), 300.0))) > 1
    return saved(folder, model, "lomp_stream", spec, settings=LOMP)


def series(folder: Path) -> Path:
    """Save a model of strain that tells x and y from three of five voltages."""
    spec, rng = Spec(2, 1, 3, 1, 2), np.random.default_rng(0)
    x = 2 + 0.1 * rng.normal(size=(200, 3)).astype(np.float32)
    record = Record(x, 10 * x[:, :2], np.ones(200, bool), np.arange(200) < 150, np.zeros(200, np.int32))
    settings = dict(units=20, spectral_radius=0.9, leak=0.3, input_scale=0.5, ridge=1e-6)
    model = tasks.of("strain").adapted(models.build("esn", spec, settings, "test"), spec)
    model.fit([record], seed=0)
    assert np.abs(model.predict(x)[20:] - record.y[20:]).mean() < 0.5 * np.abs(record.y - record.y.mean(0)).mean()
    return saved(
        folder,
        model,
        "esn",
        spec,
        experiment="strain",
        kind="series",
        settings=settings,
        protocol="task_2",
        reading=SERIES,
        inputs=dict(columns=5, unit="V", interval_s=0.2, frame_step=1, chosen=[4, 0, 2]),
        outputs=cards.Outputs(unit="mm", names=["x_mm", "y_mm"]),
    )


def images(folder: Path) -> Path:
    """Save a model of the glove that knows three objects."""
    spec = Spec(1, 32, 32, 1, 3)
    x = np.random.default_rng(0).integers(0, 255, (30, 1, 32 * 32)).astype(np.float32)
    part = x, np.eye(3, dtype=np.float32)[np.arange(30) % 3]
    model = tasks.of("glove").adapted(models.build("constant", spec, {}, "test"), spec)
    model.fit(part, part, seed=0)
    return saved(
        folder,
        model,
        "constant",
        spec,
        experiment="glove",
        kind="images",
        protocol="session_combined",
        reading=IMAGES,
        inputs=dict(columns=405, unit="levels", interval_s=0.14, frame_step=1),
        outputs=cards.Outputs(unit="probability", names=["bottle", "can", "cup"]),
    )


KINDS = {"linear": linear, "stream": stream, "series": series, "images": images}
BOUNDS = {
    "linear": [("peak_kpa", "touch", 2.0, 20.0), ("force_n", "touch", 0.5, 1.0), ("force_n", "no touch", 0.25, None)],
    "series": [("x_mm", "always", 1.5, None), ("y_mm", "always", None, None)],
    "images": [("object", "always", 0.3, None)],
}


def calibrated(kind: str, folder: Path, **changed) -> predictor.Predictor:
    """Return a saved model whose card has BOUNDS; changed: other parts of the card."""
    KINDS[kind](folder)
    bounds = [
        cards.Bound(output=output, case=case, value=value, floor=floor, groups=20 if value else 5, rows=100)
        for output, case, value, floor in BOUNDS[kind]
    ]
    given = cards.Calibration(level=0.9, group="press", shared=False, refitted=False, bounds=bounds, coverage=[])
    cards.write(folder, consistent.read(folder).model_copy(update={"calibration": given} | changed))
    return predictor.load(folder)


def press(n: int, element: int = 4) -> np.ndarray:
    """Return readings (n, 6) in counts of an array at rest, on which one element is pressed in the second half.

    No reading is that before it, so that a reading in the place of its neighbour is seen.
    """
    readings = np.full((n, ROWS * COLS), 20)
    readings[n // 2 :, element] = 500
    readings[:, 0] += np.arange(n) % 7
    assert (np.diff(readings, axis=0) != 0).any(axis=1).all()
    return readings


def printed(
    readings: np.ndarray,
    rate_hz: float = 1 / INTERVAL_S,
    begin_us: int = 1_000_000,
    end: bytes = b"\n",
    times_us: np.ndarray | None = None,
) -> bytes:
    """Return what an array prints for readings (n, columns) in counts, at a rate or at `times_us` (n,)."""
    times = begin_us + (np.arange(len(readings)) * 1e6 / rate_hz).astype(int) if times_us is None else times_us
    rows = zip(times.tolist(), readings.tolist(), strict=True)
    return b"".join(",".join(map(str, [t_us, *values])).encode() + b"\n" for t_us, values in rows)


def target(folder: Path, classes: tuple[str, ...] = (), model: str = "extra trees") -> Path:
    """Save the model of a target of one's own, on the array of `linear`: an angle, or one of some classes."""
    rng = np.random.default_rng(0)
    x = rng.uniform(0, 1000, (60, KINDS_OF_STATISTICS, ROWS * COLS)).astype(np.float32)
    y = np.eye(len(classes))[np.arange(60) % len(classes)] if classes else x[:, 0, :1] / 10
    number = np.arange(60) % 3
    windows = Windows(x, y, list(classes), number, ["a", "b", "c"], number, number, 1, x[:, 1], 0.1 * number)
    kind = "class" if classes else "continuous"
    row = next(row for row in target_models.rows(kind, 3) if row.name == model)
    (estimator,) = row.fit(windows.columns(row.view), y)
    known = {"name": "object", "kind": kind, "folder": 1} | ({} if classes else {"name": "angle", "unit": "deg"})
    folder.mkdir(parents=True, exist_ok=True)
    kept.write(
        folder,
        Final(row, estimator, 0.1, 20),
        windows,
        {"R2": 0.9},
        experiment="touch",
        sensor="pad",
        target=Target(**known),
        settings={name: TOUCH[name] for name in kept.READ},
        window_s=2.0,
        by="recording",
        interval_s=INTERVAL_S,
        correlation=None,
        commit="0" * 40,
        trained_on=[ranges.of(x[:, 0], "v", 0, range(ROWS * COLS), 0.5)],
        logs=[kept.Log(name="a/b", sha256="0" * 64, tests=["a"])],
        tests={"a": {"R2": 0.9}},
    )
    return folder
