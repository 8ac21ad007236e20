"""Open MLflow's store: `mlflow.db` of this checkout, or the one that MLFLOW_TRACKING_URI names."""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote, urlencode, urlsplit

from tactile.base.errors import InputError, storage_error
from tactile.inference import card as cards

os.environ["MLFLOW_DISABLE_TELEMETRY"] = "true"  # read by mlflow when it is imported
os.environ["MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT"] = "true"  # two lines a run, where a server is used
os.environ["MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR"] = "false"  # two bars a run
os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "2")  # 7 retries of a dead server take 4 minutes

from mlflow import MlflowClient
from mlflow.exceptions import MlflowException
from mlflow.store.db.db_types import DATABASE_ENGINES
from sqlalchemy.exc import SQLAlchemyError

from tactile.base.paths import Workspace

MODEL = "model"  # folder of a run that MLflow opens as a model
PACKAGE = f"{MODEL}/artifacts"  # weights and card in it, where MLflow puts the files of a model
TRACK = "run `python -m pipeline.stages.track` again"
UI = "http://127.0.0.1:5055"  # where `tactile track --serve` starts MLflow's pages

for name in ("alembic", "mlflow", "urllib3"):  # what goes wrong reaches the user as one InputError, without addresses
    logging.getLogger(name).setLevel(logging.CRITICAL)


def server() -> str:
    """Return the address in MLFLOW_TRACKING_URI, a server's or a database's; empty for the default store."""
    return os.environ.get("MLFLOW_TRACKING_URI", "")


@contextmanager
def opened(workspace: Workspace, then: str = TRACK) -> Iterator[MlflowClient]:
    """Give the block a client of the store; an error of the store becomes one sentence that ends with `then`.

    The sentence names no address, and gives no reason that could quote one with a password in it.
    """
    uri = server()
    try:
        _ = urlsplit(uri).port
    except ValueError as error:  # which quotes a password
        wrong = "is no address of a server or a database, such as http://127.0.0.1:5000; correct it"
        raise InputError(f"MLFLOW_TRACKING_URI: {wrong}") from error
    try:
        if not uri:
            workspace.mlflow.mkdir(parents=True, exist_ok=True)
        client = MlflowClient(tracking_uri=uri or f"sqlite:///{workspace.mlflow_database}")
        client.search_experiments(max_results=1)
        yield client
    except (MlflowException, SQLAlchemyError, OSError, ImportError) as error:
        reason = type(error).__name__ if set("@?") & set(uri) else str(error).partition("\n")[0].rstrip(".")
        raise InputError(
            storage_error(error)
            or f"{'MLFLOW_TRACKING_URI' if uri else 'mlflow.db'}: the MLflow store cannot be used ({reason}); "
            f"start its server, close what else uses it, or move a damaged file away, and {then} (the results in data/ "
            "are safe)"
        ) from error


def experiment_id(workspace: Workspace, client: MlflowClient, name: str) -> str:
    """Return MLflow's id of the experiment `name`, which is made where there is none.

    Raises InputError where somebody deleted it, or the default store keeps its files in another checkout.
    """
    # A server knows where files go; a database alone would have them below the working folder, which may be a copy's.
    engine = (server() or "sqlite").partition(":")[0].partition("+")[0]
    place = str(workspace.mlflow / "artifacts" / name) if engine in DATABASE_ENGINES else None
    found = client.get_experiment_by_name(name)
    if found is None:
        return client.create_experiment(name, place)
    if found.lifecycle_stage == "deleted":
        raise InputError(
            f"MLflow: experiment {name} was deleted there; with MLFLOW_TRACKING_URI set to the store, bring it back "
            f"(`mlflow experiments restore -x {found.experiment_id}`) or remove it for good (`mlflow gc`), and {TRACK}"
        )
    if not server() and found.artifact_location != place:
        raise InputError(
            f"mlflow.db: keeps the files of {name} in {found.artifact_location}, so this folder was moved or "
            f"copied; delete mlflow.db and mlruns, and {TRACK}, which fills it again"
        )
    return found.experiment_id


def link(experiment: str, protocol: str, metric: str, ascending: bool) -> str:
    """Return the address at which MLflow compares the current models of a protocol in charts, sorted by a metric.

    experiment: MLflow's id. The address says `machine_learning` because MLflow 3 else opens its view of generative AI.
    """
    query = {
        "workflowType": "machine_learning",
        "searchFilter": f"tags.current = 'true' and tags.compared = 'true' and tags.protocol = '{protocol}'",
        "orderByKey": f"metrics.`{metric}`",
        "orderByAsc": str(ascending).lower(),
        "compareRunsMode": "CHART",
    }
    uri = server()
    shown = uri if uri.startswith("http") and not set("@?") & set(uri) else UI  # an account is never printed
    return f"{shown.rstrip('/')}/#/experiments/{experiment}/runs?{urlencode(query, quote_via=quote)}"


def downloaded(workspace: Workspace, run_id: str, target: Path) -> Path:
    """Copy weights and card of an MLflow run below the new folder `target`, and return their folder, a package.

    Raises InputError where the store has no such run, or the run holds no model.
    """
    if not server() and not workspace.mlflow_database.is_file():
        raise InputError(f"{run_id}: this checkout has no MLflow runs; run `dvc repro`, or set MLFLOW_TRACKING_URI")
    with opened(workspace, "repeat the command") as client:
        try:
            held = {file.path for file in client.list_artifacts(run_id, PACKAGE)}
        except MlflowException as error:
            if error.error_code != "RESOURCE_DOES_NOT_EXIST":
                raise
            raise InputError(f"{run_id}: no such run in MLflow; copy the run's id from its page there") from error
        if f"{PACKAGE}/{cards.NAME}" not in held:
            raise InputError(f"{run_id}: this MLflow run holds no model with {cards.NAME}; {TRACK} and take one of its")
        target.mkdir(parents=True)
        return Path(client.download_artifacts(run_id, PACKAGE, str(target)))
