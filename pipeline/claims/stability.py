"""Judge at which severity of a stress test each model of the evidence loses its skill.

A model's skill is how far its error is below that of the model `constant`, which reads no sensor. Half of it is lost
where the error is half-way from that on clean data, severity 0, to that of `constant`, all of it where it is that of
`constant`. A test that changes the scene changes the truth, and with it the error of `constant`, as a press at twice
the pressure does: there both errors are as shares of that of `constant` at the same severity. `fails_at` is where the
error passes what a user could work with (`stress.<experiment>.usable`).
Severities of one sign are walked from 0 outwards, each sign apart. Between two severities the error is taken as a
straight line on the axis of the severity, on that of its logarithm where the severities of the test span a factor of
SPAN or more and neither is 0. Where a curve passes a level several times, the first time counts.

Intervals are of the mean curves of DRAWS draws, with replacement. An end at which the level is not reached is infinite.
Of recordings that are scored in blocks of presses, grasps or frames, blocks are drawn (`units.of_written`), the same
ones for all seeds, severities and models: how far a number would differ with other presses. Else as many seeds are
drawn as there are; a model and `constant` share the seeds of a draw. Fewer than FEWEST blocks, or seeds, have no
interval. The column `over` says what was drawn.

A model is usable clean where its clean error, the mean over seeds that the tables of accuracy have, is at most `usable`
and below that of `constant`. Others have no skill whose loss could be told, and stand in no table but that of UNUSABLE.
The one rule asks for both, so that no model is judged that a user would not take, and nothing that knows nothing.

Two kinds of test have no severity at which something is lost, and are told by their errors alone: one whose severities
are numbers of other sensors, which have no order, and one without a severity 0, as three touches have.
"""

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

from pipeline.results.claim_inputs import FULL
from tactile.base.errors import InputError
from tactile.experiments import facts, module
from tactile.scoring import units
from tactile.scoring.estimates import CONFIDENCE, FEWEST, estimate
from tactile.settings.stress import TESTS

