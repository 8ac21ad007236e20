"""LoMP's stacked weights and hand-written backward pass against one plain module an element."""

import numpy as np
import pytest
import torch
from torch import nn

from benchmarks.peers import LoopedLomp
from tactile.base.errors import InputError
from tactile.learning import lomp_network, lomp_prediction, lomp_shape
from tactile.learning.spec import Spec
from tactile.learning.training import products_in
from tactile.models import lomp, lomp_stream
from tactile.settings.training import WindowTraining

TRAINING = WindowTraining(learning_rate=1e-3, batch_size=16, epochs=1, rest_share=1.0)


def network(spec, hidden=128, readout=(128, 64), neighbours=4, alpha=0.1):
    """A network as in the middle of its training: one that starts answers zero and passes no gradient on."""
    torch.manual_seed(0)
    started = lomp_network.Lomp(spec, hidden, list(readout), neighbours, alpha)
    with torch.no_grad():
        for last in (started.readout[-1], started.readout_bias[-1]):
            assert not last.any()
            last.uniform_(-0.3, 0.3)
    return started


@pytest.mark.parametrize("neighbours", [4, 8])
@pytest.mark.parametrize(
    "spec, hidden, readout",
    [(Spec(8, 5, 5, 20, 20), 128, (128, 64)), (Spec(3, 2, 4, 6, 4), 8, (5,)), (Spec(1, 2, 2, 4, 4), 4, (3,))],
    ids=["paper", "oblong", "one frame"],
)
def test_outputs_and_all_gradients_equal_a_loop_over_modules(spec, hidden, readout, neighbours):
    stacked = network(spec, hidden, readout, neighbours, alpha=0.3)
    naive = LoopedLomp(stacked)
    x = torch.randn(6, spec.frames, spec.elements)
    target = torch.randn(6, spec.outputs)
    ours, theirs = stacked(x), naive(x)
    torch.testing.assert_close(ours, theirs, rtol=1e-5, atol=1e-5)
    ((ours - target) ** 2).sum().backward()
    ((theirs - target) ** 2).sum().backward()
    gradients = {name: weight.grad for name, weight in stacked.named_parameters()}
    compared = 0
    # a stand-in for the stacked network that holds its gradients under the same names
    holder = type("Gradients", (), {})()
    for name, gradient in gradients.items():
        owner, _, number = name.partition(".")
        if number:
            holder.__dict__.setdefault(owner, []).append(gradient)
        else:
            setattr(holder, name, gradient)
    for mine, theirs in naive.twins:
        scale = float(mine.grad.abs().max()) or 1.0
        assert float((theirs(holder) - mine.grad).abs().max()) <= 1e-5 * max(scale, 1.0)
        compared += mine.numel()
    assert compared == sum(weight.numel() for weight in stacked.parameters())


@pytest.mark.parametrize(("carried", "rel", "absolute"), [(False, 1e-6, 1e-8), (True, 1e-5, 1e-7)])
def test_gradients_are_slopes(carried, rel, absolute):
    stacked = network(Spec(3, 2, 2, 2, 2), hidden=3, readout=[4], alpha=0.3).double()
    x = torch.randn(5, 3, 4, dtype=torch.float64)
    state = torch.randn(4, 5, 3, dtype=torch.float64) if carried else None
    stacked.go_on(x, state)[0].square().sum().backward()
    step = 1e-6
    for name, weight in stacked.named_parameters():
        direction = torch.randn_like(weight)
        losses = []
        for sign in (1, -1):
            with torch.no_grad():
                weight += sign * step * direction
                losses.append(float(stacked.go_on(x, state)[0].square().sum()))
                weight -= sign * step * direction
        slope = (losses[0] - losses[1]) / (2 * step)
        assert slope == pytest.approx(float((weight.grad * direction).sum()), rel=rel, abs=absolute), name


def test_products_in_bfloat16_give_the_same_gradients_but_for_rounding():
    stacked = network(Spec(8, 5, 5, 20, 20), hidden=16, readout=[8])
    nn.init.normal_(stacked.readout[-1], std=0.1)
    x, y = torch.randn(16, 8, 25), torch.rand(16, 400)
    gradients = []
    for precision in ("float32", "bfloat16"):
        stacked.zero_grad()
        with products_in(precision, x.device):
            maps = stacked(x)
        assert maps.dtype == getattr(torch, precision)
        nn.functional.mse_loss(maps.float(), y).backward()
        gradients.append([weight.grad.clone() for weight in stacked.parameters()])
    for (name, _), exact, rounded in zip(stacked.named_parameters(), *gradients, strict=True):
        assert rounded.dtype == torch.float32
        assert 0 < (rounded - exact).norm() < 0.05 * exact.norm(), name


