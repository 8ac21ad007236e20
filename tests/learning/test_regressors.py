"""Training on windows: which windows an epoch sees, the rate of each update, what is kept and refused."""

import numpy as np
import pytest
import torch
from safetensors.torch import load_file
from torch import nn
from torch.optim.optimizer import register_optimizer_step_post_hook

from tactile.base.errors import InputError
from tactile.learning import cost, regressors, weights
from tactile.learning.estimators import SklearnRegressor
from tactile.learning.regressors import TorchRegressor
from tactile.learning.spec import Spec
from tactile.settings.training import WindowTraining

SPEC = Spec(2, 1, 3, 2, 2)


def settings(**changes):
    return dict(learning_rate=0.01, batch_size=8, epochs=20, rest_share=1.0) | changes


def linear_network():
    return nn.Sequential(nn.Flatten(), nn.Linear(SPEC.frames * SPEC.elements, SPEC.outputs))


def regressor(**changes):
    return TorchRegressor(linear_network, SPEC, WindowTraining(**settings(**changes)))


def windows(n=64, seed=0):
    rng = np.random.default_rng(seed)
    x = rng.uniform(0, 1000, (n, SPEC.frames, SPEC.elements)).astype(np.float32)
    y = x.reshape(n, -1) @ rng.uniform(-1, 1, (6, 4)) + 50
    return x, y.astype(np.float32)


def test_all_epochs_are_run_and_the_weights_of_the_best_are_kept():
    x, y = windows()
    validation = (x, -y)  # what helps training hurts validation, so the best epoch is an early one
    model = regressor()
    history = model.fit((x, y), validation, seed=0)
    losses = [row["validation_loss"] for row in history]
    assert [row["epoch"] for row in history] == list(range(1, 21))
    assert model.summary == ("completed", 1 + int(np.argmin(losses))) and model.summary.best_epoch < 20
    assert np.mean((model.predict(x) + y) ** 2) == pytest.approx(min(losses), rel=1e-4)
    assert losses[-1] > min(losses)
    assert history[-1]["train_loss"] < history[0]["train_loss"]


@pytest.fixture
def rates():
    """Learning rate of every update of an optimiser from now on."""
    noted = []
    hook = register_optimizer_step_post_hook(
        lambda optimiser, *arguments: noted.append(optimiser.param_groups[0]["lr"])
    )
    yield noted
    hook.remove()


def test_the_rate_of_every_update_rises_over_a_tenth_and_falls_to_zero(rates):
    history = regressor(epochs=5).fit(windows(), windows(seed=1), seed=0)
    assert len(rates) == 5 * 8
    done = (np.arange(40) + 0.5) / 40  # at the middle of each batch
    assert rates == pytest.approx(0.01 * np.where(done < 0.1, done / 0.1, (1 - done) / 0.9))
    assert [row["learning_rate"] for row in history] == rates[7::8]
    assert rates[-1] < 0.02 * 0.01


class _Noting(nn.Module):
    """Notes the first value of every window that it is trained on: in normalised counts, as `seen` gives back."""

    def __init__(self):
        super().__init__()
        self.network = nn.Sequential(nn.Flatten(), nn.BatchNorm1d(SPEC.frames * SPEC.elements), linear_network()[1])
        self.batches = []

    def forward(self, x):
        if self.training:
            self.batches.append(x[:, 0, 0].clone())
        return self.network(x)


def seen(touched: int, at_rest: int, **changes) -> list[list[list[int]]]:
    """Numbers of the windows by epoch and batch; the first `touched` of the training windows have a touch."""
    x, y = windows(touched + at_rest)
    x[:, 0, 0] = np.arange(len(x))
    y[touched:] = 0
    model = TorchRegressor(_Noting, SPEC, WindowTraining(**settings(**changes)))
    ends = []
    model.fit((x, y), windows(seed=1), seed=0, progress=lambda *numbers: ends.append(len(model.network.batches)))
    mean, spread = float(model.scaled.input_mean[0]), float(model.scaled.input_spread[0])
    numbers = [(batch * spread + mean).round().int().tolist() for batch in model.network.batches]
    return [numbers[first:end] for first, end in zip([0, *ends], ends, strict=False)]


def test_an_epoch_sees_every_touch_and_a_share_of_the_windows_at_rest_drawn_anew():
    epochs = [sum(batches, []) for batches in seen(100, 400, epochs=6, rest_share=0.25, batch_size=3)]
    assert len(epochs) == 6
    for numbers in epochs:
        assert len(set(numbers)) == len(numbers)
        assert len(set(range(100)) - set(numbers)) <= 1  # one that was alone in the last batch
        assert 60 < len(set(numbers) - set(range(100))) < 140  # 100, standard deviation 9
    at_rest = [set(numbers) - set(range(100)) for numbers in epochs]
    assert len(set(map(frozenset, at_rest))) == 6 and len(set.union(*at_rest)) > 250  # 400 * (1 - 0.75 ** 6) = 329
    assert epochs[0] != sorted(epochs[0])
    everything = [sum(batches, []) for batches in seen(30, 34, epochs=2, rest_share=1.0)]
    assert [sorted(numbers) for numbers in everything] == [list(range(64))] * 2 and everything[0] != everything[1]


