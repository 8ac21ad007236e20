"""Compare this machine's scores with the committed ones of evidence/look.csv: reports/look/agreement.md.

Networks are trained to other last digits by other processors, and from there apart; how far apart a number may be is
the spread over starts and specimens that the evidence has for it. The report is of this machine and this moment, so
neither git nor DVC keeps it. With `accept`, the scores of this machine become the committed ones; those of experiments
that did not run here stay.
Usage: python -m pipeline.stages.agreement [accept]
"""

import numpy as np
import pandas as pd

from pipeline.results import shards
from pipeline.results.claim_inputs import FULL, HALF
from tactile.base import arguments, files, params
from tactile.base.paths import Workspace
from tactile.drawing.markdown import table
from tactile.scoring import estimates

GROUP = ["experiment", "protocol", "condition", "model", "metric"]
KEY = [*GROUP, "seed"]
ROWS = [*KEY, "unit", "value", "n"]  # of look.csv
LEAST = 0.02  # of the value: three seeds can be closer together by chance than other digits may take them apart
ROUNDING = 1e-6
VERDICTS = ("to the bit", "to six digits", "within tolerance", "beyond", "only here", "only committed")
LISTED = 50  # of the numbers that do not agree
ACCEPT = "accept"
COMMITTED = "evidence/look.csv"


def spreads(evidence: pd.DataFrame) -> pd.Series:
    """Return (*GROUP) -> standard deviation over the seeds of the evidence's scores, as of `shards.read`.

    It is that at the full budget, or at half where no more was run; of errors in units of their mean, for a look trains
    less and has larger ones. Without seeds to compare there is none.
    """
    rows = evidence[evidence["variant"].fillna("") == ""]
    found = []
    for at in (FULL, HALF):
        values = rows[rows["budget"].fillna("").isin([at, ""])].groupby(GROUP)["value"].agg(["std", "mean"])
        relative = values.index.get_level_values("metric").map(estimates.scale_of) == estimates.LOG
        found.append((values["std"] / np.where(relative, values["mean"].abs(), 1.0)).dropna())
    full, half = found
    return full.combine_first(half)


def tolerances(committed: pd.DataFrame, spread: pd.Series) -> pd.Series:
    """Return how far each committed number may be off, in its own unit, at least LEAST of its value; spread: as above.

    A protocol that the evidence lacks has the largest spread of the others of its condition.
    """
    of_others = spread.groupby(["experiment", "condition", "model", "metric"]).max()
    own = spread.reindex(pd.MultiIndex.from_frame(committed[GROUP])).to_numpy(float)
    others = of_others.reindex(pd.MultiIndex.from_frame(committed[of_others.index.names])).to_numpy(float)
    size = committed["value"].abs()
    relative = committed["metric"].map(estimates.scale_of) == estimates.LOG
    known = np.nan_to_num(np.where(np.isnan(own), others, own))
    return np.maximum(known * size.where(relative, 1.0), LEAST * size)


def compare(committed: pd.DataFrame, scores: pd.DataFrame, spread: pd.Series) -> pd.DataFrame:
    """Return KEY, `value`, `here`, `tolerance` and one of VERDICTS for every number of either table (KEY, `value`).

    spread: see `spreads`. Two failed runs (NaN) agree; a failed one and a number do not.
    """
    there = committed[[*KEY, "value"]].assign(tolerance=tolerances(committed, spread))
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


def report(committed: pd.DataFrame, scores: pd.DataFrame, spread: pd.Series) -> tuple[str, str]:
    """Return agreement.md and its first sentence. Experiments without a score here are named, not compared."""
    absent = committed[~committed["experiment"].isin(scores["experiment"])]["experiment"].value_counts(sort=False)
    numbers = compare(committed[~committed["experiment"].isin(absent.index)], scores, spread)
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
        "# Agreement of this machine's look with the committed one\n",
        f"{sentence} Tolerance: the standard deviation over starts and specimens of the evidence, at least "
        f"{100 * LEAST:.0f} % of the value.\n",
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


def accept(workspace: Workspace, scores: pd.DataFrame) -> None:
    """Write the scores of this machine to look.csv, in place of those of the same experiments."""
    path = workspace.root / COMMITTED
    former = estimates.read_csv(path, ROWS, f"git checkout {COMMITTED}") if path.exists() else scores[:0]
    others = former[~former["experiment"].isin(scores["experiment"])]
    files.write_table(path, pd.concat([scores, others])[ROWS], missing="nan")
    print(f"{COMMITTED}: {len(scores)} numbers of this machine, {len(others)} as they were")


def main(workspace: Workspace) -> None:
    """Compare the scores of all experiments of the settings, or accept them."""
    given = arguments.parse(__doc__, what=(ACCEPT, None))
    experiments = params.load(workspace.params)["experiments"]
    here = [estimates.read_csv(workspace.scores(name), ROWS, "dvc repro evaluate") for name in experiments]
    scores = pd.concat([part for part in here if len(part)] or here)
    if given.what == ACCEPT:
        accept(workspace, scores)
        return
    path = workspace.root / COMMITTED
    committed = estimates.read_csv(path, ROWS, f"git checkout {COMMITTED}") if path.exists() else scores[:0]
    if len(committed):
        text, sentence = report(committed, scores, spreads(shards.read(workspace)))
    else:
        sentence = (
            f"Not compared: there is no number in {COMMITTED}; `python -m pipeline.stages.agreement accept` writes it."
        )
        text = f"# Agreement of this machine's look with the committed one\n\n{sentence}\n"
    files.write_text(workspace.look / "agreement.md", text)
    print(sentence)


if __name__ == "__main__":
    arguments.run(main)
