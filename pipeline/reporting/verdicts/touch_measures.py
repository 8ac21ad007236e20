"""Measure what the claims of the LoMP paper are about, and say what was tried where one is not reproduced."""

from collections.abc import Mapping
from functools import partial

import numpy as np
import pandas as pd

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.datasets import labels, schemas
from pipeline.reporting.verdicts.rules import Evidence, NotTestable, complete, each, interval, summary
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import number as digits
from pipeline.reporting.words.markdown import size
from pipeline.scoring import ablation, metrics
from pipeline.scoring.published import PRINTED, rmse, time_ms
from pipeline.scoring.results import read_predictions

CONVENTIONAL = ("linear", "poly", "tree")
GLOBAL = ("cnn", "vgg", "convlstm", "rnn")  # learning models that see the whole array
LEARNED = (*GLOBAL, "lomp")
HIGH_KPA = 200.0  # "when a high pressure is applied": the upper half of the paper's 30 to 400 kPa
KPA_BINS = np.arange(50.0, 401.0, 50.0)
NO_MESSAGES = "lomp_alpha_0"  # row of touch.ablation
PAPERS_SPLIT = "random_window"  # windows that overlap, at random 8:1:1 (section IV-B)
MOST = 0.5  # recognised: in more than half of the windows, or of the variance
MODELS = tuple(PRINTED["lomp"])


def main_protocol(e: Evidence) -> str:
    """Return the split that is believed: the first of params.yaml."""
    return next(iter(e.values["touch"]["protocols"]))


def score(
    e: Evidence, model: str, condition: str = "single", metric: str = "rmse", protocol: str | None = None
) -> pd.Series:
    """Return seed -> value on a split, the main one if None."""
    return e.runs("touch", protocol or main_protocol(e), condition, model, metric)


def better(e: Evidence, one: str, other: str, condition: str = "single", metric: str = "rmse") -> pd.Series:
    """Return how far the error of `one` is below that of `other`, by seed."""
    return score(e, other, condition, metric) - score(e, one, condition, metric)


def growth(e: Evidence, model: str, protocol: str | None = None) -> pd.Series:
    """Return the error on double touch over that on single touch, by seed."""
    return score(e, model, "double", protocol=protocol) / score(e, model, protocol=protocol)


def without_messages(e: Evidence, condition: str) -> pd.Series:
    """Return how much higher the error (kPa) of LoMP is without message passing than with it, by seed."""
    e.require("touch", "lomp")
    try:
        table = e.once(("ablation", "touch"), lambda: ablation.read("touch"))
    except InputError as error:
        raise NotTestable(str(error)) from error
    pairs = ablation.paired(table, e.scores("touch"), e.values["touch"], NO_MESSAGES, condition)
    if pairs.empty:
        raise NotTestable(f"touch.ablation of params.yaml has no row {NO_MESSAGES} on {condition} touch")
    return complete(pairs["error"] - pairs["reference"], f"{NO_MESSAGES} ({condition})")


def maps(e: Evidence, model: str, protocol: str, seed: int) -> np.ndarray:
    """Read the predicted maps of one run on all windows, (n, map_rows, map_cols) in kPa, NaN outside its test part."""
    label = e.values["touch"]["label"]
    predicted = read_predictions("touch", model, protocol, seed, e.table("touch"))
    return predicted.reshape(-1, label["map_rows"], label["map_cols"])


def high_pressure_error(e: Evidence, model: str) -> pd.Series:
    """Return the mean distance of predicted from true peak pressure (kPa) on single touches above HIGH_KPA, by seed."""
    score(e, model)  # no failed run

    def read() -> pd.Series:
        table, protocol = e.table("touch"), main_protocol(e)
        peak = np.nan_to_num(labels.peaks_kpa(table, e.values["touch"])).max(axis=1)
        high = (schemas.names(table["condition"]) == "single") & (peak > HIGH_KPA)
        errors = {}
        for seed in e.values["touch"]["protocols"][protocol]["seeds"]:
            rows = high & (schemas.names(table[schemas.split_column(protocol, seed)]) == "test")
            largest = maps(e, model, protocol, seed)[rows].max(axis=(1, 2))
            errors[seed] = float(np.abs(largest - peak[rows]).mean()) if rows.any() else np.nan
        return pd.Series(errors)

    return e.once(("high_pressure_error", model), read).dropna()


