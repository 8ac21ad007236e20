"""Judge claims by the results: claims.csv.

A verdict is of a budget of training, `full`, and says so. Where half of it gives the opposite verdict the claim moves
with training, and is undecided. A sentence is judged on the protocol in which nothing is on two sides, a printed number
on the one that the paper used, as far as its text says.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.claims.entries import UNTESTABLE, Claim
from pipeline.claims.evidence import Evidence
from pipeline.claims.expressions import evaluate
from pipeline.claims.rules import BAD, GOOD, OUTSIDE, RULES, UNDECIDED, Judgement, Open
from pipeline.scoring.one_table import FULL, HALF, Results

ANY = "any"  # budget of what no training changes
COLUMNS = ["id", "claim", "paper", "section", "data", "kind", "protocol", "published", "ours", "low", "high", "unit"]
COLUMNS += ["verdict", "reason", "power", "seeds", "budget", "over", "measured"]


def judged(claim: Claim, results: Results) -> tuple[Judgement, str]:
    """Return the verdict on a claim and its budget: `full`, or `half` where no more was run."""
    if claim.rule == UNTESTABLE:
        return Judgement(np.nan, np.nan, np.nan, OUTSIDE, claim.reason), ""
    full, trained = _ruled(claim, results, FULL)
    half, _ = _ruled(claim, results, HALF)
    if not trained and full.runs:
        return full, ANY
    if full.runs == 0 and not half.runs:
        return full, ""
    if full.runs == 0:
        return replace(half, verdict=UNDECIDED, reason=f"waits for the budget {FULL}; at half {half.verdict}"), HALF
    if {half.verdict in GOOD, full.verdict in GOOD} == {half.verdict in BAD, full.verdict in BAD} == {True, False}:
        moves = f"moves with training: {half.verdict} at half of the budget, {full.verdict} at all of it"
        return replace(full, verdict=UNDECIDED, reason="; ".join(filter(None, [moves, full.reason]))), FULL
    return full, FULL


def _ruled(claim: Claim, results: Results, budget: str) -> tuple[Judgement, bool]:
    """Return what the rule of a claim says at a budget, and whether the budget matters; no runs where it is open."""
    evidence = Evidence(results, budget)
    try:
        runs = {
            name: evaluate(expression, lambda result: evidence.runs(claim, result))
            for name, expression in claim.values.items()
        }
        found = RULES[claim.rule](runs, claim.printed, **claim.options)
        return replace(found, trainings=evidence.trainings), evidence.trained
    except Open as error:
        return Judgement(error.ours, np.nan, np.nan, UNDECIDED, str(error), error.runs), evidence.trained


def on_own_logs(claim: Claim, values: Mapping) -> Claim:
    """Return the claim as it stands where params.yaml names the user's own logs in place of the simulator."""
    if claim.data == "recorded" or values[claim.experiment]["source"] == "simulated":
        return claim
    return replace(claim, data="recorded", id=f"{claim.id}/recorded", tried="")  # what was tried was on the scene


def table(claims: Iterable[Claim], results: Results) -> pd.DataFrame:
    """Return claims.csv, one row per claim in full precision."""
    return pd.DataFrame([_row(claim, results) for claim in claims], columns=COLUMNS)


def _row(claim: Claim, results: Results) -> list:
    found, budget = judged(claim, results)
    protocols = [claim.protocol] if isinstance(claim.protocol, str) else dict.fromkeys(claim.protocol.values())
    draws = f"draws of presses or grasps of {found.trainings} training{'s' * (found.trainings > 1)}"
    split = "+".join(protocol.replace("{condition}", "").strip("_") or "time" for protocol in protocols)
    return [
        claim.id, claim.text, claim.paper, claim.section, claim.data, claim.kind, split, claim.published,
        found.ours, found.low, found.high, claim.unit, found.verdict, found.reason, found.power,
        found.runs, budget, draws if found.trainings else claim.over, int(claim.measured),
    ]  # fmt: skip
