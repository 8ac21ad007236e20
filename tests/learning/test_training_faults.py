"""Training with faults: what a batch then has, in numbers, what it leaves alone, and that it helps."""

import numpy as np
import pytest
import torch
from torch import nn

from pipeline.stability import perturbations
from tactile.base.errors import InputError
from tactile.datasets import levels, series
from tactile.datasets.levels import Levels
from tactile.learning.faults import FaultDraws, Readings
from tactile.learning.image_classifier import ImageClassifier
from tactile.learning.lstm import LstmRegressor
from tactile.learning.regressors import TorchRegressor
from tactile.learning.series_regressors import Windowed
from tactile.learning.spec import Spec, of_images
from tactile.models import cnn, lomp_stream, lstm_highpass
from tactile.settings.training import (
    AugmentedTraining,
    Faults,
    ScheduledTraining,
    SequenceTraining,
    StretchTraining,
    WindowTraining,
)

FAULTS = {"dead": 0.1, "gain": 0.2, "offset": 0.02}
WINDOWS = {"learning_rate": 0.01, "batch_size": 8, "epochs": 2, "rest_share": 1.0}
IMAGES = {"learning_rate": 0.01, "batch_size": 8, "epochs": 2, "flip": 0.0, "noise": 0.0, "affine": 0.0}
SERIES = {"learning_rate": 5e-3, "epochs": 2, "drop_epoch": 2, "drop": 0.2, "clip": 1.0, "streams": 1, "batch": 1}
CPU = torch.device("cpu")
COUNTS = Levels(1000.0, np.array([100.0, 200, 300, 50, 0]), 0.0, 0.0, 1000.0, whole=True)
VOLTS = Levels(np.array([1.0, 2, 4, 1, 1]), np.array([2.0, 1, 2.5, 3, 1]), 5.0, 0.0, 5.0)


class Drawn:
    """A generator that gives the numbers that FaultDraws drew, in place of new ones."""

    def __init__(self, normal=None, order=None):
        self.normal, self.order = normal, order

    def standard_normal(self, size):
        assert size == len(self.normal)
        return self.normal

    def permutation(self, n):
        assert n == len(self.order)
        return self.order


def draws(faults: dict, known: Levels = COUNTS, mean=0.0, spread=1.0, seed=0) -> FaultDraws:
    scale = torch.full((5,), float(mean)), torch.full((5,), float(spread))
    return FaultDraws(Faults(**{"dead": 0.0, "gain": 0.0, "offset": 0.0} | faults), known, seed, CPU, *scale)


@pytest.mark.parametrize(("mean", "spread"), [(0, 1), (40, 7)])
@pytest.mark.parametrize("known", [COUNTS._replace(whole=False), VOLTS], ids=["counts", "volts"])
def test_a_fault_is_that_of_the_stress_tests(known, mean, spread):
    """Of each of three windows, with the numbers that were drawn for it; no window has the faults of another."""
    known = known._replace(lowest=-1e6, highest=1e6)
    x = np.random.default_rng(0).uniform(1, 4, (3, 6, 5))
    inputs = torch.from_numpy(((x - mean) / spread).astype(np.float32))
    for name, test, level in (
        ("gain", perturbations.gain_drift, {"rest": known.rest}),
        ("offset", perturbations.offset_drift, {"span": known.span}),
        ("dead", perturbations.dead, {"low": known.low}),
    ):
        one = draws({name: 0.4}, known, mean, spread)
        drawn = one.drawn(3)
        found = one.changed(inputs, drawn).numpy() * spread + mean
        for k in range(3):
            gain, offset, chance = drawn[k].numpy().astype(float)
            failing = int((chance < 0.4).sum())
            rng = Drawn({"gain": gain, "offset": offset}.get(name), np.argsort(chance))
            expected = test(x[k], failing if name == "dead" else 0.4, rng, **level)
            np.testing.assert_allclose(found[k], expected, rtol=1e-4, atol=1e-3)
        assert not np.allclose(found, x, atol=0.1)


