"""Show how often the 90 % intervals, or sets of classes, of trained models held the truth on test data."""

from collections.abc import Callable, Iterator

import pandas as pd

from tactile.base.paths import Workspace
from tactile.drawing.labels import model_name, place_name
from tactile.drawing.markdown import number
from tactile.scoring import conformal, estimates

COLUMNS = (  # of reports/coverage/EXPERIMENT.csv; a row is an output of one run on one test condition
    *("experiment", "protocol", "condition", "model", "seed", "output", "case", "unit"),
    *("bound", "floor", "group", "calibrated", "width", "share", "low", "high", "groups", "rows", "reason"),
)
HEADER = (
    *("Test", "Output", "Model", "Calibrated on", "Mean width", "Coverage (%) [95 %]", "Test groups"),
    *("Reason", "Models inside", "Furthest from 90 %"),
)
FLOOR = "constant"  # has intervals, too, of which nobody has any use


def read(workspace: Workspace, experiment: str) -> pd.DataFrame:
    """Read reports/coverage/EXPERIMENT.csv. Raises InputError where it is missing or lacks a column."""
    return estimates.read_csv(workspace.coverage(experiment), COLUMNS, f"tactile coverage {experiment}")


def rows(table: pd.DataFrame, named: Callable[[str, str], str] = place_name) -> Iterator[list[str]]:
    """Yield the rows under HEADER: of each protocol and test condition (`named`), the outputs of one model.

    It is the model with the narrowest intervals of the first output, or of this one where that cannot tell. A model is
    inside where its coverage is plausible.
    """
    told = table[(table["model"] != FLOOR) & table["share"].notna()]
    for (protocol, condition), place in told.groupby(["protocol", "condition"], sort=False):
        outputs = list(place.groupby(["output", "case"], sort=False))
        best = outputs[0][1].set_index("model")["width"].idxmin()
        for (output, case), group in outputs:
            narrowest = group.set_index("model")["width"].idxmin()
            shown = best if best in set(group["model"]) else narrowest
            for row in group[group["model"] == shown].itertuples():
                yield [
                    named(protocol, condition),
                    output if case == "always" else f"{output}, {case}",
                    model_name(shown),
                    f"{row.calibrated} {conformal.plural(row.group, row.calibrated)}",
                    f"{number(row.width)} {row.unit}",
                    f"{100 * row.share:.0f} [{100 * row.low:.0f}, {100 * row.high:.0f}]",
                    str(row.groups),
                    "" if pd.isna(row.reason) else row.reason,
                    f"{group['share'].between(*conformal.PLAUSIBLE).sum()} of {len(group)}",
                    _furthest(group),
                ]


def _furthest(group: pd.DataFrame) -> str:
    """Return the model whose coverage is furthest from what is asked for, with the reason where it is outside."""
    row = group.loc[(group["share"] - conformal.LEVEL).abs().idxmax()]
    reason = "" if pd.isna(row["reason"]) or not row["reason"] else f" ({row['reason']})"
    return f"{model_name(row['model'])} {100 * row['share']:.0f}{reason}"


def untold(table: pd.DataFrame, named: Callable[[str, str], str] = place_name) -> list[str]:
    """Return the protocols of which no model has an interval, of any output or of those named, and how many groups."""
    said = []
    for protocol, of_protocol in table.groupby("protocol", sort=False):
        outputs = of_protocol.groupby(["output", "case"], sort=False)
        missing = {key: group for key, group in outputs if group["share"].isna().all()}
        if len(missing) == len(outputs):
            missing = {("", "always"): of_protocol}
        for (output, case), group in missing.items():
            most = int(group["calibrated"].max())
            of = output if case == "always" else f"{output}, {case}"
            count = f"{most} {conformal.plural(group['group'].iloc[0], most)}"
            said.append(f"{named(protocol, protocol)} ({of}{': ' if of else ''}{count})")
    return said
