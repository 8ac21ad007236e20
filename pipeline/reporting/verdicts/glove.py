"""List the claims of the SP-ResNet paper (glove), on the simulated glove and on recorded grasps."""

from decimal import Decimal
from functools import partial
from itertools import chain

import numpy as np
import pandas as pd

from pipeline.datasets.images import MODALITIES
from pipeline.reporting.verdicts.glove_measures import (
    MODELS,
    NAMED_PAIRS,
    PAPERS_SPLIT,
    above,
    by_frames,
    find_pair,
    fusion,
    gain,
    printed_attention,
    printed_ratio,
    published_fusion,
    score,
    why_attention,
    why_augmentation,
    why_cost,
    why_counts,
    why_frames,
    why_fusion,
    why_number,
    why_order,
    why_pair,
    why_recorded,
)
from pipeline.reporting.verdicts.rules import (
    CONTRADICTED,
    COUNT,
    REPRODUCED,
    Claim,
    Evidence,
    Judge,
    Judgement,
    NotTestable,
    all_of,
    all_positive,
    at_most,
    calibration_claim,
    count,
    ordered,
    positive,
    printed_claim,
    untestable,
    within,
)
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import number as digits
from pipeline.reporting.words.markdown import size
from pipeline.scoring.glove_results import (
    BASELINES,
    COMPARED,
    FORMS,
    MOST_CONFUSED,
    NETWORKS,
    like_with_like,
    pair_shares,
    ranked_pairs,
)
from pipeline.scoring.published import counts, precision, precision_gain

SMALLEST_GAIN = 0.5  # points: less is no improvement; about what the paper calls one (0.47 for its attention)
HALF_A_PLACE = 0.5
ALL_NETWORKS = (*NETWORKS, "sp_resnet_nogcam")
claim, printed = partial(Claim, "sp_resnet"), partial(printed_claim, "sp_resnet")


def order(dataset: str) -> Judge:
    """Return the judge of: pairs of models are in the paper's order."""
    models = sorted(MODELS, key=lambda model: -precision(model, dataset))
    pairs = [(a, b) for k, a in enumerate(models) for b in models[k + 1 :]]

    def judge(e: Evidence) -> Judgement:
        gaps = {f"{model_name(a)} above {model_name(b)}": above(e, a, b, dataset) for a, b in pairs}
        return ordered(gaps)

    return judge


def second_best(experiment: str) -> Judge:
    """Return the judge of: SP-ResNet's place among the networks is nearer to the second than to another."""

    def judge(e: Evidence) -> Judgement:
        over = pd.DataFrame({m: above(e, m, "sp_resnet", "combined", experiment) for m in NETWORKS if m != "sp_resnet"})
        places, better = 1.0 + (over.dropna() > 0).sum(axis=1), [m for m in over if over[m].mean() > 0]
        reason = f"above it by their means: {', '.join(map(model_name, better)) or 'none'}"
        if len(places) > 1 and places.nunique() == 1:
            verdict = REPRODUCED if places.iloc[0] == 2 else CONTRADICTED
            return Judgement(places.iloc[0], np.nan, np.nan, verdict, f"in every run; {reason}", f"{len(places)} seeds")
        return within(places, HALF_A_PLACE, around=2.0)._replace(reason=reason)

    return judge


def cheapest(column: str) -> Judge:
    """Return the judge of: SP-ResNet has the fewest of the networks; ours: its count over the next lowest."""

    def judge(e: Evidence) -> Judgement:
        costs = like_with_like(e.counts()).loc[list(NETWORKS), column].astype(float)
        ratio = costs["sp_resnet"] / costs.drop("sp_resnet").min()
        listed = ", ".join(f"{model_name(model)} {size(value)}" for model, value in costs.items())
        return count(ratio, np.nan, equal=bool(ratio < 1))._replace(reason=listed)

    return judge


def counted(model: str, column: str) -> Judge:
    """Return the judge of a count, at the shape that the paper's numbers are of, against the printed one."""
    value, unit = counts()[model, column]

    def judge(e: Evidence) -> Judgement:
        rows = e.counts()
        rows = rows[(rows["model"] == model) & rows["published_macs"].notna()]
        if not len(rows):
            raise NotTestable(f"{model_name(model)} was not counted")
        ours = int(rows.iloc[0][column])
        return count(ours, float(value * unit), equal=(Decimal(ours) / unit).quantize(value) == value)

    return judge