def test_a_batch_has_faults_of_the_stated_rate_and_spread():
    n = 20_000
    x = torch.full((n, 2, 5), 500.0)
    fine = COUNTS._replace(whole=False, lowest=-1e9, highest=1e9)
    found = {name: draws({name: size}, fine) for name, size in FAULTS.items()}
    found = {name: one.changed(x, one.drawn(n)).numpy() for name, one in found.items()}
    assert all((each[:, 0] == each[:, 1]).all() for each in found.values())  # the same in all frames
    dead = found["dead"][:, 0] == 0
    assert dead.mean() == pytest.approx(0.1, abs=0.004)
    assert dead.mean(axis=0) == pytest.approx(np.full(5, 0.1), abs=0.01)
    assert dead.sum(axis=1).var() == pytest.approx(5 * 0.1 * 0.9, rel=0.05)  # each element by itself
    gain = np.log((found["gain"][:, 0] - COUNTS.rest) / (500 - COUNTS.rest))
    assert gain.std(axis=0) == pytest.approx(np.full(5, 0.2), rel=0.03) and abs(gain.mean()) < 0.003
    offset = (found["offset"][:, 0] - 500) / COUNTS.span
    assert offset.std(axis=0) == pytest.approx(np.full(5, 0.02), rel=0.03) and abs(offset.mean()) < 3e-4
    between = np.corrcoef(np.concatenate([gain, offset], 1), rowvar=False) - np.eye(10)
    assert abs(between).max() < 0.04


def test_readings_stay_in_the_range_counts_whole_and_cells_that_are_not_wired_as_they_are():
    wired = np.array([True, True, False, True, True])
    one = draws({"dead": 0.2, "gain": 1.0, "offset": 0.5}, COUNTS._replace(wired=wired))
    x = torch.randint(0, 1001, (500, 3, 5)).float()
    found = one.changed(x, one.drawn(500))
    assert float(found.min()) == 0 and float(found.max()) == 1000 and torch.equal(found, found.round())
    assert torch.equal(found[..., 2], x[..., 2]) and (found != x)[..., wired].float().mean() > 0.9
    loose = draws({"dead": 1.0}, VOLTS)
    assert (loose.changed(x[:2], loose.drawn(2)) == 5).all()  # a strand that has come loose reads the supply


class Seen(nn.Module):
    """Notes what a network is given: in training, and where it validates."""

    def __init__(self, network):
        super().__init__()
        self.network, self.trained, self.validated = network, [], []

    def forward(self, x):
        (self.trained if self.training and torch.is_grad_enabled() else self.validated).append(x.detach().clone())
        return self.network(x)


SPEC = Spec(2, 1, 5, 1, 3)


def window_data(n=48, seed=0):
    x = np.random.default_rng(seed).integers(400, 600, (n, 2, 5)).astype(np.float32)
    return x, x[:, 0, :3] / 10


def windows_seen(faults, seed=0):
    """A model of windows of which one in three begins a stream of its own, and what it was given in counts."""
    known = COUNTS._replace(rest=np.full(5, 400.0))
    block = WINDOWS | ({"faults": Faults(**faults)} if faults else {})
    network = lambda: Seen(nn.Sequential(nn.Flatten(), nn.Linear(10, 3)))  # noqa: E731
    model = TorchRegressor(network, SPEC, WindowTraining(**block))
    given = {"levels": known} if faults else {}
    history = model.fit(window_data(), window_data(seed=1), seed=seed, device="cpu", **given)
    counts = lambda parts: torch.cat(parts) * model.scaled.input_spread + model.scaled.input_mean  # noqa: E731
    return model, history, counts(model.network.trained), counts(model.network.validated)


def images_seen(faults, seed=0):
    """As windows_seen: images of 5 cells, each as wide as the readings' largest, in counts of that."""
    block = IMAGES | ({"faults": Faults(**faults)} if faults else {})
    network = lambda: Seen(nn.Sequential(nn.Flatten(), nn.Linear(5, 2)))  # noqa: E731
    model = ImageClassifier(network, of_images(2, (1, 5)), AugmentedTraining(**block))
    readings, y = window_data(96)[0][:, 0], np.eye(2, dtype=np.float32)[np.arange(96) % 2]
    shown = lambda cells: cells / 1000 * 255  # noqa: E731
    known = Readings(readings[:48], COUNTS._replace(rest=np.full(5, 400.0)), shown)
    given = {"readings": known} if faults else {}
    x = shown(readings)[:, None].astype(np.float32)
    history = model.fit((x[:48], y[:48]), (x[48:], y[48:]), seed=seed, device="cpu", **given)
    seen = model.network[1]
    return model, history, *(torch.cat(parts).flatten(2) * 1000 for parts in (seen.trained, seen.validated))


