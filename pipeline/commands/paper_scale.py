"""Run an experiment at the papers' scale in a folder of its own, and keep what it says in reports/paper_scale.

The folder, build/paper_scale, is a clone of this repository at the present commit with the values of scales/paper.yaml,
and shares DVC's cache with it. `dvc repro` runs there up to the experiment's scores, times and verdicts; interrupted,
the same command goes on where it stopped. `--protocols` runs some of the experiment's protocols, so that a run of many
hours can be made in parts, also on several machines. `--longer` then trains every network of these protocols twice as
long, at one seed, as `tactile longer EXPERIMENT` does: claims on networks whose validation errors still fall get no
verdict. Into reports/paper_scale go scores.csv, latency.csv, claim_inputs.csv, longer.csv and claims.csv: rows of
other experiments and protocols stay, and so does the verdict on a claim that this part could not test. Into
<experiment>/, with the names of the protocols where not all were run, go claims.md, params.yaml and dvc.lock.
"""

import argparse
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import yaml

from pipeline.base import files, params
from pipeline.base.errors import InputError
from pipeline.base.params_file import set_values
from pipeline.base.paths import Workspace
from pipeline.claims.rules import NOT_TESTABLE
from pipeline.scoring import claim_inputs

FOLDER, REPORTS = Path("build") / "paper_scale", Path("reports") / "paper_scale"  # of the repository
STAGES = {  # what the verdicts of an experiment's paper need
    "touch": ["evaluate@touch", "latency@touch"],
    "strain": ["evaluate@strain", "latency@strain", "study_strain"],
    "glove": ["evaluate@glove", "latency@glove", "count"],
    "glove_recorded": [
        "evaluate@glove_recorded",
        "latency@glove_recorded",
    ],  # a run for each seed takes long there, too
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes to its parser."""
    parser.add_argument("experiment", choices=sorted(STAGES))
    parser.add_argument(
        "--protocols", nargs="+", default=[], metavar="NAME", help="some of the protocols; default: all"
    )
    parser.add_argument("--longer", action="store_true", help="tell which trainings have ended")


def run(folder: Path, *command: str) -> None:
    """Run a command in a folder, with its code before all other; InputError where it fails."""
    environment = os.environ | {"PYTHONPATH": str(folder.resolve())}
    done = subprocess.run(command, cwd=folder, env=environment)
    if done.returncode:
        raise InputError(f"{folder}: `{' '.join(command)}` failed; its message is above")


def prepare(workspace: Workspace, experiment: str, protocols: Sequence[str], folder: Path) -> None:
    """Make the clone, or bring it to the present commit; what it has computed stays.

    protocols: those of the experiment that its params.yaml keeps; all where there are none.
    """
    root, git = str(workspace.root.resolve()), ["git", "-c", "advice.detachedHead=false"]
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=workspace.root, capture_output=True, text=True, check=True
    ).stdout.strip()
    if not (folder / ".git").exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        run(workspace.root, *git, "clone", "--quiet", "--shared", "--no-checkout", root, str(folder.resolve()))
    else:
        run(folder, *git, "fetch", "--quiet", "origin")
    run(folder, *git, "checkout", "--quiet", "--force", commit)
    settings = folder / "params.yaml"
    set_values(params.parsed(workspace.scales / "paper.yaml"), settings, "scales/paper.yaml")
    if protocols:
        known = params.read(settings)[experiment]["protocols"]
        unknown = [name for name in protocols if name not in known]
        if unknown:
            raise InputError(f"--protocols: {experiment} has no '{unknown[0]}'; take of {', '.join(known)}")
        set_values({f"{experiment}.protocols": {name: known[name] for name in known if name in protocols}}, settings)
    run(folder, sys.executable, "-m", "dvc", "config", "--local", "cache.dir", f"{root}/.dvc/cache")


def merged(name: str, rows: pd.DataFrame, before: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a file of reports/paper_scale: those of this run, and those of earlier ones that stay.

    name: that of the file; rows: of this run, of one experiment; before: of the file.
    """
    if name == "claims.csv":
        tested = before[before["id"].isin(rows["id"]) & (before["verdict"] != NOT_TESTABLE)]["id"]
        rows = rows[~((rows["verdict"] == NOT_TESTABLE) & rows["id"].isin(tested))]
        stay = ~before["id"].isin(rows["id"])
    else:
        key = [column for column in ("experiment", "protocol") if column in rows]
        stay = ~pd.MultiIndex.from_frame(before[key]).isin(pd.MultiIndex.from_frame(rows[key]))
    return pd.concat([before[stay], rows])


def keep_numbers(experiment: str, folder: Path, target: Path) -> None:
    """Bring the scores and times of the run in `folder`, and its longer trainings, to `target`."""
    protocols = list(_settings(experiment, folder)["protocols"])
    data, trained_longer = folder / "data" / experiment, folder / "reports" / "longer" / f"{experiment}.csv"
    _keep_rows(data / "scores.csv", target / "scores.csv")
    _keep_rows(data / "speed" / "latency.csv", target / "latency.csv")
    _keep_rows(data / "claim_inputs.csv", target / "claim_inputs.csv")
    if trained_longer.is_file():
        rows = _rows(trained_longer)
        rows = rows[rows["protocol"].isin(protocols)].assign(experiment=experiment)
        files.write_table(target / "longer.csv", _with_earlier(rows, target / "longer.csv"))


def keep_verdicts(experiment: str, protocols: Sequence[str], folder: Path, target: Path) -> None:
    """Bring the verdicts of the run in `folder`, its settings and hashes to `target`.

    protocols: of this run, none where all were run.
    """
    _keep_rows(folder / "reports" / "claims.csv", target / "claims.csv")
    settings = _settings(experiment, folder)
    part = target / experiment / "_and_".join(protocols)
    part.mkdir(parents=True, exist_ok=True)
    shutil.copy(folder / "reports" / "claims.md", part / "claims.md")
    lock = yaml.safe_load((folder / "dvc.lock").read_text(encoding="utf-8"))
    stages = {name: stage for name, stage in lock["stages"].items() if experiment in name or name in STAGES[experiment]}
    files.write_text(part / "dvc.lock", yaml.safe_dump({"schema": lock["schema"], "stages": stages}, sort_keys=True))
    files.write_text(part / "params.yaml", yaml.safe_dump({experiment: settings}, sort_keys=False))


def _settings(experiment: str, folder: Path) -> dict:
    """Return the experiment's block of the settings of a run."""
    return params.read(folder / "params.yaml")[experiment]


def _rows(path: Path) -> pd.DataFrame:
    """Read a CSV file of a run as text, with its scale."""
    return pd.read_csv(path, dtype=str, keep_default_na=False).assign(scale="paper")


def _with_earlier(rows: pd.DataFrame, target: Path) -> pd.DataFrame:
    """Return rows with those of the file `target` that stay, as `merged` says."""
    if not target.exists():
        return rows
    return merged(target.name, rows, pd.read_csv(target, dtype=str, keep_default_na=False))


def _keep_rows(path: Path, target: Path) -> None:
    """Bring the rows of a CSV file of a run, where there is one, to the file `target`."""
    if path.is_file():
        files.write_table(target, _with_earlier(_rows(path), target))


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Run the experiment that was given, and keep its results."""
    folder = workspace.root / FOLDER
    prepare(workspace, given.experiment, given.protocols, folder)
    run(folder, sys.executable, "-m", "dvc", "repro", *STAGES[given.experiment])
    if given.longer:
        tactile = [sys.executable, "-m", "pipeline.commands.command_line"]
        protocols = ["--protocols", *params.load(folder / "params.yaml")[given.experiment]["protocols"]]
        run(folder, *tactile, "longer", given.experiment, *protocols)
    if given.experiment in claim_inputs.EXPERIMENTS:
        run(folder, sys.executable, "-m", "pipeline.stages.claim_inputs", given.experiment)
    keep_numbers(given.experiment, folder, workspace.root / REPORTS)
    run(folder, sys.executable, "-m", "pipeline.stages.judge", given.experiment)
    keep_verdicts(given.experiment, given.protocols, folder, workspace.root / REPORTS)
    print(f"{workspace.root / REPORTS}: {given.experiment} at the papers' scale")
