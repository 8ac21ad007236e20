"""Write ablation.md of touch: what LoMP's messages and the frames that a model sees are worth."""

from collections.abc import Mapping

import pandas as pd

from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, table
from pipeline.scoring.ablation import paired
from pipeline.scoring.results import Scores, estimate


def text(ablation: pd.DataFrame, scores: Scores, settings: Mapping, conditions: list[str]) -> str:
    """Write ablation.md; conditions: those of Table I that are recorded."""
    protocol = next(iter(settings["protocols"]))
    rows = []
    for name, row in settings["ablation"].items():
        if row["of"] not in settings["models"]:  # it was not run
            continue
        beside = row.get("beside", "")
        same = settings["models"].get(row["of"]) or {}
        changed = {key: value for key, value in row["settings"].items() if beside or same.get(key) != value}
        change = ", ".join(f"{key} {value}" for key, value in changed.items()) or "-"
        cells = [name, model_name(row["of"]), change, str(row["frames"]), beside or f"{model_name(row['of'])}, Table I"]
        for condition in conditions:
            pair = paired(ablation, scores, settings, name, condition)
            ratio = estimate(pair["error"] / pair["reference"])
            missed = f"{50 * (ratio.high - ratio.low):.0f} %" if ratio.runs > 1 else "not known"
            cells += [interval(estimate(pair["error"])), interval(ratio), missed]
        rows.append(cells)
    header = ["Row", "Model", "Changed", "Frames it sees", "Compared with"]
    for condition in conditions:
        header += [f"{condition}: RMSE (kPa)", f"{condition}: ratio to what it is compared with"]
        header += [f"{condition}: smallest change seen"]
    inputs = ", ".join(
        f"{model_name(model)} {frames_seen(model, settings)}" for model in settings["models"] if model != "constant"
    )
    return "\n".join(
        [
            "# What one thing is worth\n",
            f"One thing of a model is changed; split (`{protocol}`), seeds and training are those of Table I. Ratios "
            "are paired by seed, with a 95 % t interval where there are two seeds or more: above 1, the change does "
            "harm. The smallest change seen is half that interval: a smaller effect would have been missed. One seed "
            "has no interval, and cannot tell a change from chance.\n",
            "alpha weighs LoMP's messages (eq. 4): 1 in the tables, 0 leaves message passing out.\n",
            table(header, rows),
            f"Frames that the models of Table I see: {inputs}.\n",
        ]
    )


def frames_seen(model: str, settings: Mapping) -> int:
    """Return how many frames of a window a model of the tables sees; a stream has its state besides."""
    return 1 if model in ("linear", "poly", "poly_array", "lomp_stream") else settings["window"]["frames"]