def record(samples=600, outputs=2) -> series.Record:
    """Five channels, each of which tells both outputs apart, between 1 and 4 V."""
    rng = np.random.default_rng(1)
    y = np.sin(np.cumsum(rng.normal(scale=0.2, size=(samples, outputs)), axis=0))
    x = 2.5 + y @ rng.normal(scale=0.5, size=(outputs, 5)) + 0.01 * rng.normal(size=(samples, 5))
    training = np.arange(samples) < 0.8 * samples
    free = np.full(samples, -1)
    return series.Record(np.clip(x, 1, 4).astype(np.float32), y.astype(np.float32), free < 0, training, free)


def series_seen(faults, seed=0, streams=48):
    """As windows_seen: an LSTM on a series in pieces, in volts."""
    block = SERIES | {"streams": streams, "batch": 8} | ({"faults": Faults(**faults)} if faults else {})
    model = LstmRegressor(Spec(5, 1, 5, 1, 2), 4, SequenceTraining(**block), transfer=False)
    given = {"levels": VOLTS._replace(rest=np.full(5, 1.0))} if faults else {}
    taken, validated = [], []
    forward = model.network.__class__.forward

    def noted(network, x):
        (taken if torch.is_grad_enabled() else validated).append(x.detach().clone())
        return forward(network, x)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(model.network.__class__, "forward", noted)
        history = model.fit([record()], seed=seed, device="cpu", base=None, **given)
    volts = lambda parts: torch.cat(parts) * model.scaling.x_spread + model.scaling.x_mean  # noqa: E731
    return model, history, volts(taken), volts(validated) if validated else None


KINDS = {"windows": (windows_seen, 0.0), "images": (images_seen, 0.0), "series": (series_seen, 5.0)}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_trained_on_has_the_faults_and_comes_in_the_order_of_a_training_without(kind):
    seen, low = KINDS[kind]
    clean, dead = seen(None)[2], seen({"dead": 0.1, "gain": 0.0, "offset": 0.0})[2]
    failed = (dead - low).abs() < 1e-2
    assert not ((clean - low).abs() < 1e-2).any()
    assert torch.equal(failed.any(1), failed.all(1))  # an element fails in all frames of a window or none
    assert float(failed[:, 0].float().mean()) == pytest.approx(0.1, abs=0.06)
    assert len(set(map(tuple, failed[:, 0].tolist()))) > 3  # not the same ones in every example
    torch.testing.assert_close(dead[~failed], clean[~failed], rtol=1e-5, atol=1e-2)


@pytest.mark.parametrize("kind", KINDS)
def test_gains_and_offsets_reach_the_network(kind):
    seen = KINDS[kind][0]
    clean = seen(None)[2]
    for faults, spread in (({"gain": 0.2, "offset": 0.0}, 0.2), ({"gain": 0.0, "offset": 0.02}, 0.02)):
        changed = seen({"dead": 0.0} | faults)[2]
        rest, span = (1.0, torch.tensor(VOLTS.span)) if kind == "series" else (400.0, 1000.0)
        if faults["gain"]:
            usable = (clean - rest > (0.5 if kind == "series" else 50)) & (
                changed < (4.99 if kind == "series" else 999)
            )
            found = torch.log((changed - rest) / (clean - rest))[usable]
        else:
            found = ((changed - clean) / span).flatten()
        assert float(found.std()) == pytest.approx(spread, rel=0.25), faults


@pytest.mark.parametrize("kind", KINDS)
def test_what_validates_is_as_it_was_read(kind):
    seen = KINDS[kind][0]
    clean, faulty = (seen(faults)[3] for faults in (None, FAULTS))
    if kind == "series":  # which without faults reports the loss that it trains on
        clean, part = seen(None)[2], faulty
        assert all((part_of == clean).flatten(1).all(1).any() for part_of in part)
    else:
        assert torch.equal(clean, faulty)


@pytest.mark.parametrize("kind", KINDS)
def test_the_seed_alone_draws_the_faults(kind):
    seen = KINDS[kind][0]
    once, again, other = (seen(FAULTS, seed=seed) for seed in (3, 3, 4))
    assert torch.equal(once[2], again[2]) and once[1] == again[1]
    assert not torch.equal(once[2], other[2])


