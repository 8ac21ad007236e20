"""Models on series: counts of the paper, causality, transfer, read-outs, scores and decoders."""

import itertools

import numpy as np
import pytest
import torch

from pipeline.studies.latent import decoded, settled
from tactile import models
from tactile.base.errors import InputError
from tactile.datasets import series
from tactile.learning.series_regressors import adapted, ridge_weights
from tactile.learning.spec import Spec, of_series

RECIPE = {"learning_rate": 5e-3, "epochs": 3, "drop_epoch": 2, "drop": 0.2, "clip": 1.0, "streams": 1, "batch": 1}
BLOCKS = {
    "constant": {},
    "ridge": {"ridge": 1.0},
    "esn": {"units": 30, "spectral_radius": 0.9, "leak": 0.5, "input_scale": 0.5, "ridge": 1e-6},
    "lstm_direct": {"units": 8, "training": RECIPE},
    "lstm_transfer": {"training": RECIPE | {"learning_rate": 0.05}},
    "lstm_transfer_ridge": {"ridge": 1e-6},
}


def spec(outputs: int, channels: int = 6) -> Spec:
    task = series.Task(tuple(range(outputs)), {"a": list(range(channels))}, False, "a")
    return of_series(task, 5)


def build(name: str, shapes: Spec, block: dict | None = None):
    return adapted(models.build(name, shapes, BLOCKS[name] if block is None else block, "test"), shapes)


def record(samples: int = 400, outputs: int = 2) -> series.Record:
    """Voltages that are mixtures of a random walk and its velocity."""
    rng = np.random.default_rng(1)
    y = np.cumsum(rng.normal(size=(samples, outputs)), axis=0)
    x = 2 + 0.01 * y @ rng.normal(size=(outputs, 6)) + 0.001 * rng.normal(size=(samples, 6))
    everything = np.ones(samples, dtype=bool)
    training = np.arange(samples) < 0.9 * samples
    return series.Record(x.astype(np.float32), y.astype(np.float32), everything, training, np.full(samples, -1))


@pytest.fixture(scope="module")
def model_zero(tmp_path_factory):
    """A folder with a direct LSTM trained on three outputs."""
    folder = tmp_path_factory.mktemp("zero")
    model = build("lstm_direct", spec(3))
    model.fit([record(outputs=3)], seed=0, device="cpu", base=None)
    model.save(folder)
    return folder


@pytest.mark.parametrize("seed", range(4))
def test_every_reservoir_has_the_spectral_radius_asked_for(seed):
    model = build("esn", spec(2), BLOCKS["esn"] | {"units": 80})
    assert np.abs(np.linalg.eigvals(model.make(6, seed)["reservoir"])).max() == pytest.approx(0.9, rel=1e-5)


@pytest.mark.parametrize(("outputs", "direct", "transfer"), [(1, 11_450, 50), (2, 11_500, 100)])
def test_published_numbers_of_parameters(tmp_path, outputs, direct, transfer):
    zero = build("lstm_direct", spec(3), {"units": 50, "training": RECIPE | {"epochs": 1}})
    zero.fit([record(50, 3)], seed=0, device="cpu", base=None)
    zero.save(tmp_path)
    assert build("lstm_direct", spec(outputs), {"units": 50, "training": RECIPE}).parameters() == direct
    for name in ("lstm_transfer", "lstm_transfer_ridge"):
        model = build(name, spec(outputs))
        model.fit([record(50, outputs)], seed=0, device="cpu", base=tmp_path)
        assert model.parameters() == transfer
        target = tmp_path / name
        target.mkdir()
        model.save(target)
        again = build(name, spec(outputs))
        again.load(target)
        assert again.parameters() == transfer


HIGHPASS = {"learning_rate": 1e-2, "epochs": 5, "batch": 4, "length": 30, "warm_up": 10, "clip": 1.0}
EVERY_BLOCK = BLOCKS | {
    "lstm_highpass": {"filters": 5, "taps": 4, "units": 8, "training": HIGHPASS},
    "press_difference": {"press": 2, "trees": 3, "min_samples_leaf": 2},
    "window_ridge": {"parts": 4, "shares": False},
    "window_trees": {"trees": 3, "min_samples_leaf": 2},
}
BLIND = ("lstm_highpass", "press_difference")  # to a constant offset of a voltage


@pytest.mark.parametrize("name", EVERY_BLOCK)
def test_a_series_model_is_causal_and_goes_step_by_step(name, model_zero):
    data, model = record(), build(name, spec(2), EVERY_BLOCK[name])
    model.fit([data], seed=3, device="cpu", base=model_zero)
    predicted, later = model.predict(data.x), data.x.copy()
    later[200:] += 1
    np.testing.assert_allclose(model.predict(later)[:200], predicted[:200], atol=1e-4)
    steps = np.concatenate([model.step(data.x[k : k + 1]) for k in range(40)])
    np.testing.assert_allclose(steps, predicted[:40], atol=2e-3)
    assert model.step(data.x[:7]).shape == (7, 2)  # another number of streams starts anew
    offset = np.array([0.5, -0.25, 0.125, 0.5, 1.0, 0.25], np.float32)  # of which no digit is lost in the sum
    moved = np.abs(model.predict(data.x + offset) - predicted)[10:].max() / np.ptp(predicted, axis=0).max(initial=1)
    assert name == "constant" or (moved < 0.05) == (name in BLIND), moved


