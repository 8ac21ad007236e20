"""The claims of the SP-ResNet paper (glove), on the simulated glove and on recorded grasps."""

from collections.abc import Mapping
from decimal import Decimal
from functools import partial

import numpy as np
import pandas as pd

from pipeline.datasets.images import MODALITIES, classes
from pipeline.reporting.glove import (
    METHODS,
    NETWORKS,
    PRINTED,
    like_with_like,
    main_protocols,
    published,
    read_confusions,
    scores_by_frames,
)
from pipeline.reporting.glove_findings import (
    BASELINES,
    MOST_CONFUSED,
    NAMED_PAIRS,
    pair_shares,
    published_fusion,
    ranked_pairs,
)
from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import interval as shown
from pipeline.reporting.markdown import number as digits
from pipeline.reporting.markdown import size
from pipeline.reporting.verdicts.rules import (
    REPRODUCED,
    Claim,
    Evidence,
    Judgement,
    NotTestable,
    all_positive,
    at_most,
    count,
    each,
    interval,
    number,
    positive,
    untestable,
)
from pipeline.scoring.results import PUBLISHED, estimate

SINGLE = ("pressure", "strain")
# Precision as in the report of the simulated glove, accuracy as in that of the recorded grasps.
METRIC = {"glove": "macro_precision", "glove_recorded": "accuracy"}
SMALLEST_GAIN = 0.5  # points: less is no improvement; about what the paper calls one (0.47 for its attention)
claim = partial(Claim, "sp_resnet")


def score(e: Evidence, model: str, dataset: str, experiment: str = "glove") -> pd.Series:
    """Seed -> score in % on the main split."""
    protocol = main_protocols(e.values[experiment])[dataset]
    return 100 * e.runs(experiment, protocol, dataset, model, METRIC[experiment])


def above(e: Evidence, one: str, other: str, dataset: str, experiment: str = "glove") -> pd.Series:
    """How far `one` is above `other` in points, by seed."""
    return score(e, one, dataset, experiment) - score(e, other, dataset, experiment)


def attention(e: Evidence, dataset: str, experiment: str = "glove") -> Judgement:
    """SP-ResNet is above itself without attention."""
    return positive(above(e, "sp_resnet", "sp_resnet_nogcam", dataset, experiment))


def fusion(e: Evidence, model: str, experiment: str = "glove") -> pd.Series:
    """What the combined images add to the better single ones, in points, by seed."""
    single = {dataset: score(e, model, dataset, experiment) for dataset in SINGLE}
    best = max(single, key=lambda dataset: single[dataset].mean())
    return score(e, model, "combined", experiment) - single[best]


def order(e: Evidence, dataset: str, experiment: str = "glove") -> Judgement:
    """Every pair of models in the paper's order."""
    paper = published()
    models = sorted(PRINTED, key=lambda model: -paper[model, dataset])
    pairs = [(a, b) for k, a in enumerate(models) for b in models[k + 1 :]]
    named = {f"{model_name(a)} above {model_name(b)}": above(e, a, b, dataset, experiment) for a, b in pairs}
    found = all_positive(named)
    if found.verdict == REPRODUCED:
        return found
    same = sum(own.mean() > 0 for own in named.values())
    certain = sum(interval(own).low > 0 for own in named.values())
    reason = f"{same} of {len(pairs)} pairs of models are in the paper's order by their means, {certain} for certain"
    return found._replace(reason=reason)


def second_best(e: Evidence, experiment: str = "glove") -> Judgement:
    """One network certainly above SP-ResNet, the others certainly below it."""
    over = {m: above(e, m, "sp_resnet", "combined", experiment) for m in NETWORKS if m != "sp_resnet"}
    best = max(over, key=lambda model: over[model].mean())
    label = {model: model_name(model) for model in over}
    named = {f"{label[best]} above SP-ResNet": over[best]}
    named |= {f"SP-ResNet above {label[m]}": -own for m, own in over.items() if m != best}
    return all_positive(named)


