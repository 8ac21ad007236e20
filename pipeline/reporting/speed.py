"""Write reports/<experiment>/speed: error, times and weight of every model, and which models no other one beats."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.reporting.report import Report
from pipeline.reporting.texts import render
from pipeline.results import times
from pipeline.results.claim_inputs import FULL, HALF, LOOK
from tactile.base.errors import InputError
from tactile.base.processes import processor
from tactile.drawing.labels import FRONTS, MACHINES, SPREAD, TIMES, model_name, split_name
from tactile.drawing.markdown import interval, size
from tactile.scoring import estimates
from tactile.scoring.estimates import Estimate

ESTIMATE = ["error", "low", "high", "runs", "failed"]  # columns of one Estimate
MEASURED = ("p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms")
WEIGHT = ("params", "macs", "size_bytes")
UNTIMED = "not timed"
LEAST_S = 1e-3  # of a training's time, which the evidence keeps in whole milliseconds


def pareto(time: Sequence[tuple[float, float]], error: Sequence[float]) -> np.ndarray:
    """Return the Pareto front as (n,) bool: points that no other one equals in time and error and beats in one of them.

    Lower is better. time: (n, 2), the lowest and the highest that was measured; times that overlap are equal. Equal
    points are on the front together; a point with a value that is not finite never is.
    """
    low, high = np.asarray(time, dtype=float).reshape(-1, 2).T
    error = np.asarray(error, dtype=float)
    known = np.isfinite([low, high, error]).all(axis=0)
    faster, slower = high[None] < low[:, None], low[None] > high[:, None]  # (n, n): is the second than the first?
    beaten = known[None] & ~slower & (error[None] <= error[:, None]) & (faster | (error[None] < error[:, None]))
    return known & ~beaten.any(axis=1)


def error_of(report: Report, protocol: str, condition: str, model: str, metric: str, budget: str = "") -> Estimate:
    """Return mean and interval of a metric of which less is better; an accuracy becomes the share of errors in %.

    budget: the one that is shown, if none is given.
    """
    value = report.results.estimate(report.experiment, protocol, condition, model, metric, budget=budget)
    if metric != "accuracy":
        return value
    return value._replace(mean=100 * (1 - value.mean), low=100 * (1 - value.high), high=100 * (1 - value.low))


def timed(report: Report, settings: Mapping) -> dict[tuple[str, int], Mapping]:
    """Return (model, batch) -> row of latency.csv, with its calls and machine: of the evidence, or of the look.

    A model that was not timed for the evidence has no row; settings: the experiment's block.
    """
    if report.of_look:
        here = {times.MACHINE: processor(), "calls": settings["latency"]["calls"]}
        rows = estimates.read_latency(report.workspace, report.experiment, settings)
        return {key: {**row, **here} for key, row in rows.items()}
    rows = times.predictions(report.workspace, report.experiment)
    rows = rows[rows["model"].isin(settings["models"])]
    return {(row["model"], row["batch"]): row for row in rows.to_dict("records")}


def of_model(latency: Mapping[tuple[str, int], Mapping], model: str) -> dict:
    """Return what table2.csv says of a model's predictions and weight; latency: see `timed`; NaN where it has none."""
    batches = sorted({batch for _, batch in latency})
    ends = [latency[model, batch] for batch in (*batches[:1], *batches[-1:]) if (model, batch) in latency]
    one, many = ends if len(ends) == 2 else ({}, {})
    row = {key: one.get(key, np.nan) for key in ("threads", "batch", "calls", *MEASURED)}
    per_s = 1e3 * many["batch"] / many["p50_ms"] if many.get("p50_ms") else np.nan
    row |= {"large_batch": many.get("batch", np.nan), "predictions_per_s": per_s}
    return row | {"machine": one.get(times.MACHINE, "")} | {key: one.get(key, np.nan) for key in WEIGHT}