def test_transfer_leaves_the_recurrent_part_alone_and_closed_form_fits_no_worse(model_zero):
    data = record()
    block = {"training": RECIPE | {"learning_rate": 0.05, "epochs": 200, "drop_epoch": 125}}
    adam, solved = build("lstm_transfer", spec(2), block), build("lstm_transfer_ridge", spec(2))
    losses = [model.fit([data], seed=0, device="cpu", base=model_zero)[-1]["train_loss"] for model in (adam, solved)]
    assert losses[1] <= losses[0] * 1.0001
    zero = build("lstm_direct", spec(3))
    zero.load(model_zero)
    for name, weight in zero.network.lstm.state_dict().items():
        assert torch.equal(weight, adam.network.lstm.state_dict()[name])


def test_transfer_needs_model_zero_of_the_same_channels(model_zero):
    with pytest.raises(InputError, match="cannot be model-0 itself; name a model like lstm_direct"):
        build("lstm_transfer", spec(2)).fit([record()], seed=0, device="cpu", base=None)
    with pytest.raises(InputError, match="6 channels, this task 5"):
        data = record()
        build("lstm_transfer", spec(2, 5)).fit([data._replace(x=data.x[:, :5])], seed=0, base=model_zero)


def test_streams_are_the_end_of_the_series_side_by_side():
    blocks = ({"units": 8, "training": RECIPE | {"streams": k, "batch": k}} for k in (1, 4))
    one, four = (build("lstm_direct", spec(2), block) for block in blocks)
    data = record(402)  # two samples do not fill a stream
    losses = [model.fit([data], seed=0, device="cpu", base=None)[0]["train_loss"] for model in (one, four)]
    assert losses[0] != losses[1] and losses[0] == pytest.approx(losses[1], rel=0.2)


def test_uncounted_samples_do_not_matter():
    data = record()
    counted = np.arange(400) % 3 == 0
    spoilt = data._replace(counted=counted, y=np.where(counted[:, None], data.y, 1e3))
    for name in ("ridge", "esn", "lstm_direct"):
        clean, other = build(name, spec(2)), build(name, spec(2))
        clean.fit([data._replace(counted=counted)], seed=0, device="cpu", base=None)
        other.fit([spoilt], seed=0, device="cpu", base=None)
        np.testing.assert_allclose(clean.predict(data.x), other.predict(data.x), atol=1e-5)


def test_impossible_settings_are_one_sentence(tmp_path):
    block = EVERY_BLOCK["lstm_highpass"]
    for change, sentence in (
        ({"taps": 1}, "taps: input should be greater than or equal to 2, got 1"),
        ({"training": HIGHPASS | {"rate": 1}}, "test.training: unknown key 'rate'; known: learning_rate"),
        ({"training": HIGHPASS | {"warm_up": 30}}, "warm_up should be less than length"),
    ):
        with pytest.raises(InputError, match=sentence):
            build("lstm_highpass", spec(2), block | change)
    with pytest.raises(InputError, match="no stretch of 5000 samples to train on; lower training.length"):
        model = build("lstm_highpass", spec(2), block | {"training": HIGHPASS | {"length": 5000}})
        model.fit([record()], seed=0, device="cpu")
    with pytest.raises(InputError, match="press is 10, which needs windows of 13 samples, but they have 5"):
        build("press_difference", spec(2), EVERY_BLOCK["press_difference"] | {"press": 10})
    with pytest.raises(InputError, match="not found; train the model first"):
        build("lstm_highpass", spec(2), block).load(tmp_path)


def test_training_never_gets_the_test_part():
    data = record(100)
    part = series.chronological(100, 0.8, 0.125)
    assert [int((part == name).sum()) for name in ("train", "validation", "test")] == [70, 10, 20]
    piece = series.Piece("a", np.arange(100), part, np.arange(100) / 5, data)
    (seen,) = series.seen_in_training([piece])
    assert len(seen.x) == len(seen.y) == 80
    untouched = series.Piece("b", np.arange(100), np.full(100, "test"), np.arange(100) / 5, data)
    assert len(series.seen_in_training([piece, untouched])) == 1


@pytest.mark.parametrize("name", EVERY_BLOCK)
def test_all_models_of_a_table_are_fitted_to_the_same_samples(name, model_zero):
    """To the end of the validation part: what this holds changes every model."""
    data = record()
    other = data._replace(y=np.where(data.training[:, None], data.y, 20 - data.y))
    models = [build(name, spec(2), EVERY_BLOCK[name]) for _ in range(2)]
    losses = [
        model.fit([one], seed=0, device="cpu", base=model_zero)[-1]
        for model, one in zip(models, (data, other), strict=True)
    ]
    assert losses[0]["train_loss"] != losses[1]["train_loss"]
    predicted = [model.predict(data.x) for model in models]
    assert not np.array_equal(*predicted) and np.isfinite(predicted).all()


