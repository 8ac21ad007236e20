"""What reports/glove/accuracy/README.md says: the claims of the SP-ResNet paper, judged by our numbers."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.datasets.images import MODALITIES
from pipeline.reporting import sentences
from pipeline.reporting.glove import (
    METHODS,
    METRICS,
    NETWORKS,
    PRINTED,
    augmentation_gain,
    gain,
    like_with_like,
    main_protocols,
    published,
    score,
    splits,
)
from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import code, interval, number, size
from pipeline.scoring.results import Estimate, Fit, Scores, estimate

BASELINES = ("naive_bayes", "tree")
RANDOM = "random_frames"
BOTTLES = ("empty_bottle", "full_bottle_1", "full_bottle_2")
NAMED_PAIRS = {  # that the paper says are confused, section 3.2
    "pressure": (("paper_roll", "toy"),),
    "strain": tuple((a, b) for k, a in enumerate(BOTTLES) for b in BOTTLES[k + 1 :]),
}
MOST_CONFUSED = 3  # pairs that are listed; one that the paper names must be among them


def verdict(found: Estimate) -> str:
    """Whether a claim that `found` is above 0 is reproduced: its interval decides."""
    if found.low > 0 and not found.failed:
        return "reproduced"
    return "not reproduced" if found.high < 0 and not found.failed else "undecided"


def points(found: Estimate) -> str:
    """A difference with its interval and unit."""
    return f"{interval(found)} points"


def findings(
    scores: Scores,
    settings: Mapping,
    *,
    counts: pd.DataFrame,
    augmentation: Mapping[tuple[str, str], list[float]],
    confusions: Mapping[str, np.ndarray],
    objects: Sequence[str],
    frames: Mapping[str, pd.DataFrame],
    stag: pd.DataFrame,
    trained: Sequence[Fit],
    differences: Sequence[tuple[str, str]],
) -> str:
    """README.md: verdicts in sentences that are computed from the numbers.

    augmentation: macro precision; confusions: dataset -> (runs, classes, classes) images; objects: names of the
    classes; frames: dataset -> table like `stag`: macro precision by number of input frames.
    """
    protocols, split = main_protocols(settings), next(iter(splits(settings))).replace("_", " ")
    chosen = settings["yardstick"]
    what = f"{chosen['condition']}, {METRICS[chosen['metric']].lower()}, set on the validation part, frames at random"
    lines = [
        "# SP-ResNet (glove): results\n",
        f"Macro precision in % on the test part, split by {split}, mean over seeds [95 % t interval]; differences in "
        "points, paired by seed. A claim is `reproduced` or `not reproduced` where its interval excludes 0, else "
        "`undecided`. [Table 1](table1.md), [Table 2](table2.md), [speed](../speed/table2.md).\n",
        "## Models and datasets\n",
        *best_sentences(scores, settings, protocols),
        *order_sentences(scores, settings, protocols),
        *fusion_sentences(scores, settings, protocols),
        *attention_sentences(scores, settings, protocols),
        *second_best_sentences(scores, settings, protocols["combined"], like_with_like(counts)),
        *baseline_sentences(scores, settings, protocols),
        "\n## Split, scene and training\n",
        *optimism_sentences(scores, settings),
        sentences.yardstick(scores, settings, (f"{RANDOM}_{chosen['condition']}", chosen["condition"]), what, "%"),
        training_sentence(trained),
        "\n## Augmentation and input frames\n",
        *augmentation_sentences(augmentation),
        *frames_sentences(frames),
        *stag_sentences(stag),
        "\n## Confusions\n",
        *pair_sentences(confusions, objects),
        *confused_sentences(confusions, objects),
        "\n## Figures\n",
    ]
    captions = {
        "figure10": "tactile images of one grasp",
        "figure13": "tactile sequences of all objects",
        **{f"figure14_{dataset}": f"confusion matrix, {dataset}" for dataset in confusions},
        **(
            {"figure15": "macro precision against the number of input frames"} if any(map(len, frames.values())) else {}
        ),
        **({"figure15_stag": "the same on the STAG data set"} if len(stag) else {}),
        **({"learning_curves": "validation loss over epochs"} if trained else {}),
    }
    lines += [f"- [{name}.png]({name}.png): {text}" for name, text in captions.items()]
    lines += sentences.differences_section(differences)
    return "\n".join(lines) + "\n"


def ranked(scores: Scores, settings: Mapping, protocol: str, metric: str = "macro_precision") -> dict[str, Estimate]:
    """Models without a failed run, the best first, in percent."""
    found = {model: score(scores, protocol, model, metric) for model in settings["models"]}
    good = [model for model, one in found.items() if one.runs and not one.failed]
    return {model: found[model] for model in sorted(good, key=lambda model: -found[model].mean)}


def best_sentences(scores: Scores, settings: Mapping, protocols: Mapping[str, str]) -> list[str]:
    """Which model is best on each dataset, and which ones a difference paired by seed does not tell from it."""
    lines = []
    for dataset, protocol in protocols.items():
        found = ranked(scores, settings, protocol)
        failed = [model_name(model) for model in settings["models"] if model not in found]
        if failed:
            lines.append(f"- {dataset.capitalize()}: runs failed for {', '.join(failed)}.")
        if not found:
            continue
        best = next(iter(found))
        close = [
            f"{model_name(model)} ({interval(one)})"
            for model, one in found.items()
            if model != best and verdict(gain(scores, (protocol, best), (protocol, model))) != "reproduced"
        ]
        lines.append(
            f"- {dataset.capitalize()}: {model_name(best)} is best with {interval(found[best])} %"
            + (f"; not told apart from it: {', '.join(close)}." if close else ".")
        )
    return lines


def order_sentences(scores: Scores, settings: Mapping, protocols: Mapping[str, str]) -> list[str]:
    """The order of the published models in ours and in the paper."""
    paper, lines = published(), []
    for dataset, protocol in protocols.items():
        found = [model for model in ranked(scores, settings, protocol) if (model, dataset) in paper]
        if len(found) < 2:
            continue
        printed = sorted(found, key=lambda model: -paper[model, dataset])
        pairs = [(a, b) for k, a in enumerate(printed) for b in printed[k + 1 :]]
        same = sum(found.index(a) < found.index(b) for a, b in pairs)
        lines.append(
            f"- Order, {dataset}: {', '.join(model_name(model) for model in found)}; in the paper "
            f"{', '.join(model_name(model) for model in printed)}: {same} of {len(pairs)} pairs of models are in the "
            "paper's order."
        )
    return lines


def missing(settings: Mapping, what: str, models: Sequence[str]) -> list[str]:
    """The sentence in place of a comparison whose models are not all in params.yaml; empty where they are."""
    absent = [model for model in models if model not in settings["models"]]
    return [f"- {what}: cannot be compared without {', '.join(absent)}."] if absent else []


def fusion_gain(scores: Scores, protocols: Mapping[str, str], model: str) -> tuple[str, Estimate]:
    """(the better single dataset, what the combined one adds to it in points)."""
    single = [dataset for dataset in protocols if dataset != "combined"]
    better = max(single, key=lambda dataset: score(scores, protocols[dataset], model).mean)
    return better, gain(scores, (protocols["combined"], model), (protocols[better], model))


def fusion_sentences(scores: Scores, settings: Mapping, protocols: Mapping[str, str]) -> list[str]:
    """What pressure and strain together add to the better one of them."""
    if absent := missing(settings, "Fusion", ["sp_resnet"]):
        return absent
    printed = published_fusion("sp_resnet")
    better, found = fusion_gain(scores, protocols, "sp_resnet")
    inside = "inside" if found.low <= printed <= found.high else "outside"
    each = ", ".join(f"{d} {interval(score(scores, p, 'sp_resnet'))}" for d, p in protocols.items())
    lines = [
        f"- Fusion, SP-ResNet: {each} %. Both together add {points(found)} to {better}, the better single one (paper: "
        f"{number(printed)}, {inside} the interval): {verdict(found)}."
    ]
    others = []
    for model in (model for model in settings["models"] if model in PRINTED and model != "sp_resnet"):
        _, more = fusion_gain(scores, protocols, model)
        others.append(f"{model_name(model)} {interval(more)} (paper: {number(published_fusion(model))})")
    if others:
        lines.append(f"- Fusion, the other models, over their better single dataset (points): {', '.join(others)}.")
    return lines


def published_fusion(model: str) -> float:
    """What the combined dataset adds to the better single one in the paper, in points."""
    paper = published()
    return paper[model, "combined"] - max(paper[model, dataset] for dataset in MODALITIES if dataset != "combined")


def attention_sentences(scores: Scores, settings: Mapping, protocols: Mapping[str, str]) -> list[str]:
    """What the attention (GCAM) is worth."""
    if absent := missing(settings, "Attention (GCAM)", ["sp_resnet", "sp_resnet_nogcam"]):
        return absent
    paper, parts = published(), []
    for dataset, protocol in protocols.items():
        found = gain(scores, (protocol, "sp_resnet"), (protocol, "sp_resnet_nogcam"))
        printed = paper["sp_resnet", dataset] - paper["sp_resnet_nogcam", dataset]
        parts.append(f"{dataset} {points(found)} (paper: {number(printed)}): {verdict(found)}")
    return [f"- Attention (GCAM), SP-ResNet with it against without: {'; '.join(parts)}."]


def second_best_sentences(scores: Scores, settings: Mapping, protocol: str, own: pd.DataFrame) -> list[str]:
    """Whether SP-ResNet is second best of the networks at the lowest cost; own: counts like with like, by model."""
    if absent := missing(settings, "Second best at the lowest cost", NETWORKS):
        return absent
    others = [model for model in NETWORKS if model != "sp_resnet"]
    above = {model: gain(scores, (protocol, model), (protocol, "sp_resnet")) for model in others}
    certain = sum(verdict(one) == "reproduced" for one in above.values())
    possible = sum(verdict(one) != "not reproduced" for one in above.values())
    place = 1 + sum(one.mean > 0 for one in above.values())
    said = "undecided"
    if certain > 1 or possible < 1:
        said = "not reproduced"
    elif certain == possible == 1:
        said = "reproduced"
    each = ", ".join(f"{model_name(model)} {interval(one)}" for model, one in above.items())
    lines = [
        f"- Second best, combined: SP-ResNet is number {place} of {len(NETWORKS)} networks by its mean; the others are "
        f"above it by {each} points: {said}."
    ]
    for name, what in (("macs", "multiply-accumulates"), ("params", "parameters")):
        counts = own.loc[list(NETWORKS), name]
        least = counts.idxmin()
        lines.append(
            f"- Lowest cost, like with like: of these networks {model_name(least)} has the fewest {what} "
            f"({size(counts[least])}"
            + (
                f"; next is {model_name(counts.drop(least).idxmin())}, {size(counts.drop(least).min())}): reproduced."
                if least == "sp_resnet"
                else f"; SP-ResNet {size(counts['sp_resnet'])}): not reproduced."
            )
        )
    return lines


def baseline_sentences(scores: Scores, settings: Mapping, protocols: Mapping[str, str]) -> list[str]:
    """Naive Bayes and tree beside the networks, and beside a constant answer."""
    if absent := missing(settings, "Baselines", [*BASELINES, *NETWORKS]):
        return absent
    paper, lines = published(), []
    for dataset, protocol in protocols.items():
        means = {model: score(scores, protocol, model) for model in (*BASELINES, *NETWORKS)}
        worst = min(NETWORKS, key=lambda model: means[model].mean)
        better = max(BASELINES, key=lambda model: means[model].mean)
        found = gain(scores, (protocol, worst), (protocol, better))
        values = [f"{model_name(m)} {interval(means[m])} % (paper: {number(paper[m, dataset])})" for m in BASELINES]
        lines.append(
            f"- Baselines, {dataset}: {', '.join(values)}; the last of the networks, {model_name(worst)}, is above "
            f"the better of them by {points(found)}: that every network beats both is {verdict(found)}."
        )
    if "constant" in settings["models"]:
        floor = score(scores, protocols["combined"], "constant", "accuracy")
        lines.append(f"- A constant answer (the most frequent object) names {interval(floor)} % of the images rightly.")
    return lines


def optimism_sentences(scores: Scores, settings: Mapping) -> list[str]:
    """How much better every model looks when frames of one session are on both sides."""
    both = splits(settings)
    main = next(iter(both))
    lines, paper = [], published()
    for other in (split for split in both if split != main):
        for dataset in MODALITIES:
            found = {}
            for model in (model for model in settings["models"] if model != "constant"):
                pair = [score(scores, f"{split}_{dataset}", model) for split in (other, main)]
                if not any(one.failed for one in pair):
                    found[model] = pair[0].mean - pair[1].mean
            if not found:
                continue
            least, most = min(found, key=found.get), max(found, key=found.get)
            text = (
                f"- {other.replace('_', ' ').capitalize()} against {main}s, {dataset}: scores are higher by "
                f"{number(found[least])} ({model_name(least)}) to {number(found[most])} points ({model_name(most)})"
            )
            if "sp_resnet" in found:
                ours = [interval(score(scores, f"{split}_{dataset}", "sp_resnet")) for split in (main, other)]
                text += f"; SP-ResNet has {ours[0]} % by {main} and {ours[1]} % on {other.replace('_', ' ')}"
            lines.append(text + ".")
    known = [(model, dataset, value) for (model, dataset), value in paper.items() if model in settings["models"]]
    if not known:
        return lines
    distance = {
        split: np.nanmean([abs(score(scores, f"{split}_{data}", m).mean - value) for m, data, value in known])
        for split in both
    }
    nearest = min(distance, key=distance.get)
    each = ", ".join(f"{number(value)} points by {split.replace('_', ' ')}" for split, value in distance.items())
    lines.append(
        f"- The paper does not state its split. Table 1 lies nearest to ours by {nearest.replace('_', ' ')} (mean "
        f"distance over models and datasets: {each}); frames at random seems likely, and the yardstick was set on it."
    )
    return lines


def augmentation_sentences(values: Mapping[tuple[str, str], list[float]]) -> list[str]:
    """What each method adds; the paper says that B alone adds nothing, the others something."""
    paper, lines = published(), []
    for method, printed in list(METHODS.items())[1:]:
        parts = []
        for dataset in MODALITIES:
            found = augmentation_gain(values, method, dataset)
            claimed = paper[method, dataset] - paper["none", dataset]
            # That B does not help is reproduced where it harms, and refuted where it helps.
            turned = found._replace(low=-found.high, high=-found.low)
            said = verdict(turned if method == "B" else found)
            parts.append(f"{dataset} {points(found)} (paper: {number(claimed)}): {said}")
        claim = {"B": "adds nothing", "all": "help"}.get(method, "helps")
        name = "all methods together" if method == "all" else printed
        lines.append(f"- Augmentation, claim `{name} {claim}`: {'; '.join(parts)}.")
    return lines


def frames_sentences(tables: Mapping[str, pd.DataFrame]) -> list[str]:
    """Whether more frames help, and whether SP-ResNet is always above ResNet_3x3; tables: see `findings`."""
    lines = []
    for dataset, rows in tables.items():
        own = rows[rows["metric"] == "macro_precision"]
        if not len(own):
            continue
        numbers = sorted(set(own["frames"]))
        parts = []
        for model in dict.fromkeys(own["model"]):
            mean = {n: estimate(_at(own, model, n)["value"]).percent() for n in (numbers[0], numbers[-1])}
            more = _difference(_at(own, model, numbers[-1]), _at(own, model, numbers[0]))
            parts.append(
                f"{model_name(model)} from {interval(mean[numbers[0]])} to {interval(mean[numbers[-1]])} %, a gain of "
                f"{points(more)}: {verdict(more)}"
            )
        lines.append(f"- More input frames ({numbers[0]} to {numbers[-1]}) help, {dataset}: {'; '.join(parts)}.")
        if {"sp_resnet", "resnet3x3"} <= set(own["model"]):
            above = {n: _difference(_at(own, "sp_resnet", n), _at(own, "resnet3x3", n)) for n in numbers}
            verdicts = [verdict(one) for one in above.values()]
            said = "undecided"
            if "not reproduced" in verdicts:
                said = "not reproduced"
            elif set(verdicts) == {"reproduced"}:
                said = "reproduced"
            each = ", ".join(f"{n}: {interval(one)}" for n, one in above.items())
            higher = sum(one.mean > 0 for one in above.values())
            lines.append(
                f"- SP-ResNet is above ResNet_3x3 at every number of frames, {dataset}: in the mean at {higher} of "
                f"{len(above)}, by ({each} points): {said}."
            )
    return lines


def _at(rows: pd.DataFrame, model: str, frames: int) -> pd.DataFrame:
    return rows[(rows["model"] == model) & (rows["frames"] == frames)]


def _difference(one: pd.DataFrame, other: pd.DataFrame) -> Estimate:
    """In points, paired by seed."""
    return estimate(100 * (one.set_index("seed")["value"] - other.set_index("seed")["value"]))


def stag_sentences(stag: pd.DataFrame) -> list[str]:
    """The same on the paper's second data set, where the user has it."""
    if not len(stag):
        return [
            "- The paper's figure 15 is of the STAG data set; no file of it is named (`glove.stag.file` of "
            "params.yaml), so it was not run."
        ]
    return frames_sentences({"STAG": stag})