def test_a_batch_does_not_see_the_one_before():
    stacked = network(Spec(8, 5, 5, 20, 20), hidden=16, readout=[8])
    x = torch.randn(4, 8, 25)
    with torch.no_grad():
        first = stacked(x)
        stacked(torch.randn(4, 8, 25))
        stacked(torch.randn(9, 8, 25))
        torch.testing.assert_close(stacked(x), first, rtol=0, atol=0)
        torch.testing.assert_close(stacked(x[:1]), first[:1], rtol=1e-5, atol=1e-6)


def test_backward_after_another_forward_is_refused():
    stacked = network(Spec(8, 5, 5, 20, 20), hidden=4, readout=[4])
    x = torch.randn(2, 8, 25)
    loss = stacked(x).sum()
    stacked(x)
    with pytest.raises(RuntimeError, match="overwritten"):
        loss.backward()


def test_neighbours_of_corner_edge_and_centre():
    four, eight = lomp_shape.neighbour_matrix(5, 5, 4), lomp_shape.neighbour_matrix(5, 5, 8)
    assert np.flatnonzero(four[0]).tolist() == [1, 5]
    assert np.flatnonzero(eight[0]).tolist() == [1, 5, 6]
    assert np.flatnonzero(four[12]).tolist() == [7, 11, 13, 17]
    assert eight[12].sum() == 8 and eight[10].sum() == 5
    assert np.array_equal(four, four.T) and np.array_equal(eight, eight.T)
    assert lomp_shape.neighbour_matrix(1, 1, 4).tolist() == [[0.0]]


@pytest.mark.parametrize("one_readout", [False, True])
@pytest.mark.parametrize("readout", [[], [7, 5]])
def test_the_shapes_that_are_told_without_torch_are_those_of_the_network(readout, one_readout):
    spec = Spec(3, 2, 4, 6, 4)
    made = lomp_network.maker(
        spec, hidden=11, readout=readout, neighbours=4, alpha=1.0, one_readout=one_readout
    )().state_dict()
    assert lomp_shape.shapes(spec, 11, readout, one_readout) == {name: tuple(each.shape) for name, each in made.items()}


def test_without_messages_an_element_sees_only_itself():
    stacked = network(Spec(8, 5, 5, 20, 20), hidden=8, readout=[8], alpha=0.0)
    x = torch.randn(1, 8, 25)
    other = x.clone()
    other[:, :, 7] += 1  # second row, third column
    with torch.no_grad():
        change = (stacked(x) - stacked(other)).view(20, 20) != 0
    assert change[4:8, 8:12].any()
    change[4:8, 8:12] = False
    assert not change.any()


@pytest.mark.parametrize(
    "change, named", [({"neighbours": 6}, "neighbours"), ({"spec": Spec(8, 5, 5, 19, 20)}, "19x20")]
)
def test_impossible_settings_are_refused(change, named):
    settings = dict(spec=Spec(8, 5, 5, 20, 20), hidden=4, readout=[4], neighbours=4, alpha=0.1, start="identity")
    with pytest.raises(InputError, match=named):
        lomp.build(**(settings | change), training=TRAINING)


SHAPES = {  # spec, settings of `network`
    "paper": (Spec(8, 5, 5, 20, 20), {"alpha": 1.0}),
    "oblong, odd widths, 8 neighbours": (Spec(3, 2, 4, 6, 4), dict(hidden=11, readout=[13, 7, 5], neighbours=8)),
    "read-out of one layer, no messages": (Spec(4, 3, 1, 3, 2), dict(hidden=6, readout=[], alpha=0.0)),
    "a frame": (Spec(1, 5, 5, 20, 20), dict(hidden=64, readout=[64, 32], alpha=1.0)),
}


def compiled(network: lomp_network.Lomp) -> lomp_prediction.Prediction:
    """The same network in compiled code."""
    weights = {name: tensor.numpy() for name, tensor in network.state_dict().items()}
    return lomp_prediction.Prediction(network.spec, weights, network.neighbours.numpy(), network.alpha)


def largest_difference(ours: np.ndarray, exact: torch.Tensor) -> float:
    """Share of full scale."""
    return float(np.abs(ours - exact.numpy()).max() / exact.abs().max())


@pytest.mark.parametrize("spec, settings", SHAPES.values(), ids=SHAPES)
def test_a_row_in_compiled_code_is_a_row_of_a_batch(spec, settings):
    stacked = network(spec, **settings)
    prediction = compiled(stacked)
    x = torch.randn(30, spec.frames, spec.elements)
    before = torch.randn(spec.elements, 30, stacked.hidden).relu()
    for state in (None, before):
        with torch.no_grad():
            maps, after = stacked.go_on(x, state)
        for k in range(30):
            row = None if state is None else state[:, k].numpy()
            image, went_on = prediction.run(x[k].numpy(), row)
            assert image.shape == (spec.outputs,) and image.dtype == went_on.dtype == np.float32
            assert largest_difference(image, maps[k]) < 5e-4  # as compiled_lomp.py says
            assert largest_difference(went_on, after[:, k]) < 5e-4


