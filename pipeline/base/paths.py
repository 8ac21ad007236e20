"""Give every file of an experiment its path."""

from pathlib import Path

from pipeline.base.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
MODEL_ZERO = "model_zero"  # beside an experiment's models: the networks that transfer starts from
PARAMS = ROOT / "params.yaml"
CODE = ROOT / "pipeline"
EXPERIMENTS = CODE / "experiments"  # one file per experiment
MODELS = CODE / "models"  # one file per row of a table
SOURCES = ROOT / "data" / "sources"
REPORTS = ROOT / "reports"
SCALES = ROOT / "scales"  # amounts of data, epochs and runs: laptop.yaml, paper.yaml


def shown(path: Path) -> str:
    """Return `path` as a message names it: relative to the repository."""
    return path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else str(path)


def experiment_folder(experiment: str) -> Path:
    """Return `data/<experiment>`, the folder of all that the stages of one experiment write."""
    return ROOT / "data" / experiment


def logs(experiment: str) -> Path:
    """Return the folder of raw logs that the simulator writes: `<condition>/<recording>/<device>.log`."""
    return experiment_folder(experiment) / "logs"


def frames(experiment: str) -> Path:
    """Return the file of aligned, validated frames (output of ingest)."""
    return experiment_folder(experiment) / "frames.parquet"


def rejects(experiment: str) -> Path:
    """Return the file of rejected lines with file, number and reason, the first with their text (output of ingest)."""
    return experiment_folder(experiment) / "rejects.parquet"


def ingest_report(experiment: str) -> Path:
    """Return the report of ingest: rates, clock offsets, gaps and reject counts per recording."""
    return experiment_folder(experiment) / "ingest.json"


def check(experiment: str) -> Path:
    """Return the picture of a folder of own logs, written by `tactile check`; no stage reads it."""
    return experiment_folder(experiment) / "check.png"


def windows(experiment: str) -> Path:
    """Return the table with one row per window (output of window)."""
    return experiment_folder(experiment) / "windows.parquet"


def dataset(experiment: str) -> Path:
    """Return the table of windows with labels and one split column per run (output of dataset)."""
    return experiment_folder(experiment) / "dataset.parquet"


def models(experiment: str) -> Path:
    """Return the folder of an experiment's trained models (output of train)."""
    return experiment_folder(experiment) / "models"


def model_folder(experiment: str, model: str) -> Path:
    """Return the folder that `train` writes for one model: one folder per run, named `<protocol>-<seed>`."""
    return models(experiment) / model


def model_draft(experiment: str, model: str) -> Path:
    """Return the folder in which `train` builds a model's folder: outside `models`, so that no stage reads a draft."""
    return experiment_folder(experiment) / "unfinished" / model


def run_folder(experiment: str, model: str, protocol: str, seed: int) -> Path:
    """Return the folder of one trained model: its files, `history.csv` and `fit.json`."""
    return model_folder(experiment, model) / f"{protocol}-{seed}"


def training_times(experiment: str, model: str) -> Path:
    """Return the file of measured training seconds, apart from the model because they differ from call to call.

    The folder holds nothing else: the stage latency, which joins the seconds of all models, depends on it.
    """
    return experiment_folder(experiment) / "latency" / f"{model}.train.csv"


def latency(experiment: str) -> Path:
    """Return the file of measured inference times (output of latency)."""
    return experiment_folder(experiment) / "speed" / "latency.csv"


def predictions(experiment: str) -> Path:
    """Return the folder with one Parquet file per model: the predictions of all its runs on the test windows."""
    return experiment_folder(experiment) / "predictions"


def scores(experiment: str) -> Path:
    """Return the table with one row per metric, in full precision (output of evaluate)."""
    return experiment_folder(experiment) / "scores.csv"


def augmentation(experiment: str) -> Path:
    """Return the scores of one model with each augmentation method alone (output of augmentation)."""
    return experiment_folder(experiment) / "augmentation.csv"


def input_frames(experiment: str) -> Path:
    """Return the scores of networks that are trained on several input frames (output of input_frames)."""
    return experiment_folder(experiment) / "input_frames.csv"


def ablation(experiment: str) -> Path:
    """Return the scores of models with one thing changed (output of ablation)."""
    return experiment_folder(experiment) / "ablation.csv"


def probe(experiment: str) -> Path:
    """Return the scores of naming the object from recorded joint angles alone (output of joint_angles)."""
    return experiment_folder(experiment) / "probe.csv"


def stag(experiment: str) -> Path:
    """Return the scores of figure 15 on the STAG data set (output of stag); only a header without the user's file."""
    return experiment_folder(experiment) / "stag.csv"


def claim_inputs(experiment: str) -> Path:
    """Return the numbers that claims need beside scores, times and counts (output of claim_inputs)."""
    return experiment_folder(experiment) / "claim_inputs.csv"


def stress(experiment: str) -> Path:
    """Return the scores of the trained models on perturbed data (output of stress)."""
    return experiment_folder(experiment) / "stress.csv"


def stress_scenes(experiment: str) -> Path:
    """Return the folder of datasets of perturbed scenes, which exists while `stress` runs."""
    return experiment_folder(experiment) / "unfinished" / "stress"


def physics(experiment: str) -> Path:
    """Return the scores of small models on the scene without one of its effects (output of physics)."""
    return experiment_folder(experiment) / "physics.csv"


def twins(experiment: str) -> Path:
    """Return the model-free statistics of a scene and of its recordings (output of twins)."""
    return experiment_folder(experiment) / "twins.csv"


def require(path: Path, made_by: str) -> Path:
    """Return `path`; where it does not exist, raise InputError that names the command which makes it."""
    if not path.exists():
        name = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
        raise InputError(f"{name}: not found; run `{made_by}` first (or `dvc repro` for everything)")
    return path
