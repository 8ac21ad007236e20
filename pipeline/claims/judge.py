"""Judge claims by the results: claims.csv.

A verdict is of a budget of training, `full`, and says so. Where half of it gives the opposite verdict the claim moves
with training, and is undecided. A sentence is judged on the protocol in which nothing is on two sides, a printed number
on the one that the paper used, as far as its text says. What comes out with its control, too, or is not told apart from
it, tells nothing, and is undecided.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.claims import entries, rules
from pipeline.claims.entries import RECORDED, UNTESTABLE, Claim, Control
from pipeline.claims.evidence import Evidence
from pipeline.claims.expressions import evaluate
from pipeline.claims.rules import BAD, GOOD, OUTSIDE, RULES, UNDECIDED, Judgement, Open
from pipeline.results.one_table import FULL, HALF, Results
from tactile.experiments import facts

ANY = "any"  # budget of what no training changes
HOLDS, FAILS, OPEN = "it holds", "it does not hold", "open"  # of what is beyond the paper
COLUMNS = ["id", "claim", "paper", "section", "data", "kind", "protocol", "published", "ours", "low", "high", "unit"]
COLUMNS += ["verdict", "reason", "power", "seeds", "budget", "over", "measured", "control", "control_value"]
COLUMNS += ["draw_low", "draw_high", "flips_at", "p", "weak"]


def judged(claim: Claim, results: Results) -> tuple[Judgement, str]:
    """Return the verdict on a claim and its budget: `full`, or `half` where no more was run."""
    found, budget = _judged(claim, results)
    other = None
    if claim.control:
        other, _ = _ruled(claim, results, FULL, claim.control)
        found = replace(found, control=claim.control.name, control_value=other.ours)
    if claim.kind == entries.BEYOND:
        word = HOLDS if found.verdict in GOOD else FAILS if found.verdict in BAD else OPEN
        return replace(found, verdict=rules.BEYOND, reason="; ".join(filter(None, [word, found.reason]))), budget
    if found.verdict in GOOD and other is not None and (passed := _passed(found, other)):
        reason = "; ".join(filter(None, [f"its control {passed}", found.reason]))
        return replace(found, verdict=UNDECIDED, reason=reason), budget
    return found, budget


def _passed(found: Judgement, control: Judgement) -> str:
    """Return why a control does not fail, empty where it does: it is contradicted, or open and apart from the claim."""
    if not control.runs:
        return control.reason
    if control.verdict in GOOD:
        return "passes, too"
    (low, high), (least, most) = (
        (each.ours, each.ours) if np.isnan(each.low) else (each.low, each.high) for each in (found, control)
    )
    if control.verdict in BAD or most < low or least > high:
        return ""
    return f"may pass, too: it is open, and its interval [{least:.3g}, {most:.3g}] reaches into that of the claim"


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


def _ruled(claim: Claim, results: Results, budget: str, control: Control | None = None) -> tuple[Judgement, bool]:
    """Return what the rule of a claim says at a budget, and whether the budget matters; no runs where it is open."""
    evidence = Evidence(results, budget, control.models if control else {})
    try:
        runs = {
            name: evaluate(expression, lambda result: evidence.runs(claim, result))
            for name, expression in (control and control.values or claim.values).items()
        }
        printed = claim.printed
        if control:
            runs = {name: rules.fixed(value) if isinstance(value, float) else value for name, value in runs.items()}
            printed = {name: claim.printed.get(name, claim.published) for name in runs}
        found = RULES[claim.rule](runs, printed, **claim.options)
        reason = "; ".join(filter(None, [found.reason, evidence.few()]))
        return replace(found, reason=reason, trainings=evidence.trainings), evidence.trained
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


def weighed(table: pd.DataFrame) -> pd.DataFrame:
    """Return claims.csv of all claims with its weak sentences marked: decided, but not by Holm's test over all."""
    decided = table["kind"].eq(entries.SENTENCE) & table["verdict"].isin((rules.REPRODUCED, rules.CONTRADICTED))
    weak = rules.weak(table["p"].where(decided))
    said = f"weak: not decided by Holm's test over all {int((decided & table['p'].notna()).sum())} decided sentences"
    reason = [f"{said}; {why}" if why else said for why in table["reason"]]
    return table.assign(weak=weak.astype(int), reason=np.where(weak, reason, table["reason"]))


def _row(claim: Claim, results: Results) -> list:
    found, budget = judged(claim, results)
    drawn = f"{facts(claim.experiment).subject}s" if facts(claim.experiment).subject else "presses or grasps"
    draws = f"resamplings of {drawn}, {found.trainings} training{'s' * (found.trainings > 1)}"
    if isinstance(claim.protocol, tuple):
        split = f"{claim.protocol[0]} to {claim.protocol[-1]}"
    else:
        protocols = [claim.protocol] if isinstance(claim.protocol, str) else dict.fromkeys(claim.protocol.values())
        split = "+".join(protocol.replace("{condition}", "").strip("_") or "time" for protocol in protocols)
    return [
        claim.id, claim.text, claim.paper, claim.section, claim.data, claim.kind, split, claim.published,
        found.ours, found.low, found.high, claim.unit, found.verdict, found.reason, found.power,
        found.runs, budget, draws if found.trainings else claim.over, int(claim.rule == "timed"),
        found.control, found.control_value, found.draw_low, found.draw_high, found.flips_at, found.p, 0,
    ]  # fmt: skip
