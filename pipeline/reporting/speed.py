"""What reports/<experiment>/speed says: error, times and weight of every model, and which models nobody beats."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.base.errors import InputError
from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import interval, number, size, table
from pipeline.scoring.results import Estimate, Scores, read_training_times

FRONTS = {"p50_ms": "speed_front", "train_s": "training_front"}  # measured time -> the column of its Pareto front


def pareto(time: Sequence[float], error: Sequence[float]) -> np.ndarray:
    """(n,) bool: the Pareto front, points that no other one equals in both values and beats in one.

    Lower is better. Equal points are on the front together; a point with a value that is not finite never is.
    """
    points = np.column_stack([time, error]).astype(float)
    as_good = (points[None] <= points[:, None]).all(axis=2)  # (n, n): the second axis is who beats the first
    better = (points[None] < points[:, None]).any(axis=2)
    return np.isfinite(points).all(axis=1) & ~(as_good & better).any(axis=1)


def error_of(scores: Scores, protocol: str, condition: str, model: str, metric: str) -> Estimate:
    """Mean and interval of a metric of which less is better; an accuracy becomes the share of wrong answers in %."""
    found = scores.estimate(protocol, condition, model, metric)
    if metric != "accuracy":
        return found
    return found._replace(mean=100 * (1 - found.mean), low=100 * (1 - found.high), high=100 * (1 - found.low))


def speed_table(
    scores: Scores,
    settings: Mapping,
    latency: Mapping[tuple[str, int], Mapping],
    panels: Mapping[str, tuple[str, str]],
    measure: tuple[str, str],
) -> pd.DataFrame:
    """table2.csv: a row for every panel and model, in full precision; charts and table2.md are drawn from it.

    panels: title -> (protocol, condition); measure: (metric, its name and unit as an axis shows it). `p50_ms`,
    `p95_ms`: of one call at `batch`; `predictions_per_s`: at `large_batch`; `train_s`: median over the panel's seeds.
    """
    (metric, name), batches = measure, settings["latency"]["batches"]
    rows = []
    for panel, (protocol, condition) in panels.items():
        for model in settings["models"]:
            one, many = latency[model, batches[0]], latency[model, batches[-1]]
            times = read_training_times(scores.experiment, model, protocol)
            row = {"panel": panel, "protocol": protocol, "condition": condition, "model": model, "measure": name}
            mean, *others = error_of(scores, protocol, condition, model, metric)
            row |= dict(zip(("error", "low", "high", "runs", "failed"), (mean, *others), strict=True))
            row |= {"threads": one["threads"], "batch": batches[0], "p50_ms": one["p50_ms"], "p95_ms": one["p95_ms"]}
            row |= {"large_batch": batches[-1], "predictions_per_s": 1e3 * batches[-1] / many["p50_ms"]}
            row |= {"train_s": float(np.median(times)) if times else np.nan}
            rows.append(row | {key: one[key] for key in ("params", "macs", "size_bytes")})
            for key in FRONTS:
                if not 0 < rows[-1][key] < np.inf:
                    raise InputError(
                        f"{scores.experiment}: {model} has no {key} above zero for {protocol}; run its "
                        f"{'training' if key == 'train_s' else 'latency'} stage again"
                    )
    found = pd.DataFrame(rows)
    for key, column in FRONTS.items():
        found[column] = 0
        for _, own in found.groupby("panel"):
            # A model with a failed run is not judged by its other runs.
            error = own["error"].where(own["failed"] == 0)
            found.loc[own.index, column] = pareto(own[key], error).astype(int)
    return found


def speed_text(found: pd.DataFrame, calls: int, note: str = "") -> str:
    """table2.md from table2.csv; calls: how many predictions were timed; note: what else to know."""
    threads, batch, large = (found[key].iloc[0] for key in ("threads", "batch", "large_batch"))
    panels, protocols = list(dict.fromkeys(found["panel"])), list(dict.fromkeys(found["protocol"]))
    measure = found["measure"].iloc[0]
    digits = 3 if found["error"].min() < 1 else 2
    rows = []
    for model, own in found.groupby("model", sort=False):
        one = own.iloc[0]
        row = [model_name(model), *(interval(_estimate(line), digits) for line in own.itertuples())]
        row += [f"{one['p50_ms']:.3f} / {one['p95_ms']:.3f}", f"{one['predictions_per_s']:,.0f}"]
        row.append(" / ".join(_seconds(time) for time in own.drop_duplicates("protocol")["train_s"]))
        row += [size(one[key]) for key in ("params", "macs", "size_bytes")]
        rows.append([*row, *(_fronts(own, column) for column in FRONTS.values())])
    training = "Training (s)" + (f": {' / '.join(map(_words, protocols))}" if len(protocols) > 1 else "")
    header = ["Model", *(f"{panel}: {measure}" for panel in panels)]
    header += [f"batch {batch}: median / 95 % (ms)", f"predictions a second, batch {large}", training]
    header += ["Trained parameters", "MACs", "File (bytes)", "front of time", "front of training time"]
    lines = [
        "# Speed against accuracy\n",
        f"Error on test data: mean [95 % t interval] over seeds. Times: median and 95th percentile of {calls} "
        f"predictions (of batches a tenth as many) on {threads} CPU {'thread' if threads == 1 else 'threads'}; "
        "training: median over the seeds of a split. Times differ from run to run and from machine to machine: "
        "differences of a few percent mean nothing. MACs (multiply-accumulates) are of one prediction. On a Pareto "
        "front are the models that no other one equals in time and mean error and beats in one of them; a model with "
        "a failed run never is.\n",
        "Charts: [time of a prediction](tradeoff.png), [training time](training.png). In them, an arrowhead is an "
        "interval that leaves the axis, a cross at the top edge a model with a failed run.\n",
        *([f"{note}\n"] if note else []),
        table(header, rows),
        f"Pareto fronts, the fastest first, with time and {measure}:\n",
    ]
    for key, what, unit in (("p50_ms", "time of a prediction", "ms"), ("train_s", "training time", "s")):
        for panel in panels:
            own = found[(found["panel"] == panel) & (found[FRONTS[key]] == 1)].sort_values(key, kind="stable")
            parts = [
                f"{model_name(line.model)} ({getattr(line, key):.3g} {unit}, {number(line.error, digits)})"
                for line in own.itertuples()
            ]
            lines.append(f"- {what.capitalize()}, {panel}: {', '.join(parts) or 'none, all models have a failed run'}.")
    return "\n".join(lines) + "\n"


def _estimate(line: tuple) -> Estimate:
    return Estimate(line.error, line.low, line.high, line.runs, line.failed)


def _fronts(own: pd.DataFrame, column: str) -> str:
    """On which panels' fronts a model is."""
    on = own[own[column] == 1]["panel"].tolist()
    return ("yes" if len(own) == 1 else "all" if len(on) == len(own) else ", ".join(on)) if on else "no"


def _words(name: str) -> str:
    return name.replace("_", " ")


def _seconds(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.2g}" if value < 1 else f"{value:.1f}"