def above_baselines(dataset: str, experiment: str) -> Judge:
    """Return the judge of: every network is above both baselines."""
    return lambda e: all_positive(
        {
            f"{model_name(m)} above {model_name(b)}": above(e, m, b, dataset, experiment)
            for m in NETWORKS
            for b in BASELINES
        }
    )


def attention(dataset: str, experiment: str) -> Judge:
    """Return the judge of: SP-ResNet is above itself without attention."""
    return lambda e: positive(above(e, "sp_resnet", "sp_resnet_nogcam", dataset, experiment))


def helps(method: str, dataset: str) -> Judge:
    """Return the judge of: an augmentation method gains something."""
    return lambda e: positive(gain(e, method, dataset))


def does_not_help(method: str, dataset: str) -> Judge:
    """Return the judge of: an augmentation method gains less than SMALLEST_GAIN."""
    return lambda e: at_most(gain(e, method, dataset), SMALLEST_GAIN)


def confused(dataset: str, names: tuple[str, str]) -> Judge:
    """Return the judge of: two objects are confused more than an average pair, and are one of the most confused."""

    def judge(e: Evidence) -> Judgement:
        runs, place = find_pair(e, dataset, names)
        upper = np.triu_indices(runs.shape[1], 1)
        judged = positive(pd.Series([pair_shares(run)[place] - pair_shares(run)[upper].mean() for run in runs]))
        rank = ranked_pairs(runs.sum(axis=0)).index(place) + 1
        words = f"rank {rank} of {len(upper[0])} pairs"
        if judged.verdict == REPRODUCED and rank > MOST_CONFUSED:
            return judged._replace(verdict=CONTRADICTED, reason=words)
        return judged._replace(reason="; ".join(filter(None, [judged.reason, words])))

    return judge


def resolved(dataset: str, names: tuple[str, str]) -> Judge:
    """Return the judge of: combined images confuse two objects less than those of one dataset do."""

    def judge(e: Evidence) -> Judgement:
        (alone, place), (both, _) = find_pair(e, dataset, names), find_pair(e, "combined", names)
        shares = [pair_shares(a)[place] - pair_shares(b)[place] for a, b in zip(alone, both, strict=True)]
        return positive(pd.Series(shares))

    return judge


def more_frames(source: str, model: str) -> Judge:
    """Return the judge of: precision with the most frames is above that with one."""

    def judge(e: Evidence) -> Judgement:
        form, precisions = by_frames(e, source)
        numbers = sorted(frames for name, frames in precisions if name == model)
        return with_form(positive(precisions[model, numbers[-1]] - precisions[model, numbers[0]]), form)

    return judge


def always_above(source: str) -> Judge:
    """Return the judge of: SP-ResNet is above ResNet_3x3 at every number of frames."""

    def judge(e: Evidence) -> Judgement:
        form, precisions = by_frames(e, source)
        numbers = sorted({frames for _, frames in precisions})
        gaps = {
            f"{n} frame{'s' if n > 1 else ''}": precisions["sp_resnet", n] - precisions["resnet3x3", n] for n in numbers
        }
        return with_form(all_positive(gaps), form)

    return judge


def with_form(judged: Judgement, form: str) -> Judgement:
    """Return the judgement with the form of answer to several frames that it is of."""
    return judged._replace(reason="; ".join(filter(None, [judged.reason, FORMS[form]])))


# One record per claim: key, section and unit; the sentence; how it is judged, and the rest.
# fmt: off


def fusion_claims(experiment: str, bending: str, end: str, why, **more) -> list[Claim]:
    """List the claims on two kinds of touch; bending: the second kind in words; end: of the keys."""
    return [
        claim(f"fusion{end}", "Abstract, 3.2", "points",
            f"Pressure and {bending} together are recognised better than either alone (SP-ResNet).",
            lambda e: positive(fusion(e, "sp_resnet", experiment)), published_fusion("sp_resnet"), why=why, **more),
        printed(f"fusion-number{end}", "Abstract, 3.2", "points",
            "Together they gain 4.33 points over the better of the two (SP-ResNet).",
            partial(fusion, model="sp_resnet", experiment=experiment), published_fusion("sp_resnet"), why=why, **more),
        claim(f"fusion-networks{end}", "Table 1", "points",
            "Every network gains by having both.",
            all_of(ALL_NETWORKS, lambda e, model: fusion(e, model, experiment)),
            min(map(published_fusion, ALL_NETWORKS)), why=why, **more),
    ]


