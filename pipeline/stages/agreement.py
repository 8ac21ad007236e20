"""Compare this machine's scores with the committed ones of evidence/look.csv: reports/look/agreement.md.

Networks are trained to other last digits by processors of another make, and from there apart. The file has the look of
several makes: a machine is compared with its own, or else with the first of the file. A number may be as far off as the
evidence's spread over starts and specimens; where another make is compared with, also as far as two draws are apart
that are spread as the makes of the file. The report is of this machine and this moment, so neither git nor DVC keeps
it. With `accept`, the scores of this machine become those of its make; those of experiments that did not run here stay.
Usage: python -m pipeline.stages.agreement [accept]
"""

import numpy as np
import pandas as pd

from pipeline.results import shards
from pipeline.results.claim_inputs import FULL, HALF
from tactile.base import arguments, files, params, processes
from tactile.base.paths import Workspace
from tactile.drawing.markdown import table
from tactile.scoring import estimates

GROUP = ["experiment", "protocol", "condition", "model", "metric"]
KEY = [*GROUP, "seed"]
ROWS = [*KEY, "unit", "value", "n"]  # of scores
MADE = [*ROWS, "make"]  # of look.csv
DRAWS = 2.0  # times their usual difference is the most that 95 % of pairs of draws differ by
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


def of_makes(committed: pd.DataFrame) -> pd.Series:
    """Return (experiment, model, metric) -> usual difference (root mean square) of the looks of several makes.

    committed: rows of look.csv. In the unit of `spreads`; without several makes there is none.
    """
    wide = committed.pivot_table("value", KEY, "make", sort=False)
    first, others = wide.iloc[:, 0], wide.iloc[:, 1:]
    relative = first.index.get_level_values("metric").map(estimates.scale_of) == estimates.LOG
    unit = np.where(relative, first.abs(), 1.0)
    square = others.sub(first, axis=0).div(unit, axis=0).pow(2).stack()
    return np.sqrt(square.groupby(["experiment", "model", "metric"]).mean())


def tolerances(reference: pd.DataFrame, spread: pd.Series, makes: pd.Series, make: str) -> pd.Series:
    """Return how far each number of `reference` may be off, in its own unit, at least LEAST of its value.

    spread: see `spreads`; a protocol that the evidence lacks has the largest of the others of its condition. makes: see
    `of_makes`; make: of this machine, of which no number may differ for its make.
    """
    of_others = spread.groupby(["experiment", "condition", "model", "metric"]).max()
    relative = reference["metric"].map(estimates.scale_of) == estimates.LOG

    def known(of: pd.Series) -> np.ndarray:
        return of.reindex(pd.MultiIndex.from_frame(reference[of.index.names])).to_numpy(float)

    own = np.where(np.isnan(known(spread)), known(of_others), known(spread))
    size = reference["value"].abs()
    by_make = np.where(reference["make"] == make, 0.0, np.nan_to_num(DRAWS * known(makes)))
    most = np.fmax(np.nan_to_num(own), by_make)
    return np.maximum(most * size.where(relative, 1.0), LEAST * size)


def compare(committed: pd.DataFrame, scores: pd.DataFrame, spread: pd.Series, make: str) -> pd.DataFrame:
    """Return KEY, `value`, its `make`, `here`, `tolerance` and one of VERDICTS for every number of either table.

    committed: rows of look.csv, of which those of this `make` are compared with, and of an experiment that it lacks
    those of the first; scores: KEY and `value`; spread: see `spreads`. Two failed runs (NaN) agree; a failed one and a
    number do not.
    """
    chosen = committed.groupby("experiment")["make"].agg(lambda makes: make if make in set(makes) else makes.iloc[0])
    reference = committed[committed["make"] == committed["experiment"].map(chosen)]
    there = reference[[*KEY, "value", "make"]].assign(
        tolerance=tolerances(reference, spread, of_makes(committed), make)
    )
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


