"""Write the claims of all papers with their verdicts: claims.csv, claims.md, and tables of some of them."""

from collections.abc import Callable, Mapping, Sequence

import pandas as pd

from pipeline.claims import entries, judge
from pipeline.claims.entries import NUMBER, RECORDED, SENTENCE
from pipeline.claims.rules import BAD, BAND, BEYOND, RANKS, UNDECIDED, VERDICTS
from pipeline.reporting.texts import render
from pipeline.results.one_table import Results
from tactile.base.paths import Workspace
from tactile.drawing.markdown import number, size, table

RULES = (
    ("direction", "the difference, paired by seed, is on the claimed side of 0, or of the limit that is named"),
    ("several directions", "all of them are; contradicted where one is not by Holm's test over all of them"),
    ("order", f"the rank correlation with the printed order is above {RANKS:g}"),
    (
        "number",
        f"our error matches the printed one where all of its interval is within {100 * BAND:.0f} %, is near it "
        f"within {200 * BAND:.0f} %, and off where none of the interval matches; of a precision of 95 % the error is 5 "
        "points",
    ),
    ("no difference, no increase", "the value is inside, or below, the margin that is named"),
    ("count", "equal at the precision that is printed"),
    ("measured time", "listed as outside, as the paper's devices are not at hand, and not judged"),
)
COUNTED = (SENTENCE, NUMBER)  # kinds
HEADER = ["Claim", "Section", "Data", "Protocol", "Published", "Ours", "Unit", "Verdict", "Power", "Runs", "Budget"]
HEADER += ["One specimen", "Flips at", "Control", "Reason"]
NOT_TRIED = "Not investigated."


def titles(workspace: Workspace) -> dict[str, str]:
    """Return paper -> its name in headings."""
    return {key: paper.title for key, paper in entries.papers(workspace).items()}


def value_text(value: float, unit: str) -> str:
    """Return a claim's number, rounded; a dash for NaN."""
    if unit == "count":
        return "-" if value != value else size(value)
    return number(value, 3 if abs(value) < 1 else 2)


def ours_text(ours: float, low: float, high: float, unit: str) -> str:
    """Return our value with its interval, if there is one."""
    text = value_text(ours, unit)
    return text if low != low else f"{text} [{value_text(low, unit)}, {value_text(high, unit)}]"


def counted(claims: pd.DataFrame) -> pd.DataFrame:
    """Return the claims that count: sentences and numbers that our data can test and that no scene was tuned to."""
    return claims[claims["kind"].isin(COUNTED) & claims["verdict"].isin(VERDICTS)]


def count_rows(workspace: Workspace, claims: pd.DataFrame, by: Sequence[str]) -> list[list[str]]:
    """Return the rows of a table of counts: of recorded and of simulated data, each with a sum, and of all claims.

    claims: rows as of claims.csv, of which those that are `counted` count; by: `paper`, `kind` or both. Each row has
    the data, the names of its group, a count per verdict, and the number of claims.
    """
    claims = counted(claims).assign(paper=lambda rows: rows["paper"].map(titles(workspace)))
    groups = []
    for data, of_data in claims.groupby("data"):
        groups += [([data, *names], group) for names, group in of_data.groupby(list(by), sort=False)]
        groups.append(([data, "all", *[""] * (len(by) - 1)], of_data))
    groups.append((["all", *[""] * len(by)], claims))
    rows = []
    for names, group in groups:
        verdicts = list(group["verdict"])
        rows.append([*names, *map(str, (*map(verdicts.count, VERDICTS), len(verdicts)))])
    return rows


def tables_of(workspace: Workspace, experiment: str, results: Results) -> Callable[..., str]:
    """Return what gives the table of claims on an experiment by their names, the last parts of their ids.

    Without a name it is of all claims whose results are the experiment's own, and empty where there is none.
    """
    listed, papers = entries.read(workspace)
    of = {name: (paper.simulated, *paper.recorded) for name, paper in papers.items()}
    claims = {claim.id.split("/")[1]: claim for claim in listed if experiment in of[claim.paper]}

    def judged(*names: str) -> str:
        chosen = [claims[name] for name in names if name in claims]
        if not names and not (chosen := [claim for claim in listed if claim.experiment == experiment]):
            return ""
        rows = judge.table(chosen, results)
        return table(["Claim", "Paper", "Ours", "Verdict", "Reason"], [short_row(row) for row in rows.itertuples()])

    return judged


