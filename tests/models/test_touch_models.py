"""The touch models: size, shapes, files, repeatability, and that each of them learns."""

import numpy as np
import pytest
from builders.project import ROOT
from torch import nn

from tactile import models
from tactile.base import params
from tactile.base.errors import InputError
from tactile.learning import per_element
from tactile.learning.spec import Spec

PAPER = Spec(8, 5, 5, 20, 20)
SMALL = Spec(3, 2, 2, 4, 4)


def training(**changes):
    return dict(learning_rate=1e-3, batch_size=16, epochs=1, rest_share=1.0) | changes


VALUES = params.load(ROOT / "params.yaml")
PAPER_SETTINGS = VALUES["touch"]["models"]
SMALL_SETTINGS = {
    "constant": {},
    "linear": {},
    "poly": dict(degree=3, ridge=1e-3),
    "tree": dict(each="element", min_samples_leaf=5, max_features=1.0),
    "linear_array": {},
    "poly_array": dict(degree=2, ridge=1.0),
    "tree_array": dict(min_samples_leaf=5, max_features=0.5),
    "rbf": dict(centres=20, width=2.0, ridge=1e-3),
    "rnn": dict(layers=2, hidden=16, training=training()),
    "cnn": dict(channels=[4, 8], hidden=[16], training=training()),
    "convlstm": dict(filters=8, training=training()),
    "vgg": dict(channels=[16, 16, 32, 32, 32], training=training()),
    "lomp": dict(hidden=16, readout=[8], neighbours=4, alpha=0.1, training=training()),
}  # lomp_stream: tests/models/test_lomp_stream.py
NETWORKS = [key for key, settings in SMALL_SETTINGS.items() if "training" in settings]
ONE_ELEMENT = [
    "constant",
    "linear",
    "poly",
    "tree",
    "linear_array",
    "tree_array",
    "rbf",
    "rnn",
]  # rows of the recorded single-element task


def build(key, spec, settings, **training_changes):
    settings = dict(settings)
    if training_changes and "training" in settings:
        settings["training"] = settings["training"] | training_changes
    return models.build(key, spec, settings, "test")