def cheapest(e: Evidence, column: str) -> Judgement:
    """SP-ResNet has the fewest of the networks; ours: its count over that of the cheapest other one."""
    own = like_with_like(e.counts()).loc[list(NETWORKS), column].astype(float)
    others = own.drop("sp_resnet")
    ratio = own["sp_resnet"] / others.min()
    found = count(ratio, np.nan, equal=bool(ratio < 1))
    each = ", ".join(f"{model_name(model)} {size(value)}" for model, value in own.items())
    return found._replace(reason=each)


def printed_counts() -> dict[tuple[str, str], tuple[Decimal, int]]:
    """(model, macs or params) -> the count as printed in Table 1, and its unit."""
    table = pd.read_csv(PUBLISHED, dtype=str)
    table = table[table["paper"] == "sp_resnet"].set_index(["model", "metric"])
    keys = {"multiply-accumulates": "macs", "parameters": "params"}
    return {
        (model, key): (Decimal(row["value"]), int(float(row["unit"])))
        for model, printed in PRINTED.items()
        for metric, key in keys.items()
        if (printed, metric) in table.index
        for row in [table.loc[(printed, metric)]]
    }


def printed_ratio(column: str) -> float:
    """SP-ResNet's count over that of the cheapest other network, as printed."""
    found = {model: float(value * unit) for (model, name), (value, unit) in printed_counts().items() if name == column}
    return found["sp_resnet"] / min(found[model] for model in NETWORKS if model != "sp_resnet")


def counted(e: Evidence, model: str, column: str) -> Judgement:
    """A count at the shape that the paper's numbers are of, against the printed one."""
    rows = e.counts()
    rows = rows[(rows["model"] == model) & rows["published_macs"].notna()]
    if not len(rows):
        raise NotTestable(f"{model_name(model)} was not counted")
    printed, unit = printed_counts()[model, column]
    ours = int(rows.iloc[0][column])
    equal = (Decimal(ours) / unit).quantize(printed) == printed
    return count(ours, float(printed * unit), equal=equal)


def gain(e: Evidence, method: str, dataset: str) -> pd.Series:
    """What an augmentation method adds to training without any, in points, by seed."""
    return e.augmentation(method, dataset) - e.augmentation("none", dataset)


def helps(e: Evidence, method: str, dataset: str) -> Judgement:
    """An augmentation method gains something."""
    return positive(gain(e, method, dataset))


def confusions(e: Evidence) -> tuple[dict[str, np.ndarray], list[str]]:
    """(dataset -> (runs, classes, classes) images named by SP-ResNet, names of the classes)."""
    e.require("glove", "sp_resnet")

    def read():
        models = dict.fromkeys(MODALITIES, "sp_resnet")
        return read_confusions("glove", e.values["glove"], e.table("glove"), models), classes(e.table("glove"))

    return e.once(("confusions",), read)


def pair(e: Evidence, dataset: str, names: tuple[str, str]) -> tuple[np.ndarray, tuple[int, int]]:
    """Confusions of a dataset, and the places of two objects. NotTestable where one is missing or a run failed."""
    counts, objects = confusions(e)
    if absent := [name for name in names if name not in objects]:
        raise NotTestable(f"there is no object {', '.join(absent)}")
    score(e, "sp_resnet", dataset)
    return counts[dataset], tuple(sorted(objects.index(name) for name in names))


def confused(e: Evidence, dataset: str, names: tuple[str, str]) -> Judgement:
    """Two objects are given each other's name more than an average pair, and as one of the most confused pairs."""
    counts, place = pair(e, dataset, names)
    upper = np.triu_indices(counts.shape[1], 1)
    excess = pd.Series([pair_shares(run)[place] - pair_shares(run)[upper].mean() for run in counts])
    found = positive(excess)
    rank = ranked_pairs(counts.sum(axis=0)).index(place) + 1
    said = f"rank {rank} of {len(upper[0])} pairs"
    if found.verdict == REPRODUCED and rank > MOST_CONFUSED:
        return found._replace(verdict="not reproduced", reason=f"contradicted: {said}")
    return found._replace(reason="; ".join(filter(None, [found.reason, said])))