FLOOR = "constant"
SPAN = 10.0
DRAWS = 1000
SEEDS = "seeds"  # what intervals are over where no blocks are known; their word stands in Facts.seeds
SEED = 0  # of the draws of seeds
TAILS = (1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2
UP, DOWN = "up", "down"  # directions: severities above 0, and below
LINEAR, LOG = "linear", "log"  # axes
NO_ORDER, NO_CLEAN = "no order", "no clean level"
NAMES = ", number"  # end of the unit of a test whose severities are numbers of other sensors
TESTED_ON = ["protocol", "condition", "perturbation"]
KEY = [*TESTED_ON, "severity", "model", "seed"]
WHERE = ["experiment", *TESTED_ON, "model"]
LEVELS = ("half", "all", "fails")
FAILURES = [*WHERE, "fails_at", "half_at", "half_low", "half_high", "all_at", "clean", "seeds", "budget", "direction"]
FAILURES += ["unit", "axis", "all_low", "all_high", "largest", "half_note", "all_note", "fails_note", "start", "floor"]
FAILURES += ["usable", "failed", "over"]
UNUSABLE = ["experiment", "protocol", "condition", "model", "clean", "floor", "usable", "seeds", "failed"]
STARTS = ["experiment", "model", "starts", "failed", "worse", "protocols", "third", "thrice", "rate_seeds"]
RATE = re.compile(r"(?:^|_)rate_([\d.]+)$")  # variants trained at so many times their learning rate
THIRD, THRICE = 1 / 3, 3.0
WORSE = 2.0  # times the median of the starts


class Runs(NamedTuple):
    """The runs of one model in one condition under one test, of the seeds that `constant` has, too."""

    severities: np.ndarray  # (k,) rising, 0 among them or not
    errors: np.ndarray  # (seeds, k)
    floor: np.ndarray  # (seeds, k) of `constant`, NaN where there is none
    budget: str
    failed: int  # runs without an error, which are not among these
    draws: np.ndarray  # (draws, k) errors, mean over the runs, of blocks or seeds drawn anew; none without an interval
    floor_draws: np.ndarray  # (draws, k) of `constant`, of the same draws
    over: str  # what is drawn, in the plural, or SEEDS; empty where nothing is


def as_error(table: pd.DataFrame, experiment: str) -> pd.DataFrame:
    """Return the rows of an experiment's main metric with the column `error`: less is better."""
    metric = facts(experiment).metric
    own = table[(table["experiment"] == experiment) & (table["metric"] == metric)]
    value = own["value"].astype(float)
    return own.assign(error=1 - value if metric == "accuracy" else value)


def of_variant(table: pd.DataFrame, variant: str) -> pd.DataFrame:
    """Return the rows of one variant, fully trained."""
    return table[(table["variant"].fillna("") == variant) & table["budget"].fillna("").isin(["", FULL])]


def runs(stress: pd.DataFrame, experiment: str, variant: str = "") -> pd.DataFrame:
    """Return KEY, budget, error, draws and over of the runs of an experiment, fully trained; stress: `shards.stress`.

    draws: (DRAWS,) errors of blocks drawn anew, None where the row has fewer than FEWEST; over: what these are.
    Raises InputError where a run is there twice, or is absent where another seed has it.
    """
    own = as_error(of_variant(stress, variant), experiment)
    for row in own[own.duplicated(KEY)][KEY].itertuples(index=False):
        words = ", ".join(f"{name} {value}" for name, value in zip(KEY, row, strict=True))
        raise InputError(f"evidence/stress: two rows of {experiment} for {words}; run `tactile evidence` again")
    for test, severity, model, seed in _lacking(own):
        raise InputError(
            f"evidence/stress: no row of {experiment} for perturbation {test}, severity {severity:g}, model {model}, "
            f"seed {seed}, which others have; run `tactile evidence` again"
        )
    drawn = [_of_blocks(text, experiment) for text in own["blocks"]]
    for name, column in zip(("draws", "over"), zip(*drawn, strict=True) if drawn else ((), ()), strict=True):
        own[name] = pd.Series(column, own.index, object)
    return own[[*KEY, "budget", "error", "draws", "over"]].fillna({"budget": ""}).reset_index(drop=True)


def _of_blocks(text: str, experiment: str) -> tuple[np.ndarray | None, str]:
    """Return the errors of blocks drawn anew, (DRAWS,), and what these are, if there are FEWEST."""
    if text.count(":") < FEWEST:
        return None, ""
    of = facts(experiment)
    draws, persons = units.of_written(text, of.metric)
    return 1 - draws if of.metric == "accuracy" else draws, units.called(of, module(experiment).KIND, len(persons))


def _lacking(own: pd.DataFrame) -> Iterator[tuple[str, float, str, int]]:
    """Yield test, severity, model and seed of each run that is absent where another seed of the model has it."""
    for (*_, test, model), rows in own.groupby([*TESTED_ON, "model"], sort=False):
        present = set(zip(rows["severity"], rows["seed"], strict=True))
        every = itertools.product(rows["severity"].unique(), rows["seed"].unique())
        yield from ((test, at, model, seed) for at, seed in every if (at, seed) not in present)


def clean_errors(rows: pd.DataFrame, stressed: pd.DataFrame, experiment: str, variant: str = "") -> pd.DataFrame:
    """Return (protocol, condition, model, seed) -> clean error, of the runs that were put under stress.

    rows: of the one table, whose errors are those of the tables of accuracy; stressed: `runs`, whose errors at severity
    0 count where that table lacks a condition, as touches that were pressed anew.
    """
    run = ["protocol", "condition", "model", "seed"]
    told = as_error(of_variant(rows, variant), experiment).drop_duplicates(run).set_index(run)["error"]
    here = stressed[stressed["severity"] == 0].groupby(run)["error"].mean()
    return told.reindex(here.index).fillna(here).rename("error").reset_index()


def limit(usable: Mapping[str, float], protocol: str, condition: str) -> float:
    """Return the largest error that is usable: of the condition, `protocol/condition`, or else of the protocol."""
    return usable.get(f"{protocol}/{condition}", usable[protocol])


def unit_of(test: str) -> str:
    """Return the unit of the severities of a test."""
    return {name: told.unit for _, name, told in TESTS}.get(test, "severity")


def groups(table: pd.DataFrame) -> Iterator[tuple[tuple[str, str, str], dict[str, Runs]]]:
    """Yield (protocol, condition, perturbation) and the runs of each model, in the order of the table."""
    for place, own in table.groupby(TESTED_ON, sort=False):
        matrices = {model: _matrix(rows) for model, rows in own.groupby("model", sort=False)}
        floor = matrices.get(FLOOR, pd.DataFrame())
        found = {}
        for model, matrix in matrices.items():
            known = matrix.dropna()
            paired = known[known.index.isin(floor.index)] if len(floor) else known
            budget = own.loc[own["model"] == model, "budget"].iloc[0]
            at_floor = floor.reindex(index=paired.index, columns=matrix.columns).to_numpy(float)
            columns, errors = np.array(matrix.columns, dtype=float), paired.to_numpy(float)
            there = own[own["seed"].isin(paired.index) & own["severity"].isin(matrix.columns)]
            drawn = _drawn_blocks(there, model) or _drawn_seeds(errors, at_floor)
            found[model] = Runs(columns, errors, at_floor, budget, len(matrix) - len(known), *drawn)
        yield place, found


def _matrix(rows: pd.DataFrame) -> pd.DataFrame:
    """Return errors by seed (rows) and rising severity (columns)."""
    return rows.pivot(index="seed", columns="severity", values="error").sort_index(axis=1)


def _drawn_blocks(rows: pd.DataFrame, model: str) -> tuple[np.ndarray, np.ndarray, str] | None:
    """Return draws, floor_draws and over of Runs by blocks drawn anew; None where some row has none."""
    errors = []
    for name in (model, FLOOR):
        own = rows[rows["model"] == name]
        if own.empty or own["draws"].isna().any():
            return None
        errors.append(np.stack([np.mean(list(at), axis=0) for _, at in own.groupby("severity")["draws"]], axis=1))
    over = " and ".join(rows.loc[rows["model"] == model, "over"].unique())
    return (errors[0], errors[1], over) if errors[0].shape == errors[1].shape else None


def _drawn_seeds(errors: np.ndarray, floor: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    """Return draws, floor_draws and over of Runs by seeds drawn anew; no draw of fewer than FEWEST."""
    if len(errors) < FEWEST:
        return errors[:0], floor[:0], ""
    chosen = drawn(len(errors))
    return errors[chosen].mean(axis=1), floor[chosen].mean(axis=1), SEEDS


def crossing(severities: np.ndarray, errors: np.ndarray, level: np.ndarray | float, axis: str) -> np.ndarray:
    """Return the first severity (...) at which curves reach a level, infinite where they do not.

    severities: (k,) rising from 0; errors: (..., k); level: (...).
    """
    errors, level = np.asarray(errors, dtype=float), np.asarray(level, dtype=float)
    above = errors >= level[..., None]
    last = above.argmax(axis=-1)
    before = np.maximum(last - 1, 0)
    at, former = (np.take_along_axis(errors, each[..., None], -1)[..., 0] for each in (last, before))
    rise = at - former
    share = np.divide(level - former, rise, out=np.zeros_like(rise), where=rise > 0)
    low, high = severities[before], severities[last]
    found = low + share * (high - low)
    if axis == LOG:
        ends = np.where(low > 0, low, 1.0), np.where(high > 0, high, 1.0)
        found = np.where(low > 0, ends[0] * (ends[1] / ends[0]) ** share, found)
    return np.where(above.any(axis=-1), np.where(last == 0, severities[0], found), np.inf)


def axis_of(severities: Iterable[float]) -> str:
    """Return the axis on which errors between two severities are interpolated; severities: of one sign and 0."""
    sizes = [abs(each) for each in severities if each]
    return LOG if len(sizes) > 1 and max(sizes) >= SPAN * min(sizes) else LINEAR


def drawn(seeds: int) -> np.ndarray:
    """Return (DRAWS, seeds) places of the seeds of each draw, the same in every call."""
    return np.random.default_rng(SEED).integers(0, seeds, (DRAWS, seeds))


def walked(own: Runs) -> Iterator[tuple[str, Runs]]:
    """Yield each direction of a test, and the runs there, of severities from 0 outwards, without their sign."""
    for direction, sign in ((UP, 1), (DOWN, -1)):
        chosen = np.flatnonzero(sign * own.severities >= 0)
        chosen = chosen[np.argsort(np.abs(own.severities[chosen]))]
        if len(chosen) > 1:
            parts = {name: getattr(own, name)[:, chosen] for name in ("errors", "floor", "draws", "floor_draws")}
            yield direction, own._replace(severities=np.abs(own.severities[chosen]), **parts)


def lost_at(own: Runs, usable: float) -> dict[str, float | str]:
    """Return where half and all of the skill is lost, and where a model is no more usable, with the notes.

    own: of severities from 0 outwards. A level that is not reached has NaN, and the note says beyond what.
    """
    severities, axis = own.severities, axis_of(own.severities)

    def levels(curves: np.ndarray, constant: np.ndarray) -> dict[str, np.ndarray]:
        shares = curves / constant
        wanted = {"half": (shares[..., 0] + 1) / 2, "all": np.ones(shares.shape[:-1])}
        found = {name: crossing(severities, shares, level, axis) for name, level in wanted.items()}
        return found | {"fails": crossing(severities, curves, np.full(shares.shape[:-1], usable), axis)}

    mean = levels(own.errors.mean(axis=0), own.floor.mean(axis=0))
    found: dict[str, float | str] = {"axis": axis, "largest": severities[-1], "over": own.over}
    for name, value in mean.items():
        reached = np.isfinite(value)
        found[f"{name}_at"] = float(value) if reached else np.nan
        found[f"{name}_note"] = "" if reached else f"> {severities[-1]:g}"
    ends = dict.fromkeys(LEVELS, (np.nan, np.nan))
    if own.over:
        draws = levels(own.draws, own.floor_draws)
        ends = {name: np.quantile(each, TAILS, method="inverted_cdf") for name, each in draws.items()}
    for name in ("half", "all"):
        found[f"{name}_low"], found[f"{name}_high"] = map(float, ends[name])
    return found


def _signed(found: dict, direction: str) -> dict:
    """Return what `lost_at` found with the sign of the severities of a direction."""
    if direction == UP:
        return found
    turned = {name: -found[name] for name in ("half_at", "all_at", "fails_at", "largest")}
    for name in ("half", "all"):
        turned |= {f"{name}_low": -found[f"{name}_high"], f"{name}_high": -found[f"{name}_low"]}
    for name in LEVELS:
        turned[f"{name}_note"] = f"< {-found['largest']:g}" if found[f"{name}_note"] else ""
    return {**found, **turned}


def usable_clean(clean: pd.DataFrame, experiment: str, usable: Mapping[str, float]) -> pd.DataFrame:
    """Return columns UNUSABLE and `good` (bool), a row for each condition and model but `constant`.

    clean: see `clean_errors`; usable: see `limit`. A model without a run that did not fail is not good.
    """
    rows = []
    for (protocol, condition), own in clean.groupby(["protocol", "condition"], sort=False):
        errors = {model: each["error"] for model, each in own.groupby("model", sort=False)}
        floor, most = errors.get(FLOOR, pd.Series(dtype=float)).mean(), limit(usable, protocol, condition)
        for model, each in errors.items():
            if model != FLOOR:
                mean, failed = each.mean(), int(each.isna().sum())
                good = bool(mean <= most and mean < floor)
                rows.append(
                    (experiment, protocol, condition, model, mean, floor, most, len(each) - failed, failed, good)
                )
    return pd.DataFrame(rows, columns=[*UNUSABLE, "good"]).astype({"good": bool})


def failures(
    table: pd.DataFrame, clean: pd.DataFrame, experiment: str, usable: Mapping[str, float]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Judge all models that are usable clean, a row of FAILURES for each test and direction; the others: UNUSABLE.

    table: see `runs`; clean: see `clean_errors`; usable: see `limit`.
    """
    judged = usable_clean(clean, experiment, usable)
    told = {(row.protocol, row.condition, row.model): row for row in judged.itertuples()}
    rows = []
    for (protocol, condition, test), models in groups(table):
        unit = unit_of(test)
        for model, own in models.items():
            known = told.get((protocol, condition, model))
            has_clean = 0 in own.severities
            if model == FLOOR or (has_clean and not (known and known.good)):
                continue
            most = limit(usable, protocol, condition)
            row: dict[str, object] = dict(zip(WHERE, (experiment, protocol, condition, test, model), strict=True))
            row |= {"seeds": len(own.errors), "failed": own.failed, "budget": own.budget, "unit": unit, "usable": most}
            note = NO_CLEAN if not has_clean else NO_ORDER if unit.endswith(NAMES) else ""
            if note or known is None:
                notes = {f"{name}_note": note for name in LEVELS}
                rows.append(row | notes | ({"clean": known.clean, "floor": known.floor} if has_clean and known else {}))
                continue
            row |= {"clean": known.clean, "floor": own.floor[:, own.severities == 0].mean()}
            for direction, here in walked(own) if len(own.errors) else ():
                found = _signed(lost_at(here, most), direction)
                found["over"] = facts(experiment).seeds if found["over"] == SEEDS else found["over"]
                rows.append(row | found | {"direction": direction, "start": here.errors[:, 0].mean()})
    return pd.DataFrame(rows, columns=FAILURES), judged[~judged["good"]][UNUSABLE]


def shares(rows: pd.DataFrame) -> pd.DataFrame:
    """Return, of each test and direction (rows), the share of its severities up to which models keep half their skill.

    rows: of FAILURES of one condition; infinite where they keep it up to the largest. Severities of different tests
    have no common unit, so that shares of the largest, what the settings think the worst, are compared.
    """
    known = rows[rows["largest"].notna()]
    share = (known["half_at"] / known["largest"]).fillna(np.inf)
    table = known.assign(share=share).pivot(index=["perturbation", "direction"], columns="model", values="share")
    return table.loc[list(dict.fromkeys(zip(known["perturbation"], known["direction"], strict=True)))]


def hardest(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Return tests and directions, from the one that takes half of the skill of models first, by their median."""
    table = shares(rows)
    order = pd.DataFrame({"median": table.median(axis=1), "least": table.min(axis=1)}).round(
        6
    )  # last digits are no order
    return list(order.sort_values(["median", "least"], kind="stable").index)


class Better(NamedTuple):
    """A model with less error than the one that is best clean, where that one has lost half of its skill."""

    perturbation: str
    direction: str
    severity: float  # with its sign
    model: str
    error: float
    of_best: float  # error of the model that is best clean


def better(table: pd.DataFrame, rows: pd.DataFrame) -> list[Better]:
    """Return where another model is to be taken than the one with the least clean error; see Better.

    table: `runs` of one condition; rows: of FAILURES of it. Of the others that are usable clean the one with the least
    mean error is asked; the interval of its difference, over the same as those of the rows, must not hold 0. Where the
    rows have no interval, nothing tells.
    """
    found, good = [], set(rows["model"])
    curves = {test: models for (_, _, test), models in groups(table[table["model"].isin([*good, FLOOR])])}
    best = rows.dropna(subset="clean").sort_values("clean", kind="stable")["model"].iloc[0]
    for row in rows[(rows["model"] == best) & rows["half_at"].notna()].itertuples():
        test, size = row.perturbation, abs(row.half_at)
        there = {
            model: here
            for model, own in curves[test].items() if model in good
            for direction, here in walked(own) if direction == row.direction and len(here.errors)
        }  # fmt: skip
        errors = {model: error_at(each.severities, each.errors, size, row.axis) for model, each in there.items()}
        other = min(errors, key=lambda model: errors[model].mean())
        if other == best or len(errors[other]) != len(errors[best]) or there[other].over != there[best].over:
            continue
        if _low_gain(there[best], there[other], size, row.axis) > 0:
            means = errors[other].mean(), errors[best].mean()
            found.append(Better(test, row.direction, row.half_at, other, *means))
    return found


def _low_gain(worse: Runs, better: Runs, size: float, axis: str) -> float:
    """Return the lower end of the interval of how far the error of one model is above that of another; or NaN."""
    gains = [
        error_at(worse.severities, one, size, axis) - error_at(worse.severities, other, size, axis)
        for one, other in ((worse.errors, better.errors), (worse.draws, better.draws))
    ]
    return estimate(gains[0]).low if worse.over in ("", SEEDS) else float(np.quantile(gains[1], TAILS[0]))


def error_at(severities: np.ndarray, errors: np.ndarray, size: float, axis: str) -> np.ndarray:
    """Return the error of each seed at a severity, between those that were tried as in `crossing`."""
    after = int(np.clip(np.searchsorted(severities, size), 1, len(severities) - 1))
    low, high = severities[after - 1], severities[after]
    logarithmic = axis == LOG and low > 0
    share = np.log(size / low) / np.log(high / low) if logarithmic else (size - low) / (high - low)
    return errors[:, after - 1] + share * (errors[:, after] - errors[:, after - 1])


def helped(plain: pd.DataFrame, other: pd.DataFrame) -> pd.DataFrame:
    """Join rows of FAILURES of the models of `other`, of a variant, with those of the same models as in the tables.

    Columns of the variant end in `_variant`; `ratio`: of the severities at which half of the skill is lost. It is NaN
    where one of them is not reached.
    """
    on = [*WHERE, "direction", "unit"]
    values = ["clean", "half_at", "half_low", "half_high", "half_note", "largest", "seeds", "over"]
    joined = plain[[*on, *values]].merge(other[[*on, *values]], on=on, suffixes=("", "_variant"))
    joined = joined[joined["largest"].notna()]
    return joined.assign(ratio=joined["half_at_variant"] / joined["half_at"]).reset_index(drop=True)


def starts(rows: pd.DataFrame, experiment: str) -> pd.DataFrame:
    """Return columns STARTS, a row for each network of an experiment; rows: of the one table.

    A start is one training: a protocol and a seed, as in the tables, fully trained. It failed where it has no error in
    some condition; it is worse where in some condition its error is above WORSE times the median of all seeds. third,
    thrice: the error at that share of the learning rate over the one at the rate itself, geometric mean over seeds,
    protocols and conditions, of variants trained as briefly; NaN where not computed, infinite where one failed.
    """
    own = as_error(rows, experiment)
    own = own[own["budget"].eq(FULL) & own["variant"].fillna("").eq("")]
    place = ["protocol", "condition"]
    found = []
    for model, each in own.groupby("model", sort=False):
        median = each.groupby(place)["error"].transform("median")
        each = each.assign(failed=each["error"].isna(), worse=each["error"] > WORSE * median)
        by_start = each.groupby(["protocol", "seed"])[["failed", "worse"]].any()
        ratios, seeds = _rates(rows, experiment, model)
        counts = len(by_start), int(by_start["failed"].sum()), int((by_start["worse"] & ~by_start["failed"]).sum())
        found.append((experiment, model, *counts, each["protocol"].nunique(), *ratios, seeds))
    return pd.DataFrame(found, columns=STARTS)


def _rates(rows: pd.DataFrame, experiment: str, model: str) -> tuple[tuple[float, float], int]:
    """Return the error of a model at a third and at three times its learning rate over that at the rate, and seeds."""
    own = as_error(rows, experiment)
    own = own.assign(times=own["variant"].fillna("").map(_times))
    own = own[(own["model"] == model) & own["times"].notna()]
    if own.empty:
        return (np.nan, np.nan), 0
    errors = own.pivot(index=["protocol", "condition", "seed"], columns="times", values="error")
    ratios = []
    for wanted in (THIRD, THRICE):
        near = [at for at in errors if np.isclose(at, wanted, rtol=0.05)]
        logs = np.log(errors[near[0]] / errors[1.0]) if near and 1.0 in errors else pd.Series(dtype=float)
        mean = np.exp(logs.mean()) if logs.notna().all() else np.inf
        ratios.append(float(mean) if len(logs) else np.nan)
    return (ratios[0], ratios[1]), int(own["seed"].nunique())


def _times(variant: str) -> float:
    """Return at how many times its learning rate a variant was trained; NaN of one that is no such variant."""
    found = RATE.search(variant)
    return float(found[1]) if found else np.nan
