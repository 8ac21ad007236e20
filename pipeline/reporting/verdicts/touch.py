"""List the claims of the LoMP paper (touch), on the simulated array and on the recorded taxel."""

from collections.abc import Sequence
from functools import partial

import pandas as pd

from pipeline.reporting.verdicts.rules import (
    CONSTRUCTION,
    NUMBER,
    TOLERANCE,
    Claim,
    Evidence,
    Judge,
    Judgement,
    all_at_most,
    all_of,
    all_positive,
    calibration_claim,
    measured_number,
    near,
    positive,
    printed_claim,
    slower,
    untestable,
    within,
)
from pipeline.reporting.verdicts.touch_measures import (
    CONVENTIONAL,
    GLOBAL,
    LEARNED,
    MODELS,
    MOST,
    PAPERS_SPLIT,
    better,
    growth,
    high_pressure_error,
    press_shift,
    score,
    taxel,
    tilt,
    time_ratio,
    why_double,
    why_high,
    why_latency,
    why_learning,
    why_number,
    why_rnn,
    why_tape,
    why_taxel,
    why_touches,
    why_vgg,
    without_messages,
)
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import number as digits
from pipeline.scoring.published import rmse, time_ms
from pipeline.scoring.results import R2, SHARE

HALF_WAY_MM = 1.5  # to the next of 400 places 3 mm apart: a place that is further off is nearer to another one
REST = tuple(model for model in MODELS if model != "lomp")
claim, printed = partial(Claim, "lomp"), partial(printed_claim, "lomp")
recorded = partial(claim, data="recorded")


def lower(
    key: str, section: str, text: str, ones: Sequence[str], others: Sequence[str], condition: str = "single", why=None
) -> Claim:
    """Return the claim that every one of `ones` has a lower error than every one of `others`."""
    published = min(rmse(model, condition) for model in others) - max(rmse(model, condition) for model in ones)
    return claim(key, section, "kPa", text, all_better(ones, others, condition), published, why=why)


def all_better(ones: Sequence[str], others: Sequence[str], condition: str) -> Judge:
    """Return the judge of: every one of `ones` has a lower error than every one of `others`."""
    pairs = sorted({(one, other) for one in ones for other in others if one != other})
    return lambda e: all_positive({below(a, b): better(e, a, b, condition) for a, b in pairs})


def taxel_better(e: Evidence, ones: Sequence[str], others: Sequence[str]) -> Judgement:
    """Judge that every one of `ones` has a lower error on the taxel than every one of `others`."""
    return all_positive({below(a, b): taxel(e, a, b) for a in ones for b in others})


def below(one: str, other: str) -> str:
    """Return the name of a comparison."""
    return f"{model_name(one)} below {model_name(other)}"


def recognised(condition: str) -> Judge:
    """Return the judge of: LoMP's peaks are the touches in more than half of the windows."""
    return lambda e: positive(score(e, "lomp", condition, "touches_found"), above=MOST, scale=SHARE)


def measured_ratio(one: str, other: str) -> Judge:
    """Return the judge of a printed ratio of two median times."""
    return lambda e: measured_number(time_ratio(e, one, other), time_ms(one) / time_ms(other))


def double_margin(e: Evidence) -> pd.Series:
    """Return the error of the next model on double touch over LoMP's, by seed."""
    next_best = min((score(e, model, "double") for model in REST), key=lambda errors: errors.mean())
    return next_best / score(e, "lomp", "double")


def printed_growth(model: str) -> float:
    """Return the printed error on double touch over that on single touch."""
    return rmse(model, "double") / rmse(model)


# One record per claim: key, section and unit; the sentence; how it is judged, and the rest.
# fmt: off


def rmse_claims() -> list[Claim]:
    """List the numbers of Table I."""
    return [
        printed(f"rmse-{condition}-{model}", "Table I", "kPa",
            f"{model_name(model)} has an error of {digits(rmse(model, condition))} kPa on {condition} touch.",
            partial(score, model=model, condition=condition, protocol=PAPERS_SPLIT), rmse(model, condition),
            strict=partial(score, model=model, condition=condition), why=why_number(model, condition))
        for condition in ("single", "double")
        for model in MODELS
    ]


