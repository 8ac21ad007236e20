"""Write the claims of all papers with their verdicts: claims.csv, claims_by_scale.csv, claims.md, and their sentences.

A claim is judged by the present run, which params.yaml sets, and by the run at the papers' scale, whose claims.csv lies
in reports/paper_scale. The verdict that is shown first, and counted, is that of the papers' scale where it is known.
"""

from collections.abc import Callable, Mapping, Sequence

import pandas as pd

from pipeline.base.paths import Workspace
from pipeline.claims import entries, evidence, judge
from pipeline.claims.entries import NUMBER, SENTENCE
from pipeline.claims.rules import AGREEMENT, BAND, CONTRADICTED, NOT_TESTABLE, TOLERANCE, UNDECIDED, VERDICTS
from pipeline.reporting.words.markdown import number, size
from pipeline.reporting.words.templates import render
from pipeline.scoring import one_table
from pipeline.scoring.results import read_csv

RULES = (
    ("direction", "the difference, paired by seed, is on the claimed side of 0, or of the limit that is named"),
    ("several directions", "every one of them is; contradicted, if one is not; the weakest is shown"),
    ("order", f"more than {100 * AGREEMENT:.0f} % of the pairs come in the printed order"),
    (
        "number",
        f"our error is within {100 * BAND:.0f} % of the printed one (of a precision of 95 %, the error is 5 points)",
    ),
    ("no difference, no increase", "the value is inside, or below, the margin that is named"),
    ("count", "equal at the precision that is printed"),
    ("measured time", f"the ratio of medians is more than {100 * TOLERANCE:.0f} % on the claimed side of 1"),
)
COUNTED = (SENTENCE, NUMBER)  # kinds
PAPER = "paper"  # a scale
RECORDED = "recorded"  # data; its claims come before those of simulated data
BY_SCALE = {"present_verdict": "Present run", "paper_scale_verdict": "Papers' scale", "recorded_verdict": "Recorded"}
HEADER = ["Claim", "Section", "Data", "Kind", "Published", "Ours", "Unit", "Verdict", *BY_SCALE.values()]
HEADER += ["Strict", "Reason"]
NOT_TRIED = "No reason was looked for."


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


def count_rows(workspace: Workspace, claims: pd.DataFrame, by: Sequence[str]) -> list[list[str]]:
    """Return the rows of a table of counts: of recorded and of simulated data, each with a sum, and of all claims.

    claims: rows as of claims.csv, of which those of the kinds COUNTED are; by: `paper`, `kind` or both. Each row has
    the data, the names of its group, a count per verdict, and the number of claims.
    """
    claims = claims[claims["kind"].isin(COUNTED)].assign(paper=lambda table: table["paper"].map(titles(workspace)))
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


def read_paper_scale(workspace: Workspace) -> pd.DataFrame:
    """Read claims.csv of the run at the papers' scale; no row where there was none."""
    path = workspace.reports / "paper_scale" / "claims.csv"
    if not path.exists():
        return pd.DataFrame(columns=["id", "verdict", "ours"])
    table = read_csv(path, ["id", "verdict"], "tactile paper-scale")
    for name in table.select_dtypes(exclude="number"):
        table[name] = table[name].astype(object).where(table[name].notna(), "")
    return table


def by_scale(claims: pd.DataFrame, paper_scale: pd.DataFrame) -> pd.DataFrame:
    """Return one row per claim, as in claims.csv, with the verdict that is shown first and its numbers and scale.

    claims, paper_scale: rows of claims.csv of the present run and of the one at the papers' scale. Further columns are
    those of BY_SCALE: the verdict of the present run, that of the papers' scale, and that of the same claim on recorded
    data; "" where there is none.
    """
    claims, there = claims.set_index("id"), paper_scale.set_index("id")
    there = there.loc[[id_ for id_ in claims.index if id_ in there.index]]
    rows = claims.copy()
    # Where neither run has a verdict, the numbers are those of the papers' scale, too, if it has any.
    neither = (claims["verdict"] == NOT_TESTABLE)[there.index] & there["ours"].notna()
    first = there[(there["verdict"] != NOT_TESTABLE) | neither]
    columns = [column for column in claims.columns if column in there.columns]
    rows.loc[first.index, columns] = first[columns]
    simulated = claims["data"] != RECORDED
    rows["present_verdict"] = claims["verdict"].where(simulated, "")
    rows["paper_scale_verdict"] = claims["verdict"].where(simulated & claims["scale"].isin([PAPER, "both"]), "")
    rows.loc[there.index, "paper_scale_verdict"] = there["verdict"]
    rows["recorded_verdict"] = [rows["verdict"].get(f"{id_}/{RECORDED}", "") for id_ in rows.index]
    rows.loc[~simulated, "recorded_verdict"] = rows["verdict"][~simulated]
    return rows.reset_index()