def tilt(e: Evidence) -> pd.Series:
    """Return how much further left LoMP's pressure lies on the tape than right, as a share of all of it, by seed."""
    score(e, "lomp", "tape")

    def read() -> pd.Series:
        table, protocol = e.table("touch"), main_protocol(e)
        seeds = e.values["touch"]["protocols"][protocol]["seeds"]
        return pd.Series({s: _tilt(e, read_predictions("touch", "lomp", protocol, s, table)) for s in seeds})

    return e.once(("tilt",), read).dropna()


def true_tilt(e: Evidence) -> float:
    """Return the tilt of the labels."""
    return _tilt(e, schemas.matrix(e.table("touch")["y"]))


def _tilt(e: Evidence, values: np.ndarray) -> float:
    """Return the tilt of maps; values: (n, map_rows * map_cols) in kPa on all windows."""
    table, label = e.table("touch"), e.values["touch"]["label"]
    pressed = schemas.matrix(table["y"]).max(axis=1) >= metrics.touch_threshold_kpa(e.values["touch"])
    chosen = values[pressed & (schemas.names(table["condition"]) == "tape")]
    column = np.maximum(chosen.reshape(-1, label["map_rows"], label["map_cols"]), 0).sum(axis=1)
    half = label["map_cols"] // 2
    left, right = column[:, :half].sum(axis=1), column[:, -half:].sum(axis=1)
    some = left + right > 0
    return float(np.mean((left - right)[some] / (left + right)[some])) if some.any() else np.nan