def pressure_claim(experiment: str, bending: str, end: str, **more) -> Claim:
    """Return the claim that pressure tells more than the joints."""
    return claim(f"pressure-above-strain{end}", "3.2", "points",
        f"Palm pressure alone is recognised better than {bending} alone (SP-ResNet).",
        lambda e: positive(score(e, "sp_resnet", "pressure", experiment) - score(e, "sp_resnet", "strain", experiment)),
        precision("sp_resnet", "pressure") - precision("sp_resnet", "strain"), **more)


def second_best_claim(experiment: str, end: str, **more) -> Claim:
    """Return the claim on SP-ResNet's place."""
    return claim(f"second-best{end}", "3.3, Table 1", "1",
        "SP-ResNet is the second best of the networks, combined (its place).",
        second_best(experiment), 2.0, why=why_order("combined", experiment), **more)


def baseline_claim(experiment: str, dataset: str, end: str, **more) -> Claim:
    """Return the claim that every network is above both baselines on a dataset."""
    return claim(f"networks-above-baselines{end}-{dataset}", "Table 1", "points",
        f"Every network is above Naive Bayes and the decision tree, {dataset}.",
        above_baselines(dataset, experiment),
        min(precision(m, dataset) for m in NETWORKS) - max(precision(b, dataset) for b in BASELINES),
        why=why_order(dataset, experiment), **more)


def attention_claim(experiment: str, dataset: str, end: str, **more) -> Claim:
    """Return the claim that the attention helps on a dataset."""
    return claim(f"attention{end}-{dataset}", "3.3, Table 1", "points",
        f"The attention (GCAM) helps SP-ResNet, {dataset}.",
        attention(dataset, experiment), printed_attention(dataset), why=why_attention(dataset, experiment), **more)


def precision_claims() -> list[Claim]:
    """List the numbers of Table 1."""
    return [
        printed(f"precision-{dataset}-{model}", "3.2, Table 1" if model == "sp_resnet" else "Table 1", "%",
            f"{model_name(model)} has a precision of {digits(precision(model, dataset))} %, {dataset}.",
            partial(score, model=model, dataset=dataset, split=PAPERS_SPLIT), precision(model, dataset), best=100.0,
            strict=partial(score, model=model, dataset=dataset), why=why_number(model, dataset))
        for dataset in MODALITIES
        for model in MODELS
    ]


def cost_claims() -> list[Claim]:
    """List the claims that SP-ResNet costs least."""
    return [
        claim(f"fewest-{column}", "3.3, Table 1", "1",
            f"SP-ResNet costs least: the fewest {words} of the networks (over the next lowest).",
            cheapest(column), printed_ratio(column), kind=COUNT, why=why_cost)
        for column, words in (("macs", "multiply-accumulates"), ("params", "parameters"))
    ]


def dataset_claims(dataset: str) -> list[Claim]:
    """List what the paper concludes from its tables for one dataset."""
    words = {"A": "Flips (A) alone help", "C": "Moves, turns and scales (C) alone help"}
    words["all"] = "All augmentations together help"
    return [
        claim(f"order-{dataset}", "Table 1", "points",
            f"The seven models come in the order of Table 1, {dataset}.",
            order(dataset), why=why_order(dataset)),
        baseline_claim("glove", dataset, ""),
        attention_claim("glove", dataset, ""),
        *(
            claim(f"augmentation-{method}-{dataset}", "3.3, Table 2", "points",
                f"{help_of}, {dataset}.",
                helps(method, dataset), precision_gain(method, dataset), why=why_augmentation(dataset))
            for method, help_of in words.items()
        ),
        claim(f"augmentation-B-{dataset}", "3.3, Table 2", "points",
            f"Noise (B) alone does not help (a gain below {SMALLEST_GAIN} points), {dataset}.",
            does_not_help("B", dataset), precision_gain("B", dataset), why=why_augmentation(dataset)),
    ]