@pytest.mark.parametrize("name", ["esn", "lstm_direct", "lstm_transfer_ridge", "lstm_highpass"])
def test_inputs_and_outputs_are_scaled_by_the_training_part_alone(name, model_zero):
    data = record()
    counted = np.arange(400) % 3 > 0
    model = build(name, spec(2), EVERY_BLOCK.get(name))
    model.fit([data._replace(counted=counted)], seed=0, device="cpu", base=model_zero)
    expected = {"x": data.x[data.training], "y": data.y[data.training & counted]}
    for column, values in expected.items():
        np.testing.assert_allclose(getattr(model.scaling, f"{column}_mean"), values.mean(0, dtype=float), rtol=1e-6)
        np.testing.assert_allclose(getattr(model.scaling, f"{column}_spread"), values.std(0, dtype=float), rtol=1e-6)


def test_highpass_keeps_its_last_epoch(monkeypatch):
    """Though its validation loss rises from epoch to epoch."""
    model = build("lstm_highpass", spec(2), EVERY_BLOCK["lstm_highpass"] | {"training": HIGHPASS})
    rising = itertools.count(1)
    monkeypatch.setattr(model, "_loss", lambda *_: float(next(rising)))
    history = model.fit([record()], seed=0, device="cpu", base=None)
    assert [row["validation_loss"] for row in history] == [1, 2, 3, 4, 5]
    assert model.summary.best_epoch == 5


def test_decoder_reads_what_is_there_and_nothing_else():
    rng = np.random.default_rng(0)
    time = np.arange(6000) / 5
    drift = np.sin(time / 300)[:, None]
    seen = np.column_stack([2 * drift + 0.01 * rng.normal(size=(6000, 1)), rng.normal(size=(6000, 3))])
    assert decoded(seen, drift, time) > 0.95
    assert decoded(seen[:, 1:], drift, time) < 0.1


@pytest.mark.parametrize("inputs", [20, 200])
def test_decoder_is_tested_on_blocks_that_it_has_not_seen(inputs):
    """A decoder with as many inputs as samples in a block, or more, knows noise by heart where it is fitted."""
    rng, samples = np.random.default_rng(0), 400
    given, noise, time = rng.normal(size=(samples, inputs)), rng.normal(size=(samples, 1)), np.arange(samples) / 5
    assert decoded(given, noise, time) < 0
    drift = np.cumsum(rng.normal(size=(samples, 1)), axis=0)
    assert decoded(given, rng.permutation(drift), time) < 0
    everywhere = given @ np.linalg.lstsq(given, noise, rcond=None)[0]  # fitted on the blocks that it is tested on
    assert 1 - np.square(everywhere - noise).sum() / np.square(noise).sum() > 0.04


def test_decoder_knows_nothing_of_the_fifth_of_the_blocks_that_it_is_tested_on():
    time = np.arange(9000) / 5  # half an hour: 15 blocks of two minutes, 3 in each fifth
    fifth = (time // 120).astype(int) % 5
    assert decoded(np.eye(5)[fifth], fifth[:, None].astype(float), time) < 0
    sixth = (time // 120).astype(int) % 6  # of which every fifth has seen some
    assert decoded(np.eye(6)[sixth], sixth[:, None].astype(float), time) > 0.9


def test_drift_is_read_when_the_states_have_forgotten_their_start():
    """An LSTM begins with states of 0; where these were decoded, too, R2 was -3.0 in place of 0.97."""
    time = 7.0 + np.arange(30_000) / 5
    assert settled(time, 10).tolist() == [*range(300, 30_000)]
    assert settled(time[:200], 10).tolist() == [*range(20, 200)], "a tenth of a short recording"
    assert settled(time[:50], 10).tolist() == [*range(9, 50)], "at least a window"


def test_ridge_weights_are_the_minimum():
    rng = np.random.default_rng(0)
    states, y = rng.normal(size=(50, 4)), rng.normal(size=(50, 2))
    weights = ridge_weights(states, y, 0.1)

    def cost(w):
        return np.square(states @ w - y).sum() / 50 + 0.1 * np.square(w).sum()

    assert all(cost(weights) < cost(weights + 0.01 * rng.normal(size=weights.shape)) for _ in range(5))


def test_reservoir_in_pieces_forgets_where_they_start():
    block = {"units": 200, "spectral_radius": 0.95, "leak": 0.3, "input_scale": 0.5, "ridge": 1e-6}  # of params.yaml
    model = models.build("esn", spec(2), block, "test")
    system = model.make(6, 0)
    x = np.random.default_rng(0).normal(size=(1, 9001, 6)).astype(np.float32)
    whole = model.advance(system, x, None)[0]
    exact, state = [], None
    for start in range(0, len(x[0]), 1900):  # too short to be cut into pieces, each from the state before
        part = model.advance(system, x[:, start : start + 1900], state)
        exact.append(part[0])
        state = part[:, -1]
    np.testing.assert_allclose(whole, np.concatenate(exact), rtol=0, atol=1e-6)
    np.testing.assert_array_equal(whole[:500], exact[0][:500])