def speed_table(
    report: Report,
    settings: Mapping,
    latency: Mapping[tuple[str, int], Mapping],
    panels: Mapping[str, tuple[str, str]],
    measure: tuple[str, str],
) -> pd.DataFrame:
    """Return table2.csv, one row per panel and model, in full precision; charts and table2.md are drawn from it.

    latency: see `timed`; panels: title -> (protocol, condition); measure: (metric, its name and unit as an axis shows
    it). `p50_ms`, `p95_ms`: of one call at `batch`; `predictions_per_s`: at `large_batch`, both on `machine`.
    `train_s`: median over the trainings of the panel's protocol on `training_machine`, at the budget that the error is
    of (see `times.Trainings`). `half_error`, `half_train_s`: at half of it, NaN where that was not run.
    `p50_low_ms` to `p50_high_ms` and `train_low_s` to `train_high_s`: smallest and largest median of a round, and
    training.
    """
    metric, name = measure
    trained = times.trainings(report.workspace, report.experiment, {protocol for protocol, _ in panels.values()})
    rows = []
    for panel, (protocol, condition) in panels.items():
        for model in settings["models"]:
            shown = report.results.shown(report.experiment, protocol)
            budget = shown if report.of_look or shown != LOOK else ""  # nothing of it is in the evidence
            row = {"panel": panel, "protocol": protocol, "condition": condition, "model": model, "measure": name}
            row |= dict(zip(ESTIMATE, error_of(report, protocol, condition, model, metric), strict=True))
            row |= of_model(latency, model)
            if report.of_look:
                taken = estimates.read_training_times(report.workspace, report.experiment, model, protocol)
            else:
                taken = trained.seconds(protocol, model, budget)
            row |= dict(zip(("train_s", *SPREAD["train_s"]), spread(taken), strict=True))
            half = [] if report.of_look or budget != FULL else trained.seconds(protocol, model, HALF)
            place = (report.experiment, protocol, condition, model, metric, "", HALF)
            less = len(half) > 0 and report.results.found(*place)[1] == HALF  # it has epochs
            row |= {
                "half_error": error_of(report, protocol, condition, model, metric, HALF).mean if less else np.nan,
                "half_train_s": spread(half)[0] if less else np.nan,
                "budget": budget,
                "training_machine": (processor() if report.of_look else trained.machine) if taken else "",
            }
            for key in FRONTS:
                known = report.of_look or not np.isnan(row[key])
                if known and not 0 < row[key] < np.inf:
                    stage = "training" if key == "train_s" else "latency"
                    where = f"{report.experiment}: {model} has no {key} above zero for {protocol}"
                    raise InputError(f"{where}; run its {stage} stage again")
            rows.append(row)
    table = pd.DataFrame(rows)
    for key, column in FRONTS.items():
        table[column] = 0
        for _, panel in table.groupby("panel"):
            # A model with a failed run is not judged by its other runs.
            error = panel["error"].where(panel["failed"] == 0)
            table.loc[panel.index, column] = pareto(panel[SPREAD[key]], error).astype(int)
    return table


def spread(seconds: Sequence[float]) -> tuple[float, float, float]:
    """Return median, lowest and highest of the times of some trainings, at least LEAST_S; NaN where there are none."""
    if not seconds:
        return np.nan, np.nan, np.nan
    return tuple(max(float(of(seconds)), LEAST_S) for of in (np.median, np.min, np.max))


def speed_text(speeds: pd.DataFrame, note: str) -> str:
    """Return table2.md from table2.csv; note: more to know. What was not timed is said in its cells."""
    threads, batch, large, calls = (whole(speeds[key]) for key in ("threads", "batch", "large_batch", "calls"))
    panels, protocols = list(dict.fromkeys(speeds["panel"])), list(dict.fromkeys(speeds["protocol"]))
    measure, digits = speeds["measure"].iloc[0], 3 if speeds["error"].min() < 1 else 2
    rows = []
    for model, by_panel in speeds.groupby("model", sort=False):
        first = by_panel.iloc[0]
        errors = (Estimate(*values) for values in by_panel[ESTIMATE].itertuples(index=False))
        row = [model_name(model), *(interval(error, digits) for error in errors)]
        if np.isnan(first["p50_ms"]):
            row += [UNTIMED] * 3
        else:
            low, high = (f"{first[name]:.3f}" for name in SPREAD["p50_ms"])
            row += [
                f"{first['p50_ms']:.3f} [{low}, {high}]",
                f"{first['p95_ms']:.3f}",
                f"{first['predictions_per_s']:,.0f}",
            ]
        row += [seconds(time) for time in by_panel.drop_duplicates("protocol")["train_s"]]
        row += [size(first[key]) for key in WEIGHT]
        rows.append([*row, *(fronts(by_panel, column) for column in FRONTS.values())])
    training = [f"Training, {split_name(name)} (s)" for name in protocols] if len(protocols) > 1 else ["Training (s)"]
    header = ["Model", *(f"{panel}: {measure}" for panel in panels)]
    of, at = (f" of batch {batch}", f", batch {large}") if batch else ("", "")
    header += [f"Median{of} [of rounds] (ms)", "95th percentile (ms)"]
    header += [f"Predictions per second{at}", *training, "Trained parameters", "Multiply-accumulates"]
    header += ["File (bytes)", "On the front of time", "On the front of training time"]
    said = {name: times.one_machine(speeds[name], TIMES[time]) for time, name in MACHINES.items()}
    said |= {"threads": threads, "calls": calls, "budgets": " and ".join(filter(None, dict.fromkeys(speeds["budget"])))}
    return render("speed", **said, note=note, table_of_models=(header, rows))


def whole(values: pd.Series) -> int:
    """Return the one whole number that is in a column beside NaN; 0 where there is none."""
    known = values.dropna()
    return int(known.iloc[0]) if len(known) else 0


def fronts(by_panel: pd.DataFrame, column: str) -> str:
    """Name the panels on whose fronts a model is."""
    on = by_panel[by_panel[column] == 1]["panel"].tolist()
    return ("yes" if len(by_panel) == 1 else "all" if len(on) == len(by_panel) else ", ".join(on)) if on else "no"


def seconds(value: float) -> str:
    """Return a training time with two digits or more."""
    if np.isnan(value):
        return UNTIMED
    return f"{value:,.0f}" if value >= 100 else f"{value:.2g}" if value < 1 else f"{value:.1f}"
