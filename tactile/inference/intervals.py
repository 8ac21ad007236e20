"""Put an interval around every prediction, or name the set of classes, as the calibration in a model's card says.

A card has one bound per output and case. Cases are told from the prediction alone, so that each is calibrated on its
own kind (Mondrian conformal prediction, Vovk, Gammerman and Shafer 2005, section 4.5): an array with a touch, whose
force is off by more the harder it is pressed, and one without.
"""

import numpy as np

from tactile.inference import touches
from tactile.inference.card import Bound, Calibration, Card
from tactile.scoring import conformal

PEAK, FORCE, OBJECT = "peak_kpa", "force_n", "object"  # of maps and classes; of numbers, outputs.names
TOUCH, REST, ALWAYS = "touch", "no touch", "always"
OUTSIDE = "outside_training"


def bound(card: Card, output: str, case: str = ALWAYS) -> Bound | None:
    """Return the bound of an output, None where the card has no calibration or cannot tell."""
    known = card.calibration.bounds if card.calibration else []
    found = next((each for each in known if (each.output, each.case) == (output, case)), None)
    return None if found is None or found.value is None else found


def scale(predicted: np.ndarray, floor: float | None) -> np.ndarray | float:
    """Return what half widths are multiplied by: 1 without a floor, else conformal.root."""
    return 1.0 if floor is None else conformal.root(predicted, floor)


def limits(predicted: np.ndarray, of: Bound | None) -> tuple[np.ndarray, np.ndarray]:
    """Return the low and high ends of the intervals of predictions (n,), both (n,) float32; NaN: cannot tell."""
    if of is None:
        return np.full((2, *np.shape(predicted)), np.nan, np.float32)
    half = of.value * scale(predicted, of.floor)
    low = np.maximum(predicted - half, 0) if of.output == PEAK else predicted - half  # no pressure is below 0
    return np.float32(low), np.float32(predicted + half)


def touched(peak: np.ndarray, card: Card) -> np.ndarray:
    """Return whether there is a touch in maps with these highest values, (n,) bool; peak: (n,) in the card's unit.

    On one element, whose map is the force itself, there is a touch from `window.contact_threshold_n` on.
    """
    least = card.outputs.touch_kpa
    return peak >= (card.reading["window"]["contact_threshold_n"] if least is None else least)


def of_force(force_n: np.ndarray, peak: np.ndarray, card: Card) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the intervals of forces (n,) in N; peak: (n,) highest values of the maps."""
    ends = [limits(force_n, bound(card, FORCE, case)) for case in (TOUCH, REST)]
    pairs = zip(*ends, strict=True)
    return tuple(np.where(touched(peak, card), with_touch, without) for with_touch, without in pairs)


def of_peak(peak_kpa: np.ndarray, card: Card) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the intervals of the highest pressures (n,) of maps in kPa; NaN where there is no touch."""
    ends = limits(peak_kpa, bound(card, PEAK, TOUCH))
    return tuple(np.where(touched(peak_kpa, card), values, np.float32(np.nan)) for values in ends)


def of_series(predicted: np.ndarray, card: Card) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the intervals of positions (n, outputs) in mm, both (n, outputs)."""
    ends = [limits(values, bound(card, name)) for name, values in zip(card.outputs.names, predicted.T, strict=True)]
    return tuple(np.stack(columns, axis=1) for columns in zip(*ends, strict=True))


def of_objects(probabilities: np.ndarray, card: Card) -> list[list[str]]:
    """Return the set of objects of each prediction (n, objects), the likeliest first.

    All of them: cannot tell; none: no prediction.
    """
    known = bound(card, OBJECT)
    sets = conformal.class_sets(probabilities, 0.0 if known is None else known.value)
    sets[np.isnan(probabilities).any(axis=1)] = False
    order = np.argsort(-probabilities, axis=1, kind="stable")
    return [[card.outputs.names[k] for k in places if inside[k]] for places, inside in zip(order, sets, strict=True)]


def names(card: Card) -> list[str]:
    """Return the names of `columns`: of intervals where the card has a calibration, OUTSIDE where it has ranges."""
    known = [] if card.trained_on is None else [OUTSIDE]
    if card.calibration is None:
        return known
    if card.says == "classes":
        return [card.outputs.set_of_them, *known]
    outputs = card.outputs.names or ([FORCE] if card.outputs.touch_kpa is None else [FORCE, PEAK])
    return [*(name for output in outputs for name in _ends(output)), *known]


def _ends(output: str) -> tuple[str, str]:
    """Return the names of the two ends of an output's interval: x_low_mm and x_high_mm of x_mm."""
    name, unit = output.rsplit("_", 1)
    return f"{name}_low_{unit}", f"{name}_high_{unit}"


