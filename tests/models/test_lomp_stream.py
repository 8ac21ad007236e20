"""LoMP as a stream: which window goes on from which, and that a state carried is a longer window."""

import numpy as np
import pyarrow as pa
import pytest
import torch

from tactile import models
from tactile.datasets.windows import Dataset
from tactile.learning.spec import Spec
from tactile.models import lomp_stream

SPEC = Spec(4, 2, 2, 4, 4)
TRAINING = dict(learning_rate=3e-3, batch_size=8, epochs=15)
BLOCK = dict(hidden=8, readout=[6], neighbours=4, alpha=0.3, training=TRAINING)
WINDOWED = BLOCK | {"training": TRAINING | {"rest_share": 1.0}}  # of `lomp`


def build(block=BLOCK):
    return models.build("lomp_stream", SPEC, block, "test")


def presses(count=40, seed=0):
    """Windows (x, y, previous) of presses of three windows; the map tells how far the press has come."""
    rng = np.random.default_rng(seed)
    levels = rng.uniform(0.5, 1, (count, 1, 4)) * np.linspace(0, 1, 12)[:, None]  # (presses, 12 frames, elements)
    x = (1000 * levels).reshape(count * 3, 4, 4).astype(np.float32)
    y = np.repeat(x[:, -1], 4, axis=1) * np.tile([1, 2, 3], count)[:, None] / 3
    previous = np.arange(3 * count) - 1
    previous[::3] = -1
    return x, y.astype(np.float32), previous


def test_of_some_windows_only_those_before_that_are_there_count():
    table = pa.table({"previous": pa.array([-1, 0, 1, -1, 3, 4], pa.int32())})
    data = Dataset(np.zeros((6, 1, 1)), np.zeros((6, 1)), table)
    assert data.previous(np.array([0, 1, 2, 4, 5])).tolist() == [-1, 0, 1, -1, 3]
    assert data.previous(np.arange(6)).tolist() == [-1, 0, 1, -1, 3, 4]


def test_streams_are_chains_of_windows():
    found = lomp_stream.streams(np.array([-1, -1, 0, 1, 2, -1]))
    assert sorted(found) == [[0, 2, 4], [1, 3], [5]]


def test_a_state_that_is_carried_is_a_longer_window():
    x, y, previous = presses(3)
    model = build()
    model.fit((x, y, previous), (x, y, previous), seed=0)
    whole = models.build("lomp", SPEC._replace(frames=12), WINDOWED, "test")
    whole.scaled.load_state_dict(model.scaled.state_dict())
    ends = whole.predict(x.reshape(3, 12, 4))
    np.testing.assert_allclose(model.predict(x, previous)[2::3], ends, rtol=1e-4, atol=1e-3)
    model.state = None
    for frame in x.reshape(3, 12, 4).transpose(1, 0, 2):
        answer = model.step(frame)
    np.testing.assert_allclose(answer, ends, rtol=1e-4, atol=1e-3)
    assert model.step(x[:1, 0]).shape == (1, 16)  # another number of streams starts anew


def test_a_stream_starts_at_zero():
    x, _, previous = presses(2)
    model = build()
    assert not model.predict(x, previous).any() and not model.step(x[:1, 0]).any() and not model.step(x[:3, 0]).any()


@pytest.mark.parametrize("side_by_side", [1, 3])
def test_a_state_that_grows_is_cut(side_by_side):
    """P of twice the identity doubles a state with every frame: after 200 frames, past float32."""
    model = build(BLOCK | {"alpha": 0.0})
    with torch.no_grad():
        model.network.update[:] = 2 * torch.eye(8)
        torch.nn.init.normal_(model.network.readout[-1])
    frames = np.ones((200, side_by_side, 4), np.float32)
    maps = [model.step(frame) for frame in frames]
    assert np.isfinite(maps).all() and float(model.state.max()) == lomp_stream.LARGEST_STATE
    windows = np.ones((50, 4, 4), np.float32)
    predicted = model.predict(windows, np.arange(50) - 1)
    assert np.isfinite(predicted).all()
    np.testing.assert_array_equal(predicted[-1], predicted[-2])  # as far as it goes
    np.testing.assert_allclose(predicted[-1], maps[-1][0], rtol=2e-3, atol=1e-3)  # cut after every frame, as in `step`
    model.network.train()
    part, state, losses = (torch.from_numpy(windows), torch.zeros(50, 16), None), None, []
    for window in range(50):
        loss, state = model.update(part, sum, torch.tensor([window]), state)
        losses.append(loss.item())
    assert not np.isfinite(losses).all()  # in training a state is as large as it gets


@pytest.mark.slow
def test_the_state_tells_what_a_window_alone_cannot():
    train, validation = presses(60), presses(20, seed=1)
    model = build(BLOCK | {"training": TRAINING | {"epochs": 60}})
    history = model.fit(train, validation, seed=0)
    assert history[-1]["validation_loss"] < history[0]["validation_loss"] / 4
    x, y, previous = validation
    carried, alone = (np.mean((model.predict(x, which) - y) ** 2) for which in (previous, None))
    assert carried == pytest.approx(min(row["validation_loss"] for row in history), rel=1e-4)
    assert carried < alone / 2


def test_a_frame_costs_its_share_of_a_window():
    model, window_model = build(), models.build("lomp", SPEC, WINDOWED, "test")
    readout = sum(weight.numel() for weight in model.network.readout)
    assert model.macs() - readout == (window_model.macs() - readout) / SPEC.frames
