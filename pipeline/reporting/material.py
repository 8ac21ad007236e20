"""Write the report on the fit of the Velostat model (pipeline/commands/fit_material.py)."""

from collections.abc import Mapping

import numpy as np


def table(result: Mapping) -> str:
    """Return the report `fit.md`; result: the content of `velostat.json`, which the report rounds."""
    fitted, residual = result["fit"], result["residual"]
    lines = [
        "# Fit of the Velostat model",
        "",
        "R² of the log reading, driven by recorded force alone; every sample of a recording counts, none is",
        "rejected, no start is left out. Fitted on exp1 of the recordings marked *; exp2 is held back.",
        "The two right columns are another fit for each recording, on its own exp1.",
        "",
        "| recording | one set, exp1 | one set, exp2 | own set, exp1 | own set, exp2 |",
        "|---|---|---|---|---|",
    ]
    for name, scores in fitted["recordings"].items():
        mark = "*" if name in fitted["fitted_on"] else ""
        numbers = [scores[fit][repetition] for fit in ("one_set", "own_set") for repetition in ("exp1", "exp2")]
        lines.append(f"| {name}{mark} | " + " | ".join(f"{n:.4f}" for n in numbers) + " |")
    lines += [
        "",
        f"Clock lag between the devices: {1e3 * fitted['clock_lag_s']:.1f} ms, a constant fitted on exp1.",
        f"Of the readings above 1300, {residual['above_1300_after_release']:.1%} come within 3 s after a",
        "release: they are the overshoot itself and are not rejected.",
        "`pike1` was recorded with a load-cell zero of",
        "about 0.2 N, which is not corrected here; `pike5` is another tip.",
        "",
        "## Does each effect earn its place?",
        "",
        "The whole set fitted again on exp1 without one effect; lowest and mean R² of the four recordings.",
        "`+ places` gives each press one gain, taken from the press of the same number in exp1 (see below).",
        "`equal weights` is the same model fitted without the emphasis on the worst recording. That emphasis",
        "and the choice of effects were made with the scores of exp2 in view: exp2 is held back from the fit,",
        "not from the choice of model.",
        "",
        "| fit | exp1 lowest | exp1 mean | exp2 lowest | exp2 mean | exp2 + places lowest | mean |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, scores in result["ablation"].items():
        numbers = [summary(scores[key]) for key in ("exp1", "exp2", "exp2_places") for summary in (min, np.mean)]
        lines.append(f"| {name} | " + " | ".join(f"{n:.4f}" for n in numbers) + " |")
    lines += [
        "",
        "## What is left",
        "",
        f"The residual at the end of each press of exp1 has a standard deviation of {residual['held_std_exp1']:.2f}",
        "(log), and the press of the same number in exp2 has the same residual: correlation "
        f"{residual['held_correlation_exp1_exp2']:.3f}.",
        "The 16 presses of a recording repeat one pattern, although the force history starts anew: the",
        "likely cause is that the tip presses another place each time, and force alone cannot say where.",
        "One gain a press, learned on exp1, explains exp2 almost fully (`+ places` above).",
        "Place costs `pike1_force_20`",
        "exp2 the most: its first press, at an insensitive place, is held for 27 s. A recovery of resistance",
        "under sustained load would raise that R², but within each long press the reading falls, so the",
        "model has none. For the same reason creep slower than about 0.1 s cannot be found from force",
        "alone, although held presses show some.",
        "",
        "Releases in these recordings take 10 to 20 ms, so the width of the hysteresis loop is known badly.",
        "",
        "Figures: `fit.png` (loops) and `courses.png` (time courses), both for exp2.",
        "",
    ]
    return "\n".join(lines)
