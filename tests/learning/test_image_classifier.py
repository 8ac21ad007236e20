"""Training on images: what each augmentation method does, and what is refused."""

import numpy as np
import pytest
import torch
from torch import nn

from tactile.base.errors import InputError
from tactile.datasets.images import SIDE
from tactile.learning.image_classifier import ImageClassifier, augmented, draw_alterations
from tactile.learning.spec import of_images
from tactile.settings.training import AugmentedTraining

NONE = {"learning_rate": 2e-4, "batch_size": 8, "epochs": 3}
NONE |= {"flip": 0.0, "noise": 0.0, "affine": 0.0}


def pictures(n=400):
    """Images with one bright pixel in the upper left."""
    images = torch.zeros(n, 1, SIDE, SIDE)
    images[:, 0, 8:11, 6:9] = 1.0
    return images


def altered(images, **methods):
    training, rng = AugmentedTraining(**NONE | methods), torch.Generator().manual_seed(0)
    return augmented(images, training, draw_alterations(len(images), images.shape[1:], training, rng))


def centres(images):
    """Row and column of the centre of brightness, (n, 2)."""
    weight = images[:, 0] / images.sum(dim=(1, 2, 3))[:, None, None]
    at = torch.arange(SIDE, dtype=torch.float32)
    return torch.stack([(weight.sum(2) * at).sum(1), (weight.sum(1) * at).sum(1)], 1)


def test_without_a_method_nothing_changes():
    assert torch.equal(altered(pictures()), pictures())


def test_a_flip_is_vertical_or_horizontal_and_as_frequent_as_said():
    found = altered(pictures(4000), flip=0.3)
    kinds = [torch.equal(one, pictures(1)[0]) for one in found]
    up = [torch.equal(one, pictures(1)[0].flip(1)) for one in found]
    left = [torch.equal(one, pictures(1)[0].flip(2)) for one in found]
    assert all(a + b + c == 1 for a, b, c in zip(kinds, up, left, strict=True))
    assert np.mean(kinds) == pytest.approx(0.7, abs=0.03)
    assert np.mean(up) == pytest.approx(0.15, abs=0.02) and np.mean(left) == pytest.approx(0.15, abs=0.02)


def test_noise_is_gaussian_of_the_stated_spread():
    difference = altered(pictures(50), noise=0.02) - pictures(50)
    assert float(difference.std()) == pytest.approx(0.02, rel=0.02)
    assert abs(float(difference.mean())) < 3e-4


def test_an_affine_change_moves_turns_or_scales_within_the_limits():
    found = altered(pictures(4000), affine=0.3)
    moved = centres(found) - centres(pictures(4000))
    changed = (found - pictures(4000)).abs().amax(dim=(1, 2, 3)) > 1e-4
    assert float(changed.float().mean()) == pytest.approx(0.3, abs=0.03)
    # 2 pixels by translation; the blob is 11 pixels from the centre: 1.9 by 10 degrees, 1.1 by 10 %.
    assert float(moved.abs().max()) < 2.1
    assert float(found.sum(dim=(1, 2, 3)).mean()) == pytest.approx(9, rel=0.02)


class Linear(nn.Module):
    def __init__(self):
        super().__init__()
        self.layer = nn.Linear(SIDE * SIDE, 2)

    def forward(self, x):
        return self.layer(x.flatten(1))


def task(n):
    """Two objects that differ in which half of the image is bright."""
    label = np.arange(n) % 2
    x = np.zeros((n, 1, SIDE * SIDE), np.float32)
    x[label == 0, :, : SIDE * SIDE // 2] = 255
    x[label == 1, :, SIDE * SIDE // 2 :] = 255
    return x, np.eye(2, dtype=np.float32)[label]


def classifier(**changes):
    return ImageClassifier(Linear, of_images(2), AugmentedTraining(**NONE | changes))


@pytest.mark.slow
@pytest.mark.parametrize("n", [16, 17])  # 17: a last batch of one image, which batch normalisation cannot train on
def test_learns_and_gives_probabilities(n):
    model = classifier()
    history = model.fit(task(n), task(4), seed=0, device="cpu")
    predicted = model.predict(task(6)[0])
    assert predicted.sum(axis=1) == pytest.approx(1) and (predicted.argmax(1) == task(6)[1].argmax(1)).all()
    assert [row["epoch"] for row in history] == [1, 2, 3]
    done = [(epoch + 0.75) / 3 for epoch in range(3)]  # at the middle of the second of two batches
    assert [row["learning_rate"] for row in history] == pytest.approx([2e-4 * (1 - share) / 0.9 for share in done])
    assert history[-1]["validation_loss"] < history[0]["validation_loss"]


def test_the_weights_of_the_best_epoch_are_kept():
    """What helps training hurts validation, where the objects have each other's names: the best epoch is the first."""
    x, y = task(8)
    model = classifier(epochs=4)
    losses = [row["validation_loss"] for row in model.fit(task(16), (x, y[:, ::-1]), seed=0, device="cpu")]
    assert model.summary == ("completed", 1) and losses == sorted(losses) and losses[-1] > 1.1 * losses[0]
    assert -np.log(model.predict(x)[y[:, ::-1] == 1]).mean() == pytest.approx(losses[0], rel=1e-5)
    model.fit(task(16), (x, y), seed=0, device="cpu")
    assert model.summary == ("completed", 4)


def test_a_fit_starts_anew_from_its_seed():
    model, said = classifier(), []
    for seed in (0, 1, 0):
        model.fit(task(16), task(4), seed=seed, device="cpu")
        said.append(model.predict(task(4)[0]))
    assert (said[0] == said[2]).all() and (said[0] != said[1]).any()


def test_too_few_images_are_one_sentence():
    with pytest.raises(InputError, match="the training part has fewer than 2 images"):
        classifier().fit(task(1), task(4), seed=0)
    with pytest.raises(InputError, match="the validation part has fewer than 1 images"):
        classifier().fit(task(4), task(0), seed=0)
