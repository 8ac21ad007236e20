"""Judge claims by the results: claims.csv.

A claim on a network that was not trained to the end, of which a longer training lowers the validation error by 1 % or
more, is not testable. At the papers' scale it has a verdict all the same where a longer training would not change it:
where the rule says the same of test errors that are lower by what the longer training takes from the validation error,
once and twice, for all of these networks at once and for each alone. Twice is what ever longer trainings take together,
where each takes half of what the one before took.

A printed number is judged on the split that the paper used, as far as its text says; beside it stands the verdict on
the stricter one, where nothing is on two sides. A paper printed single numbers, so besides its sign a difference is
`compatible` where our interval includes the printed one.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
import pandas as pd

from pipeline.claims import longer
from pipeline.claims.entries import SENTENCE, UNTESTABLE, Claim
from pipeline.claims.evidence import Evidence
from pipeline.claims.expressions import evaluate
from pipeline.claims.rules import CALIBRATED, NOT_TESTABLE, RULES, SHOWN, Judgement, NotTestable


def judged(claim: Claim, evidence: Evidence, protocol: object = None) -> Judgement:
    """Return the verdict on a claim on its own protocol or on another one.

    It is `not testable` where results are missing or failed, and where a network was not trained to the end.
    """
    evidence.start()
    try:
        found = _ruled(claim, evidence, protocol)
    except NotTestable as error:
        return Judgement(error.ours, np.nan, np.nan, NOT_TESTABLE, str(error))
    unended = evidence.unended()
    if found.verdict == CALIBRATED or not unended:
        return found
    changes = {
        claim.names.get(model, model): f"{100 * share:.0f} % with more epochs" for (*_, model), share in unended.items()
    }
    said = [f"{name} ({change})" for name, change in changes.items()]
    falling = ", ".join(said[:SHOWN]) + (f" and {len(said) - SHOWN} more" if len(said) > SHOWN else "")
    at_papers = all(evidence.scale(experiment) != "laptop" for experiment, _, _ in unended)
    if at_papers and evidence.whole and _stays(claim, found.verdict, evidence, protocol, unended):
        reason = f"stays where test errors fall as validation errors still do, or by twice as much: {falling}"
        return replace(found, reason="; ".join(filter(None, [found.reason, reason])))
    reason = f"validation errors still fall: {falling}; so far {found.verdict}"
    return replace(found, verdict=NOT_TESTABLE, reason=": ".join(filter(None, [reason, found.reason])))


def _ruled(claim: Claim, evidence: Evidence, protocol: object) -> Judgement:
    """Return what the rule of a claim says of the results as they are."""
    if claim.rule == UNTESTABLE:
        raise NotTestable(claim.reason)
    place = protocol or claim.protocol
    runs = {
        name: evaluate(expression, lambda result: evidence.runs(claim, result, place))
        for name, expression in claim.values.items()
    }
    return RULES[claim.rule](runs, claim.printed, **claim.options)


def _stays(
    claim: Claim, verdict: str, evidence: Evidence, protocol: object, unended: Mapping[longer.Network, float]
) -> bool:
    """Tell whether a verdict is the same after longer trainings of these networks, of all at once and of each alone."""
    try:
        for networks in (unended, *([network] for network in unended)):
            for gains in (1, 2):
                evidence.factors = {network: (1 + unended[network]) ** gains for network in networks}
                if _ruled(claim, evidence, protocol).verdict != verdict:
                    return False
    except NotTestable:
        return False
    finally:
        evidence.factors = {}
    return True


def on_own_logs(claim: Claim, values: Mapping) -> Claim:
    """Return the claim as it stands where params.yaml names the user's own logs in place of the simulator."""
    if claim.data == "recorded" or values[claim.experiment]["source"] == "simulated":
        return claim
    return replace(claim, data="recorded", id=f"{claim.id}/recorded", tried="")  # what was tried was on the scene


COLUMNS = ["id", "claim", "paper", "section", "data", "kind", "published", "ours", "low", "high", "unit", "verdict"]
COLUMNS += ["strict", "strict_ours", "compatible", "reason", "over", "measured", "scale"]


def table(claims: Iterable[Claim], evidence: Evidence) -> pd.DataFrame:
    """Return claims.csv, one row per claim in full precision."""
    return pd.DataFrame([_row(claim, evidence) for claim in claims], columns=COLUMNS)


def _row(claim: Claim, evidence: Evidence) -> list:
    found, compatible = judged(claim, evidence), ""
    strict = judged(claim, evidence, claim.strict) if claim.strict else None
    numbers = np.isfinite([claim.published, found.low, found.high]).all()
    if claim.kind == SENTENCE and found.verdict != NOT_TESTABLE and numbers:
        compatible = "yes" if found.low <= claim.published <= found.high else "no"
    return [
        claim.id, claim.text, claim.paper, claim.section, claim.data, claim.kind, claim.published,
        found.ours, found.low, found.high, claim.unit, found.verdict,
        strict.verdict if strict else "", strict.ours if strict else np.nan, compatible, found.reason,
        f"{found.runs} {claim.over}" if found.runs else "", int(claim.measured),
        evidence.scale(claim.experiment),
    ]  # fmt: skip
