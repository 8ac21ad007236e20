"""Every model with weights drawn from a seed answers a fixed input with the numbers that it gave when they were pinned.

A fault in the order of frames, an activation or a read-out moves them; training, which may change, does not. A model
without a file of tensors is fitted to fixed data.
"""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file
from test_contract_of_models import VALUES, Given, built, fit, given, given_windows, kind_of, predicted

from tactile.learning.spec import Spec
from tactile.learning.weights import NETWORK_FILE

MODELS = {model: experiment for experiment in reversed(VALUES["experiments"]) for model in VALUES[experiment]["models"]}
SMALL = Spec(10, 3, 4, 6, 12)  # frames, rows and columns of an array, and of its map: few are alike
PINNED = {
    "constant": [2186.5, 2797.0, 2846.1, 2898.4, 2765.2],
    "naive_bayes": [0.36706, 0.0, 0.98268, 0.73095, 0.072084],
    "tree": [2734.8, 2659.9, 2914.5, 3067.7, 3211.0],
    "resnet18": [0.08607, 0.89765, 0.02332, 0.00033459, 0.076628],
    "mobilenet": [0.11039, 0.40624, 0.095376, 0.38799, 0.11039],
    "resnet3x3": [0.91404, 0.000136, 0.00043325, 0.082943, 0.91836],
    "sp_resnet_nogcam": [2.6364e-05, 0.00070741, 0.85008, 0.14443, 2.6612e-05],
    "sp_resnet": [0.0035815, 0.10729, 0.82638, 0.0654, 0.0036374],
    "window_trees": [2333.9, 2769.9, 2834.9, 2870.6, 2820.6],
    "window_ridge": [2732.2, 2659.3, 2911.3, 3069.8, 3208.8],
    "ridge": [2.3322, -1.4595, -10.756, -14.018, -14.602],
    "esn": [64.137, 13.085, -14.766, -21.983, -22.058],
    "press_difference": [9.005, -22.979, 11.06, -21.602, 10.524],
    "lstm_direct": [-0.3333, -2.7962, -2.9159, -2.4964, -2.5131],
    "lstm_transfer": [-0.3333, -2.7962, -2.9159, -2.4964, -2.5131],
    "lstm_transfer_ridge": [-0.3333, -2.7962, -2.9159, -2.4964, -2.5131],
    "lstm_highpass": [16.868, 16.836, 16.952, 17.137, 17.341],
    "linear": [2256.2, 2701.4, 2781.7, 3173.4, 2761.3],
    "poly": [2337.0, 2724.2, 2868.7, 3184.4, 2730.6],
    "linear_array": [2734.8, 2659.9, 2914.5, 3067.7, 3211.0],
    "tree_array": [2740.8, 2735.6, 2740.5, 3247.5, 3029.8],
    "rbf": [2463.3, 2726.2, 2773.6, 2814.5, 3023.2],
    "rnn": [-5339.0, -4927.2, 11983.0, -3889.97, 708.24],
    "poly_array": [2696.6, 2745.1, 2905.7, 3129.9, 3188.6],
    "cnn": [11740.0, -11123.0, -3668.5, 26198.0, -17988.0],
    "vgg": [7193.4, -7378.9, 5387.7, -13822.0, 2939.2],
    "convlstm": [1701.1, 10534.0, 2507.0, -1588.7, -4984.1],
    "lomp": [-1441.9, -6163.7, 1443.8, -1267.5, 535.88],
    "lomp_shared": [-2500.7, -2562.8, -2281.1, -2425.5, 2033.7],
    "lomp_stream": [1805.8, -10327.0, -1532.6, -1777.0, 2164.7],
}
__all__ = ["fit"]  # a fixture


def fixed(experiment: str, model: str) -> Given:
    """Return data of few elements; images that hardly tell their objects, so that no answer is sure.

    Naive Bayes, which multiplies the odds of all pixels, sees three of them.
    """
    if kind_of(experiment) == "windows":
        return given_windows(SMALL, 60)
    data = given(experiment)
    if kind_of(experiment) == "series":
        return data
    rng = np.random.default_rng(1)
    x = rng.uniform(0, 255, data.inputs.shape).astype(np.float32)
    if model == "naive_bayes":
        x[:, :, 3:] = 0
    return data._replace(parts=tuple((x, y) for _, y in data.parts), inputs=x * 0.9)


def draw_weights(path: Path) -> None:
    """Put numbers drawn by a seed in place of what was trained or drawn; constants, whose names have no dot, stay."""
    drawn, tensors = torch.Generator().manual_seed(7), load_file(path)
    for name in sorted(tensors):
        values = tensors[name]
        if "." not in name or not values.is_floating_point():
            continue
        fan_in = math.prod(values.shape[1:]) if values.ndim > 1 else 4
        new = 1.5 / math.sqrt(fan_in) * torch.randn(values.shape, generator=drawn, dtype=torch.float64)
        tensors[name] = (new.abs() + 0.5 if name.endswith("running_var") else new).to(values.dtype)
    save_file(tensors, path)


def five_outputs(experiment: str, model: str, fit, folder: Path) -> list[float]:
    """Return five outputs, of inputs and places apart."""
    data = fixed(experiment, model)
    regressor = built(experiment, model, data.spec)
    fit(experiment, regressor, data, seed=0)
    regressor.save(folder)
    if (folder / NETWORK_FILE).is_file():
        draw_weights(folder / NETWORK_FILE)
    loaded = built(experiment, model, data.spec)
    loaded.load(folder)
    answers = predicted(loaded, data)
    rows = np.linspace(len(answers) // 2, len(answers) - 1, 5).astype(int)
    return [float(answers[row, (3 * k + 1) % answers.shape[1]]) for k, row in enumerate(rows)]


@pytest.mark.parametrize(("model", "experiment"), MODELS.items())
def test_the_outputs_of_a_model_are_those_that_were_pinned(model, experiment, fit, tmp_path):
    np.testing.assert_allclose(five_outputs(experiment, model, fit, tmp_path), PINNED[model], rtol=2e-3, atol=1e-5)


def test_every_model_is_pinned_and_its_numbers_differ():
    assert PINNED.keys() == MODELS.keys()
    assert all(len(set(numbers)) >= 3 for model, numbers in PINNED.items() if model != "constant")
