"""Train a network that names the object from several frames of a recording, as STAG does (Sundaram et al. 2019).

Every frame goes through the same convolutional part. The features of all frames, one behind the other as channels, go
through a 1x1 convolution down to the channels of one frame, then through the network's own pooling and read-out.
"""

import numpy as np
import torch
from torch import nn

from pipeline.results.frame_sets import drawn_sets, fixed_sets
from tactile.datasets.seeding import generator
from tactile.learning.image_classifier import ImageClassifier
from tactile.learning.regressors import Windows
from tactile.learning.training import Progress
from tactile.scoring import classification, metrics


class JoinedFrames(nn.Module):
    """A network of one image (n, 1, rows, cols), made one of `frames` images (n, frames, rows, cols).

    The models offer no seam, but all end with a pooling over the whole map and a linear layer: what comes before the
    pooling is the convolutional part.
    """

    def __init__(self, network: nn.Sequential, frames: int):
        super().__init__()
        pooling = [isinstance(layer, nn.AdaptiveAvgPool2d) for layer in network].index(True)
        channels = network[-1].in_features
        self.convolutions, self.read_out = network[:pooling], network[pooling:]
        self.join = nn.Conv2d(frames * channels, channels, 1)

    def forward(self, images: torch.Tensor) -> torch.Tensor:
        features = self.convolutions(images.flatten(0, 1)[:, None])
        return self.read_out(self.join(features.reshape(len(images), -1, *features.shape[2:])))


class JoinedClassifier(ImageClassifier):
    """A network from sets of `frames` images to a score per class; windows x are (n, frames, rows * cols).

    `single`: the model of one image, whose settings it takes over, with `frames` times the epochs: with as many as of
    one image every set would be seen too seldom to train on. With one frame nothing is joined.
    """

    def __init__(self, single: ImageClassifier, frames: int):
        def joined() -> nn.Module:
            _, network = single.make_network()  # after the layer that gives a window its rows and columns
            return network if frames == 1 else JoinedFrames(network, frames)

        training = single.training.model_copy(update={"epochs": frames * single.training.epochs})
        super().__init__(joined, single.spec._replace(frames=frames), training)

    def fit(
        self,
        train: tuple[np.ndarray, np.ndarray, np.ndarray],
        validation: Windows,
        *,
        sets: int,
        seed: int,
        device: str = "auto",
        progress: Progress = None,
    ) -> list[dict]:
        """Train as ImageClassifier.fit does, in every epoch on other sets of images of one session.

        train: images x (n, 1, pixels), labels y (n, classes), number of each image's session (n,); validation: sets
        that stay. `sets`: how many an epoch has at most. With `batch_size` sets of 4 in a batch, in place of
        `batch_size` images, training had not begun when it ended (validation loss 2.77; 0.45 so).
        """
        order, rng = torch.Generator().manual_seed(seed), generator(seed, "input frames")
        return self.train_on(
            lambda: torch.from_numpy(drawn_sets(train[2], self.spec.frames, sets, rng)),
            train[:2],
            validation,
            order,
            seed=seed,
            device=device,
            progress=progress,
        )


def scores(
    single: ImageClassifier,
    frames: int,
    x: np.ndarray,
    y: np.ndarray,
    session: np.ndarray,
    part: np.ndarray,
    *,
    seed: int,
    device: str,
    progress: Progress,
) -> list[metrics.Row]:
    """Train a network of `frames` input frames and score it on the test part; no row where no session has as many.

    x: images (n, 1, pixels); y: (n, classes); session: (n,) number of each image's session; part: (n,) 'train',
    'validation', 'test' or another word. An epoch sees as many images as one of the network of one frame, and there are
    `frames` times as many epochs.
    """
    drawn = np.flatnonzero(part == "train")
    fixed = {}
    for name in ("validation", "test"):
        rows = np.flatnonzero(part == name)
        fixed[name] = rows[fixed_sets(session[rows], frames)]
    sets = len(drawn) // frames
    if min(len(fixed_sets(session[drawn], frames)), sets) < 2 or not all(map(len, fixed.values())):
        return []
    network = JoinedClassifier(single, frames)
    windows = {name: (x[rows, 0], y[rows[:, 0]]) for name, rows in fixed.items()}
    train = x[drawn], y[drawn], session[drawn]
    network.fit(train, windows["validation"], sets=sets, seed=seed, device=device, progress=progress)
    images, truth = windows["test"]
    named = classification.scores(truth, network.predict(images))
    return metrics.unless_failed(named, network.summary.best_epoch == 0)