def test_draws_are_independent_of_those_of_the_order_and_of_other_seeds():
    one, same, other = draws(FAULTS, seed=5), draws(FAULTS, seed=5), draws(FAULTS, seed=6)
    drawn = one.drawn(4)
    assert torch.equal(drawn, same.drawn(4)) and not torch.equal(drawn, other.drawn(4))
    order = torch.Generator().manual_seed(5)
    assert not torch.isclose(drawn[:, :2], torch.randn(4, 2, 5, generator=order)).any()


STREAMS = Spec(2, 1, 5, 1, 5)


def press_data(presses=(4, 1, 3), presses_more=0):
    """Windows of presses one after the other, and the window before each."""
    lengths = [*presses, *[2] * presses_more]
    previous = np.concatenate([[-1, *range(first, first + length - 1)] for first, length in
                               zip(np.cumsum([0, *lengths[:-1]]), lengths, strict=True)])  # fmt: skip
    x = np.random.default_rng(0).integers(400, 600, (len(previous), 2, 5)).astype(np.float32)
    return x, x[:, 0] / 10, previous


def test_a_press_of_a_stream_keeps_its_faults():
    x, y, previous = press_data(presses_more=20)
    training = ScheduledTraining(
        learning_rate=1e-9, batch_size=6, epochs=1, faults=Faults(dead=0.3, gain=0.0, offset=0.0)
    )
    model = lomp_stream.build(STREAMS, hidden=2, readout=[2], neighbours=4, alpha=1.0, training=training)
    given, update = [], model.update

    def noted(train, descend, windows, state, drawn):
        seen = model._with_faults(train[0][windows], drawn)
        given.extend(zip(windows.tolist(), seen * model.scaled.input_spread + model.scaled.input_mean, strict=True))
        return update(train, descend, windows, state, drawn)

    model.update = noted
    model.fit((x, y, previous), (x, y, previous), seed=0, device="cpu", levels=COUNTS)
    failed = {window: (seen.abs() < 1e-2).all(0).tolist() for window, seen in given}
    assert len(given) == len(failed) == len(x)
    press = np.cumsum(previous < 0)
    for one in np.unique(press):
        assert len({tuple(failed[k]) for k in np.flatnonzero(press == one)}) == 1
    assert len({tuple(each) for each in failed.values()}) > 5
    assert np.mean(list(failed.values())) == pytest.approx(0.3, abs=0.15)


def test_a_batch_that_goes_through_in_parts_keeps_the_faults_of_its_windows():
    whole, parts = windows_seen(FAULTS)[2], None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(TorchRegressor, "chunk", 3)
        parts = windows_seen(FAULTS)[2]
    torch.testing.assert_close(parts, whole, rtol=1e-5, atol=1e-2)


# Losses of the last of two epochs, training and validation, before networks could be trained with faults.
BEFORE = {
    windows_seen: (3100.3827, 2522.3507),
    images_seen: (0.70183396, 0.70444608),
    series_seen: (0.46357888, 0.72755422),
}


@pytest.mark.parametrize("seen", BEFORE)
def test_without_faults_a_training_gives_the_numbers_that_it_gave_before(seen):
    last = seen(None)[1][-1]
    assert (last["train_loss"], last["validation_loss"]) == pytest.approx(BEFORE[seen], rel=1e-4)


def test_a_training_with_faults_needs_to_know_the_readings():
    block = {"faults": Faults(**FAULTS)}
    stretch = {"learning_rate": 1e-2, "epochs": 1, "batch": 4, "length": 30, "warm_up": 10, "clip": 1.0}
    spec = Spec(5, 1, 5, 1, 2)
    convolutions = cnn.build(spec, channels=[2], hidden=[3], training=WindowTraining(**WINDOWS | block))
    models = [
        LstmRegressor(spec, 4, SequenceTraining(**SERIES | block), transfer=False),
        Windowed(convolutions, spec),
        lstm_highpass.build(spec, filters=2, taps=3, units=3, training=StretchTraining(**stretch | block)),
    ]
    for model in models:
        with pytest.raises(InputError, match="training.faults: .* take `faults` out of the model's block"):
            model.fit([record()], seed=0, device="cpu", base=None)
        model.fit([record()], seed=0, device="cpu", base=None, levels=levels.of_series([record()], {}))
        assert np.isfinite(model.predict(record().x)).all()
    classifier = ImageClassifier(lambda: nn.Flatten(), of_images(2, (1, 5)), AugmentedTraining(**IMAGES | block))
    x, y = np.zeros((4, 1, 5), np.float32), np.eye(2, dtype=np.float32)[[0, 1, 0, 1]]
    with pytest.raises(InputError, match="images or windows without the sensor's readings"):
        classifier.fit((x, y), (x, y), seed=0, device="cpu")


