"""The training loop: when it stops, what it keeps, what it refuses."""

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from torch import nn

from pipeline.base.blocks import EarlyStopping
from pipeline.base.errors import InputError
from pipeline.learning import cost, regressors, weights
from pipeline.learning.estimators import SklearnRegressor
from pipeline.learning.regressors import Spec, TorchRegressor, input_scale

SPEC = Spec(2, 1, 3, 2, 2)


def settings(**changes):
    return dict(learning_rate=0.01, batch_size=8, max_epochs=20, patience=5, plateau=2, drop=0.5) | changes


def linear_network():
    return nn.Sequential(nn.Flatten(), nn.Linear(SPEC.frames * SPEC.elements, SPEC.outputs))


def regressor(**changes):
    return TorchRegressor(linear_network, SPEC, EarlyStopping(**settings(**changes)))


def windows(n=64, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(0, 1000, (n, SPEC.frames, SPEC.elements)).astype(np.float32)
    y = x.reshape(n, -1) @ rng.uniform(-1, 1, (6, 4)) + 50
    return x, y.astype(np.float32)


def test_early_stopping_stops_and_restores_the_best_epoch():
    x, y = windows()
    validation = (x, -y)  # what helps training hurts validation, so the best epoch is an early one
    model = regressor(max_epochs=100, patience=4)
    history = model.fit((x, y), validation, seed=0)
    losses = [row["validation_loss"] for row in history]
    assert model.summary.stop_reason == "patience"
    assert model.summary.best_epoch == 1 + int(np.argmin(losses))
    assert len(history) == model.summary.best_epoch + 4 < 100
    assert np.mean((model.predict(x) + y) ** 2) == pytest.approx(min(losses), rel=1e-4)
    assert losses[-1] > min(losses)


def test_training_stops_at_max_epochs():
    model = regressor(max_epochs=3)
    history = model.fit(windows(), windows(seed=1), seed=0)
    assert [row["epoch"] for row in history] == [1, 2, 3]
    assert model.summary.stop_reason == "max_epochs"
    assert history[-1]["train_loss"] < history[0]["train_loss"]


def test_learning_rate_drops_on_a_plateau():
    x, y = windows()
    history = regressor(max_epochs=6, patience=50, plateau=2, drop=0.5).fit((x, y), (x, -y), seed=0)
    assert int(np.argmin([row["validation_loss"] for row in history])) == 0
    rates = [row["learning_rate"] for row in history]
    assert rates == pytest.approx([0.01, 0.01, 0.01, 0.005, 0.005, 0.0025])


class _BreaksDown(nn.Module):
    """Answers NaN from its third training step on."""

    def __init__(self):
        super().__init__()
        self.linear = linear_network()
        self.steps = 0

    def forward(self, x):
        self.steps += self.training
        return self.linear(x) * (float("nan") if self.steps > 2 else 1.0)


def test_divergence_is_recorded_not_raised():
    model = TorchRegressor(_BreaksDown, SPEC, EarlyStopping(**settings(batch_size=64)))
    history = model.fit(windows(), windows(seed=1), seed=0)
    assert model.summary == ("diverged", 2)
    assert len(history) == 3 and np.isnan(history[-1]["train_loss"])


def test_divergence_in_the_first_epoch():
    x, y = windows()
    model = regressor()
    history = model.fit((x, y), (x, y * np.float32(np.inf)), seed=0)
    assert model.summary == ("diverged", 0) and len(history) == 1


def test_same_seed_same_bytes_other_seed_other_bytes(tmp_path):
    saved = []
    for seed in (1, 1, 2):
        torch.rand(7)  # the state of torch's own generator must not matter
        model = regressor(max_epochs=2)
        model.fit(windows(), windows(seed=1), seed=seed)
        model.save(tmp_path)
        saved.append((tmp_path / weights.NETWORK_FILE).read_bytes())
    assert saved[0] == saved[1] != saved[2]


def test_fit_leaves_the_global_generator_alone():
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    regressor(max_epochs=1).fit(windows(), windows(seed=1), seed=0)
    assert torch.equal(torch.rand(3), expected)


def test_normalisation_comes_from_the_training_part_and_is_saved(tmp_path):
    train, validation = windows(), windows(seed=1)
    train[0][..., 1] = 300  # an element that was never pressed
    model = regressor(max_epochs=1)
    model.fit(train, (validation[0] * 50, validation[1]), seed=0)
    model.save(tmp_path)
    saved = load_file(tmp_path / weights.NETWORK_FILE)
    np.testing.assert_allclose(saved["input_mean"], train[0].mean((0, 1)), rtol=1e-5)
    np.testing.assert_allclose(saved["input_spread"][[0, 2]], train[0].std((0, 1))[[0, 2]], rtol=1e-5)
    assert saved["input_spread"][1] == regressors.SMALLEST_SPREAD
    assert saved["output_scale"] == pytest.approx(train[1].std(), rel=1e-5)


def test_input_scale_has_one_pair_an_element():
    x = np.stack([np.zeros((4, 5)), np.full((4, 5), 10)], 0).astype(np.float32)  # 2 windows, 4 frames, 5 elements
    mean, spread = input_scale(x)
    assert mean.tolist() == [5] * 5 and spread.tolist() == [5] * 5


def test_predictions_do_not_depend_on_how_many_windows_are_asked():
    model = regressor(max_epochs=1)
    model.fit(windows(), windows(seed=1), seed=0)
    x, _ = windows(300, seed=2)
    together = model.predict(x)
    assert together.shape == (300, 4) and together.dtype == np.float32
    alone = np.concatenate([model.predict(x[i : i + 1]) for i in range(0, 300, 37)])
    np.testing.assert_allclose(together[::37], alone, rtol=1e-5, atol=1e-3)


def test_progress_is_reported_every_epoch():
    seen = []
    history = regressor(max_epochs=3).fit(windows(), windows(seed=1), seed=0, progress=lambda *a: seen.append(a))
    assert seen == [(row["epoch"], 3, row["train_loss"], row["validation_loss"]) for row in history]


def constant():
    from sklearn.dummy import DummyRegressor

    return SklearnRegressor(lambda seed: DummyRegressor(), SPEC, count=lambda fitted: 0, macs=0)


@pytest.mark.parametrize("make", [regressor, constant])
def test_wrong_shapes_and_empty_parts_are_refused(make):
    x, y = windows()
    with pytest.raises(InputError, match="the training part has windows"):
        make().fit((x[:, :, :2], y), (x, y), seed=0)
    with pytest.raises(InputError, match="the validation part has windows"):
        make().fit((x, y), (x, y[:, :3]), seed=0)
    with pytest.raises(InputError, match="the validation part has no windows"):
        make().fit((x, y), (x[:0], y[:0]), seed=0)


@pytest.mark.parametrize("make", [regressor, constant])
def test_loading_from_an_empty_folder_says_what_to_do(make, tmp_path):
    with pytest.raises(InputError, match="train the model first"):
        make().load(tmp_path)


def test_loading_weights_of_other_settings_is_refused(tmp_path):
    regressor().save(tmp_path)
    other = TorchRegressor(
        lambda: nn.Sequential(nn.Flatten(), nn.Linear(6, 5), nn.Linear(5, 4)),
        SPEC,
        EarlyStopping(**settings()),
    )
    with pytest.raises(InputError, match="other settings"):
        other.load(tmp_path)


def test_types_that_were_not_named_are_not_loaded(tmp_path):
    from sklearn.tree import DecisionTreeRegressor

    def tree(*trusted):
        return SklearnRegressor(
            lambda seed: DecisionTreeRegressor(), SPEC, count=lambda fitted: 0, macs=None, trusted=trusted
        )

    part = windows()
    model = tree()
    model.fit(part, part, seed=0)
    model.save(tmp_path)
    with pytest.raises(InputError, match="no model of this kind .*Tree"):
        tree().load(tmp_path)
    loaded = tree("sklearn.tree._tree.Tree")
    loaded.load(tmp_path)
    np.testing.assert_array_equal(loaded.predict(part[0]), model.predict(part[0]))


def test_counting_of_layers():
    x = torch.zeros(2, 4, 6, 6)
    convolution = nn.Conv2d(4, 8, 3, groups=2)
    assert cost.multiply_accumulates(convolution, x) == 2 * 8 * 16 * 2 * 9
    assert cost.parameters(convolution) == 8 * 2 * 9 + 8
    sequence = torch.zeros(3, 5, 7)
    assert cost.multiply_accumulates(nn.GRU(7, 4, batch_first=True), sequence) == 15 * 12 * (7 + 4)
    assert cost.multiply_accumulates(nn.LSTM(7, 4, 2, batch_first=True), sequence) == 15 * 16 * (11 + 8)
    twice = nn.Linear(7, 7)
    assert cost.multiply_accumulates(nn.Sequential(twice, nn.ReLU(), twice), sequence) == 2 * 15 * 49
    twice.weight.requires_grad = False
    assert cost.parameters(twice) == 7