def single_claims() -> list[Claim]:
    """List what the paper says of single touch beside Table I."""
    return [
        lower("rnn-lowest", "IV-C",
            "The RNN has the lowest error of all on single touch.",
            ["rnn"], [model for model in MODELS if model != "rnn"], why=why_rnn),
        claim("lomp-like-rnn", "IV-C, V", "1",
            "On single touch LoMP performs like the RNN (ratio of errors).",
            lambda e: within(score(e, "lomp") / score(e, "rnn"), TOLERANCE, around=1.0), rmse("lomp") / rmse("rnn"),
            why=why_rnn),
        claim("high-pressure-cnn", "IV-C, Fig. 4", "kPa",
            "At high pressure networks with convolutions (CNN, VGG-16, ConvLSTM) are further off than the RNN.",
            lambda e: all_positive(
                {
                    f"{model_name(m)} above RNN": high_pressure_error(e, m) - high_pressure_error(e, "rnn")
                    for m in ("cnn", "vgg", "convlstm")
                }
            ),
            why=why_high),
        claim("high-pressure-lomp", "IV-C, Fig. 4", "kPa",
            "At high pressure LoMP is further off than the RNN.",
            lambda e: positive(high_pressure_error(e, "lomp") - high_pressure_error(e, "rnn")), why=why_high),
        claim("locations", "IV-C, V", "mm",
            "From 25 elements, learning-based models tell 400 places 3 mm apart (location error).",
            lambda e: all_at_most({model_name(m): score(e, m, metric="location_error") for m in LEARNED}, HALF_WAY_MM),
            why=why_rnn),
        claim("off-centre", "IV-C, Fig. 5", "counts",
            "Off its centre, the same pressure gives a lower reading of an element: the curve shifts to the left.",
            lambda e: positive(press_shift(e), "elements"), kind=CONSTRUCTION),
    ]


def double_claims() -> list[Claim]:
    """List what the paper says of double touch beside Table I."""
    others = [model for model in (*LEARNED, "rbf") if model != "vgg"]
    next_best = min(rmse(model, "double") for model in REST)
    return [
        lower("lomp-best-double", "IV-D, Table I",
            "LoMP, fitted to single touches alone, has the lowest error of all on double touch.",
            ["lomp"], REST, "double", why=why_double),
        printed("lomp-margin-double", "Table I", "1",
            "On double touch the next model has about twice LoMP's error.",
            double_margin, next_best / rmse("lomp", "double"), why=why_double),
        claim("growth-global", "IV-D, Fig. 7", "1",
            "From single to double touch, errors of RNN, CNN, ConvLSTM and VGG-16 grow by more than LoMP's.",
            all_of(GLOBAL, lambda e, m: growth(e, m) - growth(e, "lomp")),
            min(map(printed_growth, GLOBAL)) - printed_growth("lomp"), why=why_double),
        printed("growth-lomp", "Table I", "1",
            "LoMP's error on double touch is 3.45 times that on single touch.",
            partial(growth, model="lomp", protocol=PAPERS_SPLIT), printed_growth("lomp"),
            strict=partial(growth, model="lomp"), why=why_double),
        lower("conventional-double", "IV-D, Table I",
            "Linear and polynomial regression have lower errors on double touch than RNN, CNN, ConvLSTM and VGG-16.",
            ["linear", "poly"], GLOBAL, "double", why=why_double),
        *(
            claim(f"growth-{model}", "IV-D, Table I", "1",
                f"The error of a conventional model about doubles with a second touch: {model_name(model)}.",
                near(partial(growth, model=model), printed_growth(model)), printed_growth(model), why=why_double)
            for model in CONVENTIONAL
        ),
        claim("vgg-overfits", "IV-D", "1",
            "VGG-16 is more overfitted to single touch than other learning models: its error grows most.",
            all_of(others, lambda e, m: growth(e, "vgg") - growth(e, m)),
            printed_growth("vgg") - max(map(printed_growth, others)), why=why_vgg),
        lower("rnn-below-cnn-double", "IV-D, Table I",
            "On double touch the RNN has a lower error than CNN and ConvLSTM.",
            ["rnn"], ["cnn", "convlstm"], "double", why=why_double),
        claim("cnn-two-peaks", "IV-D, Figs. 6, 8a", "1",
            "CNN and ConvLSTM show both touches more often than the RNN, which does not tell them apart.",
            all_of(("cnn", "convlstm"), lambda e, m: both_shown(e, m) - both_shown(e, "rnn"))),
        claim("message-passing", "III-C, VI", "kPa",
            "Message passing between neighbours lowers LoMP's error on one touch and on two (without minus with).",
            lambda e: all_positive({f"{c} touch": without_messages(e, c) for c in ("single", "double")})),
        claim("lomp-two-peaks", "IV-D, Fig. 8a", "1",
            "LoMP shows both touches more often than RNN, CNN, ConvLSTM and VGG-16.",
            all_of(GLOBAL, lambda e, m: both_shown(e, "lomp") - both_shown(e, m))),
    ]


def both_shown(e: Evidence, model: str) -> pd.Series:
    """Return the share of double-touch windows in contact whose peaks are the touches, by seed."""
    return score(e, model, "double", "touches_found")