def pair_shares(counts: np.ndarray) -> np.ndarray:
    """(classes, classes) in %: of the images of two objects, how many were given the other's name.

    counts: (classes, classes) images of one run or of several together.
    """
    images = counts.sum(axis=1)
    both = images[:, None] + images
    return 100 * np.divide(counts + counts.T, both, out=np.zeros(counts.shape), where=both > 0)


def ranked_pairs(counts: np.ndarray) -> list[tuple[int, int]]:
    """All pairs of classes, the most confused first."""
    shares = pair_shares(counts)
    first, second = np.triu_indices(len(shares), 1)
    return [(int(first[k]), int(second[k])) for k in np.argsort(-shares[first, second], kind="stable")]


def pair_sentences(confusions: Mapping[str, np.ndarray], objects: Sequence[str]) -> list[str]:
    """The pairs that the paper says a single dataset cannot tell apart."""
    lines = []
    for dataset, pairs in NAMED_PAIRS.items():
        if not {dataset, "combined"} <= set(confusions):
            lines.append(f"- Pairs, {dataset}: cannot be judged without sp_resnet.")
            continue
        counts, combined = confusions[dataset], confusions["combined"]
        if not len(counts):
            lines.append(f"- Pairs, {dataset}: every run failed.")
            continue
        order = ranked_pairs(counts.sum(axis=0))
        upper = np.triu_indices(len(objects), 1)
        for names in pairs:
            if absent := [name for name in names if name not in objects]:
                lines.append(f"- Pairs, {dataset}: there is no object {', '.join(absent)}.")
                continue
            i, j = pair = tuple(sorted(objects.index(name) for name in names))
            rank = order.index(pair) + 1
            excess = estimate([pair_shares(run)[pair] - pair_shares(run)[upper].mean() for run in counts])
            said = verdict(excess)
            if said == "reproduced" and rank > MOST_CONFUSED:
                said = f"not reproduced, {rank - 1} pairs are confused more"
            rates = [estimate([100 * run[a, b] / run[a].sum() for run in counts]) for a, b in ((i, j), (j, i))]
            one, other = (f"`{objects[k]}`" for k in pair)
            together = f"{number(pair_shares(combined.sum(axis=0))[pair])} %" if len(combined) else "failed"
            lines.append(
                f"- Confused by {dataset}, claim {one} and {other}: {one} is named {other} in {interval(rates[0])} % "
                f"of its images, {other} {one} in {interval(rates[1])} %; rank {rank} of {len(order)} pairs, "
                f"{points(excess)} above an average pair: {said}. Combined: {together} of both."
            )
    return lines


def confused_sentences(confusions: Mapping[str, np.ndarray], objects: Sequence[str]) -> list[str]:
    """The most confused pairs of each dataset."""
    lines = []
    for dataset, counts in confusions.items():
        total = counts.sum(axis=0)
        shares = pair_shares(total) if len(counts) else np.zeros((len(objects),) * 2)
        order = [pair for pair in ranked_pairs(total) if shares[pair] > 0] if len(counts) else []
        quoted = [code(name) for name in objects]
        named = [f"{quoted[i]} and {quoted[j]} {number(shares[i, j])} %" for i, j in order[:MOST_CONFUSED]]
        lines.append(
            f"- Most confused, {dataset} (images of both given the other's name): {', '.join(named) or 'no pair'}."
        )
    return lines


def training_sentence(trained: Sequence[Fit]) -> str:
    """How the runs of the networks ended."""
    last = sum(fit.best_epoch == fit.epochs for fit in trained)
    return (
        f"- {sentences.stops(trained)} The learning rate follows a fixed course over the allowed epochs, so none stops "
        f"by patience; the best epoch, which is kept, was the last one in {last} of them."
    )