def windows(spec, n, seed=0):
    """A press that grows over the window; its map is the elements' last values, spread over their blocks."""
    rng = np.random.default_rng(seed)
    press = rng.uniform(0, 1, (n, spec.elements))
    ramp = np.linspace(0.3, 1, spec.frames)[None, :, None]
    x = 100 + 800 * press[:, None] * ramp + rng.normal(0, 2, (n, spec.frames, spec.elements))
    image = press.reshape(n, spec.rows, spec.cols)
    image = image.repeat(spec.map_rows // spec.rows, 1).repeat(spec.map_cols // spec.cols, 2)
    return x.astype(np.float32), (300 * image**1.5).reshape(n, -1).astype(np.float32)


@pytest.mark.parametrize(
    "key, count",
    [
        ("constant", 400),
        ("linear", 800),
        ("poly", 1_600),
        ("linear_array", 80_400),
        ("poly_array", 140_400),
        ("rbf", 300_400),
        ("rnn", 482_704),
        ("cnn", 804_400),
        ("convlstm", 358_544),
        ("vgg", 14_926_992),
        ("lomp", 2_741_712),
    ],
)
def test_number_of_parameters(key, count):
    model = build(key, PAPER, PAPER_SETTINGS[key])
    if key not in NETWORKS:
        part = windows(PAPER, 510)
        model.fit(part, part, seed=0)
    assert model.parameters() == count


def test_number_of_parameters_of_a_tree():
    part = windows(SMALL, 60)
    for each, trees in (("input", 1), ("element", SMALL.elements)):
        one_leaf = build("tree", SMALL, dict(each=each, min_samples_leaf=60, max_features=1.0))
        one_leaf.fit(part, part, seed=0)
        assert one_leaf.parameters() == SMALL.outputs
        two_leaves = build("tree", SMALL, dict(each=each, min_samples_leaf=30, max_features=1.0))
        two_leaves.fit(part, part, seed=0)
        assert two_leaves.parameters() == trees + 2 * SMALL.outputs


@pytest.mark.parametrize(
    "key, macs",
    [
        ("constant", 0),
        ("linear", 400),
        ("poly", 25 * 2 + 3 * 400),
        ("tree", None),
        ("linear_array", 200 * 400),
        ("poly_array", 325 + 350 * 400),
        ("tree_array", None),
        ("rbf", 500 * 200 + 500 * 400),
        ("rnn", 8 * 4 * 128 * (25 + 3 * 128) + 128 * 512 + 512 * 400),
        ("cnn", 25 * 9 * (8 * 32 + 32 * 64 + 64 * 64) + 1600 * 256 + 256 * 512 + 512 * 400),
        ("convlstm", 8 * 25 * 9 * 33 * 128 + 800 * 400),
        (  # the GRU, U and P of an element and frame; its read-out
            "lomp",
            25 * (8 * (384 + 128 * 384 + 2 * 128 * 128) + 256 * 128 + 128 * 64 + 64 * 16),
        ),
    ],
)
def test_multiply_accumulates(key, macs):
    assert build(key, PAPER, PAPER_SETTINGS[key]).macs() == macs


@pytest.mark.parametrize(("key", "others"), [("tree_array", {}), ("rbf", {})])
def test_the_seed_draws_what_a_model_in_closed_form_draws(key, others):
    part = windows(SMALL, 40)
    models = [build(key, SMALL, SMALL_SETTINGS[key] | others) for _ in range(2)]
    for seed, model in enumerate(models):
        model.fit(part, part, seed=seed)
    assert (models[0].predict(part[0]) != models[1].predict(part[0])).any()


@pytest.mark.parametrize("key", SMALL_SETTINGS)
@pytest.mark.parametrize("spec", [Spec(8, 1, 1, 1, 1), Spec(8, 10, 10, 40, 40)], ids=["1x1", "10x10"])
def test_other_arrays(key, spec):
    if spec.elements == 1 and key not in ONE_ELEMENT:
        pytest.skip("not a row of the single-element task")
    part = windows(spec, 30)
    model = build(key, spec, SMALL_SETTINGS[key])
    model.fit(part, part, seed=0)
    maps = model.predict(part[0][:1])
    assert maps.shape == (1, spec.outputs) and maps.dtype == np.float32
    np.testing.assert_allclose(model.predict(part[0])[:1], maps, rtol=1e-3, atol=1e-2)


@pytest.mark.parametrize("key", NETWORKS)
def test_a_network_starts_at_zero_everywhere(key):
    """Most cells of most maps are zero: what a network learns first is not to undo a random map."""
    part = windows(SMALL, 8)
    model = build(key, SMALL, SMALL_SETTINGS[key])
    assert not model.predict(part[0]).any() and not model.predict(part[0][:1]).any()
    model.fit(part, part, seed=0)
    assert model.predict(part[0]).any()


def networks_of_maps():
    """Return (where, model, shapes, settings) of every network that draws maps of more than one cell."""
    scenes = {"touch": VALUES["touch"], "array_recorded": VALUES["array_recorded"]}
    scenes["physics.touch"] = {**VALUES["touch"], **VALUES["physics"]["touch"]["scene"]}
    scenes["physics.touch"]["models"] = VALUES["physics"]["touch"]["models"]
    for where, scene in scenes.items():
        label, sensor = scene["label"], scene["sensor"]
        shapes = Spec(1, sensor["rows"], sensor["cols"], label["map_rows"], label["map_cols"])
        for model, settings in scene["models"].items():
            if "training" in settings:
                yield pytest.param(model, shapes, settings, id=f"{where} {model}")


@pytest.mark.parametrize(("key", "shapes", "settings"), list(networks_of_maps()))
def test_a_network_can_draw_every_map(key, shapes, settings):
    """A last layer of fewer inputs than cells draws maps of that rank: of 128 it keeps 74 % of a peak, of 256 94 %.

    The array's contacts are wider than a press, and there 512 in place of 256 gains 1.5 % (params/array_recorded.yaml).
    Effects of physics compare a model with itself, and their shards are still of an RNN with 64 inputs for 144 cells.
    """
    network = build(key, shapes, settings).network
    if key.startswith("lomp"):  # (elements, inputs, outputs), the cells over one element
        inputs, outputs = network.readout[-1].shape[1:]
    else:
        last = [module for module in network.modules() if isinstance(module, nn.Linear)][-1]
        inputs, outputs = last.in_features, last.out_features
    assert outputs in (shapes.outputs, shapes.outputs // shapes.elements)
    assert inputs >= {("cnn", 10): 256, ("rnn", 3): 64}.get((key, shapes.rows), outputs)


def test_vgg_trains_where_the_last_batch_would_be_one_window():
    """Its last layers see one pixel, on which batch normalisation cannot train with one window."""
    part = windows(SMALL, 17)
    model = build("vgg", SMALL, SMALL_SETTINGS["vgg"], epochs=2)
    history = model.fit(part, part, seed=0)
    assert model.summary.stop_reason == "completed" and np.isfinite(history[-1]["train_loss"])


def test_rbf_with_too_few_windows_is_refused():
    part = windows(SMALL, 10)
    with pytest.raises(InputError, match="centres is 20, but there are only 10"):
        build("rbf", SMALL, SMALL_SETTINGS["rbf"]).fit(part, part, seed=0)


def test_vgg_as_it_was_first_published_has_no_normalisation_and_three_linear_layers():
    model = build("vgg", PAPER, PAPER_SETTINGS["vgg"] | {"batch_norm": False, "hidden": [4096, 4096]})
    kinds = [type(module) for module in model.network.modules()]
    assert model.parameters() == 35_234_704 and nn.BatchNorm2d not in kinds and kinds.count(nn.Linear) == 3


def test_lomp_starts_near_the_identity_or_as_it_is_drawn():
    """Without the identity P is no larger than torch draws it; all other weights are the same."""
    near, drawn = (
        build("lomp", SMALL, SMALL_SETTINGS["lomp"] | {"start": start}).network for start in ("identity", "drawn")
    )
    assert near.update.diagonal(dim1=1, dim2=2).mean() > 0.9 and drawn.update.abs().max() <= 16**-0.5
    assert ((near.update - drawn.update * 0.1).diagonal(dim1=1, dim2=2) - 1).abs().max() < 1e-6
    assert all(
        (one == other).all()
        for (name, one), other in zip(near.named_parameters(), drawn.parameters(), strict=True)
        if name != "update"
    )


def test_vgg_with_a_wrong_number_of_stages_is_refused():
    with pytest.raises(InputError, match="channels must give 5 widths"):
        build("vgg", SMALL, SMALL_SETTINGS["vgg"] | {"channels": [8, 8]})


@pytest.mark.parametrize("key", ["linear", "poly", "tree"])
def test_an_element_answers_for_its_own_block_alone(key):
    """Conventional calibration: the map over an element depends on that element's reading and on nothing else."""
    spec = Spec(3, 2, 3, 4, 6)
    part = windows(spec, 120)
    model = build(key, spec, SMALL_SETTINGS[key])
    model.fit(part, part, seed=0)
    x = part[0][:1]
    pressed = x.copy()
    pressed[:, :, 4] = 950  # row 1, column 1
    rows, cols = np.nonzero((model.predict(pressed) != model.predict(x)).reshape(4, 6))
    assert set(rows) == {2, 3} and set(cols) == {2, 3}


@pytest.mark.parametrize("key", ["linear", "poly"])
def test_the_polynomial_of_an_element_is_that_of_least_squares(key):
    part = windows(SMALL, 60)
    model = build(key, SMALL, SMALL_SETTINGS[key] | ({"ridge": 0.0} if key == "poly" else {}))
    model.fit(part, part, seed=0)
    degree = SMALL_SETTINGS[key].get("degree", 1)
    own, cell = part[0][:, -1, 1].astype(float), part[1].reshape(-1, 4, 4)[:, 1, 2]  # element 1, one of its cells
    expected = np.polyval(np.polyfit(own / 500, cell, degree), own / 500)
    np.testing.assert_allclose(model.predict(part[0]).reshape(-1, 4, 4)[:, 1, 2], expected, rtol=1e-4, atol=1e-2)


def test_cells_are_of_the_element_that_their_centre_lies_above():
    """5 cells over 2 elements: the one in the middle is the second's; each cell sees its own element alone."""
    spec = Spec(1, 1, 2, 1, 5)
    assert per_element.owners(spec) == (0, 0, 1, 1, 1)
    assert set(per_element.owners(Spec(1, 3, 3, 20, 20))) == set(range(9))
    x = np.random.default_rng(0).normal(size=(60, 1, 2)).astype(np.float32)
    y = np.concatenate([x[:, 0, [0, 0]], x[:, 0, [1, 1, 1]]], axis=1) * np.arange(1, 6, dtype=np.float32)
    model = build("linear", spec, {})
    model.fit((x, y), (x, y), seed=0)
    np.testing.assert_allclose(model.predict(x), y, atol=1e-5)
