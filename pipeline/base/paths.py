"""Where every file of an experiment lies, relative to the repository root."""

from pathlib import Path

from pipeline.base.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
MODEL_ZERO = "model_zero"  # beside an experiment's models: the networks that transfer starts from
PARAMS = ROOT / "params.yaml"
CODE = ROOT / "pipeline"
MODELS = CODE / "models"  # one file per row of a table
SOURCES = ROOT / "data" / "sources"
REPORTS = ROOT / "reports"


def experiment_folder(experiment: str) -> Path:
    """`data/<experiment>`: everything the stages of one experiment write."""
    return ROOT / "data" / experiment


def logs(experiment: str) -> Path:
    """Raw logs written by the simulator: `<condition>/<recording>/<device>.log`."""
    return experiment_folder(experiment) / "logs"


def frames(experiment: str) -> Path:
    """Aligned, validated frames (output of ingest)."""
    return experiment_folder(experiment) / "frames.parquet"


def rejects(experiment: str) -> Path:
    """Every rejected line with its file, number and reason, and the text of the first (output of ingest)."""
    return experiment_folder(experiment) / "rejects.parquet"


def ingest_report(experiment: str) -> Path:
    """What ingest understood: rates, clock offsets, gaps, reject counts per recording."""
    return experiment_folder(experiment) / "ingest.json"


def check(experiment: str) -> Path:
    """The picture of a folder of own logs (written by `tactile check`; no stage reads it)."""
    return experiment_folder(experiment) / "check.png"


def windows(experiment: str) -> Path:
    """One row a window (output of window)."""
    return experiment_folder(experiment) / "windows.parquet"


def dataset(experiment: str) -> Path:
    """Windows with labels and one split column a run (output of dataset)."""
    return experiment_folder(experiment) / "dataset.parquet"


def model_folder(experiment: str, model: str) -> Path:
    """Everything `train` writes for one model: a folder a run, named `<protocol>-<seed>`."""
    return experiment_folder(experiment) / "models" / model


def model_draft(experiment: str, model: str) -> Path:
    """Where `train` builds a model's folder: outside `models`, so that a killed run leaves nothing for others."""
    return experiment_folder(experiment) / "unfinished" / model


def run_folder(experiment: str, model: str, protocol: str, seed: int) -> Path:
    """One trained model: its files, `history.csv` and `fit.json`."""
    return model_folder(experiment, model) / f"{protocol}-{seed}"


def training_times(experiment: str, model: str) -> Path:
    """Measured training seconds, apart from the model because they differ from run to run.

    Nothing else is in their folder: the stage latency, which joins those of all models, depends on it.
    """
    return experiment_folder(experiment) / "latency" / f"{model}.train.csv"


def latency(experiment: str) -> Path:
    """Measured inference times (output of latency)."""
    return experiment_folder(experiment) / "speed" / "latency.csv"


def predictions(experiment: str) -> Path:
    """A Parquet file a model with the predictions of all its runs on the test windows."""
    return experiment_folder(experiment) / "predictions"


def scores(experiment: str) -> Path:
    """One row a metric (output of evaluate), in full precision."""
    return experiment_folder(experiment) / "scores.csv"


def augmentation(experiment: str) -> Path:
    """Scores of one model with each augmentation method alone (output of augment)."""
    return experiment_folder(experiment) / "augmentation.csv"


def probe(experiment: str) -> Path:
    """What gives the object away in the recorded joint angles (output of probe)."""
    return experiment_folder(experiment) / "probe.csv"


def stag(experiment: str) -> Path:
    """Scores of figure 15 on the STAG data set (output of train_stag); only a header without the user's file."""
    return experiment_folder(experiment) / "stag.csv"


def stress(experiment: str) -> Path:
    """Scores of the trained models on perturbed data (output of stress)."""
    return experiment_folder(experiment) / "stress.csv"


def stress_scenes(experiment: str) -> Path:
    """Datasets of perturbed scenes, while `stress` runs."""
    return experiment_folder(experiment) / "unfinished" / "stress"


def physics(experiment: str) -> Path:
    """Scores of small models on the scene without one of its effects (output of physics)."""
    return experiment_folder(experiment) / "physics.csv"


def require(path: Path, made_by: str) -> Path:
    """`path`, or the sentence that says which stage makes it."""
    if not path.exists():
        shown = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
        raise InputError(f"{shown}: not found; run `{made_by}` first (or `dvc repro` for everything)")
    return path
