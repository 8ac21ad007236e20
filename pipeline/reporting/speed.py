"""Write reports/<experiment>/speed: error, times and weight of every model, and which models no other one beats."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.reporting.report import Report
from pipeline.reporting.words.labels import FRONTS, SPREAD, model_name, plain
from pipeline.reporting.words.markdown import interval, size
from pipeline.reporting.words.templates import render
from pipeline.scoring.claim_inputs import FULL, HALF, LOOK
from pipeline.scoring.results import Estimate, read_training_times

ESTIMATE = ["error", "low", "high", "runs", "failed"]  # columns of one Estimate
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


def speed_table(
    workspace: Workspace,
    report: Report,
    settings: Mapping,
    latency: Mapping[tuple[str, int], Mapping],
    panels: Mapping[str, tuple[str, str]],
    measure: tuple[str, str],
) -> pd.DataFrame:
    """Return table2.csv, one row per panel and model, in full precision; charts and table2.md are drawn from it.

    panels: title -> (protocol, condition); measure: (metric, its name and unit as an axis shows it). `p50_ms`,
    `p95_ms`: of one call at `batch`; `predictions_per_s`: at `large_batch`; `train_s`: median over the panel's seeds,
    of the budget that the error is of. `half_error`, `half_train_s`: at half of it, NaN where that was not run.
    `p50_low_ms` to `p50_high_ms` and `train_low_s` to `train_high_s`: smallest and largest median of a round, and seed.
    """
    (metric, name), batches = measure, settings["latency"]["batches"]
    rows = []
    for panel, (protocol, condition) in panels.items():
        for model in settings["models"]:
            single, large = latency[model, batches[0]], latency[model, batches[-1]]
            kept = {at: report.training_times(protocol, model, at) for at in (HALF, FULL)}
            budget = report.results.shown(report.experiment, protocol)
            times = kept.get(budget) or read_training_times(workspace, report.experiment, model, protocol)
            row = {"panel": panel, "protocol": protocol, "condition": condition, "model": model, "measure": name}
            row |= dict(zip(ESTIMATE, error_of(report, protocol, condition, model, metric), strict=True))
            row |= {"threads": single["threads"], "batch": batches[0]}
            row |= {key: single[key] for key in ("p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms")}
            row |= {"large_batch": batches[-1], "predictions_per_s": 1e3 * batches[-1] / large["p50_ms"]}
            spread = (max(float(of(times)), LEAST_S) if times else np.nan for of in (np.median, np.min, np.max))
            row |= dict(zip(("train_s", "train_low_s", "train_high_s"), spread, strict=True))
            place = (report.experiment, protocol, condition, model, metric, "", HALF)
            less = budget == FULL and len(kept[HALF]) > 0 and report.results.found(*place)[1] == HALF  # it has epochs
            row |= {
                "half_error": error_of(report, protocol, condition, model, metric, HALF).mean if less else np.nan,
                "half_train_s": max(float(np.median(kept[HALF])), LEAST_S) if less else np.nan,
                "budget": budget if kept.get(budget) else LOOK,
            }
            rows.append(row | {key: single[key] for key in ("params", "macs", "size_bytes")})
            for key in FRONTS:
                if not 0 < rows[-1][key] < np.inf:
                    stage = "training" if key == "train_s" else "latency"
                    where = f"{report.experiment}: {model} has no {key} above zero for {protocol}"
                    raise InputError(f"{where}; run its {stage} stage again")
    table = pd.DataFrame(rows)
    for key, column in FRONTS.items():
        table[column] = 0
        for _, panel in table.groupby("panel"):
            # A model with a failed run is not judged by its other runs.
            error = panel["error"].where(panel["failed"] == 0)
            table.loc[panel.index, column] = pareto(panel[SPREAD[key]], error).astype(int)
    return table


def speed_text(speeds: pd.DataFrame, calls: int, machines: str, note: str) -> str:
    """Return table2.md from table2.csv.

    calls: how many predictions were timed; machines: what the shards were trained on; note: more to know.
    """
    threads, batch, large, measure = (speeds[key].iloc[0] for key in ("threads", "batch", "large_batch", "measure"))
    panels, protocols = list(dict.fromkeys(speeds["panel"])), list(dict.fromkeys(speeds["protocol"]))
    digits = 3 if speeds["error"].min() < 1 else 2
    rows = []
    for model, by_panel in speeds.groupby("model", sort=False):
        first = by_panel.iloc[0]
        errors = (Estimate(*values) for values in by_panel[ESTIMATE].itertuples(index=False))
        row = [model_name(model), *(interval(error, digits) for error in errors)]
        low, high = (f"{first[name]:.3f}" for name in SPREAD["p50_ms"])
        row += [
            f"{first['p50_ms']:.3f} [{low}, {high}]",
            f"{first['p95_ms']:.3f}",
            f"{first['predictions_per_s']:,.0f}",
        ]
        row += [seconds(time) for time in by_panel.drop_duplicates("protocol")["train_s"]]
        row += [size(first[key]) for key in ("params", "macs", "size_bytes")]
        rows.append([*row, *(fronts(by_panel, column) for column in FRONTS.values())])
    training = [f"Training, {plain(name)} (s)" for name in protocols] if len(protocols) > 1 else ["Training (s)"]
    header = ["Model", *(f"{panel}: {measure}" for panel in panels)]
    header += [f"Median of batch {batch} [of rounds] (ms)", "95th percentile (ms)"]
    header += [f"Predictions per second, batch {large}", *training, "Trained parameters", "Multiply-accumulates"]
    header += ["File (bytes)", "On the front of time", "On the front of training time"]
    return render("speed", calls=calls, threads=threads, machines=machines, note=note, table_of_models=(header, rows))


def fronts(by_panel: pd.DataFrame, column: str) -> str:
    """Name the panels on whose fronts a model is."""
    on = by_panel[by_panel[column] == 1]["panel"].tolist()
    return ("yes" if len(by_panel) == 1 else "all" if len(on) == len(by_panel) else ", ".join(on)) if on else "no"


def seconds(value: float) -> str:
    """Return a training time with two digits or more."""
    return f"{value:,.0f}" if value >= 100 else f"{value:.2g}" if value < 1 else f"{value:.1f}"
