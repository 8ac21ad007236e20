"""Make the files of a run in MLflow a model that `mlflow.pyfunc.load_model` opens, and take a model out of a run.

Nothing is pickled: the model is the file mlflow_model.py, a card and the weights that the run has anyway.
"""

import importlib.metadata
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from pipeline import experiments, tracking
from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.datasets import images, schemas
from pipeline.inference import card as cards
from pipeline.inference.describer import Describer

CODE = paths.CODE / "inference" / "mlflow_model.py"
# What a loaded model imports, and pandas, which MLflow hands it tables with. MLflow finds this out in seconds a model.
REQUIRED = (
    *("numba", "numpy", "pandas", "pyarrow", "pydantic", "ruamel.yaml", "safetensors", "scikit-learn", "scipy"),
    *("skops", "threadpoolctl", "torch"),
)
PREDICTED = 4  # readings of the input example that have a prediction


class Writer:
    """Writes the models of many runs, and reads what the runs of an experiment share once."""

    def __init__(self, values: Mapping):
        """Take params.yaml as nested dictionaries."""
        self.values = values
        self._of_experiment: dict[str, tuple[Describer, np.ndarray]] = {}
        versions = {name: importlib.metadata.version(name).partition("+")[0] for name in REQUIRED}
        self._requirements = [f"{name}=={version}" for name, version in versions.items()]

    def write(self, run: tracking.TrackedRun, logged, folder: Path) -> str:
        """Write what makes the files of a run a model into `folder`, to lie beside them; return its description.

        logged: the MLflow run that gets the files; the same one gets the same files again. Raises InputError where
        frames or dataset of the experiment are missing.
        """
        import mlflow.pyfunc
        from mlflow.models import Model, ModelSignature
        from mlflow.types import Schema, TensorSpec

        if run.experiment not in self._of_experiment:
            describer = Describer(self.values, run.experiment)
            self._of_experiment[run.experiment] = describer, _readings(run.experiment, self.values[run.experiment])
        describer, readings = self._of_experiment[run.experiment]
        card = describer.card(run.model, run.protocol, run.seed, logged.data.tags.get("git_commit", "unknown"))
        shapes, number = card.shapes, np.dtype("float32")
        of_maps, outputs = card.kind == "windows", shapes.map_rows * shapes.map_cols
        predicted = (shapes.map_rows, shapes.map_cols) if of_maps else (outputs,)
        whole = (shapes.frames - 1) * card.inputs.frame_step if of_maps else 0
        model = Model(
            artifact_path=tracking.MODEL,
            run_id=logged.info.run_id,
            utc_time_created=datetime.fromtimestamp(logged.info.start_time / 1000, UTC).replace(tzinfo=None),
            model_uuid=logged.info.run_id,
        )
        told = _description(card, predicted, whole)
        mlflow.pyfunc.save_model(
            folder,
            python_model=str(CODE),
            mlflow_model=model,
            signature=ModelSignature(
                Schema([TensorSpec(number, (-1, card.inputs.columns))]), Schema([TensorSpec(number, (-1, *predicted))])
            ),
            input_example=readings[: whole + PREDICTED],
            pip_requirements=self._requirements,
            metadata={"experiment": run.experiment, "protocol": run.protocol, "model": run.model, "seed": run.seed}
            | told,
        )
        flavour = model.flavors[mlflow.pyfunc.FLAVOR_NAME]
        flavour["model_code_path"] = CODE.name
        flavour["artifacts"] = {"package": {"path": ".", "uri": "."}}  # the card is written here, the weights are there
        cards.write(folder, card)
        model.model_size_bytes = sum(
            path.stat().st_size for place in (folder, run.folder) for path in place.rglob("*") if path.is_file()
        )
        model.save(folder / "MLmodel")
        return "\n\n".join(f"{name}: {text}" for name, text in told.items())


def _description(card: cards.Card, predicted: tuple[int, ...], whole: int) -> dict[str, str]:
    """Say what goes in and out; whole: readings that have no prediction, before a window is whole."""
    inputs, outputs = card.inputs, card.outputs
    shape = ", ".join(map(str, ("n", *predicted)))
    said = f"float32 ({shape}) in {outputs.unit}, one per reading"
    if outputs.names:
        said += f": {', '.join(outputs.names)}"
    if whole:
        said += f"; where a model takes whole windows, NaN for the first {whole}"
    taken = f"float32 (n, {inputs.columns}) in {inputs.unit}, {inputs.order}; one every {inputs.interval_s:g} s"
    return {"readings": taken, "predictions": said}


def _readings(experiment: str, settings: Mapping) -> np.ndarray:
    """Return the readings of an experiment's frames, (n, columns) float32."""
    schema = experiments.module(experiment).frames_schema(settings)
    names = ["v"] if "v" in schema.names else images.reading_columns(schema)
    frames = schemas.read(paths.require(paths.frames(experiment), "dvc repro evaluate"), names)
    return np.concatenate([schemas.matrix(frames[name]) for name in names], axis=1).astype(np.float32)


def downloaded(run_id: str, target: Path) -> Path:
    """Copy weights and card of an MLflow run below the new folder `target`, and return their folder, a package.

    The run is looked for in the store of this checkout, or the one that MLFLOW_TRACKING_URI names. Raises InputError
    where there is no such run, or it holds no model.
    """
    if not tracking.store.server() and not tracking.store.database().is_file():
        raise InputError(f"{run_id}: this checkout has no MLflow runs; run `dvc repro`, or set MLFLOW_TRACKING_URI")
    from mlflow.exceptions import MlflowException

    with tracking.opened("repeat the command") as client:
        try:
            client.get_run(run_id)
        except MlflowException as error:
            if error.error_code != "RESOURCE_DOES_NOT_EXIST":
                raise
            raise InputError(f"{run_id}: no such run in MLflow; copy the run's id from its page there") from error
        held = {Path(file.path).name for file in client.list_artifacts(run_id, tracking.MODEL)}
        weights = [name for name in cards.WEIGHTS if name in held]
        if cards.NAME not in held or not weights:
            raise InputError(
                f"{run_id}: this MLflow run holds no model with {cards.NAME}; run `python -m pipeline.stages.track`, "
                "which adds it to the present results"
            )
        target.mkdir(parents=True)
        for name in (cards.NAME, *weights):
            copied = client.download_artifacts(run_id, f"{tracking.MODEL}/{name}", str(target))
    return Path(copied).parent
