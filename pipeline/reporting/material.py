"""Write the report on the fit of the Velostat model (pipeline/commands/fit_material.py)."""

from collections.abc import Mapping

import numpy as np

from pipeline.reporting.sentences import caption, figure_lines


def table(result: Mapping) -> str:
    """Return the report `fit.md`; result: the content of `velostat.json`, which the report rounds."""
    fitted, places = result["fit"], result["places"]
    lines = [
        "# Fit of the Velostat model",
        "",
        "R² of the log reading; every sample of a recording counts, none is rejected, no start is left out. One set of",
        "parameters, fitted on exp1 of the recordings marked *; exp2 is held back. `force`: driven by recorded force",
        "alone. `places`: each of the 16 presses of a recording, which are at 16 places of the taxel, has the gain and",
        "the exponent that its place has in exp1 of the recordings marked *.",
        "",
        "| recording | force, exp1 | force, exp2 | places, exp1 | places, exp2 |",
        "|---|---|---|---|---|",
    ]
    for name, scores in fitted["recordings"].items():
        mark = "*" if name in fitted["fitted_on"] else ""
        numbers = [*scores["force"], *scores["places"]]
        lines.append(f"| {name}{mark} | " + " | ".join("-" if n is None else f"{n:.4f}" for n in numbers) + " |")
    lines += [
        "",
        f"Residual with places, exp2 of the recordings marked *: {min(fitted['residual_rms']):.3f} to "
        f"{max(fitted['residual_rms']):.3f} (standard deviation, log).",
        f"Clock lag between the devices: {1e3 * fitted['clock_lag_s']:.1f} ms, a constant fitted on exp1.",
        f"Of the readings above 1300, {result['above_1300_after_release']:.1%} come within 3 s after a",
        "release: they are the overshoot itself and are not rejected.",
        "`pike1` was recorded with a load-cell zero of about 0.2 N, which is not corrected here; `pike5` is another",
        "tip; exp1 of `pike1_force_30` has 17 presses, `pike1_force_1` 3 and 6.",
        "",
        "## Parameters",
        "",
        "No parameter lies on a bound of its range; the command refuses to write a set in which one does.",
        "",
        "| parameter | value |",
        "|---|---|",
        *(f"| {name} | {value:.4g} |" for name, value in result["parameters"].items()),
        "",
        "Slow creep cannot be told from presses of 1.5 s. Its weight and time are fitted to the courses of the holds",
        "of more than 3 s, from 1 s after the press began; `creep` is how far the log reading falls in that time, the",
        "residuals (standard deviation) are those of its course:",
        "",
        "| hold | seconds | creep | residual | residual without slow creep |",
        "|---|---|---|---|---|",
        *(
            f"| {hold['recording']} | {hold['seconds']:.1f} | {hold['creep']:.3f} | {hold['rms']:.4f} | "
            f"{hold['rms_without']:.4f} |"
            for hold in fitted["holds"]
        ),
        "",
        "## Places of one taxel",
        "",
        f"The log gains of the 16 places have a standard deviation of {places['gain_std']:.2f}, their exponents",
        f"(mean 1) one of {places['exponent_std']:.2f}: force alone cannot say where the tip presses, and that is most",
        "of what it leaves unexplained. The places are a raster of 4 x 4 on 13 x 15 mm; the log gains of neighbours,",
        f"3.25 or 3.75 mm apart, correlate with {places['neighbour_correlation']:.2f} (24 pairs).",
        "",
        "| row | " + " | ".join(f"{k + 1}" for k in range(4)) + " |",
        "|---|---|---|---|---|",
    ]
    for row, (gains, exponents) in enumerate(
        zip(np.reshape(places["log_gain"], (4, 4)), np.reshape(places["exponent"], (4, 4)), strict=True)
    ):
        cells = (f"{gain:+.2f} ({exponent:.2f})" for gain, exponent in zip(gains, exponents, strict=True))
        lines.append(f"| {row + 1} | " + " | ".join(cells) + " |")
    lines += [
        "",
        "Log gain at 10 N, in brackets the exponent, as fitted on exp1.",
        "",
        "## Does each effect earn its place?",
        "",
        "The whole set fitted again on exp1 without one effect; lowest and mean R² of the four recordings.",
        "",
        "| fit | exp1 lowest | exp1 mean | exp2 lowest | exp2 mean |",
        "|---|---|---|---|---|",
    ]
    for name, scores in result["ablation"].items():
        numbers = [summary(scores[key]) for key in ("exp1", "exp2") for summary in (min, np.mean)]
        lines.append(f"| {name} | " + " | ".join(f"{n:.4f}" for n in numbers) + " |")
    lines += [
        "",
        "Releases in these recordings take 20 to 50 ms, so the width of the hysteresis loop is known badly.",
        "",
        *figure_lines(captions(fitted)),
        "",
    ]
    return "\n".join(lines)


def captions(fitted: Mapping) -> dict[str, str]:
    """Return the captions of fit.png and courses.png, both of exp2, by name; fitted: the part `fit` of the result."""
    scores = {name: fitted["recordings"][name]["places"][1] for name in fitted["fitted_on"]}
    lowest, highest = min(scores, key=scores.get), max(scores, key=scores.get)
    text = f"R² of the log reading from force and place is {scores[lowest]:.3f} (`{lowest}`) to {scores[highest]:.3f} "
    text += f"(`{highest}`), on presses that the fit has not seen"
    return {"fit": caption(f"reading over force: {text}"), "courses": caption(f"reading over time: {text}")}