def count_claims() -> list[Claim]:
    """List the counts of Table 1."""
    words = {"macs": "multiply-accumulates", "params": "parameters"}
    return [
        claim(f"{column}-{model}", "3.3, Table 1", "count",
            f"{model_name(model)} has {float(value * unit):,.0f} {words[column]}.",
            counted(model, column), float(value * unit), kind=COUNT, why=why_counts(model))
        for (model, column), (value, unit) in counts().items()
    ]


def pair_claims(dataset: str, names: tuple[str, str]) -> list[Claim]:
    """List the claims on two objects that the paper says one dataset cannot tell apart."""
    words = " and ".join(name.replace("_", " ") for name in names)
    return [
        claim(f"confused-{dataset}-{'-'.join(names)}", "3.2, Fig. 14", "points",
            f"From {dataset} alone {words} are confused: above an average pair, and among the worst three.",
            confused(dataset, names), why=why_pair(dataset, names)),
        claim(f"resolved-{dataset}-{'-'.join(names)}", "3.2, Fig. 14", "points",
            f"Both together make up for it: {words} are confused less than from {dataset} alone.",
            resolved(dataset, names), why=why_pair(dataset, names)),
    ]


def frames_claims(source: str) -> list[Claim]:
    """List the claims on the number of input frames; source: a dataset of the glove, or stag."""
    where = "STAG data set" if source == "stag" else f"simulated glove, {source}"
    data = "recorded" if source == "stag" else "simulated"
    return [
        claim(f"above-resnet3x3-{source}", "3.3, Fig. 15", "points",
            f"SP-ResNet is above ResNet_3x3 at every number of input frames, {where}.",
            always_above(source), data=data, why=why_frames(source)),
        *(
            claim(f"more-frames-{model}-{source}", "3.3, Fig. 15", "points",
                f"More input frames help {model_name(model)}, {where}.",
                more_frames(source, model), data=data, why=why_frames(source))
            for model in COMPARED
        ),
    ]


def hardware_claims() -> list[Claim]:
    """List the claims about the glove itself."""
    words = {
        "pressure": ("A pressure unit repeats its reading over some 600 cycles of 0 to 1 N in 1000 s.", 8),
        "bending": ("A joint's strain sensor repeats its reading over some 300 bends of 0 to 90 degrees in 500 s.", 9),
    }
    why = "it is about the glove itself, which is not at hand; the scene's laws have no fatigue that could disprove it"
    hardware = untestable(why)
    return [
        claim(f"repeatable-{kind}", f"1.4, Fig. {figure}", "1", text, hardware, data="recorded")
        for kind, (text, figure) in words.items()
    ]


def claims() -> list[Claim]:
    """List every claim that is looked at, in the order of the paper."""
    recorded = {"data": "recorded"}
    of_recordings = ("glove_recorded", "joint angles", "-recorded")
    return [
        *fusion_claims("glove", "joint bending", "", why_fusion),
        pressure_claim("glove", "joint bending", ""),
        *precision_claims(),
        calibration_claim("sp_resnet", "Table 1",
            "Combined, the decision tree has 0.39 times the errors of Naive Bayes.",
            (100 - precision("tree", "combined")) / (100 - precision("naive_bayes", "combined"))),
        second_best_claim("glove", ""),
        *cost_claims(),
        *chain.from_iterable(map(dataset_claims, MODALITIES)),
        *count_claims(),
        *chain.from_iterable(pair_claims(dataset, pair) for dataset, pairs in NAMED_PAIRS.items() for pair in pairs),
        *chain.from_iterable(map(frames_claims, ("stag", "combined", "pressure"))),
        *hardware_claims(),
        *fusion_claims(*of_recordings, why_recorded, **recorded),
        pressure_claim(*of_recordings, why=why_recorded, **recorded),
        second_best_claim("glove_recorded", "-recorded", **recorded),
        *(
            make("glove_recorded", dataset, "-recorded", **recorded)
            for dataset in MODALITIES
            for make in (baseline_claim, attention_claim)
        ),
    ]
