"""Train a network that names the object from several frames of a recording, as STAG does (Sundaram et al. 2019).

Every frame goes through the same convolutional part. The features of all frames, one behind the other as channels, go
through a 1x1 convolution down to the channels of one frame, then through the network's own pooling and read-out.
"""

import numpy as np
import torch
from torch import nn

from pipeline.datasets.images import SIDE
from pipeline.datasets.seeding import generator
from pipeline.learning.image_classifier import ImageClassifier, augmented
from pipeline.learning.regressors import LARGEST_BATCH, Windows
from pipeline.learning.training import Epoch, Plateau, Progress, device_of, new_network, run_epochs
from pipeline.scoring import classification, metrics
from pipeline.scoring.frame_sets import drawn_sets, fixed_sets


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
    """A network from sets of `frames` images to a score per class; windows x are (n, frames, SIDE * SIDE).

    `single`: the model of one image, whose settings it takes over. With one frame nothing is joined.
    """

    def __init__(self, single: ImageClassifier, frames: int):
        def joined() -> nn.Module:
            _, network = single.make_network()  # after the layer that gives a window its rows and columns
            return network if frames == 1 else JoinedFrames(network, frames)

        super().__init__(joined, single.spec._replace(frames=frames), single.training)

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
        that stay. `sets`: how many an epoch has at most. A batch holds `batch_size` images, so that an epoch has as
        many updates as that of one frame: with `batch_size` sets of 4, training had not begun when its patience ended
        (validation loss 2.77; 0.45 so). Every image is altered alone.
        """
        place, frames, training = device_of(device), self.spec.frames, self.training
        order, rng = torch.Generator().manual_seed(seed), generator(seed, "input frames")
        network = self.network = new_network(self.make_network, seed).to(place)
        optimiser = torch.optim.Adam(network.parameters(), lr=training.learning_rate, fused=True)
        (x, y), (x_validation, y_validation) = (self._normalised(part[:2], place) for part in (train, validation))
        plateau = Plateau(optimiser, patience=training.patience, plateau=training.plateau, drop=training.drop)

        def run_epoch() -> Epoch:
            network.train()
            total, learning_rate = torch.zeros((), device=place), plateau.learning_rate
            drawn = torch.from_numpy(drawn_sets(train[2], frames, sets, rng)).to(place)
            for batch in drawn.split(max(1, training.batch_size // frames)):
                images = augmented(x[batch.flatten()].view(-1, 1, SIDE, SIDE), training, order)
                loss = nn.functional.cross_entropy(network(images.view(len(batch), frames, -1)), y[batch[:, 0]])
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
                total += loss.detach() * len(batch)
            network.eval()
            with torch.no_grad():
                parts = zip(x_validation.split(LARGEST_BATCH), y_validation.split(LARGEST_BATCH), strict=True)
                sums = [
                    nn.functional.cross_entropy(network(images), labels, reduction="sum") for images, labels in parts
                ]
            return Epoch(float(total) / len(drawn), float(sum(sums)) / len(x_validation), learning_rate)

        history, self.summary = run_epochs(network, training.max_epochs, run_epoch, progress=progress, stop=plateau)
        network.eval().to("cpu")
        return history


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
    'validation', 'test', 'unused' (of training sessions, but left out where one image is an input) or another word.
    An epoch sees as many images as one of the network of one frame: those of the part 'train'.
    """
    drawn = np.flatnonzero(np.isin(part, ("train", "unused")))
    fixed = {}
    for name in ("validation", "test"):
        rows = np.flatnonzero(part == name)
        fixed[name] = rows[fixed_sets(session[rows], frames)]
    sets = int((part == "train").sum()) // frames
    if min(len(fixed_sets(session[drawn], frames)), sets) < 2 or not all(map(len, fixed.values())):
        return []
    network = JoinedClassifier(single, frames)
    windows = {name: (x[rows, 0], y[rows[:, 0]]) for name, rows in fixed.items()}
    train = x[drawn], y[drawn], session[drawn]
    network.fit(train, windows["validation"], sets=sets, seed=seed, device=device, progress=progress)
    images, truth = windows["test"]
    named = classification.scores(truth, network.predict(images))
    return metrics.unless_failed(named, network.summary.best_epoch == 0)