def resolved(e: Evidence, dataset: str, names: tuple[str, str]) -> Judgement:
    """Combined images confuse two objects less than those of one dataset do."""
    alone, place = pair(e, dataset, names)
    both, _ = pair(e, "combined", names)
    return positive(
        pd.Series([pair_shares(a)[place] - pair_shares(b)[place] for a, b in zip(alone, both, strict=True)])
    )


def by_frames(e: Evidence, source: str) -> Mapping[tuple[str, int], pd.Series]:
    """(model, frames) -> macro precision in % by seed; source: a dataset of the glove, or stag."""

    def read() -> pd.DataFrame:
        if source == "stag":
            return e.stag()
        models = [model for model in ("sp_resnet", "resnet3x3") if model in e.values["glove"]["models"]]
        return scores_by_frames(e.table("glove"), main_protocols(e.values["glove"])[source], e.values["glove"], models)

    e.require("glove", "sp_resnet", "resnet3x3")
    rows = e.once(("frames", source), read)
    if not len(rows):
        raise NotTestable("the STAG data set is not here: no file of it is named (glove.stag.file of params.yaml)")
    rows = rows[rows["metric"] == "macro_precision"]
    if rows["value"].isna().any():
        raise NotTestable(f"failed runs: {rows['value'].isna().sum()} scores by number of frames")
    return {key: 100 * own.set_index("seed")["value"] for key, own in rows.groupby(["model", "frames"])}


def more_frames(e: Evidence, source: str, model: str) -> Judgement:
    """Precision with the most frames above that with one."""
    found = by_frames(e, source)
    numbers = sorted(frames for name, frames in found if name == model)
    return positive(found[model, numbers[-1]] - found[model, numbers[0]])


def always_above(e: Evidence, source: str) -> Judgement:
    """SP-ResNet above ResNet_3x3 at every number of frames."""
    found = by_frames(e, source)
    numbers = sorted({frames for _, frames in found})
    return all_positive(
        {f"{n} frame{'s' if n > 1 else ''}": found["sp_resnet", n] - found["resnet3x3", n] for n in numbers}
    )


# What was tried where a claim is not reproduced.


def by_seed(e: Evidence, model: str, dataset: str, experiment: str = "glove") -> str:
    """The score of each seed."""
    return ", ".join(digits(value, 1) for value in score(e, model, dataset, experiment))


def training(e: Evidence, experiment: str = "glove") -> str:
    """What differs between the seeds, and how long the networks are trained."""
    settings, protocols = e.values[experiment], main_protocols(e.values[experiment])
    epochs = settings["models"]["sp_resnet"]["training"]["max_epochs"]
    fits = [fit for protocol in protocols.values() for fit in e.fits(experiment, "sp_resnet", protocol)]
    last = sum(fit.best_epoch == fit.epochs for fit in fits)
    return (
        f"Each of the {len(settings['protocols'][protocols['combined']]['seeds'])} seeds has other test grasps and "
        f"another start. Training takes {epochs} epochs here, 50 in the paper; for SP-ResNet, the last epoch was the "
        f"best in {last} of {len(fits)} runs."
    )


def lookalikes(e: Evidence, dataset: str) -> str:
    """Which objects SP-ResNet's wrong answers are about."""
    counts, objects = confusions(e)
    score(e, "sp_resnet", dataset)
    total = counts[dataset].sum(axis=0)
    alike = sorted({place for two in ranked_pairs(total)[:MOST_CONFUSED] for place in two})
    wrong = total - np.diag(np.diag(total))
    if not wrong.sum():
        return ""
    share = wrong[np.ix_(alike, alike)].sum() / wrong.sum()
    return (
        f"Of SP-ResNet's wrong answers, {dataset}, {100 * share:.0f} % confuse {', '.join(objects[k] for k in alike)} "
        "with each other. "
    )


