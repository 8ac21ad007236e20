"""Build transfer (latent-space paper, section III-B): model-0's recurrent part, frozen; a read-out trained by Adam."""

import torch
from pydantic import Field

from tactile.datasets.series import Record
from tactile.learning.lstm import LstmRegressor
from tactile.learning.spec import Spec
from tactile.settings.shared import Block
from tactile.settings.training import SequenceTraining

TRANSFER = True


class Settings(Block):
    """Settings of a model `lstm_transfer` in params.yaml."""

    training: SequenceTraining = Field(description="How the read-out is trained")


def build(spec: Spec, *, training: SequenceTraining) -> "Transfer":
    """Return the model before transfer; 50 states are 50 trained parameters for one output, 100 for two."""
    return Transfer(spec, 1, training, transfer=True)


class Transfer(LstmRegressor):
    """An LstmRegressor whose read-out starts from `seed`, too: model-0, read in `fit`, gives the read-out's size."""

    def fit(self, records: list[Record], *, seed: int, **options) -> list[dict]:
        """Train the read-out; arguments and result as for LstmRegressor.fit."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return super().fit(records, seed=seed, **options)
