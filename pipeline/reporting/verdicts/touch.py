"""The claims of the LoMP paper (touch), on the simulated array and on the recorded taxel."""

from functools import partial

import numpy as np
import pandas as pd

from pipeline.base import paths
from pipeline.datasets import labels, schemas
from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import interval as shown
from pipeline.reporting.markdown import number as digits
from pipeline.reporting.markdown import size
from pipeline.reporting.touch import PRINTED, published_value, unseen_products
from pipeline.reporting.verdicts.rules import (
    Claim,
    Evidence,
    Judgement,
    all_positive,
    each,
    interval,
    number,
    positive,
    slower,
    untestable,
    within,
)
from pipeline.scoring.results import estimate, read_predictions

CONVENTIONAL = ("linear", "poly", "tree")
GLOBAL = ("cnn", "vgg", "convlstm", "rnn")  # learning models that see the whole array
LEARNED = (*GLOBAL, "lomp")
HIGH_KPA = 200.0  # "when a high pressure is applied": the upper half of the paper's 30 to 400 kPa
KPA_BINS = np.arange(50.0, 401.0, 50.0)
MOST = 0.5  # recognised: in more than half of the windows, or of the variance
claim = partial(Claim, "lomp")


def main_protocol(e: Evidence) -> str:
    """The split that is believed: the first of params.yaml."""
    return next(iter(e.values["touch"]["protocols"]))


def score(e: Evidence, model: str, condition: str = "single", metric: str = "rmse") -> pd.Series:
    """Seed -> value on the main split."""
    return e.runs("touch", main_protocol(e), condition, model, metric)


def better(e: Evidence, one: str, other: str, condition: str = "single", metric: str = "rmse") -> pd.Series:
    """How far the error of `one` is below that of `other`, by seed."""
    return score(e, other, condition, metric) - score(e, one, condition, metric)


def all_better(e: Evidence, ones, others, condition: str = "single", metric: str = "rmse") -> Judgement:
    """Every one of `ones` has a lower error than every one of `others`."""
    pairs = {(one, other) for one in ones for other in others if one != other}
    named = {f"{model_name(a)} below {model_name(b)}": better(e, a, b, condition, metric) for a, b in sorted(pairs)}
    return all_positive(named)


def growth(e: Evidence, model: str) -> pd.Series:
    """Error on double touch over that on single touch, by seed."""
    return score(e, model, "double") / score(e, model)


def paper(model: str, condition: str = "single") -> float:
    """The printed RMSE in kPa."""
    return published_value(model, f"{condition} touch")


def paper_ms(model: str) -> float:
    """The printed time in ms."""
    return published_value(model, "single touch (GTX 1070)")


def maps(e: Evidence, model: str, protocol: str, seed: int) -> np.ndarray:
    """Predicted maps of one run on all windows, (n, map_rows, map_cols) in kPa, NaN outside its test part."""
    label = e.values["touch"]["label"]
    found = read_predictions("touch", model, protocol, seed, e.table("touch"))
    return found.reshape(-1, label["map_rows"], label["map_cols"])


def high_pressure_error(e: Evidence, model: str) -> pd.Series:
    """Mean distance of predicted from true peak pressure (kPa) on single touches above HIGH_KPA, by seed."""
    score(e, model)  # no failed run

    def read() -> pd.Series:
        table, protocol = e.table("touch"), main_protocol(e)
        peak = np.nan_to_num(labels.peaks_kpa(table, e.values["touch"])).max(axis=1)
        high = (schemas.names(table["condition"]) == "single") & (peak > HIGH_KPA)
        found = {}
        for seed in e.values["touch"]["protocols"][protocol]["seeds"]:
            rows = high & (schemas.names(table[schemas.split_column(protocol, seed)]) == "test")
            largest = maps(e, model, protocol, seed)[rows].max(axis=(1, 2))
            found[seed] = float(np.abs(largest - peak[rows]).mean()) if rows.any() else np.nan
        return pd.Series(found)

    return e.once(("high_pressure_error", model), read).dropna()


def tilt(e: Evidence) -> pd.Series:
    """How much further left LoMP's pressure lies on the tape than right, as a share of all of it, by seed."""
    score(e, "lomp", "tape")

    def read() -> pd.Series:
        table, protocol = e.table("touch"), main_protocol(e)
        seeds = e.values["touch"]["protocols"][protocol]["seeds"]
        return pd.Series({s: _tilt(e, read_predictions("touch", "lomp", protocol, s, table)) for s in seeds})

    return e.once(("tilt",), read).dropna()