def on_random_frames(e: Evidence, model: str, dataset: str) -> float:
    """The score (%) where frames of a grasp are on both sides."""
    return float(100 * e.runs("glove", f"random_frames_{dataset}", dataset, model, METRIC["glove"]).mean())


def why_number(model: str, dataset: str):
    """Paragraph on one number of Table 1."""

    def why(e: Evidence) -> str:
        text = (
            f"By seed {by_seed(e, model, dataset)} %; on frames split at random, as the paper seems to have split, "
            f"{digits(on_random_frames(e, model, dataset), 1)} %. "
        )
        if dataset == "strain":
            text += (
                f"All models are below their printed numbers on joint images: "
                f"{each(PRINTED, lambda m: digits(score(e, m, dataset).mean() - published()[m, dataset], 0))} points. "
                "An image holds one number a joint; how far these give an object away depends on how closely fingers "
                "follow it and how much a grasp varies, for which the paper has no data. "
            )
        if "training" in e.values["glove"]["models"][model]:
            return text + lookalikes(e, dataset) + training(e)
        chosen = e.values["glove"]["yardstick"]
        return text + (
            f"The scene's difficulty was set by {model_name(chosen['model'])}, {chosen['condition']}, on frames split "
            "at random; it is fitted in closed form, so training has no part in it."
        )

    return why


def why_fusion(e: Evidence) -> str:
    """Fusion by seed, and on random frames."""
    parts = [f"{d} {by_seed(e, 'sp_resnet', d)}" for d in MODALITIES]
    random = {d: on_random_frames(e, "sp_resnet", d) for d in MODALITIES}
    others = each((m for m in PRINTED if m != "sp_resnet"), lambda m: shown(estimate(fusion(e, m))))
    return (
        f"SP-ResNet by seed (%): {'; '.join(parts)}; without its attention, on the same combined images, "
        f"{by_seed(e, 'sp_resnet_nogcam', 'combined')}. On frames split at random the gain is "
        f"{digits(random['combined'] - max(random[d] for d in SINGLE))} points. Gain of the other models (points): "
        f"{others}. {''.join(lookalikes(e, d) for d in MODALITIES)}Joint images alone name "
        f"{digits(score(e, 'sp_resnet', 'strain').mean(), 1)} % here, in the paper "
        f"{digits(published()['sp_resnet', 'strain'], 1)} %. In a combined image both kinds share one scale (equation "
        f"6); whether separate ones help was not tried. {training(e)}"
    )


def why_order(dataset: str, experiment: str = "glove"):
    """Paragraph on the order of the models."""

    def why(e: Evidence) -> str:
        found = {model: estimate(score(e, model, dataset, experiment)) for model in PRINTED}
        ranked = sorted(found, key=lambda model: -found[model].mean)
        half = np.mean([one.high - one.low for one in found.values()]) / 2
        printed = [published()[model, dataset] for model in (*NETWORKS, "sp_resnet_nogcam")]
        return (
            f"Scores (%): {each(ranked, lambda m: shown(found[m], 1))}. The paper's networks lie within "
            f"{digits(max(printed) - min(printed), 1)} points of each other; our intervals reach {digits(half, 1)} "
            f"points to a side on average. {training(e, experiment)}"
        )

    return why


def why_attention(dataset: str, experiment: str = "glove"):
    """Paragraph on the attention."""

    def why(e: Evidence) -> str:
        spread = above(e, "sp_resnet", "sp_resnet_nogcam", dataset, experiment).std(ddof=1)
        printed = published()["sp_resnet", dataset] - published()["sp_resnet_nogcam", dataset]
        return (
            f"By seed (%): with attention {by_seed(e, 'sp_resnet', dataset, experiment)}; without "
            f"{by_seed(e, 'sp_resnet_nogcam', dataset, experiment)}. The difference spreads by {digits(spread, 1)} "
            f"points (standard deviation); to show one of {digits(printed)} points, about "
            f"{size(np.ceil((1.96 * spread / printed) ** 2))} seeds would be needed. The paper does not say how many "
            f"runs its number is of. {training(e, experiment)}"
        )

    return why