def short_row(row) -> list[str]:
    """Return claim, published number, ours with its interval and unit, verdict and reason; row: of claims.csv."""
    unit = f" {row.unit}" if row.unit not in ("1", "count") and row.ours == row.ours else ""
    ours = ours_text(row.ours, row.low, row.high, row.unit) + unit
    control = f"control: {text}" if (text := control_text(row)) else ""
    why = "; ".join(filter(None, [row.reason, control]))
    return [row.claim, value_text(row.published, row.unit), ours, row.verdict, why or "-"]


def control_text(row) -> str:
    """Return the name of a claim's control with our number for it; empty where there is none; row: of claims.csv."""
    return f"{row.control} ({value_text(row.control_value, row.unit)})" if row.control else ""


def text(workspace: Workspace, claims: pd.DataFrame, tried: Mapping[str, str]) -> str:
    """Write claims.md.

    claims: rows of claims.csv; tried: id of a claim -> what was tried where it is not reproduced.
    """
    ordered, papers = claims.sort_values("data", kind="stable"), []
    for paper, title in titles(workspace).items():
        own = ordered[ordered["paper"] == paper]
        rows = claim_rows(own[own["verdict"] != BEYOND])
        papers.append({"title": title, "rows": rows, "missed": missed(own, tried)})
    open_ones = counted(ordered)[counted(ordered)["verdict"] == UNDECIDED]
    return render(
        "claims",
        rules=RULES,
        counts=(["Data", "Paper", "Kind", *VERDICTS, "claims"], count_rows(workspace, claims, ["paper", "kind"])),
        open=[
            [row.claim, row.data, power_text(row.power), runs_text(row.seeds, row.over), row.reason]
            for row in open_ones.itertuples()
        ],
        header=HEADER,
        papers=papers,
        beyond=[
            [row.claim, row.data, ours_text(row.ours, row.low, row.high, row.unit), row.unit, row.reason]
            for row in ordered[ordered["verdict"] == BEYOND].itertuples()
        ],
    )


def power_text(power: float) -> str:
    """Return a power as a percentage; a dash where the paper prints no number, or nothing was drawn."""
    return "-" if power != power else f"{100 * power:.0f} %"


def runs_text(count: int, over: str) -> str:
    """Return how many runs a claim's interval is over; over: what they are, in the plural."""
    return f"{count} {over.removesuffix('s') if count == 1 else over}"


def claim_rows(claims: pd.DataFrame) -> list[list[str]]:
    """Return the cells of the table of claims, in the order of HEADER."""
    return [
        [
            row.claim + (" *" if row.measured else ""),
            str(row.section),
            row.data,
            row.protocol,
            value_text(row.published, row.unit),
            ours_text(row.ours, row.low, row.high, row.unit),
            row.unit,
            row.verdict,
            power_text(row.power),
            str(row.seeds) if row.over == "seeds" else runs_text(row.seeds, row.over),
            row.budget or "-",
            "-"
            if row.draw_low != row.draw_low
            else f"{value_text(row.draw_low, row.unit)} to {value_text(row.draw_high, row.unit)}",
            value_text(row.flips_at, row.unit),
            control_text(row) or "-",
            row.reason or "-",
        ]
        for row in claims.itertuples()
    ]


def missed(claims: pd.DataFrame, tried: Mapping[str, str]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return (what was tried, [(claim, verdict with its reason)]) for the claims that are contradicted or undecided.

    What is beyond the paper is there where something was tried.
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    explained = claims["verdict"].eq(BEYOND) & claims["id"].map(tried).fillna("").ne("")
    for row in claims[claims["verdict"].isin([*BAD, UNDECIDED]) | explained].itertuples():
        found = "; ".join(filter(None, [row.verdict, f"{row.data} data" if row.data == RECORDED else "", row.reason]))
        groups.setdefault(tried.get(row.id) or NOT_TRIED, []).append((row.claim.rstrip("."), found))
    return list(groups.items())
