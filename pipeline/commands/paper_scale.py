"""Run an experiment at the papers' scale in a folder of its own, and keep what it says in reports/paper_scale.

The folder, build/paper_scale, is a clone of this repository at the present commit with the values of scales/paper.yaml,
and shares DVC's cache with it. `dvc repro` runs there up to the experiment's scores, times and verdicts; interrupted,
the same command goes on where it stopped. Into reports/paper_scale go scores.csv, latency.csv, claims.csv (rows of
other experiments stay) and <experiment>/: the table beside the published one, its settings and dvc.lock.
"""

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import yaml

from pipeline.base import files, params, paths
from pipeline.base.errors import InputError
from pipeline.commands.scale import set_values
from pipeline.reporting.verdicts.rules import EXPERIMENTS

FOLDER, REPORTS = Path("build") / "paper_scale", Path("reports") / "paper_scale"  # of the repository
STAGES = {  # what the verdicts of an experiment's paper need
    "touch": ["evaluate@touch", "latency@touch"],
    "strain": ["evaluate@strain", "latency@strain", "study_strain"],
    "glove": ["evaluate@glove", "latency@glove", "count"],
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes to its parser."""
    parser.add_argument("experiment", choices=sorted(EXPERIMENTS.values()))


def run(folder: Path, *command: str) -> None:
    """Run a command in a folder, with its code before all other; InputError where it fails."""
    environment = os.environ | {"PYTHONPATH": str(folder)}
    done = subprocess.run(command, cwd=folder, env=environment)
    if done.returncode:
        raise InputError(f"{paths.shown(folder)}: `{' '.join(command)}` failed; its message is above")


def prepare(folder: Path) -> None:
    """Make the clone, or bring it to the present commit; what it has computed stays."""
    git = ["git", "-c", "advice.detachedHead=false"]
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=paths.ROOT, capture_output=True, text=True, check=True
    ).stdout.strip()
    if not (folder / ".git").exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        run(paths.ROOT, *git, "clone", "--quiet", "--shared", "--no-checkout", str(paths.ROOT), str(folder))
    else:
        run(folder, *git, "fetch", "--quiet", "origin")
    run(folder, *git, "checkout", "--quiet", "--force", commit)
    set_values(params.parsed(paths.PAPER_SCALE), folder / "params.yaml")
    run(folder, sys.executable, "-m", "dvc", "config", "--local", "cache.dir", str(paths.ROOT / ".dvc" / "cache"))


def keep(experiment: str, folder: Path, target: Path) -> None:
    """Copy what the run in `folder` says to `target`; rows of the experiment's own replace earlier ones."""
    ours = {
        "scores.csv": folder / "data" / experiment / "scores.csv",
        "latency.csv": folder / "data" / experiment / "speed" / "latency.csv",
        "claims.csv": folder / "reports" / "claims.csv",
    }
    paper = next(key for key, name in EXPERIMENTS.items() if name == experiment)
    for name, path in ours.items():
        column, own = ("paper", paper) if name == "claims.csv" else ("experiment", experiment)
        rows = pd.read_csv(path, dtype=str, keep_default_na=False)
        if (target / name).exists():
            before = pd.read_csv(target / name, dtype=str, keep_default_na=False)
            rows = pd.concat([before[before[column] != own], rows])
        files.write_table(target / name, rows)
    own = target / experiment
    own.mkdir(parents=True, exist_ok=True)
    shutil.copy(folder / "reports" / "claims.md", own / "claims.md")
    lock = yaml.safe_load((folder / "dvc.lock").read_text(encoding="utf-8"))
    stages = {name: stage for name, stage in lock["stages"].items() if experiment in name or name in STAGES[experiment]}
    files.write_text(own / "dvc.lock", yaml.safe_dump({"schema": lock["schema"], "stages": stages}, sort_keys=True))
    values = yaml.safe_load((folder / "params.yaml").read_text(encoding="utf-8"))
    files.write_text(own / "params.yaml", yaml.safe_dump({experiment: values[experiment]}, sort_keys=False))


def main(given: argparse.Namespace) -> None:
    """Run the experiment that was given, and keep its results."""
    folder = paths.ROOT / FOLDER
    prepare(folder)
    run(folder, sys.executable, "-m", "dvc", "repro", *STAGES[given.experiment])
    run(folder, sys.executable, "-m", "pipeline.stages.judge", given.experiment)
    keep(given.experiment, folder, paths.ROOT / REPORTS)
    print(f"{paths.shown(paths.ROOT / REPORTS)}: {given.experiment} at the papers' scale")
