"""Transfer (latent-space paper, section III-B): the recurrent part of model-0, frozen; the read-out trained by Adam."""

import torch

from pipeline.base.blocks import SequenceTraining
from pipeline.datasets.series import Record
from pipeline.learning.regressors import Spec
from pipeline.learning.series_regressors import LstmRegressor


def build(spec: Spec, *, training: SequenceTraining) -> "Transfer":
    """Read-out of model-0's 50 states: 50 trained parameters for one output, 100 for two."""
    return Transfer(spec, 1, training, transfer=True)


class Transfer(LstmRegressor):
    """Draws the read-out's start from `seed` too: its size is known only once model-0 has been read."""

    def fit(self, records: list[Record], *, seed: int, **how) -> list[dict]:
        """As LstmRegressor.fit."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return super().fit(records, seed=seed, **how)
