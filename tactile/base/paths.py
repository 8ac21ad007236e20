"""Give every file of a workspace its path, and name the folders of the installed code."""

import os
from dataclasses import dataclass
from pathlib import Path

from tactile.base.errors import InputError
from tactile.base.installed import BROUGHT, CODE

EXPERIMENTS = CODE / "experiments"  # one file per experiment
MODELS = CODE / "models"  # one file per row of a table
MODEL_ZERO = "model_zero"  # beside an experiment's models: the networks that transfer starts from


@dataclass(frozen=True)
class Workspace:
    """A folder in which stages and commands read and write: a checkout, one of an own sensor, or any other.

    `root` as it was given: messages name files by it, and for the current folder that is `data/...`.
    """

    root: Path

    def brought(self, name: str | Path) -> Path:
        """Return a file or folder of this workspace, or, where it has none, the one that came with the code."""
        own = self.root / name
        return own if own.exists() else BROUGHT / name

    @property
    def params(self) -> Path:
        """Return the file of settings, which need not be there: params.settings_files then has those of the code."""
        return self.root / "params.yaml"

    @property
    def sources(self) -> Path:
        """Return the folder of public recordings that the user downloaded."""
        return self.root / "data" / "sources"

    @property
    def reports(self) -> Path:
        """Return the folder of what people read."""
        return self.root / "reports"

    @property
    def mlflow(self) -> Path:
        """Return `mlruns`, where MLflow's default store keeps the files of runs, in `artifacts`.

        `dvc exp run --queue` and `--temp` work in a copy below the checkout's `.dvc/tmp/exps`, which DVC then removes.
        The runs go to the checkout, which DVC_ROOT names.
        """
        root = self.root.resolve()  # MLflow notes the place of its files
        origin = Path(os.environ.get("DVC_ROOT", root)).resolve()
        return (origin if root.is_relative_to(origin / ".dvc" / "tmp" / "exps") else root) / "mlruns"

    @property
    def mlflow_database(self) -> Path:
        """Return `mlflow.db`, the default store of MLflow, beside `mlruns`: where plain `mlflow ui` looks."""
        return self.mlflow.with_name("mlflow.db")

    @property
    def look(self) -> Path:
        """Return the folder of the same reports of what was computed here, which git ignores."""
        return self.reports / "look"

    def experiment_folder(self, experiment: str) -> Path:
        """Return `data/<experiment>`, the folder of all that the stages of one experiment write."""
        return self.root / "data" / experiment

    def logs(self, experiment: str) -> Path:
        """Return the folder of raw logs that the simulator writes: `<condition>/<recording>/<device>.log`."""
        return self.experiment_folder(experiment) / "logs"

    def frames(self, experiment: str) -> Path:
        """Return the file of aligned, validated frames (output of ingest)."""
        return self.experiment_folder(experiment) / "frames.parquet"

    def rejects(self, experiment: str) -> Path:
        """Return the file of rejected lines: file, number and reason, of the first their text (output of ingest)."""
        return self.experiment_folder(experiment) / "rejects.parquet"

    def ingest_report(self, experiment: str) -> Path:
        """Return the report of ingest: rates, clock offsets, gaps and reject counts per recording."""
        return self.experiment_folder(experiment) / "ingest.json"

    def check(self, experiment: str) -> Path:
        """Return the picture of a folder of own logs, written by `tactile check`; no stage reads it."""
        return self.experiment_folder(experiment) / "check.png"

    def windows(self, experiment: str) -> Path:
        """Return the table with one row per window (output of window)."""
        return self.experiment_folder(experiment) / "windows.parquet"

    def dataset(self, experiment: str) -> Path:
        """Return the table of windows with labels and one split column per run (output of dataset)."""
        return self.experiment_folder(experiment) / "dataset.parquet"

    def models(self, experiment: str) -> Path:
        """Return the folder of an experiment's trained models (output of train)."""
        return self.experiment_folder(experiment) / "models"

    def model_folder(self, experiment: str, model: str) -> Path:
        """Return the folder that `train` writes for one model: one folder per run, named `<protocol>-<seed>`."""
        return self.models(experiment) / model

    def model_draft(self, experiment: str, model: str) -> Path:
        """Return where `train` builds a model's folder: outside `models`, so that no stage reads a draft."""
        return self.experiment_folder(experiment) / "unfinished" / model

    def run_folder(self, experiment: str, model: str, protocol: str, seed: int) -> Path:
        """Return the folder of one trained model: its files, `history.csv` and `fit.json`."""
        return self.model_folder(experiment, model) / f"{protocol}-{seed}"

    def training_times(self, experiment: str, model: str) -> Path:
        """Return the file of measured training seconds, apart from the model because they differ from call to call.

        The folder holds nothing else: the stage latency, which joins the seconds of all models, depends on it.
        """
        return self.experiment_folder(experiment) / "latency" / f"{model}.train.csv"

    def latency(self, experiment: str) -> Path:
        """Return the file of measured inference times (output of latency)."""
        return self.experiment_folder(experiment) / "speed" / "latency.csv"

    def predictions(self, experiment: str) -> Path:
        """Return the folder with one Parquet file per model: the predictions of all its runs on the test windows."""
        return self.experiment_folder(experiment) / "predictions"

    def kept(self, experiment: str) -> Path:
        """Return the table of what figures draw (output of evaluate), which a shard of the evidence keeps."""
        return self.experiment_folder(experiment) / "kept.parquet"

    def scores(self, experiment: str) -> Path:
        """Return the table with one row per metric, in full precision (output of evaluate)."""
        return self.experiment_folder(experiment) / "scores.csv"

    def study_result(self, experiment: str, table: str) -> Path:
        """Return the file of one table of a study, of the seed that it was called with (output of pipeline/studies)."""
        return self.experiment_folder(experiment) / "studies" / f"{table}.csv"

    def study(self, experiment: str, table: str) -> list[Path]:
        """Return the files of the evidence that hold a table of a study, one a seed; none where none was computed."""
        return sorted((self.root / "evidence" / "studies" / experiment).glob(f"{table}-*.csv"))

    def claim_inputs(self, experiment: str) -> Path:
        """Return the numbers that claims need beside scores, times and counts (output of claim_inputs)."""
        return self.experiment_folder(experiment) / "claim_inputs.csv"

    def stress(self, experiment: str) -> Path:
        """Return the scores of the trained models on perturbed data (output of stress)."""
        return self.experiment_folder(experiment) / "stress.csv"

    def stress_scenes(self, experiment: str) -> Path:
        """Return the folder of datasets of perturbed scenes, which exists while `stress` runs."""
        return self.experiment_folder(experiment) / "unfinished" / "stress"

    def calibration(self, experiment: str, model: str, protocol: str, seed: int) -> Path:
        """Return the file that keeps the calibration of a run for which a model was fitted again."""
        return self.experiment_folder(experiment) / "calibration" / model / f"{protocol}-{seed}.json"

    def coverage(self, experiment: str) -> Path:
        """Return the table of how often intervals hold the truth (output of `tactile coverage`)."""
        return self.reports / "coverage" / f"{experiment}.csv"

    def twins(self, experiment: str) -> Path:
        """Return the model-free statistics of a scene and of its recordings (output of twins)."""
        return self.experiment_folder(experiment) / "twins.csv"


def require(path: Path, made_by: str) -> Path:
    """Return `path`; where it does not exist, raise InputError that names the command which makes it."""
    if not path.exists() and made_by.startswith("git "):
        raise InputError(f"{path}: not found; run `{made_by}` in a checkout of the repository")
    if not path.exists():
        raise InputError(f"{path}: not found; run `{made_by}` first (or `dvc repro` for everything)")
    return path
