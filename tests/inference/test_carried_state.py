"""`predict` against a prediction by hand, where what a model has seen before matters: over several pieces of a log."""

import numpy as np
import pytest
import torch
from builders import random_models

from tactile.inference import predictor
from tactile.learning import series_regressors


def sigmoid(x: np.ndarray) -> np.ndarray:
    return 1 / (1 + np.exp(-x))


def lstm(network: torch.nn.LSTM, x: np.ndarray) -> np.ndarray:
    """Return the states of the last layer (T, units) for inputs (T, n) from zero, by the equations of an LSTM."""
    weights = {name: value.detach().double().numpy() for name, value in network.named_parameters()}
    for layer in range(network.num_layers):
        of_x, of_h, at_x, at_h = (
            weights[f"{kind}_l{layer}"] for kind in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")
        )
        h, c, states = np.zeros(network.hidden_size), np.zeros(network.hidden_size), []
        for row in x:
            into, forget, cell, out = np.split(of_x @ row + at_x + of_h @ h + at_h, 4)
            c = sigmoid(forget) * c + sigmoid(into) * np.tanh(cell)
            h = sigmoid(out) * np.tanh(c)
            states.append(h)
        x = np.array(states)
    return x


def array(n: int) -> np.ndarray:
    """Return readings of six elements (n, 6) in counts that no two lines share."""
    return np.random.default_rng(2).uniform(40, 200, (n, 6)).astype(np.float32).round()


def scaled(model, x: np.ndarray) -> np.ndarray:
    """Return counts as a network sees them: minus 100 + k, over 30 + k of element k, as random_models scales them."""
    return (x - (100 + np.arange(6))) / (30 + np.arange(6))


def test_windows_of_an_lstm_each_begin_anew_over_all_blocks(tmp_path, monkeypatch):
    """Frames are two lines apart, and seven windows are predicted at once."""
    monkeypatch.setattr(predictor, "SOME_WINDOWS", 7)
    model, x = predictor.load(random_models.save("rnn", tmp_path)), array(25)
    said, network = model.predict(x), model.model.scaled.network
    assert np.isnan(said[:4]).all()
    (inner, inner_bias), (outer, bias) = (
        (layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in network.readout[::2]
    )
    for k in range(4, 25):
        state = lstm(network.lstm, scaled(model, x[[k - 4, k - 2, k]]))[-1]
        read_out = outer @ np.maximum(inner @ state + inner_bias, 0) + bias
        np.testing.assert_allclose(said[k].ravel(), 250 * read_out, rtol=1e-3, atol=0.05)
    assert np.nanmax(np.abs(np.diff(said, axis=0))) > 1


def test_streams_of_lomp_carry_their_states_from_the_first_line(tmp_path):
    """Lines take turns: each second one goes on from the one two before."""
    model, x = predictor.load(random_models.save("lomp_stream", tmp_path)), array(31)
    network, said = model.model.scaled.network, model.predict(x)
    states = {0: None, 1: None}
    for k in range(31):
        given = torch.from_numpy(scaled(model, x[None, k : k + 1])).float()
        with torch.no_grad():
            maps, states[k % 2] = network.go_on(given, states[k % 2])
        if k < 4:
            assert np.isnan(said[k]).all()
        else:
            np.testing.assert_allclose(said[k].ravel(), 250 * maps.numpy().ravel(), rtol=1e-3, atol=0.05)
    assert np.abs(model.predict(x[10:])[4] - said[14]).max() > 0.1, "what came before matters"


@pytest.mark.parametrize("pieces", [1, 3])
def test_a_series_of_an_lstm_is_one_state_from_end_to_end(pieces, tmp_path):
    """Also where it comes sample by sample, and more than one series is predicted by one model."""
    model = predictor.load(random_models.save("lstm_direct", tmp_path))
    x = 2 + 0.1 * np.random.default_rng(3).normal(size=(60, 5)).astype(np.float32)
    of_training = random_models.series_record()
    mean, spread = of_training.x[of_training.training].mean(axis=0), of_training.x[of_training.training].std(axis=0)
    seen = (x[:, random_models.CHOSEN] - mean) / spread
    network = model.model.network
    states = lstm(network.lstm, np.tanh(seen))
    targets = of_training.y[of_training.training]
    wanted = states @ network.readout.weight.detach().numpy().T * targets.std(axis=0) + targets.mean(axis=0)
    for _ in range(pieces):  # the state of one log does not go into the next
        np.testing.assert_allclose(model.predict(x), wanted, rtol=1e-3, atol=1e-2)
    np.testing.assert_allclose([model.step(row) for row in x], wanted, rtol=1e-3, atol=1e-2)
    assert np.abs(model.predict(x[30:])[0] - wanted[30]).max() > 0.05, "what came before matters"


def test_windows_of_a_series_are_the_same_in_any_chunks(tmp_path, monkeypatch):
    model = predictor.load(random_models.save("ridge", tmp_path))
    x = 2 + 0.1 * np.random.default_rng(4).normal(size=(50, 5)).astype(np.float32)
    whole = model.predict(x)
    monkeypatch.setattr(series_regressors, "LARGEST_CHUNK", 7)
    np.testing.assert_allclose(model.predict(x), whole, rtol=1e-6)
    assert np.ptp(whole, axis=0).min() > 0.1
