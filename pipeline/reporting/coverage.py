"""Show how often the 90 % intervals, or sets of classes, of trained models held the truth on test data."""

from collections.abc import Iterator

import pandas as pd

from pipeline.base.paths import Workspace
from pipeline.reporting.words.labels import model_name, place_name, plural
from pipeline.reporting.words.markdown import number
from pipeline.scoring import conformal, results

COLUMNS = (  # of reports/coverage/EXPERIMENT.csv; a row is an output of one run on one test condition
    *("experiment", "protocol", "condition", "model", "seed", "output", "case", "unit"),
    *("bound", "floor", "group", "calibrated", "width", "share", "low", "high", "groups", "rows", "reason"),
)
HEADER = (
    *("Test", "Output", "Model", "Calibrated on", "Mean width", "Coverage (%) [95 %]", "Test groups"),
    *("Models inside", "Reason"),
)
FLOOR = "constant"  # has intervals, too, of which nobody has any use


def read(workspace: Workspace, experiment: str) -> pd.DataFrame:
    """Read reports/coverage/EXPERIMENT.csv. Raises InputError where it is missing or lacks a column."""
    return results.read_csv(workspace.coverage(experiment), COLUMNS, f"tactile coverage {experiment}")


def rows(table: pd.DataFrame) -> Iterator[list[str]]:
    """Yield the rows under HEADER: of each protocol and test condition, the outputs of one model.

    It is the model with the narrowest intervals of the first output. Numbers are means over seeds. A model is inside
    where its mean coverage is plausible.
    """
    told = table[(table["model"] != FLOOR) & table["share"].notna()]
    for (protocol, condition), place in told.groupby(["protocol", "condition"], sort=False):
        first = place[(place["output"] == place["output"].iloc[0]) & (place["case"] == place["case"].iloc[0])]
        best = first.groupby("model", sort=False)["width"].mean().idxmin()
        for (output, case), group in place.groupby(["output", "case"], sort=False):
            chosen = group[group["model"] == best]
            if chosen.empty:
                continue
            measured = chosen[["share", "low", "high", "width", "groups", "calibrated"]].mean()
            shares, count = group.groupby("model")["share"].mean(), round(measured.calibrated)
            yield [
                place_name(protocol, condition),
                output if case == "always" else f"{output}, {case}",
                model_name(best),
                f"{count} {plural(chosen['group'].iloc[0], count)}",
                f"{number(measured.width)} {chosen['unit'].iloc[0]}",
                f"{100 * measured.share:.0f} [{100 * measured.low:.0f}, {100 * measured.high:.0f}]",
                f"{measured.groups:.0f}",
                f"{shares.between(*conformal.PLAUSIBLE).sum()} of {len(shares)}",
                "; ".join(filter(None, pd.unique(chosen["reason"].fillna("")))),
            ]


def untold(table: pd.DataFrame) -> list[str]:
    """Return the protocols, each with one output, of which no model has an interval, and how many groups there are."""
    said = []
    for (protocol, output, case), group in table.groupby(["protocol", "output", "case"], sort=False):
        if group["share"].isna().all():
            most = int(group["calibrated"].max())
            of = output if case == "always" else f"{output}, {case}"
            said.append(f"{place_name(protocol, protocol)} ({of}: {most} {plural(group['group'].iloc[0], most)})")
    return said
