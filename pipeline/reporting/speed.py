"""Write reports/<experiment>/speed: error, times and weight of every model, and which models no other one beats."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.reporting.sentences import best, caption, split_unit
from pipeline.reporting.words.labels import FRONTS, SPREAD, model_name
from pipeline.reporting.words.markdown import interval, number, size, table
from pipeline.scoring.results import Estimate, Scores, read_training_times

ESTIMATE = ["error", "low", "high", "runs", "failed"]  # columns of one Estimate


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


def error_of(scores: Scores, protocol: str, condition: str, model: str, metric: str) -> Estimate:
    """Return mean and interval of a metric of which less is better; an accuracy becomes the share of errors in %."""
    value = scores.estimate(protocol, condition, model, metric)
    if metric != "accuracy":
        return value
    return value._replace(mean=100 * (1 - value.mean), low=100 * (1 - value.high), high=100 * (1 - value.low))


def speed_table(
    workspace: Workspace,
    scores: Scores,
    settings: Mapping,
    latency: Mapping[tuple[str, int], Mapping],
    panels: Mapping[str, tuple[str, str]],
    measure: tuple[str, str],
) -> pd.DataFrame:
    """Return table2.csv, one row per panel and model, in full precision; charts and table2.md are drawn from it.

    panels: title -> (protocol, condition); measure: (metric, its name and unit as an axis shows it). `p50_ms`,
    `p95_ms`: of one call at `batch`; `predictions_per_s`: at `large_batch`; `train_s`: median over the panel's seeds.
    `p50_low_ms` to `p50_high_ms` and `train_low_s` to `train_high_s`: smallest and largest median of a round, and seed.
    """
    (metric, name), batches = measure, settings["latency"]["batches"]
    rows = []
    for panel, (protocol, condition) in panels.items():
        for model in settings["models"]:
            single, large = latency[model, batches[0]], latency[model, batches[-1]]
            times = read_training_times(workspace, scores.experiment, model, protocol)
            row = {"panel": panel, "protocol": protocol, "condition": condition, "model": model, "measure": name}
            row |= dict(zip(ESTIMATE, error_of(scores, protocol, condition, model, metric), strict=True))
            row |= {"threads": single["threads"], "batch": batches[0]}
            row |= {key: single[key] for key in ("p50_ms", "p50_low_ms", "p50_high_ms", "p95_ms")}
            row |= {"large_batch": batches[-1], "predictions_per_s": 1e3 * batches[-1] / large["p50_ms"]}
            spread = (float(of(times)) if times else np.nan for of in (np.median, np.min, np.max))
            row |= dict(zip(("train_s", "train_low_s", "train_high_s"), spread, strict=True))
            rows.append(row | {key: single[key] for key in ("params", "macs", "size_bytes")})
            for key in FRONTS:
                if not 0 < rows[-1][key] < np.inf:
                    stage = "training" if key == "train_s" else "latency"
                    where = f"{scores.experiment}: {model} has no {key} above zero for {protocol}"
                    raise InputError(f"{where}; run its {stage} stage again")
    table = pd.DataFrame(rows)
    for key, column in FRONTS.items():
        table[column] = 0
        for _, panel in table.groupby("panel"):
            # A model with a failed run is not judged by its other runs.
            error = panel["error"].where(panel["failed"] == 0)
            table.loc[panel.index, column] = pareto(panel[SPREAD[key]], error).astype(int)
    return table


def speed_text(speeds: pd.DataFrame, calls: int, note: str = "") -> str:
    """Return table2.md from table2.csv; calls: how many predictions were timed; note: more to know."""
    threads, batch, large, measure = (speeds[key].iloc[0] for key in ("threads", "batch", "large_batch", "measure"))
    panels, protocols = list(dict.fromkeys(speeds["panel"])), list(dict.fromkeys(speeds["protocol"]))
    digits = 3 if speeds["error"].min() < 1 else 2
    rows = []
    for model, by_panel in speeds.groupby("model", sort=False):
        first = by_panel.iloc[0]
        errors = (Estimate(*values) for values in by_panel[ESTIMATE].itertuples(index=False))
        row = [model_name(model), *(interval(error, digits) for error in errors)]
        low, high = (f"{first[name]:.3f}" for name in SPREAD["p50_ms"])
        row += [f"{first['p50_ms']:.3f} [{low}, {high}] / {first['p95_ms']:.3f}"]
        row += [f"{first['predictions_per_s']:,.0f}"]
        row.append(" / ".join(_digits(time) for time in by_panel.drop_duplicates("protocol")["train_s"]))
        row += [size(first[key]) for key in ("params", "macs", "size_bytes")]
        rows.append([*row, *(_fronts(by_panel, column) for column in FRONTS.values())])
    names = " / ".join(protocols).replace("_", " ")
    training = f"Training (s): {names}" if len(protocols) > 1 else "Training (s)"
    header = ["Model", *(f"{panel}: {measure}" for panel in panels)]
    header += [f"batch {batch}: median [of rounds] / 95 % (ms)", f"predictions per second, batch {large}", training]
    header += ["Trained parameters", "MACs", "File (bytes)", "on the front of time", "on the front of training time"]
    lines = [
        "# Speed against accuracy\n",
        f"Error on test data: mean [95 % t interval] over seeds. Times: median [lowest and highest median of a round] "
        f"and 95th percentile of {calls} predictions (of batches a tenth as many) on {threads} CPU "
        f"{'thread' if threads == 1 else 'threads'}, all models in turn in every round. Networks and regressions "
        "run in ONNX Runtime, but for LoMP, which has compiled code of its own for one row; trees, naive Bayes and the "
        "ridge of series run in scikit-learn. Training: median over the seeds of a split. Times differ from run to run "
        "and from machine to machine. MACs (multiply-accumulates) are "
        "of one prediction. On a Pareto front are the models that no other one equals in time and mean error and beats "
        "in one of them, times that overlap being equal; a model with a failed run never is.\n",
        f"[Time of a prediction](tradeoff.png): {chart_caption(speeds, 'p50_ms')}\n",
        f"[Training time](training.png): {chart_caption(speeds, 'train_s')}\n",
        "In both charts, an arrowhead is an interval that leaves the axis, a cross at the top edge a model with a "
        "failed run.\n",
        *([f"{note}\n"] if note else []),
        table(header, rows),
        f"Pareto fronts, the fastest first, with time and {measure}:\n",
    ]
    for key, name, unit in (("p50_ms", "Time of a prediction", "ms"), ("train_s", "Training time", "s")):
        for panel in panels:
            front = speeds[(speeds["panel"] == panel) & (speeds[FRONTS[key]] == 1)].sort_values(key, kind="stable")
            parts = [
                f"{model_name(model)} ({time:.3g} {unit}, {number(error, digits)})"
                for model, time, error in zip(front["model"], front[key], front["error"], strict=True)
            ]
            lines.append(f"- {name}, {panel}: {', '.join(parts) or 'none, all models have a failed run'}.")
    return "\n".join(lines) + "\n"


def chart_caption(speeds: pd.DataFrame, time: str) -> str:
    """Return the caption of the chart of error against a measured time; time: a key of FRONTS.

    It says of every panel which model has the smallest error and which one is fastest; the constant model, which looks
    at no reading, is not asked for its time.
    """
    unit = "s" if time == "train_s" else "ms"
    parts = []
    for panel, rows in speeds.groupby("panel", sort=False):
        measure, error_unit = split_unit(rows["measure"].iloc[0])
        errors = {row.model: Estimate(*(getattr(row, key) for key in ESTIMATE)) for row in rows.itertuples()}
        name = measure if measure.isupper() else measure[0].lower() + measure[1:]
        text = f"{panel}: {best(errors, name, error_unit)}"
        parts.append(text)
        timed = rows[(rows["failed"] == 0) & (rows["model"] != "constant")]
        if len(timed):
            accurate, fastest = (timed.loc[timed[column].idxmin()] for column in ("error", time))
            text = f"{model_name(fastest['model'])} is fastest, {_digits(fastest[time])} {unit}"
            if fastest["model"] != accurate["model"]:
                text += f" with {number(fastest['error'])} {error_unit}"
                text += f"; {model_name(accurate['model'])} takes {_digits(accurate[time])} {unit}"
            parts.append(text)
    return caption(*parts)


def _fronts(by_panel: pd.DataFrame, column: str) -> str:
    """Name the panels on whose fronts a model is."""
    on = by_panel[by_panel[column] == 1]["panel"].tolist()
    return ("yes" if len(by_panel) == 1 else "all" if len(on) == len(by_panel) else ", ".join(on)) if on else "no"


def _digits(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.2g}" if value < 1 else f"{value:.1f}"
