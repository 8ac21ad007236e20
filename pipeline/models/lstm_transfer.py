"""Transfer (latent-space paper, section III-B): the recurrent part of model-0, frozen; the read-out trained by Adam."""

from pipeline.fitting import Spec
from pipeline.series_fitting import LstmRegressor, recipe


def build(spec: Spec, *, training: dict) -> LstmRegressor:
    """Read-out of model-0's 50 states: 50 trained parameters for one output, 100 for two."""
    return LstmRegressor(spec, 1, recipe(training), transfer=True)
