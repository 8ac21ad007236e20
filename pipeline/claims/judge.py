"""Judge claims by the results: claims.csv.

A verdict is of a budget of training, `full`, and says so. Where half of it gives the opposite verdict the claim moves
with training, and is undecided. A sentence is judged on the protocol in which nothing is on two sides, a printed number
on the one that the paper used, as far as its text says. What comes out with its control, too, tells nothing, and is
undecided.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.claims import entries, rules
from pipeline.claims.entries import RECORDED, UNTESTABLE, Claim
from pipeline.claims.evidence import Evidence
from pipeline.claims.expressions import evaluate
from pipeline.claims.rules import BAD, GOOD, OUTSIDE, RULES, UNDECIDED, Judgement, Open
from pipeline.experiments import facts
from pipeline.scoring.one_table import FULL, HALF, Results

ANY = "any"  # budget of what no training changes
HOLDS, FAILS, OPEN = "it holds", "it does not hold", "open"  # of what is beyond the paper
COLUMNS = ["id", "claim", "paper", "section", "data", "kind", "protocol", "published", "ours", "low", "high", "unit"]
COLUMNS += ["verdict", "reason", "power", "seeds", "budget", "over", "measured"]


def judged(claim: Claim, results: Results) -> tuple[Judgement, str]:
    """Return the verdict on a claim and its budget: `full`, or `half` where no more was run."""
    found, budget = _judged(claim, results)
    if claim.kind == entries.BEYOND:
        word = HOLDS if found.verdict in GOOD else FAILS if found.verdict in BAD else OPEN
        return replace(found, verdict=rules.BEYOND, reason="; ".join(filter(None, [word, found.reason]))), budget
    if found.verdict not in GOOD or not claim.control:
        return found, budget
    other, _ = _ruled(claim, results, FULL, claim.control)
    names = [[claim.names.get(model, model) for model in side] for side in (claim.control.values(), claim.control)]
    control = "with {} in place of {}".format(*(" and ".join(dict.fromkeys(side)) for side in names))
    if other.runs and other.verdict not in GOOD:
        reason = f"control: {control} it is {other.verdict} ({other.ours:.3g})"
        return replace(found, reason="; ".join(filter(None, [found.reason, reason]))), budget
    reason = f"it comes out {control}, too" if other.runs else f"its control, {control}, {other.reason}"
    return replace(found, verdict=UNDECIDED, reason=reason), budget


def _judged(claim: Claim, results: Results) -> tuple[Judgement, str]:
    """Return what `judged` does, without the control."""
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


def _ruled(
    claim: Claim, results: Results, budget: str, control: Mapping[str, str] | None = None
) -> tuple[Judgement, bool]:
    """Return what the rule of a claim says at a budget, and whether the budget matters; no runs where it is open."""
    evidence = Evidence(results, budget, control)
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
    if claim.data == RECORDED or values[claim.experiment]["source"] == "simulated":
        return claim
    return replace(claim, data=RECORDED, id=f"{claim.id}/{RECORDED}", tried="")  # what was tried was on the scene


def table(claims: Iterable[Claim], results: Results) -> pd.DataFrame:
    """Return claims.csv, one row per claim in full precision."""
    return pd.DataFrame([_row(claim, results) for claim in claims], columns=COLUMNS)


def _row(claim: Claim, results: Results) -> list:
    found, budget = judged(claim, results)
    drawn = f"{facts(claim.experiment).subject}s" if facts(claim.experiment).subject else "presses or grasps"
    draws = f"draws of {drawn} of {found.trainings} training{'s' * (found.trainings > 1)}"
    if isinstance(claim.protocol, tuple):
        split = f"{claim.protocol[0]} to {claim.protocol[-1]}"
    else:
        protocols = [claim.protocol] if isinstance(claim.protocol, str) else dict.fromkeys(claim.protocol.values())
        split = "+".join(protocol.replace("{condition}", "").strip("_") or "time" for protocol in protocols)
    return [
        claim.id, claim.text, claim.paper, claim.section, claim.data, claim.kind, split, claim.published,
        found.ours, found.low, found.high, claim.unit, found.verdict, found.reason, found.power,
        found.runs, budget, draws if found.trainings else claim.over, int(claim.rule == "timed"),
    ]  # fmt: skip