def why_augmentation(dataset: str):
    """Paragraph on augmentation."""

    def why(e: Evidence) -> str:
        parts = [
            f"{printed} {', '.join(digits(value, 1) for value in e.augmentation(method, dataset))}"
            for method, printed in METHODS.items()
        ]
        spread = np.mean([gain(e, method, dataset).std(ddof=1) for method in METHODS if method != "none"])
        gains = [published()[method, dataset] - published()["none", dataset] for method in METHODS if method != "none"]
        return (
            f"By seed (%): {'; '.join(parts)}. Gains spread by {digits(spread, 1)} points between seeds (mean standard "
            f"deviation); the paper's are {digits(min(gains))} to {digits(max(gains))} points, of 10 runs a method, "
            f"without a spread. {training(e)}"
        )

    return why


def why_pair(dataset: str, names: tuple[str, str]):
    """Paragraph on two objects."""

    def why(e: Evidence) -> str:
        objects, parts = confusions(e)[1], []
        for one in (dataset, "combined"):
            counts, place = pair(e, one, names)
            total = counts.sum(axis=0)
            worst = ", ".join(
                f"{objects[i]} and {objects[j]} {digits(pair_shares(total)[i, j], 1)}"
                for i, j in ranked_pairs(total)[:MOST_CONFUSED]
            )
            rates = ", ".join(digits(pair_shares(run)[place], 1) for run in counts)
            parts.append(f"{one}: {rates} % by seed; the most confused: {worst} %")
        reason = (
            "Every image is stretched by its own lowest and highest value (equation 6), here and in the paper, so how "
            "hard the hand presses, hence the weight, is not in it; what is left is where it presses, and that differs "
            "between these two. The objects confused most are of like shape. The paper's photographs give no sizes; "
            "those of the scene are of common things of that name."
            if dataset == "pressure"
            else "Bottles and can are nearly of one width in the scene, so fingers bend alike around all of them, and "
            "which one a network names differs between seeds, whose training sessions differ."
        )
        return f"Images of the two given the other's name, {'; '.join(parts)}. {reason}"

    return why


def why_frames(source: str):
    """Paragraph on the number of frames."""

    def why(e: Evidence) -> str:
        found = by_frames(e, source)
        numbers = sorted({frames for _, frames in found})
        parts = each(("sp_resnet", "resnet3x3"), lambda m: ", ".join(digits(found[m, n].mean(), 1) for n in numbers))
        return (
            f"Macro precision (%) with {numbers[0]} to {numbers[-1]} frames of one grasp, mean over seeds: {parts}. "
            "The mean answer to many frames of a grasp is hardly better than that to one: errors belong to grasps, "
            "not to frames. The paper's figure is of STAG, whose recordings hold many "
            "grasps, and seems to be of networks that see all frames at once; here one network answers to each frame."
        )

    return why


def why_counts(model: str):
    """Paragraph on the counts of one network."""

    def why(e: Evidence) -> str:
        rows = e.counts()
        rows = rows[rows["published_macs"].notna() & (rows["model"] == model)]
        parts = [
            f"{f'{row.note}: ' if isinstance(row.note, str) else ''}{size(row.macs)} and {size(row.params)}"
            for row in rows.itertuples()
        ]
        first = rows.iloc[0]
        return (
            f"Multiply-accumulates and parameters at the paper's shape: {'; '.join(parts)} (paper: "
            f"{size(first['published_macs'])} and {size(first['published_params'])})."
            + (" No reduction of the attention gives both printed numbers." if len(rows) > 1 else "")
        )

    return why


