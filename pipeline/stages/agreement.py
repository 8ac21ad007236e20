"""Compare this machine's scores with the committed ones, those of git's HEAD: reports/agreement.md.

Networks are trained to other last digits by other processors, and from there apart; how far apart a number may be is
measured by how far apart the seeds are. The report is of this machine and this moment, so neither git nor DVC keeps it.
Usage: python -m pipeline.stages.agreement
"""

import subprocess

import numpy as np
import pandas as pd

from pipeline.base import arguments, files, params
from pipeline.base.paths import Workspace
from pipeline.reporting.words.markdown import table
from pipeline.scoring import results

GROUP = ["experiment", "protocol", "condition", "model", "metric"]
KEY = [*GROUP, "seed"]
LEAST = 0.02  # of the value: three seeds can be closer together by chance than other digits may take them apart
ROUNDING = 1e-6
VERDICTS = ("to the bit", "to six digits", "within tolerance", "beyond", "only here", "only committed")
LISTED = 50  # of the numbers that do not agree
COMMITTED = "HEAD:./reports/scores.csv"  # of git, relative to the repository's root


def compare(committed: pd.DataFrame, scores: pd.DataFrame) -> pd.DataFrame:
    """Return KEY, `value`, `here`, `tolerance` and one of VERDICTS for every number of either table (KEY, `value`).

    The tolerance is the standard deviation over the committed seeds, at least LEAST of the value, in the score's own
    unit. Two failed runs (NaN) agree; a failed one and a number do not.
    """
    spread = committed.groupby(GROUP)["value"].transform("std").fillna(0.0)
    there = committed[[*KEY, "value"]].assign(tolerance=np.maximum(spread, LEAST * committed["value"].abs()))
    merged = there.merge(scores[[*KEY, "value"]].rename(columns={"value": "here"}), "outer", KEY, indicator=True)
    both, off = merged["_merge"] == "both", (merged["here"] - merged["value"]).abs()
    same = (merged["here"] == merged["value"]) | (merged["here"].isna() & merged["value"].isna())
    rules = [
        (merged["_merge"] == "right_only", "only here"),
        (merged["_merge"] == "left_only", "only committed"),
        (both & same, "to the bit"),
        (both & (off <= ROUNDING * merged["value"].abs()), "to six digits"),
        (both & (off <= merged["tolerance"]), "within tolerance"),
    ]
    merged["verdict"] = np.select([rule for rule, _ in rules], [name for _, name in rules], "beyond")
    return merged


def report(committed: pd.DataFrame, scores: pd.DataFrame) -> tuple[str, str]:
    """Return agreement.md and its first sentence. Experiments without a score here are named, not compared."""
    absent = committed[~committed["experiment"].isin(scores["experiment"])]["experiment"].value_counts(sort=False)
    numbers = compare(committed[~committed["experiment"].isin(absent.index)], scores)
    counts = numbers["verdict"].value_counts().reindex(VERDICTS, fill_value=0)
    compared = counts.sum() - counts["only here"]
    said = ", ".join(f"{counts[name]} {name}" for name in VERDICTS if counts[name] or name == VERDICTS[0])
    sentence = f"{counts.iloc[:3].sum()} of {compared} numbers agree: {said}."
    if len(absent):
        held = ", ".join(f"{experiment} ({count})" for experiment, count in absent.items())
        sentence += f" No scores here: {held} of {len(committed)} committed numbers; `tactile fetch` gets recordings."
    by_experiment = numbers.groupby("experiment", sort=False)["verdict"].value_counts().unstack(fill_value=0)
    cells = by_experiment.reindex(columns=VERDICTS, fill_value=0).astype(str)
    lines = [
        "# Agreement with the committed results\n",
        f"{sentence} Tolerance: the standard deviation over the seeds, at least {100 * LEAST:.0f} % of the value.\n",
        table(["experiment", *VERDICTS], [[name, *row] for name, row in zip(cells.index, cells.values, strict=True)]),
    ]
    wrong = numbers[~numbers["verdict"].isin(VERDICTS[:3])]
    if len(wrong):
        lines.append(f"## Numbers that do not agree ({min(LISTED, len(wrong))} of {len(wrong)} shown)\n")
        rows = [
            [" ".join(str(row[name]) for name in KEY), *(f"{row[name]:.6g}" for name in ("value", "here", "tolerance"))]
            for _, row in wrong.head(LISTED).iterrows()
        ]
        lines.append(table(["number", "committed", "here", "tolerance"], rows))
    return "\n".join(lines), sentence


def committed_scores(workspace: Workspace) -> pd.DataFrame | str:
    """Return reports/scores.csv as git's HEAD has it, or why there is none."""
    try:
        done = subprocess.run(["git", "show", COMMITTED], cwd=workspace.root, capture_output=True, check=True)
        return results.parse_csv(done.stdout, f"git show {COMMITTED}", "mend the commit")
    except FileNotFoundError:
        return "there is no git on this machine"
    except subprocess.CalledProcessError as error:
        return (error.stderr.decode(errors="replace").strip().splitlines() or ["git gives no reason"])[0]


def main(workspace: Workspace) -> None:
    """Compare the scores of all experiments of the settings."""
    arguments.parse(__doc__)
    experiments = params.load(workspace.params)["experiments"]
    here = [results.read_csv(workspace.scores(name), [*KEY, "value"], "dvc repro evaluate") for name in experiments]
    committed = committed_scores(workspace)
    if isinstance(committed, str):
        sentence = f"Not compared with the committed scores, {COMMITTED} of git: {committed}."
        text = f"# Agreement with the committed results\n\n{sentence}\n"
    else:
        text, sentence = report(
            committed, pd.concat([scores for scores in here if len(scores)] or [committed.iloc[:0]])
        )
    files.write_text(workspace.reports / "agreement.md", text)
    print(sentence)


if __name__ == "__main__":
    arguments.run(main)