def report(committed: pd.DataFrame, scores: pd.DataFrame, spread: pd.Series, make: str) -> tuple[str, str]:
    """Return agreement.md and its first sentence. Experiments without a score here are named, not compared."""
    lacking = committed[~committed["experiment"].isin(scores["experiment"])]
    absent = lacking.drop_duplicates(KEY)["experiment"].value_counts(sort=False)
    numbers = compare(committed.drop(lacking.index), scores, spread, make)
    counts = numbers["verdict"].value_counts().reindex(VERDICTS, fill_value=0)
    compared = counts.sum() - counts["only here"]
    said = ", ".join(f"{counts[name]} {name}" for name in VERDICTS if counts[name] or name == VERDICTS[0])
    sentence = f"{counts.iloc[:3].sum()} of {compared} numbers agree: {said}."
    if len(absent):
        held = ", ".join(f"{experiment} ({count})" for experiment, count in absent.items())
        total = len(committed.drop_duplicates(KEY))
        sentence += f" No scores here: {held} of {total} committed numbers; `tactile fetch` gets recordings."
    looks = numbers.groupby("make", sort=False)["experiment"].unique()
    compared = [f"{', '.join(names)} with the look of a processor of {name}" for name, names in looks.items()]
    by_experiment = numbers.groupby("experiment", sort=False)["verdict"].value_counts().unstack(fill_value=0)
    cells = by_experiment.reindex(columns=VERDICTS, fill_value=0).astype(str)
    lines = [
        "# Agreement of this machine's look with the committed one\n",
        f"{sentence} Compared are {'; '.join(compared)}. Tolerance: the standard deviation over starts and specimens "
        f"of the evidence, at least {100 * LEAST:.0f} % of the value, and for another make than this one ({make}) at "
        f"least {DRAWS:g} times the usual difference of two makes.\n",
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


def accept(workspace: Workspace, scores: pd.DataFrame, make: str) -> None:
    """Write the scores of this machine to look.csv, in place of those of the same experiments and make.

    The makes stay in their order, as the first is what others are compared with.
    """
    path, scores = workspace.root / COMMITTED, scores.assign(make=make)
    former = estimates.read_csv(path, MADE, f"git checkout {COMMITTED}") if path.exists() else scores[:0]
    others = former[~(former["experiment"].isin(scores["experiment"]) & (former["make"] == make))]
    rank = {name: number for number, name in enumerate(dict.fromkeys([*former["make"], make]))}
    rows = pd.concat([scores, others]).sort_values("make", key=lambda names: names.map(rank), kind="stable")
    files.write_table(path, rows[MADE], missing="nan")
    print(f"{COMMITTED}: {len(scores)} numbers of this machine, {len(others)} as they were")


def main(workspace: Workspace) -> None:
    """Compare the scores of all experiments of the settings, or accept them."""
    given = arguments.parse(__doc__, what=(ACCEPT, None))
    experiments = params.load(workspace.params)["experiments"]
    here = [estimates.read_csv(workspace.scores(name), ROWS, "dvc repro evaluate") for name in experiments]
    scores = pd.concat([part for part in here if len(part)] or here)
    if given.what == ACCEPT:
        accept(workspace, scores, processes.make())
        return
    path = workspace.root / COMMITTED
    committed = estimates.read_csv(path, MADE, f"git checkout {COMMITTED}") if path.exists() else scores[:0]
    if len(committed):
        text, sentence = report(committed, scores, spreads(shards.read(workspace)), processes.make())
    else:
        sentence = (
            f"Not compared: there is no number in {COMMITTED}; `python -m pipeline.stages.agreement accept` writes it."
        )
        text = f"# Agreement of this machine's look with the committed one\n\n{sentence}\n"
    files.write_text(workspace.look / "agreement.md", text)
    print(sentence)


if __name__ == "__main__":
    arguments.run(main)