def changed_by_scale(rows: pd.DataFrame) -> str:
    """Say how many claims have another verdict at the papers' scale than in the present run; rows: of `by_scale`."""
    judged = rows[
        rows["kind"].isin(COUNTED) & (rows["scale"] == PAPER) & ~rows["present_verdict"].isin(["", NOT_TESTABLE])
    ]
    if judged.empty:
        return "No claim was judged at both scales yet."
    changed = int((judged["present_verdict"] != judged["paper_scale_verdict"]).sum())
    return (
        f"Another verdict at the papers' scale than here: {changed} of {len(judged)} claims that were judged at both."
    )


def sentences_of(workspace: Workspace, experiment: str, settings: Mapping) -> Callable[..., list[str]]:
    """Return what gives the lines of claims by their names, judged by what the stages wrote.

    settings: the experiment's block of settings.
    """
    results = one_table.read(one_table.of_experiment(workspace, experiment))
    known = evidence.Evidence(workspace, results, {experiment: settings}, evidence.trainings(workspace.reports))
    listed, papers = entries.read(workspace)
    of = {name: (paper.simulated, paper.recorded) for name, paper in papers.items()}
    claims = {claim.id.split("/")[1]: claim for claim in listed if experiment in of[claim.paper]}

    def lines(*names: str) -> list[str]:
        rows = judge.table([claims[name] for name in names if name in claims], known)
        return [claim_sentence(row) for row in rows.itertuples()]

    return lines


def claim_sentence(row) -> str:
    """Return the line of one claim: our number, the published one, and the verdict; row: of claims.csv."""
    numbers = ""
    if row.ours == row.ours:
        unit = f" {row.unit}" if row.unit not in ("1", "count") else ""
        paper = f" (paper: {value_text(row.published, row.unit)})" if row.published == row.published else ""
        numbers = f" {ours_text(row.ours, row.low, row.high, row.unit)}{unit}{paper}:"
    reason = f" ({row.reason})" if row.reason else ""
    return f"- {row.claim.rstrip('.')}:{numbers} {row.verdict}{reason}."


def reason_text(reason: str, over: str, compatible: str) -> str:
    """Return a verdict's reason, with what its interval is over where that is not seeds, from columns of claims.csv."""
    over = "" if over.endswith(" seeds") else over
    words = {"": "", "yes": "compatible with the paper", "no": "not compatible with the paper"}
    return "; ".join(filter(None, [reason, over, words[compatible]]))


def text(workspace: Workspace, claims: pd.DataFrame, tried: Mapping[str, str]) -> str:
    """Write claims.md.

    claims: rows of `by_scale`; tried: id of a claim -> what was tried where it is not reproduced.
    """
    ordered, papers = claims.sort_values("data", kind="stable"), []
    for paper, title in titles(workspace).items():
        own = ordered[ordered["paper"] == paper]
        papers.append({"title": title, "rows": claim_rows(own), "missed": missed(own, tried)})
    return render(
        "claims",
        rules=RULES,
        changed=changed_by_scale(claims),
        counts=(["Data", "Paper", "Kind", *VERDICTS, "claims"], count_rows(workspace, claims, ["paper", "kind"])),
        header=HEADER,
        papers=papers,
    )


def claim_rows(claims: pd.DataFrame) -> list[list[str]]:
    """Return the cells of the table of claims, in the order of HEADER."""
    return [
        [
            row.claim + (" *" if row.measured else ""),
            str(row.section),
            row.data,
            row.kind,
            value_text(row.published, row.unit),
            ours_text(row.ours, row.low, row.high, row.unit),
            row.unit,
            row.verdict,
            *(getattr(row, column) or "-" for column in BY_SCALE),
            row.strict or "-",
            reason_text(row.reason, row.over, row.compatible),
        ]
        for row in claims.itertuples()
    ]


def missed(claims: pd.DataFrame, tried: Mapping[str, str]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return (what was tried, [(claim, verdict with its reason)]) for the claims that are contradicted or undecided."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for row in claims[claims["verdict"].isin([CONTRADICTED, UNDECIDED])].itertuples():
        found = "; ".join(filter(None, [row.verdict, f"{row.data} data" if row.data == RECORDED else "", row.reason]))
        groups.setdefault(tried.get(row.id) or NOT_TRIED, []).append((row.claim.rstrip("."), found))
    return list(groups.items())