def true_tilt(e: Evidence) -> float:
    """The same of the labels."""
    return _tilt(e, schemas.matrix(e.table("touch")["y"]))


def _tilt(e: Evidence, values: np.ndarray) -> float:
    """values: (n, map_rows * map_cols) in kPa on all windows."""
    table, label = e.table("touch"), e.values["touch"]["label"]
    pressed = schemas.matrix(table["y"]).max(axis=1) > KPA_BINS[0]
    chosen = values[pressed & (schemas.names(table["condition"]) == "tape")]
    column = np.maximum(chosen.reshape(-1, label["map_rows"], label["map_cols"]), 0).sum(axis=1)
    half = label["map_cols"] // 2
    left, right = column[:, :half].sum(axis=1), column[:, -half:].sum(axis=1)
    some = left + right > 0
    return float(np.mean((left - right)[some] / (left + right)[some])) if some.any() else np.nan


def press_shift(e: Evidence) -> pd.Series:
    """Element -> by how many counts its reading is lower for presses off its centre, at the same pressure.

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


def taxel(e: Evidence, one: str, other: str) -> pd.Series:
    """How far the error (N) of `one` is below that of `other` on the recorded taxel, one fit for all, by seed."""
    runs = partial(e.runs, "velostat_recorded", "repetition", "all", metric="rmse")
    return runs(model=other) - runs(model=one)


def taxel_all(e: Evidence, ones, others) -> Judgement:
    """Every one of `ones` has a lower error on the taxel than every one of `others`."""
    named = {f"{model_name(a)} below {model_name(b)}": taxel(e, a, b) for a in ones for b in others}
    return all_positive(named)


def time_ratio(e: Evidence, one: str, other: str) -> float:
    """Median time of `one` over that of `other`."""
    return e.latency("touch", one) / e.latency("touch", other)


def single_value(ratio: float) -> pd.Series:
    """A measured ratio as the rules take it."""
    return pd.Series([ratio])


# What was tried where a claim is not reproduced.


def memory(e: Evidence, model: str) -> str:
    """How a model's error on training windows compares with that on others, and where its training ended."""
    fits = e.fits("touch", model, main_protocol(e))
    last = sum(fit.best_epoch == fit.epochs for fit in fits)
    limit = sum(fit.stop_reason == "max_epochs" for fit in fits)
    gap = []
    for fit in fits:
        best = fit.history[fit.history["epoch"] == fit.best_epoch]
        gap += list(np.sqrt(best["validation_loss"] / best["train_loss"]))
    if not gap or not np.isfinite(gap).all():
        return f"{model_name(model)} is fitted in closed form."
    return (
        f"At its best epoch, {model_name(model)} has {np.mean(gap):.2f} times the error on validation windows that it "
        f"has on training windows; {limit} of {len(fits)} runs reached the allowed number of epochs, and in {last} the "
        "best epoch was the last."
    )


def amount(e: Evidence) -> str:
    """Presses that are recorded here and in the paper."""
    own = e.values["touch"]["simulate"]["single"]
    presses = own["points_per_side"] ** 2 * own["depths"] * own["repetitions"]
    return (
        f"the array is pressed {presses:,} times here, 10,000 times in the paper; whether more presses help was not "
        "tried (the full scale has them)"
    )


def on_papers_split(e: Evidence, model: str, condition: str) -> str:
    """The error on windows split at random, as the paper seems to have split."""
    found = e.runs("touch", "random_window", condition, model, "rmse")
    return f"On windows split at random, as the paper seems to have split, it is {digits(found.mean())} kPa"


