"""Open a trained model in MLflow. `track` copies this file into the folder of every model that it logs.

Readings in: float32 (n, columns); one prediction per reading out, as tactile.inference.predictor says.
"""

from pathlib import Path

import numpy as np
from mlflow.models import set_model
from mlflow.pyfunc import PythonModel


class TrainedModel(PythonModel):
    """A saved model with its card; MLflow has checked readings against its signature."""

    def load_context(self, context) -> None:
        """Load weights and card, which lie in one folder. Raises InputError where they do not belong together."""
        try:
            from tactile.inference import predictor
        except ModuleNotFoundError as error:
            if error.name != "tactile":
                raise
            raise ModuleNotFoundError(
                "the model needs the code that made it: run `pip install -e '.[reproduction]'` in a checkout of the "
                "commit in its card",
                name=error.name,
            ) from error
        self.predictor = predictor.load(Path(context.artifacts["card"]).parent)

    def predict(self, context, model_input: np.ndarray, params=None) -> np.ndarray:
        """Return one prediction per reading of a recording, (n, *output_shape) float32; NaN before a whole window."""
        return self.predictor.predict(model_input)


set_model(TrainedModel())