def test_a_window_that_would_be_the_last_batch_waits_for_another_epoch():
    """Batch normalisation cannot train on a batch of one."""
    epochs = seen(17, 0, epochs=4)
    assert [[len(batch) for batch in batches] for batches in epochs] == [[8, 8]] * 4
    assert {number for batches in epochs for batch in batches for number in batch} == set(range(17))


def test_windows_that_are_all_at_rest_are_trained_on_too():
    assert [sorted(sum(batches, [])) for batches in seen(0, 8, epochs=1, rest_share=1e-6)] == [list(range(8))]


@pytest.fixture
def processor(monkeypatch):
    """Gives the processor instructions for bfloat16 or takes them away; without them torch computes it all the same."""
    monkeypatch.setattr(torch.ops.mkldnn, "_is_mkldnn_bf16_supported", lambda: True)
    return lambda has: monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx512_bf16": has})


def trained(precision, *parts):
    model = regressor(epochs=3, precision=precision)
    model.fit(*parts, seed=0, device="cpu")
    return model, model.network[1].weight.detach()


def test_a_processor_without_bfloat16_trains_as_in_float32(processor):
    parts = windows(), windows(seed=1)
    processor(False)
    (model, without), (_, expected) = trained("bfloat16", *parts), trained("float32", *parts)
    assert model.precision == "float32" and torch.equal(without, expected)
    processor(True)
    model, rounded = trained("bfloat16", *parts)
    assert model.precision == "bfloat16" and rounded.dtype == torch.float32
    assert 0 < (rounded - expected).abs().max() < 0.02 * expected.abs().max()
    assert model.predict(parts[0][0]).dtype == np.float32


def test_fit_leaves_the_global_generator_alone():
    torch.manual_seed(5)
    expected = torch.rand(3)
    torch.manual_seed(5)
    regressor(epochs=1).fit(windows(), windows(seed=1), seed=0)
    assert torch.equal(torch.rand(3), expected)


def test_normalisation_comes_from_the_training_part_and_is_saved(tmp_path):
    train, validation = windows(), windows(seed=1)
    train[0][..., 1] = 300  # an element that was never pressed
    train[1][3, 2] = -9000  # the label furthest from zero
    model = regressor(epochs=1)
    model.fit(train, (validation[0] * 50, validation[1] * 50), seed=0)
    model.save(tmp_path)
    saved = load_file(tmp_path / weights.NETWORK_FILE)
    np.testing.assert_allclose(saved["input_mean"], train[0].mean((0, 1)), rtol=1e-5)
    np.testing.assert_allclose(saved["input_spread"][[0, 2]], train[0].std((0, 1))[[0, 2]], rtol=1e-5)
    assert saved["input_spread"][1] == regressors.SMALLEST_SPREAD
    assert saved["output_scale"] == 9000


def test_labels_are_trained_on_as_shares_of_the_largest_and_answered_in_kpa():
    """A network that always answers 1 answers the largest label; labels that are all zero stay as they are."""

    class One(nn.Module):
        def __init__(self):
            super().__init__()
            self.one = nn.Parameter(torch.ones(SPEC.outputs))

        def forward(self, x):
            return self.one.expand(len(x), -1)

    x, y = windows()
    for labels, largest in ((y - y.min() + 7, np.ptp(y) + 7), (np.zeros_like(y), 1.0)):
        model = TorchRegressor(One, SPEC, WindowTraining(**settings(epochs=1, learning_rate=1e-9)))
        (row,) = model.fit((x, labels), (x, labels), seed=0)
        assert model.predict(x) == pytest.approx(np.full_like(y, largest), rel=1e-5)
        for loss in ("train_loss", "validation_loss"):
            assert row[loss] == pytest.approx(np.mean((largest - labels) ** 2), rel=1e-4)


def test_predictions_do_not_depend_on_how_many_windows_are_asked():
    model = regressor(epochs=1)
    model.fit(windows(), windows(seed=1), seed=0)
    x, _ = windows(300, seed=2)
    together = model.predict(x)
    assert together.shape == (300, 4) and together.dtype == np.float32
    alone = np.concatenate([model.predict(x[i : i + 1]) for i in range(0, 300, 37)])
    np.testing.assert_allclose(together[::37], alone, rtol=1e-5, atol=1e-3)


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
        lambda: nn.Sequential(nn.Flatten(), nn.Linear(6, 5), nn.Linear(5, 4)), SPEC, WindowTraining(**settings())
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
    with pytest.raises(InputError, match="not a model of this kind .*Tree"):
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
