"""Public recordings of others through the doors of `tactile`, beside thirty lines of scikit-learn on the same groups.

    python -m benchmarks.gallery CLONES [NAME ...]

CLONES has a clone of the repository of each recipe of gallery.yaml, called by it (gait: CLONES/gait). Each comes in by
the one command that the recipe names, `tactile own` trains and tests it, and the forest of thirty_lines.py predicts the
same moments. reports/gallery gets scores.csv and README.md; recipes that are not computed keep their rows.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from scipy import stats

from benchmarks import thirty_lines
from tactile.base import files
from tactile.base.paths import CODE, Workspace
from tactile.drawing.markdown import table
from tactile.own import settings as own_settings
from tactile.targets import read

ROOT = CODE.parent
REPORT = ROOT / "reports" / "gallery"
RECIPES = yaml.safe_load(Path(__file__).with_name("gallery.yaml").read_text(encoding="utf-8"))
COLUMNS = ["name", "metric", "unit", "test", "ours", "thirty_lines", "constant", "coverage", "windows"]
LEVEL, FAIR = 0.95, (0.86, 0.94)  # of intervals; coverage that a 90 % interval should have in a group
INTRO = """# Recordings that nobody of this project made

By `python -m benchmarks.gallery CLONES`. Each set comes in by one command (`dataglove`, whose truth is the name of a
folder, by a copy and five lines of settings), is trained and tested by `tactile own FOLDER`, and stands beside thirty
lines of scikit-learn (`benchmarks/thirty_lines.py`, extra trees on readings at lags and statistics of two seconds) that
predict the same moments of the same groups, which no model has seen. Ours is the model that the other groups chose.
Means over groups, one training each [95 % interval of the ratio, or of the difference of shares, over groups; none of
fewer than three]. Coverage: groups of which our 90 % intervals, or sets, hold the truth in 86 to 94 % of the windows.
"""


def called(folder: Path, *words: str) -> None:
    """Run a command of the tool in a folder; a failure ends this one with what it said."""
    command = [sys.executable, "-m", "tactile.commands.command_line", *words]
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(command, cwd=folder, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"tactile {' '.join(words)}: {done.stdout[-500:]}{done.stderr[-500:]}")


def brought(name: str, recipe: dict, clone: Path, folder: Path) -> None:
    """Bring the recordings of a recipe in, as data/own/NAME of a folder."""
    head = subprocess.run(["git", "-C", clone, "rev-parse", "HEAD"], capture_output=True, text=True).stdout.strip()
    if head != recipe["commit"]:
        sys.exit(f"{clone}: is at {head or 'no commit'}; check out {recipe['commit']} of {recipe['repository']} there")
    found, sensor = sorted(clone.glob(recipe["files"])), Path("data", "own", name)
    if not found:
        sys.exit(f"{clone}: has no {recipe['files']}")
    if "import" in recipe:
        called(folder, "import", *map(str, found), str(sensor), *recipe["import"])
        return
    of_folder: dict[str, list[Path]] = {}
    for path in found:
        of_folder.setdefault(path.parent.name, []).append(path)
    for condition, paths in of_folder.items():
        for number, path in enumerate(paths):
            recording = folder / sensor / condition / f"{number:02d}"
            recording.mkdir(parents=True)
            shutil.copy(path, recording / recipe["log"])
    (folder / sensor / own_settings.FILE).write_text(recipe["settings"], encoding="utf-8")


def rows(name: str, folder: Path) -> pd.DataFrame:
    """Return a row for each group of a set that `tactile own` has tested in a folder."""
    workspace, sensor = Workspace(folder), folder / "data" / "own" / name
    settings = own_settings.of_logs(workspace, "strain", sensor)["strain"]
    data = read.own("strain", sensor, settings, own_settings.asked(sensor))
    moments = pd.read_csv(folder / "reports" / "own" / name / "predictions.csv", dtype={"test": str})
    scores = pd.read_csv(folder / "reports" / "own" / name / "scores.csv", dtype={"test": str})
    of_numbers = data.target.kind == "continuous"
    metric, unit = ("RMSE", data.target.unit) if of_numbers else ("right windows", "1")

    def scored(predicted: np.ndarray) -> pd.Series:
        each = (predicted - moments["true"]) ** 2 if of_numbers else predicted == moments["true"]
        mean = each.groupby(moments["test"]).mean()
        return np.sqrt(mean) if of_numbers else mean

    def of(model: str, wanted: str) -> pd.Series:
        chosen = scores[(scores["model"] == model) & (scores["metric"] == wanted)]
        return chosen.set_index("test")["value"]

    found = pd.DataFrame(
        {
            "ours": scored(moments["predicted"].to_numpy()),
            "thirty_lines": scored(thirty_lines.predicted(data, moments)),
            "constant": of("constant", metric),
            "coverage": of("chosen on the other groups", "coverage"),
            "windows": moments.groupby("test").size(),
        }
    ).rename_axis("test")
    return found.reset_index().assign(name=name, metric=metric, unit=unit)[COLUMNS]


def line(name: str, groups: pd.DataFrame) -> list[str]:
    """Return the cells of a set in README.md; groups: its rows."""
    metric, unit, n = groups["metric"].iloc[0], groups["unit"].iloc[0], len(groups)
    is_error = metric == "RMSE"
    ours, theirs = groups["ours"], groups["thirty_lines"]
    differences = np.log(ours / theirs) if is_error else 100 * (ours - theirs)
    half = stats.t.ppf((1 + LEVEL) / 2, n - 1) * differences.std() / np.sqrt(n) if n > 2 else np.nan
    ends = differences.mean() + half * np.array([-1, 0, 1])
    low, _, high = np.exp(ends) if is_error else ends
    mean = np.exp(differences.mean()) if is_error else differences.mean()
    said = f"{mean:.2f} times" if is_error else f"{mean:+.1f} points"
    interval = f" [{low:.2f}, {high:.2f}]" if n > 2 else ""
    coverage = groups["coverage"].dropna()
    held = coverage.between(*FAIR)
    means = [f"{value:.3g}" for value in groups[["ours", "thirty_lines", "constant"]].mean()]
    score = metric if unit == "1" else f"{metric} ({unit})"
    covered = f"{held.sum()} of {len(held)} (mean {100 * coverage.mean():.0f} %)"
    return [f"`{name}`", score, str(n), *means, said + interval, covered]


def report(scores: pd.DataFrame) -> str:
    """Return README.md of all rows."""
    body = [line(name, groups) for name, groups in scores.groupby("name", sort=False)]
    head = ["Set", "Score", "Groups", "Ours", "Thirty lines", "Constant", "Ours against thirty lines", "Coverage"]
    told = [
        f"- `{name}`: {recipe['what']} ([{recipe['repository']}](https://github.com/{recipe['repository']}), "
        f"`{recipe['commit'][:8]}`; licence: {recipe['licence']})."
        for name, recipe in RECIPES.items()
    ]
    return "\n".join([INTRO, table(head, body), *told, ""])


def main() -> None:
    """Compute the recipes that the command line names, or all whose clones are there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clones", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME")
    args = parser.parse_args()
    for name in args.names or [name for name in RECIPES if (args.clones / name).is_dir()]:
        with tempfile.TemporaryDirectory() as folder:
            brought(name, RECIPES[name], args.clones.absolute() / name, Path(folder))
            called(Path(folder), "own", f"data/own/{name}")
            found = rows(name, Path(folder))
        path = REPORT / "scores.csv"
        former = pd.read_csv(path, dtype={"test": str}) if path.exists() else found[:0]
        scores = pd.concat([former[former["name"] != name], found])
        scores = scores.sort_values("name", key=lambda names: names.map([*RECIPES].index), kind="stable")
        REPORT.mkdir(parents=True, exist_ok=True)
        files.write_table(path, scores)
        files.write_text(REPORT / "README.md", report(scores))
        print(*line(name, found), sep="; ", flush=True)


if __name__ == "__main__":
    main()