def demonstration_claims() -> list[Claim]:
    """List what the paper says of the demonstrations, which it shows without numbers."""
    words = {"three": "three simultaneous touches", "slide": "two touches that slide at the same time"}
    return [
        *(
            claim(f"recognised-{condition}", "IV-E, Fig. 8", "1",
                f"LoMP shows {touches}: in more than half of the windows its peaks are the touches (share of windows).",
                recognised(condition), why=why_touches(condition))
            for condition, touches in words.items()
        ),
        claim("recognised-tape", "IV-E, Fig. 8d", "1",
            "LoMP shows the pattern of a rolled tape: it explains more than half of the variance (R2).",
            lambda e: positive(score(e, "lomp", "tape", "r2"), above=MOST, scale=R2), why=why_touches("tape")),
        claim("tape-tilt", "IV-E, Fig. 8d", "1",
            "LoMP's map of the tape is tilted to the side that is pressed harder, the left.",
            lambda e: positive(tilt(e)), why=why_tape),
    ]


def latency_claims() -> list[Claim]:
    """List what the paper says of times."""
    return [
        claim("latency-order", "IV-C, Table II", "1",
            "Times of a prediction rise from linear regression over CNN and LoMP to RNN.",
            lambda e: slower(
                {
                    "CNN above linear": time_ratio(e, "cnn", "linear"),
                    "LoMP above CNN": time_ratio(e, "lomp", "cnn"),
                    "RNN above LoMP": time_ratio(e, "rnn", "lomp"),
                }
            ),
            time_ms("lomp") / time_ms("cnn"), measured=True, why=why_latency),
        claim("latency-lomp-rnn", "IV-C, Table II", "1",
            "LoMP, with its GRU of one layer, is faster than the RNN (RNN over LoMP).",
            lambda e: slower({"RNN above LoMP": time_ratio(e, "rnn", "lomp")}), time_ms("rnn") / time_ms("lomp"),
            measured=True, why=why_latency),
        *(
            claim(f"latency-{one}-{other}", "Table II", "1",
                f"A prediction of {model_name(one)} takes {digits(time_ms(one) / time_ms(other))} times as long as one "
                f"of {model_name(other)}.",
                measured_ratio(one, other), time_ms(one) / time_ms(other), kind=NUMBER, measured=True, why=why_latency)
            for one, other in (("lomp", "cnn"), ("lomp", "linear"), ("rnn", "linear"), ("cnn", "linear"))
        ),
        claim("latency-absolute", "IV-C, Table II", "ms",
            "LoMP takes 1.45 ms for a prediction on a GTX 1070.",
            untestable("this GPU is not at hand; times of another device do not compare"), time_ms("lomp"),
            measured=True),
    ]


def recorded_claims() -> list[Claim]:
    """List the claims that the recorded taxel can test, and one that no recording can."""
    return [
        recorded("learning-taxel", "IV-C", "N",
            "Learning-based models (RBF-Net, RNN) are below the conventional ones on recorded single touches.",
            lambda e: taxel_better(e, ("rbf", "rnn"), CONVENTIONAL), why=why_taxel),
        recorded("nonlinear-taxel", "IV-C", "N",
            "The sensor is not linear: polynomial regression is below linear regression on recorded touches.",
            lambda e: positive(taxel(e, "poly", "linear")), why=why_taxel),
        recorded("rnn-lowest-taxel", "IV-C", "N",
            "The RNN has the lowest error of all on recorded single touches.",
            lambda e: taxel_better(e, ["rnn"], [m for m in e.values["velostat_recorded"]["models"] if m != "rnn"]),
            why=why_taxel),
        recorded("double-recorded", "IV-D", "kPa",
            "LoMP has the lowest error of all on recorded double touches.",
            untestable("no recordings of a whole array with several touches are public; the recorded taxel is one")),
    ]


def claims() -> list[Claim]:
    """List every claim that is looked at, in the order of the paper."""
    return [
        lower("learning-single", "IV-C, Table I",
            "On single touch every learning-based model is below every conventional one.",
            LEARNED, CONVENTIONAL, why=why_learning),
        lower("lomp-conventional-single", "IV-C, Table I",
            "On single touch LoMP is below every conventional model.",
            ["lomp"], CONVENTIONAL),
        lower("rbf-single", "IV-C, Table I",
            "RBF-Net cannot follow single touches as the deep networks do: all of them are below it.",
            LEARNED, ["rbf"], why=why_learning),
        claim("nonlinear-single", "IV-C, Table I", "kPa",
            "The sensor is not linear: polynomial regression is below linear regression on single touch.",
            lambda e: positive(better(e, "poly", "linear")), rmse("linear") - rmse("poly"), kind=CONSTRUCTION),
        *rmse_claims(),
        calibration_claim("lomp", "Table I",
            "On single touch the error of RBF-Net is 0.58 times that of linear regression.",
            rmse("rbf") / rmse("linear")),
        *single_claims(),
        *double_claims(),
        *demonstration_claims(),
        *latency_claims(),
        *recorded_claims(),
    ]