def columns(predicted: np.ndarray, outside: np.ndarray, card: Card) -> dict[str, np.ndarray | list[list[str] | None]]:
    """Return what belongs beside predictions (n, *output_shape): two ends of each output, or the set of objects.

    outside: (n,) bool, the reading lies outside the training: no interval was calibrated on its like. It is the last
    column. Ends are (n,) float32, NaN where there is no prediction, the reading is outside or the calibration cannot
    tell; of a set, a list of names for each prediction, the likeliest first, None of a reading outside.
    """
    known = {} if card.trained_on is None else {OUTSIDE: outside}
    if card.calibration is None:
        return known
    if card.says == "classes":
        sets = of_objects(predicted, card)
        return {
            card.outputs.set_of_them: [None if out else each for each, out in zip(sets, outside, strict=True)]
        } | known
    if card.says == "numbers":
        ends = [
            end for low_high in zip(*(each.T for each in of_series(predicted, card)), strict=True) for end in low_high
        ]
    else:
        peak = predicted.max(axis=(1, 2))
        if card.outputs.touch_kpa is None:
            ends = of_force(predicted.sum(axis=(1, 2)), peak, card)
        else:
            ends = (*of_force(touches.force_n(predicted, card), peak, card), *of_peak(peak, card))
    inside = [np.where(outside, np.float32(np.nan), end) for end in ends]
    return dict(zip(names(card), [*inside, *known.values()], strict=True))


def unit(output: str, card: Card) -> str:
    """Return the unit of the width of an output's interval; of a set, what it counts."""
    return {PEAK: "kPa", FORCE: "N", OBJECT: "objects"}.get(output, card.outputs.unit)


def sentences(card: Card) -> list[str]:
    """Say what the interval of each output is, on how much it was calibrated, and where it held too little or much."""
    given = card.calibration
    if given is None:
        return ["no interval: this model's card has no calibration"]
    percent, words = f"{100 * given.level:.0f} %", []
    for each in given.bounds:
        of = each.output if each.case == ALWAYS else f"{each.output}, {each.case}"
        unit_ = unit(each.output, card)
        on = f"calibrated on {each.groups} {conformal.plural(given.group, each.groups)} of the validation part"
        if each.value is not None and (held := _held(given, each)):
            on += f"; {held}"
        if each.value is None:
            words.append(f"{of}: no interval; {on}, and {percent} need {conformal.least(given.level)}")
        elif each.output == OBJECT:
            words.append(f"{of}: {percent} set, of all with a probability of {each.value:.3g} or more; {on}")
        elif each.floor is None:
            words.append(f"{of}: {percent} interval, +- {each.value:.3g} {unit_}; {on}")
        else:
            half = f"{each.value:.3g} sqrt(prediction + {each.floor:.3g}) {unit_}"
            words.append(f"{of}: {percent} interval, +- {half}; {on}")
    if given.refitted:
        words.append("the errors are those of this model fitted without the validation part, which it was fitted to")
    if given.shared:
        words.append(
            f"the model was trained on {conformal.plural(given.group)} of the validation part: of new ones it errs more"
        )
    return words


def _held(given: Calibration, of: Bound) -> str:
    """Say the coverage of a bound on the test part, as conformal.held; tests of too few groups count alone only."""
    tests = [each for each in given.coverage if (each.output, each.case) == (of.output, of.case)]
    told = [each for each in tests if each.groups >= conformal.least(given.level)] or tests
    shares = {f"{each.condition}, {each.groups} of them": each.share for each in told}
    return conformal.held(shares, conformal.plural(given.group))