def test_a_state_goes_from_rows_to_batches_and_back():
    model = lomp_stream.build(Spec(2, 2, 3, 4, 6), hidden=10, readout=[6], neighbours=4, alpha=0.5, training=TRAINING)
    x = np.random.default_rng(0).uniform(-2, 2, (12, 6)).astype(np.float32)

    def maps(run) -> np.ndarray:
        state, answers = None, []
        for k, frame in enumerate(x):
            answer, state = run(k, frame[None], state)
            answers.append(answer[0])
        return np.array(answers)

    def batch(_, frame, state):
        with torch.no_grad():
            normalised = model.scaled.normalised(torch.from_numpy(frame))
            answer, state = model.network.go_on(normalised[:, None], None if state is None else torch.as_tensor(state))
        return answer.numpy() * model.scaled.output_scale.numpy(), state

    def mixed(k, frame, state):
        return model.one_row(frame, state) if k % 3 else batch(k, frame, state)

    exact = maps(batch)
    np.testing.assert_allclose(maps(mixed), exact, atol=1e-4 * np.abs(exact).max())


def test_a_row_is_predicted_with_the_weights_of_now(tmp_path):
    spec, rng = Spec(3, 2, 4, 6, 4), np.random.default_rng(0)
    model = lomp.build(spec, hidden=8, readout=[16, 8], neighbours=8, alpha=0.3, start="identity", training=TRAINING)
    x = rng.uniform(0, 1000, (40, spec.frames, spec.elements)).astype(np.float32)
    y = rng.uniform(0, 300, (40, spec.outputs)).astype(np.float32)
    for seed in range(2):
        model.fit((x, y), (x, y), seed=seed)
        together = model.predict(x)
        alone = np.concatenate([model.predict(x[k : k + 1]) for k in range(40)])
        np.testing.assert_allclose(alone, together, rtol=0, atol=1e-4 * np.abs(together).max())
    model.save(tmp_path)
    model.fit((x, y), (x, y), seed=5)
    assert not np.array_equal(model.predict(x[:1]), alone[:1])
    model.load(tmp_path)
    np.testing.assert_array_equal(model.predict(x[:1]), alone[:1])


def test_what_is_not_a_number_stays_none():
    spec = Spec(2, 5, 5, 5, 5)
    stacked = network(spec, hidden=8, readout=[8])
    x = np.zeros((2, 25), np.float32)
    whole = compiled(stacked).run(x, None)[0]
    assert np.isfinite(whole).all()
    x[1, 12] = np.nan  # in the last frame: the element and its neighbours
    image, state = compiled(stacked).run(x, None)
    reached = [7, 11, 12, 13, 17]
    assert np.flatnonzero(np.isnan(image)).tolist() == reached
    assert np.flatnonzero(np.isnan(state).any(axis=1)).tolist() == reached
    np.testing.assert_array_equal(np.delete(image, reached), np.delete(whole, reached))
    x[1, 12] = np.inf
    assert np.isfinite(compiled(stacked).run(x, None)[0]).all()
    with torch.no_grad():
        stacked.readout[0][3, 2, 4] = np.nan
        stacked.readout[0][8] = 0
    image = compiled(stacked).run(np.zeros((2, 25), np.float32), None)[0]
    assert np.flatnonzero(np.isnan(image)).tolist() == [3]


def test_a_batch_in_chunks_has_the_gradients_of_the_batch():
    spec, rng = Spec(3, 2, 2, 4, 4), np.random.default_rng(0)
    x = rng.uniform(0, 1000, (100, 3, 4)).astype(np.float32)
    y = rng.uniform(0, 300, (100, 16)).astype(np.float32)
    answers = []
    for chunk in (32, 1000):
        training = TRAINING.model_copy(update={"batch_size": 100})
        settings = dict(hidden=8, readout=[6], neighbours=4, alpha=0.3, start="identity")
        model = lomp.build(spec, **settings, training=training)
        model.chunk = chunk
        history = model.fit((x, y), (x, y), seed=0)
        answers.append((history[0]["train_loss"], model.predict(x)))
    assert answers[0][0] == pytest.approx(answers[1][0], rel=1e-5)
    np.testing.assert_allclose(answers[0][1], answers[1][1], rtol=1e-3, atol=1e-2)
