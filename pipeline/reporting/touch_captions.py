"""Write the captions of touch's figures: what each shows, from the numbers that the figure's function returns."""

from collections.abc import Mapping

import numpy as np

from pipeline.reporting.sentences import best, caption, one_run
from pipeline.reporting.words.markdown import number

PAPER_SPACING_MM = 2.875  # of press locations, figure 5


def characteristic_curve(lowest: float, highest: float, loading: float, unloading: float) -> str:
    """Return the caption of figure 2b; resistances in ohm: see `figures.touch.characteristic_curve`."""
    change = 100 * (unloading / loading - 1)
    ends = f"from {number(lowest / 1e3)} kΩ at 1 kPa to {number(highest / 1e3)} kΩ at 400 kPa"
    return caption(
        f"the resistance of the fitted film falls {ends}",
        f"its memory makes it {number(abs(change), 0)} % {'lower' if change < 0 else 'higher'} on unloading than on "
        "loading, at 200 kPa",
    )


def peak_pressure(shown: Mapping[str, tuple[float, float]]) -> str:
    """Return the caption of figure 4. shown: model -> L1 loss (kPa), predicted peak over the true one."""
    ratios = {model: ratio for model, (_, ratio) in shown.items() if np.isfinite(ratio)}
    low = sum(ratio < 1 for ratio in ratios.values())
    losses = one_run({model: loss for model, (loss, _) in shown.items()})
    return caption(
        f"peak pressure of single touches: {best(losses, 'L1 loss', 'kPa')}",
        f"the mean peak is {number(min(ratios.values()))} to {number(max(ratios.values()))} times the label's, too low "
        f"for {low} of {len(ratios)} models"
        if ratios
        else "",
    )


def press_location(counts: Mapping[str, float], kpa: float, spacing_mm: float) -> str:
    """Return the caption of figure 5. counts: place from the element's centre -> median counts at `kpa` or more."""
    if len(counts) < 2:
        return caption("too few press locations lie within one element to compare them")
    most, least = max(counts, key=counts.get), min(counts, key=counts.get)
    return caption(
        f"an element's reading depends on where in it the tip presses: at {number(kpa, 0)} kPa or more, the median is "
        f"{number(counts[most], 0)} counts at {most} from its centre, and {number(counts[least], 0)} at "
        f"{least}",
        f"the locations are {spacing_mm:g} mm apart; the paper says {PAPER_SPACING_MM:g} mm, a quarter of the element "
        "instead of the pitch",
    )


def double_touch(distances: Mapping[str, float], presses: int) -> str:
    """Return the caption of figure 6. distances: model -> mean distance (kPa) of its peaks from the label's."""
    nearest = best(one_run(distances), "mean error of the peak in the two pressed elements", "kPa", 1)
    return caption(f"double touch over time, {presses} presses: {nearest}")


def error_distribution(medians: Mapping[str, Mapping[str, float]]) -> str:
    """Return the caption of figure 7. medians: condition -> model -> median squared error (kPa²) of the windows."""
    return caption(
        *(
            f"{condition} touch: {best(one_run(by_model), 'mean squared error of a window, in the median', 'kPa²')}"
            for condition, by_model in medians.items()
        )
    )


def pressure_maps(errors: Mapping[str, Mapping[str, float]]) -> str:
    """Return the caption of figure 8. errors: kind of touch -> model -> RMSE (kPa) of the map drawn."""
    return caption(*(f"{kind}: {best(one_run(by_model), 'RMSE', 'kPa', 1)}" for kind, by_model in errors.items()))