def told(n, seed):
    """What is to be told, in -1 .. 1 (n,), and readings (n, 5) of 0 to 1000: the first element says it best."""
    rng = np.random.default_rng(seed)
    truth = rng.uniform(-1, 1, n)
    noise = rng.normal(size=(n, 5)) * [10, 80, 80, 80, 80]
    return truth, np.clip(500 + 300 * truth[:, None] + noise, 1, 1000).round().astype(np.float32)


def errors_of_windows(faults, changed):
    (truth, x), (held, seen) = told(400, 0), told(200, 1)
    network = lambda: nn.Sequential(nn.Flatten(), nn.Linear(5, 24), nn.ReLU(), nn.Linear(24, 1))  # noqa: E731
    training = WindowTraining(**WINDOWS | {"epochs": 25, "batch_size": 20} | faults)
    model = TorchRegressor(network, Spec(1, 1, 5, 1, 1), training)
    known = COUNTS._replace(rest=np.full(5, 500.0))
    given = {"levels": known} if faults else {}
    parts = ((a[:, None], b[:, None].astype(np.float32)) for a, b in ((x, truth), (seen, held)))
    model.fit(*parts, seed=0, device="cpu", **given)
    return np.abs(model.predict(changed(seen)[:, None])[:, 0] - held).mean()


def errors_of_images(faults, changed):
    """The share of images of which the wrong one of two objects is named."""
    (truth, x), (held, seen) = told(400, 0), told(200, 1)
    network = lambda: nn.Sequential(nn.Flatten(), nn.Linear(5, 24), nn.ReLU(), nn.Linear(24, 2))  # noqa: E731
    training = AugmentedTraining(**IMAGES | {"epochs": 25, "batch_size": 20} | faults)
    model = ImageClassifier(network, of_images(2, (1, 5)), training)
    shown = lambda cells: cells / 1000 * 255  # noqa: E731
    given = {"readings": Readings(x, COUNTS._replace(rest=np.full(5, 500.0)), shown)} if faults else {}
    parts = (
        (shown(a)[:, None], np.eye(2, dtype=np.float32)[(b > 0).astype(int)]) for a, b in ((x, truth), (seen, held))
    )
    model.fit(*parts, seed=0, device="cpu", **given)
    return (model.predict(shown(changed(seen))[:, None]).argmax(1) != (held > 0)).mean()


def errors_of_series(faults, changed):
    (truth, x), (held, seen) = told(500, 0), told(200, 1)
    recipe = {"learning_rate": 2e-2, "epochs": 50, "drop_epoch": 35, "streams": 20, "batch": 5}
    model = LstmRegressor(Spec(5, 1, 5, 1, 1), 12, SequenceTraining(**SERIES | recipe | faults), transfer=False)
    everything, free = np.full(500, True), np.full(500, -1)
    one = series.Record(x / 200, truth[:, None].astype(np.float32), everything, everything, free)
    given = {"levels": levels.of_series([one], {})._replace(low=0.0)} if faults else {}
    model.fit([one], seed=0, device="cpu", base=None, **given)
    return np.abs(model.predict(changed(seen) / 200)[:, 0] - held).mean()


@pytest.mark.parametrize("errors", [errors_of_windows, errors_of_images, errors_of_series])
def test_a_network_trained_with_faults_loses_less_to_dead_elements(errors):
    def with_dead(x):
        """Each of ten parts of the readings with two dead elements of its own."""
        rng = np.random.default_rng(0)
        return np.concatenate([perturbations.dead(part, 2, rng, low=0.0) for part in np.array_split(x, 10)])

    faults = {"faults": Faults(dead=0.2, gain=0.0, offset=0.0)}
    plain, faulty = ([errors(one, changed) for changed in (np.copy, with_dead)] for one in ({}, faults))
    assert plain[0] < 0.15 and faulty[0] < 0.2  # both have learned
    assert plain[1] > 0.2 and faulty[1] < 0.7 * plain[1], (plain, faulty)