def press_shift(e: Evidence) -> pd.Series:
    """Return element -> by how many counts its reading is lower for presses off its centre, at the same pressure.

    Single-touch frames under an element's area, in bins of 50 kPa: near the centre (within a quarter of the pitch in
    x and y) against the rest, mean over the bins that have both.
    """

    def read() -> pd.Series:
        path = paths.require(paths.frames("touch"), "python -m pipeline.stages.ingest touch")
        frames = schemas.read(path, columns=["condition", "v", "force_n", "x_mm", "y_mm"])
        frames = frames.filter(schemas.names(frames["condition"]) == "single")
        settings = e.values["touch"]
        sensor, pitch = settings["sensor"], settings["sensor"]["pitch_mm"]
        force, x, y = (schemas.matrix(frames[name])[:, 0] for name in ("force_n", "x_mm", "y_mm"))
        column = np.clip(x // pitch, 0, sensor["cols"] - 1).astype(int)
        row = np.clip(y // pitch, 0, sensor["rows"] - 1).astype(int)
        element = row * sensor["cols"] + column
        reading = schemas.matrix(frames["v"])[np.arange(len(x)), element]
        near = np.maximum(np.abs(x - (column + 0.5) * pitch), np.abs(y - (row + 0.5) * pitch)) <= pitch / 4
        level = np.digitize(labels.pressure_kpa(force, settings["label"]["tip_radius_mm"]), KPA_BINS)
        table = pd.DataFrame({"element": element, "level": level, "near": near, "reading": reading.astype(float)})
        mean = table[table["level"] > 0].groupby(["element", "level", "near"])["reading"].mean().unstack("near")
        if not {True, False} <= set(mean.columns):
            return pd.Series(dtype=float)
        return (mean[True] - mean[False]).dropna().groupby("element").mean()

    e.require("touch")
    return e.once(("press_shift",), read)


def unseen(e: Evidence) -> dict[str, float]:
    """Return the share of test windows with a product of two far elements that training never held, by condition."""

    def read() -> dict[str, float]:
        table, settings, protocol = e.table("touch"), e.values["touch"], main_protocol(e)
        seed = settings["protocols"][protocol]["seeds"][0]
        elements = settings["sensor"]["rows"] * settings["sensor"]["cols"]
        return unseen_products(
            schemas.matrix(table["x"])[:, -elements:].astype(float),
            schemas.names(table[schemas.split_column(protocol, seed)]),
            schemas.names(table["condition"]),
            settings["sensor"],
        )

    return e.once(("unseen",), read)


def unseen_products(counts: np.ndarray, part: np.ndarray, condition: np.ndarray, sensor: Mapping) -> dict[str, float]:
    """Return the share of test windows, by condition, with a product of two far elements outside its training range.

    counts: (n, elements) of the last frame; part, condition: (n,). The products are of values standardised on
    the training part; far elements are not neighbours, not even over a corner.
    """
    train = part == "train"
    spread = np.maximum(counts[train].std(axis=0), 1)
    scaled = (counts - counts[train].mean(axis=0)) / spread
    row, col = np.divmod(np.arange(sensor["rows"] * sensor["cols"]), sensor["cols"])
    away = np.maximum(np.abs(row[:, None] - row), np.abs(col[:, None] - col))
    first, second = np.nonzero(np.triu(away > 1))
    products = scaled[:, first] * scaled[:, second]
    low, high = products[train].min(axis=0, initial=np.inf), products[train].max(axis=0, initial=-np.inf)
    outside = ((products < low) | (products > high)).any(axis=1)
    return {name: float(outside[(condition == name) & (part == "test")].mean()) for name in np.unique(condition)}


def taxel(e: Evidence, one: str, other: str) -> pd.Series:
    """Return how far the error (N) of `one` is below that of `other` on the taxel (one fit for all), by seed."""
    runs = partial(e.runs, "velostat_recorded", "repetition", "all", metric="rmse")
    return runs(model=other) - runs(model=one)


def time_ratio(e: Evidence, one: str, other: str) -> float:
    """Return the median time of `one` over that of `other`."""
    return e.latency("touch", one) / e.latency("touch", other)


# What was tried where a claim is not reproduced.


def memory(e: Evidence, model: str) -> str:
    """Say how a model's error on training windows compares with that on others, and where its training ended."""
    fits = e.fits("touch", model, main_protocol(e))
    last = sum(fit.best_epoch == fit.epochs for fit in fits)
    gap = []
    for fit in fits:
        best = fit.history[fit.history["epoch"] == fit.best_epoch]
        gap += list(np.sqrt(best["validation_loss"] / best["train_loss"]))
    if not gap or not np.isfinite(gap).all():
        return f"{model_name(model)} is fitted in closed form."
    return (
        f"At its best epoch, {model_name(model)} has {np.mean(gap):.2f} times the error on validation windows that it "
        f"has on training windows; in {last} of {len(fits)} runs the best epoch was the last."
    )


def amount(e: Evidence) -> str:
    """Say how many presses are recorded here and in the paper."""
    single = e.values["touch"]["simulate"]["single"]
    presses = single["points_per_side"] ** 2 * single["depths"] * single["repetitions"]
    return (
        f"the array is pressed {presses:,} times here, 10,000 times in the paper; whether more presses help was not "
        "tried (the paper scale has them)"
    )


def on_papers_split(e: Evidence, model: str, condition: str) -> str:
    """Say the error on the paper's protocol."""
    errors = e.runs("touch", "random_window", condition, model, "rmse")
    return f"On windows that overlap, divided at random as in the paper, it is {digits(errors.mean())} kPa"


def loaded(e: Evidence, model: str) -> dict[str, float]:
    """Return the errors of the first run in kPa on parts of the test windows, and how high its maps reach.

    contact: single touch, pressed. both: double touch, both pressed; column: of these, in one column (its elements
    share a divider); apart: the others; alone: double touch with at most one pressed. peak, true_peak: mean largest
    value of the maps where both are pressed.
    """
    score(e, model, "double")

    def read() -> dict[str, float]:
        table, settings, protocol = e.table("touch"), e.values["touch"], main_protocol(e)
        seed = settings["protocols"][protocol]["seeds"][0]
        test = schemas.names(table[schemas.split_column(protocol, seed)]) == "test"
        condition = schemas.names(table["condition"])
        force, x = (np.nan_to_num(schemas.matrix(table[name])) for name in ("force_n", "x_mm"))
        pressed = (force > settings["window"]["contact_threshold_n"]).sum(axis=1)
        column = x[:, :2] // settings["sensor"]["pitch_mm"]
        double = test & (condition == "double")
        both = double & (pressed > 1)
        same = column[:, 0] == column[:, -1]
        parts = {"contact": test & (condition == "single") & (pressed > 0), "both": both}
        parts |= {"column": both & same, "apart": both & ~same, "alone": double & ~both}
        truth, predicted = schemas.matrix(table["y"]), read_predictions("touch", model, protocol, seed, table)
        errors = {"share": float(both.sum() / max(1, double.sum()))}
        for name, rows in parts.items():
            off = predicted[rows].astype(float) - truth[rows]
            errors[name] = float(np.sqrt(np.mean(off**2))) if rows.any() else np.nan
        for name, values in (("peak", predicted), ("true_peak", truth)):
            errors[name] = float(values[both].max(axis=1).mean()) if both.any() else np.nan
        return errors

    return e.once(("loaded", model), read)


def why_number(model: str, condition: str):
    """Return the paragraph on one number of Table I."""

    def why(e: Evidence) -> str:
        ours, printed, parts = score(e, model, condition).mean(), rmse(model, condition), loaded(e, model)
        text = f"{on_papers_split(e, model, condition)}. "
        if condition == "single":
            text += (
                f"{amount(e).capitalize()}. Counting only windows in which the array is pressed, the first run has "
                f"{digits(parts['contact'])} kPa: the level also depends on how much rest the test windows hold, which "
                "the paper does not say. "
            )
        else:
            text += (
                f"Both touches are pressed in {100 * parts['share']:.0f} % of our windows; over these alone the first "
                f"run has {digits(parts['both'])} kPa, over the others {digits(parts['alone'])}: the level depends on "
                "how much rest the windows hold, which the paper does not say. "
            )
        if model in LEARNED:
            text += memory(e, model) + " "
        flat = score(e, "constant", condition).mean()
        if printed > flat > ours:
            text += (
                f"The published error is above that of a constant map on our data ({digits(flat)} kPa): either the "
                "paper's windows carry more load, or the model fails there as it does not fail here. "
            )
        if model == "poly" and condition == "double":
            share = unseen(e)
            text += (
                f"In {100 * share['double']:.0f} % of the double-touch windows (single: {100 * share['single']:.0f} %) "
                "two far elements respond together as they never did in training: their product has a weight that no "
                "training window determined. The paper does not give the degree or the ridge of its polynomial. "
            )
        return text.strip()

    return why


def why_learning(e: Evidence) -> str:
    """Say which of the learning models is not ahead of the others."""
    simple = (*CONVENTIONAL, "rbf")
    best = min(simple, key=lambda model: score(e, model).mean())
    behind = [model for model in LEARNED if interval(better(e, model, best)).low <= 0]
    return (
        f"Simple models (kPa): {each(simple, lambda m: summary(score(e, m)))}; learning models: "
        f"{each(LEARNED, lambda m: summary(score(e, m)))}. " + " ".join(memory(e, m) for m in behind)
    ).strip()


def why_rnn(e: Evidence) -> str:
    """Say where the recurrent network stands."""
    location = each(LEARNED, lambda m: digits(score(e, m, metric="location_error").mean()))
    peak = each(LEARNED, lambda m: digits(score(e, m, metric="peak_error").mean(), 1))
    return (
        f"Single touch (kPa): {each(LEARNED, lambda m: summary(score(e, m)))}. Error of the place (mm): "
        f"{location}; of the pressure (kPa): {peak}. {memory(e, 'rnn')} {on_papers_split(e, 'rnn', 'single')}. Its "
        "learning rate was chosen on the validation part (params.yaml); the paper says only that it took the settings "
        "of the work that it cites."
    )


def why_double(e: Evidence) -> str:
    """Say the errors on double touch, and the growth from single to double."""
    names = (*CONVENTIONAL, "rbf", *LEARNED)
    networks = ("linear", *LEARNED)
    share = loaded(e, "lomp")
    return (
        f"From single to double touch the error grows by a factor of: "
        f"{each(names, lambda m: digits(growth(e, m).mean()))} (paper: "
        f"{each(names, lambda m: digits(rmse(m, 'double') / rmse(m)))}); that of a constant map, which knows nothing "
        f"of touches, by {digits(growth(e, 'constant').mean())}. Both touches are pressed in "
        f"{100 * share['share']:.0f} % of the windows. Over these the first run of each has (kPa; in brackets: touches "
        "in one column, whose elements share a divider, and others) "
        f"{each(names, lambda m: _loaded_errors(loaded(e, m)))}. There the mean largest value of the maps is (kPa) "
        f"{each(networks, lambda m: digits(loaded(e, m)['peak'], 0))}, that of the labels "
        f"{digits(share['true_peak'], 0)}: a model whose maps are lower than the labels misses touches, and cannot be "
        "as far off as one whose maps leave their range, as VGG-16's must have done in the paper."
    )


def _loaded_errors(parts: dict[str, float]) -> str:
    return f"{digits(parts['both'], 1)} ({digits(parts['column'], 1)}, {digits(parts['apart'], 1)})"


def why_vgg(e: Evidence) -> str:
    """Say how VGG-16 does on this scene."""
    parts = loaded(e, "vgg")
    return (
        f"VGG-16 has {digits(score(e, 'vgg', 'double').mean())} kPa on double touch, a constant map "
        f"{digits(score(e, 'constant', 'double').mean())}; where both touches are pressed, its maps reach "
        f"{digits(parts['peak'], 0)} kPa on average, the labels {digits(parts['true_peak'], 0)}: it misses touches "
        f"where the paper's overshoots. On single touch it has {summary(score(e, 'vgg'))} kPa (paper: "
        f"{digits(rmse('vgg'))}). {memory(e, 'vgg')} A network that has not fitted single touches as closely as the "
        "paper's cannot be as overfitted to them. What the paper's VGG-16, made for images of 224 x 224, did with 5 x "
        "5 elements is not said (pipeline/models/vgg.py)."
    )


def why_high(e: Evidence) -> str:
    """Say the errors at high pressure."""
    return (
        f"Error of the peak above {HIGH_KPA:.0f} kPa (kPa): "
        f"{each(LEARNED, lambda m: summary(high_pressure_error(e, m), 1))}; RMSE at all pressures: "
        f"{each(LEARNED, lambda m: digits(score(e, m).mean()))}. The paper has a figure of one stretch of presses and "
        "no number."
    )


def why_touches(condition: str):
    """Return the paragraph on a demonstration."""

    def why(e: Evidence) -> str:
        models = ("constant", *CONVENTIONAL, "rbf", *LEARNED)
        ahead = [
            m for m in models if m != "lomp" and score(e, m, condition).mean() < score(e, "lomp", condition).mean()
        ]
        text = (
            f"Error (kPa): {each(models, lambda m: digits(score(e, m, condition).mean(), 1))}; LoMP's by seed "
            f"{', '.join(digits(v, 1) for v in score(e, 'lomp', condition))}. "
        )
        if condition == "tape":
            text += "The tape presses neighbouring elements together, as no single press of the training data does" + (
                f", and ahead of LoMP are {', '.join(model_name(m) for m in ahead)}. " if ahead else ". "
            )
        else:
            shares = each(models, lambda m: f"{100 * score(e, m, condition, 'touches_found').mean():.0f}")
            text += f"Windows whose peaks are the touches (%): {shares}. "
        repetitions = e.values["touch"]["simulate"]["demonstrations"]["repetitions"]
        return text + (
            f"The paper shows one picture and no number. The demonstration is simulated {repetitions} times with one "
            "array, so seeds differ by split and training alone."
        )

    return why


def why_tape(e: Evidence) -> str:
    """Say how far LoMP's maps of the tape are tilted, by seed."""
    return (
        f"Share of the pressure that lies further left than right, by seed: "
        f"{', '.join(digits(value) for value in tilt(e))} (of the labels: {digits(true_tilt(e))}). "
        + why_touches("tape")(e)
    )


def why_latency(e: Evidence) -> str:
    """Say the times and what they consist of."""
    models, settings = ("linear", "cnn", "rnn", "lomp"), e.values["touch"]["latency"]
    times = each(models, lambda m: f"{e.latency('touch', m):.3f} (paper: {time_ms(m):.2f})")
    macs = each(models, lambda m: size(e.latency("touch", m, "macs")))
    return (
        f"Median times of one window (ms): {times}. Ours are of {settings['threads']} CPU "
        f"{'thread' if settings['threads'] == 1 else 'threads'}, the paper's of a GPU (GTX 1070), on which even a "
        f"linear map takes a millisecond: there the launch of each operation counts. Multiply-accumulates of a window: "
        f"{macs}; on a CPU they are done one after the other, also those of LoMP's 25 subnetworks. No GPU was timed."
    )


def why_taxel(e: Evidence) -> str:
    """Say the errors on the recorded taxel."""
    models = list(e.values["velostat_recorded"]["models"])
    runs = {m: e.runs("velostat_recorded", "repetition", "all", m, "rmse") for m in models}
    return f"One fit for all recordings (N): {each(models, lambda m: summary(runs[m], 3))}."