def why_cost(e: Evidence) -> str:
    """Cost like with like."""
    own, printed = like_with_like(e.counts()), printed_counts()
    return (
        f"On the same 32 x 32 images with 16 classes (multiply-accumulates): "
        f"{each(NETWORKS, lambda m: size(own.loc[m, 'macs']))}. The printed ones, "
        f"{each(NETWORKS, lambda m: size(float(printed[m, 'macs'][0] * printed[m, 'macs'][1])))}, are for ResNet-18 "
        "and MobileNet those of 224 x 224 colour images and 1000 classes (reproduced as such)."
    )


def why_recorded(e: Evidence) -> str:
    """Scores on the recorded grasps."""
    parts = [
        f"{d}: {each(PRINTED, lambda m, d=d: shown(estimate(score(e, m, d, 'glove_recorded')), 1))}" for d in MODALITIES
    ]
    gains = each(PRINTED, lambda m: digits(fusion(e, m, "glove_recorded").mean(), 1))
    return (
        f"Accuracy (%), {'; '.join(parts)}. Gain of both over the better one (points): {gains}. Another hand, other "
        f"objects and sensors than the paper's: the size of the gain is theirs. {training(e, 'glove_recorded')}"
    )


def claims() -> list[Claim]:
    """Every claim that is looked at, in the order of the paper."""
    paper, label = published(), {model: model_name(model) for model in PRINTED}
    found = [
        claim(
            "fusion",
            "Pressure and joint bending together are recognised better than either alone (SP-ResNet).",
            "Abstract, 3.2",
            "points",
            lambda e: positive(fusion(e, "sp_resnet")),
            published_fusion("sp_resnet"),
            why=why_fusion,
        ),
        claim(
            "fusion-number",
            "Together they gain 4.33 points over the better of the two (SP-ResNet).",
            "Abstract, 3.2",
            "points",
            lambda e: number(fusion(e, "sp_resnet"), published_fusion("sp_resnet")),
            published_fusion("sp_resnet"),
            printed=True,
            why=why_fusion,
        ),
        claim(
            "fusion-networks",
            "Every network gains by having both.",
            "Table 1",
            "points",
            lambda e: all_positive({label[m]: fusion(e, m) for m in (*NETWORKS, "sp_resnet_nogcam")}),
            min(published_fusion(m) for m in (*NETWORKS, "sp_resnet_nogcam")),
            why=why_fusion,
        ),
        claim(
            "pressure-above-strain",
            "Palm pressure alone is recognised better than joint bending alone (SP-ResNet).",
            "3.2",
            "points",
            lambda e: positive(score(e, "sp_resnet", "pressure") - score(e, "sp_resnet", "strain")),
            paper["sp_resnet", "pressure"] - paper["sp_resnet", "strain"],
        ),
    ]
    for dataset in MODALITIES:
        for model in PRINTED:
            found.append(
                claim(
                    f"precision-{dataset}-{model}",
                    f"{label[model]} has a precision of {digits(paper[model, dataset])} %, {dataset}.",
                    "3.2, Table 1" if model == "sp_resnet" else "Table 1",
                    "%",
                    partial(
                        lambda e, model, dataset: number(score(e, model, dataset), paper[model, dataset]),
                        model=model,
                        dataset=dataset,
                    ),
                    paper[model, dataset],
                    printed=True,
                    why=why_number(model, dataset),
                )
            )
    found += [
        claim(
            "second-best",
            "SP-ResNet is the second best of the networks, combined.",
            "3.3, Table 1",
            "points",
            second_best,
            why=why_order("combined"),
        ),
        claim(
            "fewest-macs",
            "SP-ResNet costs least: the fewest multiply-accumulates of the networks (over the next lowest).",
            "3.3, Table 1",
            "1",
            partial(cheapest, column="macs"),
            printed_ratio("macs"),
            why=why_cost,
        ),
        claim(
            "fewest-params",
            "SP-ResNet costs least: the fewest parameters of the networks (over the next lowest).",
            "3.3, Table 1",
            "1",
            partial(cheapest, column="params"),
            printed_ratio("params"),
            why=why_cost,
        ),
    ]
    for dataset in MODALITIES:
        found += [
            claim(
                f"order-{dataset}",
                f"The seven models come in the order of Table 1, {dataset}.",
                "Table 1",
                "points",
                partial(order, dataset=dataset),
                why=why_order(dataset),
            ),
            claim(
                f"networks-above-baselines-{dataset}",
                f"Every network is above Naive Bayes and the decision tree, {dataset}.",
                "Table 1",
                "points",
                partial(
                    lambda e, dataset: all_positive(
                        {f"{label[m]} above {label[b]}": above(e, m, b, dataset) for m in NETWORKS for b in BASELINES}
                    ),
                    dataset=dataset,
                ),
                min(paper[m, dataset] for m in NETWORKS) - max(paper[b, dataset] for b in BASELINES),
                why=why_order(dataset),
            ),
            claim(
                f"attention-{dataset}",
                f"The attention (GCAM) helps SP-ResNet, {dataset}.",
                "3.3, Table 1",
                "points",
                partial(
                    lambda e, dataset: positive(above(e, "sp_resnet", "sp_resnet_nogcam", dataset)), dataset=dataset
                ),
                paper["sp_resnet", dataset] - paper["sp_resnet_nogcam", dataset],
                why=why_attention(dataset),
            ),
        ]
        for method in ("A", "C", "all"):
            words = {"A": "Flips (A) alone help", "C": "Moves, turns and scales (C) alone help"}
            found.append(
                claim(
                    f"augmentation-{method}-{dataset}",
                    f"{words.get(method, 'All augmentations together help')}, {dataset}.",
                    "3.3, Table 2",
                    "points",
                    partial(
                        lambda e, method, dataset: positive(gain(e, method, dataset)), method=method, dataset=dataset
                    ),
                    paper[method, dataset] - paper["none", dataset],
                    why=why_augmentation(dataset),
                )
            )
        found.append(
            claim(
                f"augmentation-B-{dataset}",
                f"Noise (B) alone does not help (a gain below {SMALLEST_GAIN} points), {dataset}.",
                "3.3, Table 2",
                "points",
                partial(lambda e, dataset: at_most(gain(e, "B", dataset), SMALLEST_GAIN), dataset=dataset),
                paper["B", dataset] - paper["none", dataset],
                why=why_augmentation(dataset),
            )
        )
    for (model, column), (printed, unit) in printed_counts().items():
        words = {"macs": "multiply-accumulates", "params": "parameters"}[column]
        found.append(
            claim(
                f"{column}-{model}",
                f"{label[model]} has {float(printed * unit):,.0f} {words}.",
                "3.3, Table 1",
                "count",
                partial(counted, model=model, column=column),
                float(printed * unit),
                printed=True,
                why=why_counts(model),
            )
        )
    for dataset, pairs in NAMED_PAIRS.items():
        for names in pairs:
            said = " and ".join(name.replace("_", " ") for name in names)
            found += [
                claim(
                    f"confused-{dataset}-{'-'.join(names)}",
                    f"From {dataset} alone {said} are confused: above an average pair, and among the worst three.",
                    "3.2, Fig. 14",
                    "points",
                    partial(confused, dataset=dataset, names=names),
                    why=why_pair(dataset, names),
                ),
                claim(
                    f"resolved-{dataset}-{'-'.join(names)}",
                    f"Both together make up for it: {said} are confused less than from {dataset} alone.",
                    "3.2, Fig. 14",
                    "points",
                    partial(resolved, dataset=dataset, names=names),
                    why=why_pair(dataset, names),
                ),
            ]
    for source in ("stag", "combined", "pressure"):
        where = "STAG data set" if source == "stag" else f"simulated glove, {source}"
        data = "recorded" if source == "stag" else "simulated"
        found.append(
            claim(
                f"above-resnet3x3-{source}",
                f"SP-ResNet is above ResNet_3x3 at every number of input frames, {where}.",
                "3.3, Fig. 15",
                "points",
                partial(always_above, source=source),
                data=data,
                why=why_frames(source),
            )
        )
        for model in ("sp_resnet", "resnet3x3"):
            found.append(
                claim(
                    f"more-frames-{model}-{source}",
                    f"More input frames help {label[model]}, {where}.",
                    "3.3, Fig. 15",
                    "points",
                    partial(more_frames, source=source, model=model),
                    data=data,
                    why=why_frames(source),
                )
            )
    hardware = untestable("it is about the glove itself, which is not at hand")
    found += [
        claim(
            "repeatable-pressure",
            "A pressure unit repeats its reading over some 600 cycles of 0 to 1 N in 1000 s.",
            "1.4, Fig. 8",
            "1",
            hardware,
            data="recorded",
        ),
        claim(
            "repeatable-bending",
            "A joint's strain sensor repeats its reading over some 300 bends of 0 to 90 degrees in 500 s.",
            "1.4, Fig. 9",
            "1",
            hardware,
            data="recorded",
        ),
    ]
    recorded = partial(claim, data="recorded")
    found += [
        recorded(
            "fusion-recorded",
            "Pressure and joint angles together are recognised better than either alone (SP-ResNet).",
            "Abstract, 3.2",
            "points",
            lambda e: positive(fusion(e, "sp_resnet", "glove_recorded")),
            published_fusion("sp_resnet"),
            why=why_recorded,
        ),
        recorded(
            "fusion-number-recorded",
            "Together they gain 4.33 points over the better of the two (SP-ResNet).",
            "Abstract, 3.2",
            "points",
            lambda e: number(fusion(e, "sp_resnet", "glove_recorded"), published_fusion("sp_resnet")),
            published_fusion("sp_resnet"),
            printed=True,
            why=why_recorded,
        ),
        recorded(
            "fusion-networks-recorded",
            "Every network gains by having both.",
            "Table 1",
            "points",
            lambda e: all_positive({label[m]: fusion(e, m, "glove_recorded") for m in (*NETWORKS, "sp_resnet_nogcam")}),
            min(published_fusion(m) for m in (*NETWORKS, "sp_resnet_nogcam")),
            why=why_recorded,
        ),
        recorded(
            "pressure-above-strain-recorded",
            "Palm pressure alone is recognised better than joint angles alone (SP-ResNet).",
            "3.2",
            "points",
            lambda e: positive(
                score(e, "sp_resnet", "pressure", "glove_recorded") - score(e, "sp_resnet", "strain", "glove_recorded")
            ),
            paper["sp_resnet", "pressure"] - paper["sp_resnet", "strain"],
            why=why_recorded,
        ),
        recorded(
            "second-best-recorded",
            "SP-ResNet is the second best of the networks, combined.",
            "3.3, Table 1",
            "points",
            partial(second_best, experiment="glove_recorded"),
            why=why_order("combined", "glove_recorded"),
        ),
    ]
    for dataset in MODALITIES:
        found += [
            recorded(
                f"networks-above-baselines-recorded-{dataset}",
                f"Every network is above Naive Bayes and the decision tree, {dataset}.",
                "Table 1",
                "points",
                partial(
                    lambda e, dataset: all_positive(
                        {
                            f"{label[m]} above {label[b]}": above(e, m, b, dataset, "glove_recorded")
                            for m in NETWORKS
                            for b in BASELINES
                        }
                    ),
                    dataset=dataset,
                ),
                min(paper[m, dataset] for m in NETWORKS) - max(paper[b, dataset] for b in BASELINES),
                why=why_order(dataset, "glove_recorded"),
            ),
            recorded(
                f"attention-recorded-{dataset}",
                f"The attention (GCAM) helps SP-ResNet, {dataset}.",
                "3.3, Table 1",
                "points",
                partial(attention, dataset=dataset, experiment="glove_recorded"),
                paper["sp_resnet", dataset] - paper["sp_resnet_nogcam", dataset],
                why=why_attention(dataset, "glove_recorded"),
            ),
        ]
    return found