def loaded(e: Evidence, model: str) -> dict[str, float]:
    """Errors of the first run in kPa on parts of the test windows, and how high its maps reach.

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
        double, both = condition == "double", (condition == "double") & (pressed > 1)
        same = column[:, 0] == column[:, -1]
        parts = {"contact": test & (condition == "single") & (pressed > 0), "both": both}
        parts |= {"column": both & same, "apart": both & ~same, "alone": double & ~both}
        truth, predicted = schemas.matrix(table["y"]), read_predictions("touch", model, protocol, seed, table)
        found = {"share": float(both.sum() / max(1, double.sum()))}
        for name, rows in parts.items():
            off = predicted[rows].astype(float) - truth[rows]
            found[name] = float(np.sqrt(np.mean(off**2))) if rows.any() else np.nan
        for name, values in (("peak", predicted), ("true_peak", truth)):
            found[name] = float(values[both].max(axis=1).mean()) if both.any() else np.nan
        return found

    return e.once(("loaded", model), read)


def why_number(model: str, condition: str):
    """Paragraph on one number of Table I."""

    def why(e: Evidence) -> str:
        ours, printed, parts = score(e, model, condition).mean(), paper(model, condition), loaded(e, model)
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


def unseen(e: Evidence) -> dict[str, float]:
    """Share of test windows with a product of two far elements that training never held, by condition."""

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


def why_learning(e: Evidence) -> str:
    """Which of the learning models is not ahead of the others."""
    simple = (*CONVENTIONAL, "rbf")
    best = min(simple, key=lambda model: score(e, model).mean())
    behind = [model for model in LEARNED if interval(better(e, model, best)).low <= 0]
    return (
        f"Simple models (kPa): {each(simple, lambda m: shown(estimate(score(e, m))))}; learning models: "
        f"{each(LEARNED, lambda m: shown(estimate(score(e, m))))}. " + " ".join(memory(e, m) for m in behind)
    ).strip()


def why_rnn(e: Evidence) -> str:
    """Where the recurrent network stands."""
    location = each(LEARNED, lambda m: digits(score(e, m, metric="location_error").mean()))
    peak = each(LEARNED, lambda m: digits(score(e, m, metric="peak_error").mean(), 1))
    return (
        f"Single touch (kPa): {each(LEARNED, lambda m: shown(estimate(score(e, m))))}. Error of the place (mm): "
        f"{location}; of the pressure (kPa): {peak}. {memory(e, 'rnn')} {on_papers_split(e, 'rnn', 'single')}. Its "
        "learning rate was chosen on the validation part (params.yaml); the paper says only that it took the settings "
        "of the work that it cites."
    )


def why_double(e: Evidence) -> str:
    """Errors on double touch, and the growth from single to double."""
    names = (*CONVENTIONAL, "rbf", *LEARNED)
    networks = ("linear", *LEARNED)
    share = loaded(e, "lomp")
    return (
        f"From single to double touch the error grows by a factor of: "
        f"{each(names, lambda m: digits(growth(e, m).mean()))} (paper: "
        f"{each(names, lambda m: digits(paper(m, 'double') / paper(m)))}); that of a constant map, which knows nothing "
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
    """VGG-16 on this scene."""
    parts = loaded(e, "vgg")
    return (
        f"VGG-16 has {digits(score(e, 'vgg', 'double').mean())} kPa on double touch, a constant map "
        f"{digits(score(e, 'constant', 'double').mean())}; where both touches are pressed, its maps reach "
        f"{digits(parts['peak'], 0)} kPa on average, the labels {digits(parts['true_peak'], 0)}: it misses touches "
        f"where the paper's overshoots. On single touch it has {shown(estimate(score(e, 'vgg')))} kPa (paper: "
        f"{digits(paper('vgg'))}). {memory(e, 'vgg')} A network that has not fitted single touches as closely as the "
        "paper's cannot be as overfitted to them. What the paper's VGG-16, made for images of 224 x 224, did with 5 x "
        "5 elements is not said (pipeline/models/vgg.py)."
    )


def why_high(e: Evidence) -> str:
    """Errors at high pressure."""
    return (
        f"Error of the peak above {HIGH_KPA:.0f} kPa (kPa): "
        f"{each(LEARNED, lambda m: shown(estimate(high_pressure_error(e, m)), 1))}; RMSE at all pressures: "
        f"{each(LEARNED, lambda m: digits(score(e, m).mean()))}. The paper has a figure of one stretch of presses and "
        "no number."
    )


def why_touches(condition: str):
    """Paragraph on a demonstration."""

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
            found = each(models, lambda m: f"{100 * score(e, m, condition, 'touches_found').mean():.0f}")
            text += f"Windows with as many peaks as touches (%): {found}. "
        repetitions = e.values["touch"]["simulate"]["demonstrations"]["repetitions"]
        return text + (
            f"The paper shows one picture and no number. The demonstration is simulated {repetitions} times with one "
            "array, so seeds differ by split and training alone."
        )

    return why


def why_latency(e: Evidence) -> str:
    """Times and what they consist of."""
    models, settings = ("linear", "cnn", "rnn", "lomp"), e.values["touch"]["latency"]
    times = each(models, lambda m: f"{e.latency('touch', m):.3f} (paper: {paper_ms(m):.2f})")
    macs = each(models, lambda m: size(e.latency("touch", m, "macs")))
    return (
        f"Median times of one window (ms): {times}. Ours are of {settings['threads']} CPU "
        f"{'thread' if settings['threads'] == 1 else 'threads'}, the paper's of a GPU (GTX 1070), on which even a "
        f"linear map takes a millisecond: there the launch of each operation counts. Multiply-accumulates of a window: "
        f"{macs}; on a CPU they are done one after the other, also those of LoMP's 25 subnetworks. No GPU was timed."
    )


def why_taxel(e: Evidence) -> str:
    """Errors on the recorded taxel."""
    models = list(e.values["velostat_recorded"]["models"])
    runs = {m: e.runs("velostat_recorded", "repetition", "all", m, "rmse") for m in models}
    return f"One fit for all recordings (N): {each(models, lambda m: shown(estimate(runs[m]), 3))}."


def claims() -> list[Claim]:
    """Every claim that is looked at, in the order of the paper."""
    label = {model: model_name(model) for model in PRINTED}
    found = [
        claim(
            "learning-single",
            "On single touch every learning-based model is below every conventional one.",
            "IV-C, Table I",
            "kPa",
            lambda e: all_better(e, LEARNED, CONVENTIONAL),
            min(map(paper, CONVENTIONAL)) - max(map(paper, LEARNED)),
            why=why_learning,
        ),
        claim(
            "lomp-conventional-single",
            "On single touch LoMP is below every conventional model.",
            "IV-C, Table I",
            "kPa",
            lambda e: all_better(e, ("lomp",), CONVENTIONAL),
            min(map(paper, CONVENTIONAL)) - paper("lomp"),
        ),
        claim(
            "rbf-single",
            "RBF-Net cannot follow single touches as the deep networks do: all of them are below it.",
            "IV-C, Table I",
            "kPa",
            lambda e: all_better(e, LEARNED, ("rbf",)),
            paper("rbf") - max(map(paper, LEARNED)),
            why=why_learning,
        ),
        claim(
            "nonlinear-single",
            "The sensor is not linear: polynomial regression is below linear regression on single touch.",
            "IV-C, Table I",
            "kPa",
            lambda e: positive(better(e, "poly", "linear")),
            paper("linear") - paper("poly"),
        ),
    ]
    for condition in ("single", "double"):
        for model in PRINTED:
            found.append(
                claim(
                    f"rmse-{condition}-{model}",
                    f"{label[model]} has an error of {digits(paper(model, condition))} kPa on {condition} touch.",
                    "Table I",
                    "kPa",
                    partial(
                        lambda e, model, condition: number(score(e, model, condition), paper(model, condition)),
                        model=model,
                        condition=condition,
                    ),
                    paper(model, condition),
                    printed=True,
                    why=why_number(model, condition),
                )
            )
    rest = [model for model in PRINTED if model != "lomp"]
    others = [model for model in (*LEARNED, "rbf") if model != "vgg"]
    next_best = min(paper(model, "double") for model in rest)
    found += [
        claim(
            "rnn-lowest",
            "The RNN has the lowest error of all on single touch.",
            "IV-C",
            "kPa",
            lambda e: all_better(e, ("rnn",), [m for m in PRINTED if m != "rnn"]),
            min(paper(m) for m in PRINTED if m != "rnn") - paper("rnn"),
            why=why_rnn,
        ),
        claim(
            "lomp-like-rnn",
            "On single touch LoMP performs like the RNN (ratio of errors minus 1 near 0).",
            "IV-C, V",
            "1",
            lambda e: within(score(e, "lomp") / score(e, "rnn") - 1, 0.1),
            paper("lomp") / paper("rnn") - 1,
            why=why_rnn,
        ),
        claim(
            "high-pressure-cnn",
            "At high pressure networks with convolutions (CNN, VGG-16, ConvLSTM) are further off than the RNN.",
            "IV-C, Fig. 4",
            "kPa",
            lambda e: all_positive(
                {
                    f"{label[m]} above RNN": high_pressure_error(e, m) - high_pressure_error(e, "rnn")
                    for m in ("cnn", "vgg", "convlstm")
                }
            ),
            why=why_high,
        ),
        claim(
            "high-pressure-lomp",
            "At high pressure LoMP is further off than the RNN.",
            "IV-C, Fig. 4",
            "kPa",
            lambda e: positive(high_pressure_error(e, "lomp") - high_pressure_error(e, "rnn")),
            why=why_high,
        ),
        claim(
            "locations",
            "From 25 elements, learning-based models tell 400 places 3 mm apart (3 mm minus location error above 0).",
            "IV-C, V",
            "mm",
            lambda e: all_positive({label[m]: 3 - score(e, m, metric="location_error") for m in LEARNED}),
            why=why_rnn,
        ),
        claim(
            "off-centre",
            "Off its centre, the same pressure gives a lower reading of an element: the curve shifts to the left.",
            "IV-C, Fig. 5",
            "counts",
            lambda e: positive(press_shift(e), "elements"),
        ),
        claim(
            "lomp-best-double",
            "LoMP, fitted to single touches alone, has the lowest error of all on double touch.",
            "IV-D, Table I",
            "kPa",
            lambda e: all_better(e, ("lomp",), rest, "double"),
            next_best - paper("lomp", "double"),
            why=why_double,
        ),
        claim(
            "lomp-margin-double",
            "On double touch the next model has about twice LoMP's error.",
            "Table I",
            "1",
            lambda e: number(
                min((score(e, m, "double") for m in rest), key=lambda own: own.mean()) / score(e, "lomp", "double"),
                next_best / paper("lomp", "double"),
            ),
            next_best / paper("lomp", "double"),
            printed=True,
            why=why_double,
        ),
        claim(
            "growth-global",
            "From single to double touch, errors of RNN, CNN, ConvLSTM and VGG-16 grow by more than LoMP's.",
            "IV-D, Fig. 7",
            "1",
            lambda e: all_positive({label[m]: growth(e, m) - growth(e, "lomp") for m in GLOBAL}),
            min(paper(m, "double") / paper(m) for m in GLOBAL) - paper("lomp", "double") / paper("lomp"),
            why=why_double,
        ),
        claim(
            "growth-lomp",
            "LoMP's error on double touch is 3.45 times that on single touch.",
            "Table I",
            "1",
            lambda e: number(growth(e, "lomp"), paper("lomp", "double") / paper("lomp")),
            paper("lomp", "double") / paper("lomp"),
            printed=True,
            why=why_double,
        ),
        claim(
            "conventional-double",
            "Linear and polynomial regression have lower errors on double touch than RNN, CNN, ConvLSTM and VGG-16.",
            "IV-D, Table I",
            "kPa",
            lambda e: all_better(e, ("linear", "poly"), GLOBAL, "double"),
            min(paper(m, "double") for m in GLOBAL) - max(paper(m, "double") for m in ("linear", "poly")),
            why=why_double,
        ),
    ]
    for model in CONVENTIONAL:
        printed = paper(model, "double") / paper(model)
        found.append(
            claim(
                f"growth-{model}",
                f"The error of a conventional model about doubles with a second touch: {label[model]}.",
                "IV-D, Table I",
                "1",
                partial(lambda e, model, printed: number(growth(e, model), printed), model=model, printed=printed),
                printed,
                why=why_double,
            )
        )
    found += [
        claim(
            "vgg-overfits",
            "VGG-16 is more overfitted to single touch than other learning models: its error grows most.",
            "IV-D",
            "1",
            lambda e: all_positive({label[m]: growth(e, "vgg") - growth(e, m) for m in others}),
            paper("vgg", "double") / paper("vgg") - max(paper(m, "double") / paper(m) for m in others),
            why=why_vgg,
        ),
        claim(
            "rnn-below-cnn-double",
            "On double touch the RNN has a lower error than CNN and ConvLSTM.",
            "IV-D, Table I",
            "kPa",
            lambda e: all_better(e, ("rnn",), ("cnn", "convlstm"), "double"),
            min(paper("cnn", "double"), paper("convlstm", "double")) - paper("rnn", "double"),
            why=why_double,
        ),
        claim(
            "cnn-two-peaks",
            "CNN and ConvLSTM show both touches more often than the RNN, which does not tell them apart.",
            "IV-D, Figs. 6, 8a",
            "1",
            lambda e: all_positive(
                {
                    label[m]: score(e, m, "double", "touches_found") - score(e, "rnn", "double", "touches_found")
                    for m in ("cnn", "convlstm")
                }
            ),
        ),
        claim(
            "lomp-two-peaks",
            "LoMP shows both touches more often than RNN, CNN, ConvLSTM and VGG-16.",
            "IV-D, Fig. 8a",
            "1",
            lambda e: all_positive(
                {
                    label[m]: score(e, "lomp", "double", "touches_found") - score(e, m, "double", "touches_found")
                    for m in GLOBAL
                }
            ),
        ),
    ]
    demonstrations = {"three": "three simultaneous touches", "slide": "two touches that slide at the same time"}
    for condition, words in demonstrations.items():
        found.append(
            claim(
                f"recognised-{condition}",
                f"LoMP shows {words}: as many peaks as touches in more than half of the windows (share minus 0.5).",
                "IV-E, Fig. 8",
                "1",
                partial(
                    lambda e, condition: positive(score(e, "lomp", condition, "touches_found") - MOST),
                    condition=condition,
                ),
                why=why_touches(condition),
            )
        )
    found += [
        claim(
            "recognised-tape",
            "LoMP shows the pattern of a rolled tape: it explains more than half of the variance (R2 minus 0.5).",
            "IV-E, Fig. 8d",
            "1",
            lambda e: positive(score(e, "lomp", "tape", "r2") - MOST),
            why=why_touches("tape"),
        ),
        claim(
            "tape-tilt",
            "LoMP's map of the tape is tilted to the side that is pressed harder, the left.",
            "IV-E, Fig. 8d",
            "1",
            lambda e: positive(tilt(e)),
            why=lambda e: (
                f"Share of the pressure that lies further left than right, by seed: "
                f"{', '.join(digits(value) for value in tilt(e))} (of the labels: {digits(true_tilt(e))}). "
                + why_touches("tape")(e)
            ),
        ),
        claim(
            "latency-order",
            "Times of a prediction rise from linear regression over CNN and LoMP to RNN.",
            "IV-C, Table II",
            "1",
            lambda e: slower(
                {
                    "CNN above linear": time_ratio(e, "cnn", "linear"),
                    "LoMP above CNN": time_ratio(e, "lomp", "cnn"),
                    "RNN above LoMP": time_ratio(e, "rnn", "lomp"),
                }
            ),
            paper_ms("lomp") / paper_ms("cnn"),
            measured=True,
            why=why_latency,
        ),
        claim(
            "latency-lomp-rnn",
            "LoMP, with its GRU of one layer, is faster than the RNN (RNN over LoMP).",
            "IV-C, Table II",
            "1",
            lambda e: slower({"RNN above LoMP": time_ratio(e, "rnn", "lomp")}),
            paper_ms("rnn") / paper_ms("lomp"),
            measured=True,
            why=why_latency,
        ),
    ]
    for one, other in (("lomp", "cnn"), ("lomp", "linear"), ("rnn", "linear"), ("cnn", "linear")):
        printed = paper_ms(one) / paper_ms(other)
        found.append(
            claim(
                f"latency-{one}-{other}",
                f"A prediction of {label[one]} takes {digits(printed)} times as long as one of {label[other]}.",
                "Table II",
                "1",
                partial(
                    lambda e, one, other, printed: number(single_value(time_ratio(e, one, other)), printed),
                    one=one,
                    other=other,
                    printed=printed,
                ),
                printed,
                measured=True,
                printed=True,
                why=why_latency,
            )
        )
    found += [
        claim(
            "latency-absolute",
            "LoMP takes 1.45 ms for a prediction on a GTX 1070.",
            "IV-C, Table II",
            "ms",
            untestable("this GPU is not at hand; times of another device do not compare"),
            paper_ms("lomp"),
            measured=True,
        ),
        claim(
            "learning-taxel",
            "Learning-based models (RBF-Net, RNN) are below the conventional ones on recorded single touches.",
            "IV-C",
            "N",
            lambda e: taxel_all(e, ("rbf", "rnn"), CONVENTIONAL),
            data="recorded",
            why=why_taxel,
        ),
        claim(
            "nonlinear-taxel",
            "The sensor is not linear: polynomial regression is below linear regression on recorded touches.",
            "IV-C",
            "N",
            lambda e: positive(taxel(e, "poly", "linear")),
            data="recorded",
            why=why_taxel,
        ),
        claim(
            "rnn-lowest-taxel",
            "The RNN has the lowest error of all on recorded single touches.",
            "IV-C",
            "N",
            lambda e: taxel_all(e, ("rnn",), [m for m in e.values["velostat_recorded"]["models"] if m != "rnn"]),
            data="recorded",
            why=why_taxel,
        ),
        claim(
            "double-recorded",
            "LoMP has the lowest error of all on recorded double touches.",
            "IV-D",
            "kPa",
            untestable("no recordings of a whole array with several touches are public; the recorded taxel is one"),
            data="recorded",
        ),
    ]
    return found
