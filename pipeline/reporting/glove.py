"""Write reports/glove: figures, and findings on the claims of the SP-ResNet paper; its tables: see `glove_tables`."""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.base import files, paths
from pipeline.base.paths import Workspace
from pipeline.datasets import images, schemas
from pipeline.datasets.images import MODALITIES
from pipeline.datasets.seeding import generator
from pipeline.experiments import glove as glove_experiment
from pipeline.reporting import experiment, glove_captions, glove_tables, sentences
from pipeline.reporting.claims import sentences_of
from pipeline.reporting.figures import glove as glove_figures
from pipeline.reporting.figures import style
from pipeline.reporting.glove_tables import METRICS
from pipeline.reporting.words.labels import capitalised, form_name, model_name
from pipeline.reporting.words.markdown import code, interval, number
from pipeline.scenes import glove as glove_scene
from pipeline.scoring import glove_results
from pipeline.scoring.glove_results import (
    COMPARED,
    FORMS,
    MOST_CONFUSED,
    NETWORKS,
    gain,
    main_protocols,
    pair_shares,
    ranked,
    ranked_pairs,
    score,
    splits,
)
from pipeline.scoring.published import METHODS, PRINTED, precision
from pipeline.scoring.results import Estimate, Fit, Scores, estimate

RANDOM = "random_frames"
FRAMES_OF = ("combined", "pressure")  # datasets of figure 15
GRASPED = "mobile_phone"  # in figure 10
SEQUENCE_FRAMES = 50  # of figure 13
SHOWN_N = 0.6  # of figure 7
HELD_DEG, HELD_S = (0.0, 30.0, 45.0, 60.0, 90.0), 160.0  # of figure 9a: one after the other
BENDS = (300, 500 / 300)  # of figure 9b: how many, s
DATASETS = {"pressure": "pressure", "strain": "strain", "combined": "combined"}
WRONG = ("accuracy", "Images classified incorrectly (%)")

SCENE = (
    "It was set with all frames, of which `glove.window` keeps a part here. Spreads between sessions were fitted to "
    "recorded grasps (reports/twins); objects, grips and film are plain numbers, chosen before any model was trained."
)


BOTTLES = ("empty_bottle", "full_bottle_1", "full_bottle_2")
NAMED_PAIRS = {  # that the paper says are confused, section 3.2
    "pressure": (("paper_roll", "toy"),),
    "strain": tuple(combinations(BOTTLES, 2)),
}


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `glove`; see `experiment`.

    Differs from paper: left open there and chosen here: batches of 32 images, and how the learning rate rises and falls
    (see `training.Schedule`); which frames are one input of figure 15, and how many sets of them an epoch has. STAG's
    code, whose figure it is, takes every frame as the first of one set, and the others from other clusters of its
    recording; here the images of a session are divided into sets, anew in every epoch, and an epoch sees as many images
    as one of one frame.
    Differs from paper: figure 15 is of the STAG data set; on the glove, a session is one grasp.
    """
    accuracy = target / "accuracy"
    scores, latency, table, _, _ = experiment.read(workspace, "glove", settings)
    objects, protocols = images.classes(table), main_protocols(settings)
    counts, stag = glove_results.read_counts(workspace), glove_results.read_stag(workspace)
    augmentation = {metric: glove_results.read_augmentation(workspace, settings, metric) for metric in METRICS}
    fits = glove_results.read_fits(workspace, "glove", settings)
    asked = dict.fromkeys(protocols if "sp_resnet" in settings["models"] else (), "sp_resnet")
    confusions = glove_results.read_confusions(workspace, "glove", settings, table, asked)
    compared = [model for model in COMPARED if model in settings["models"]]
    frames = {
        dataset: glove_results.read_frames(workspace, table, dataset, settings, compared) for dataset in FRAMES_OF
    }
    verdicts = sentences_of(workspace, "glove", settings)

    files.write_table(accuracy / "table1.csv", glove_tables.score_table(scores, settings))
    files.write_text(accuracy / "table1.md", glove_tables.table_one(scores, settings, counts))
    files.write_table(accuracy / "table2.csv", glove_tables.augmentation_table(augmentation))
    files.write_text(accuracy / "table2.md", glove_tables.table_two(augmentation["macro_precision"], settings))
    by_frames = [rows.assign(condition=dataset) for dataset, rows in frames.items()]
    files.write_table(accuracy / "figure15.csv", pd.concat(by_frames))
    captions = draw_laws(accuracy, settings) if settings["source"] == "simulated" else {}
    captions["figure10"] = draw_grasp(accuracy / "figure10.png", table, objects)
    captions["figure13"] = draw_sequences(workspace, accuracy / "figure13.png", settings, objects)
    captions |= draw_confusions(accuracy, "figure14", settings, confusions, asked, objects, DATASETS)
    if compared:
        title = "Figure 15 on the simulated glove: several frames of a session"
        glove_figures.precision_by_frames(accuracy / "figure15.png", frames, title)
        captions["figure15"] = glove_captions.precision_by_frames(frames)
    if len(stag):
        title, of_stag = "Figure 15: the STAG data set", {"STAG": stag}
        glove_figures.precision_by_frames(accuracy / "figure15_stag.png", of_stag, title)
        captions["figure15_stag"] = glove_captions.precision_by_frames(of_stag)
    captions |= draw_learning(accuracy, settings, fits, DATASETS)
    tables = frames | {"STAG": stag}
    readme = findings(workspace, scores, settings, verdicts, confusions, objects, tables, fits, captions)
    files.write_text(accuracy / "README.md", readme)
    panels = {dataset: (protocol, dataset) for dataset, protocol in protocols.items()}
    experiment.write_speed(workspace, target, settings, scores, latency, panels, WRONG)


def findings(
    workspace: Workspace,
    scores: Scores,
    settings: Mapping,
    verdicts: Callable[..., list[str]],
    confusions: Mapping[str, np.ndarray],
    objects: Sequence[str],
    frames: Mapping[str, pd.DataFrame],
    fits: Mapping[str, Mapping[str, list[Fit]]],
    captions: Mapping[str, str],
) -> str:
    """Write README.md: verdicts on the claims, and sentences that are computed from the numbers.

    verdicts: see `claims.sentences_of`; confusions: dataset -> (runs, classes, classes) images; objects: names of the
    classes; frames: dataset -> macro precision by number of input frames, a table like stag.csv; captions: by name of
    a figure's file without .png.
    """
    protocols, split = main_protocols(settings), next(iter(splits(settings))).replace("_", " ")
    lines = [
        "# SP-ResNet (glove): results\n",
        f"Macro precision in % on the test part, split by {split}, mean over seeds [95 % t interval]; differences in "
        "points, paired by seed. Verdicts are those of `reports/claims.md`, which says by which rules. "
        "[Table 1](table1.md), [Table 2](table2.md), [speed](../speed/table2.md).\n",
        "## Models and datasets\n",
        *best_sentences(scores, settings, protocols),
        *order_sentences(scores, settings, protocols),
        *verdicts(*(f"order-{dataset}" for dataset in MODALITIES)),
        *verdicts("fusion", "fusion-number", "fusion-networks"),
        *fusion_sentences(scores, settings, protocols),
        *verdicts(*(f"attention-{dataset}" for dataset in MODALITIES)),
        *place_sentences(scores, settings, protocols["combined"]),
        *verdicts("second-best", "fewest-macs", "fewest-params"),
        *verdicts(*(f"networks-above-baselines-{dataset}" for dataset in MODALITIES)),
        *floor_sentences(scores, settings, protocols),
        "\n## Split, scene and training\n",
        *optimism_sentences(scores, settings),
        sentences.yardstick(scores, settings, SCENE, other_ratios(settings)),
        training_sentence(all_fits(fits)),
        *ending_sentences(fits),
        "\n## Augmentation and input frames\n",
        *verdicts(*(f"augmentation-{m}-{dataset}" for m in METHODS if m != "none" for dataset in MODALITIES)),
    ]
    for dataset, rows in frames.items():
        if dataset == "STAG" and not len(rows):
            lines.append(
                "- The paper's figure 15 is of the STAG data set; no file of it is named (`glove.stag.file` of "
                "params.yaml), so it was not run."
            )
            continue
        lines += frames_sentences(dataset, rows)
        keys = [*(f"more-frames-{model}" for model in COMPARED), "above-resnet3x3"]
        lines += verdicts(*(f"{key}-{dataset.lower()}" for key in keys))
    lines.append("\n## Confusions\n")
    for dataset, pairs in NAMED_PAIRS.items():
        for pair in pairs:
            lines += pair_sentences(confusions, objects, dataset, pair)
            lines += verdicts(*(f"{verb}-{dataset}-{'-'.join(pair)}" for verb in ("confused", "resolved")))
    lines += confused_sentences(confusions, objects)
    lines += ["\n## Figures\n", *sentences.figure_lines(captions)]
    lines += sentences.differences_section(experiment.experiment_differences(workspace, "glove", settings))
    return "\n".join(lines) + "\n"


def best_sentences(scores: Scores, settings: Mapping, protocols: Mapping[str, str]) -> list[str]:
    """Return which model is best on each dataset, and which ones a difference paired by seed does not tell from it."""
    lines = []
    for dataset, protocol in protocols.items():
        order = ranked(scores, settings, protocol)
        failed = [model_name(model) for model in settings["models"] if model not in order]
        if failed:
            lines.append(f"- {dataset.capitalize()}: runs failed for {', '.join(failed)}.")
        if not order:
            continue
        best = next(iter(order))
        close = [
            f"{model_name(model)} ({interval(value)})"
            for model, value in order.items()
            if model != best and not gain(scores, (protocol, best), (protocol, model)).low > 0
        ]
        lines.append(
            f"- {dataset.capitalize()}: {model_name(best)} is best with {interval(order[best])} %"
            + (f"; not told apart from it: {', '.join(close)}." if close else ".")
        )
    return lines


def order_sentences(scores: Scores, settings: Mapping, protocols: Mapping[str, str]) -> list[str]:
    """Return the order of the published models in ours and in the paper."""
    lines = []
    for dataset, protocol in protocols.items():
        order = [model for model in ranked(scores, settings, protocol) if model in PRINTED["sp_resnet"]]
        if len(order) > 1:
            printed = sorted(order, key=lambda model, dataset=dataset: -precision(model, dataset))
            lines.append(
                f"- Order, {dataset}: {', '.join(map(model_name, order))}; in the paper "
                f"{', '.join(map(model_name, printed))}."
            )
    return lines


def fusion_gain(scores: Scores, protocols: Mapping[str, str], model: str) -> Estimate:
    """Return what the combined dataset adds to the better single one, in points, paired by seed."""
    single = [dataset for dataset in protocols if dataset != "combined"]
    better = max(single, key=lambda dataset: score(scores, protocols[dataset], model).mean)
    return gain(scores, (protocols["combined"], model), (protocols[better], model))


def published_fusion(model: str) -> float:
    """Return what the combined images add to the better single ones in the paper, in points."""
    return precision(model, "combined") - max(precision(model, dataset) for dataset in ("pressure", "strain"))


def fusion_sentences(scores: Scores, settings: Mapping, protocols: Mapping[str, str]) -> list[str]:
    """Return what pressure and strain together add to the better one of them for each published model."""
    parts = [
        f"{model_name(model)} {interval(fusion_gain(scores, protocols, model))} "
        f"(paper: {number(published_fusion(model))})"
        for model in settings["models"]
        if model in PRINTED["sp_resnet"]
    ]
    return [f"- Fusion, gain over the better single dataset (points): {', '.join(parts)}."] if parts else []


def place_sentences(scores: Scores, settings: Mapping, protocol: str) -> list[str]:
    """Return SP-ResNet's place among the networks; none where one of these is not among the models."""
    if not set(NETWORKS) <= set(settings["models"]):
        return []
    others = [model for model in NETWORKS if model != "sp_resnet"]
    above = {model: gain(scores, (protocol, model), (protocol, "sp_resnet")) for model in others}
    place = 1 + sum(value.mean > 0 for value in above.values())
    parts = ", ".join(f"{model_name(model)} {interval(value)}" for model, value in above.items())
    return [
        f"- Combined, SP-ResNet is number {place} of {len(NETWORKS)} networks by its mean; the others are above it by "
        f"{parts} points."
    ]


def floor_sentences(scores: Scores, settings: Mapping, protocols: Mapping[str, str]) -> list[str]:
    """Return what the constant model has."""
    if "constant" not in settings["models"]:
        return []
    floor = score(scores, protocols["combined"], "constant", "accuracy")
    return [f"- The constant model (the most frequent object) classifies {interval(floor)} % of the images correctly."]


def optimism_sentences(scores: Scores, settings: Mapping) -> list[str]:
    """Return how much better every model looks when frames of one session are on both sides."""
    main, *others = splits(settings)
    lines = []
    for other in others:
        for dataset in MODALITIES:
            more = {}
            for model in (model for model in settings["models"] if model != "constant"):
                pair = [score(scores, f"{split}_{dataset}", model) for split in (other, main)]
                if not any(value.failed for value in pair):
                    more[model] = pair[0].mean - pair[1].mean
            if not more:
                continue
            least, most = min(more, key=more.get), max(more, key=more.get)
            text = (
                f"- {other.replace('_', ' ').capitalize()} against {main}s, {dataset}: scores change by "
                f"{number(more[least])} ({model_name(least)}) to {number(more[most])} points ({model_name(most)})"
            )
            if "sp_resnet" in more:
                ours = [interval(score(scores, f"{split}_{dataset}", "sp_resnet")) for split in (main, other)]
                text += f"; SP-ResNet has {ours[0]} % by {main} and {ours[1]} % on {other.replace('_', ' ')}"
            lines.append(text + ".")
    known = [
        (model, dataset) for model in PRINTED["sp_resnet"] if model in settings["models"] for dataset in MODALITIES
    ]
    if not known:
        return lines
    distance = {
        split: np.nanmean([abs(score(scores, f"{split}_{d}", m).mean - precision(m, d)) for m, d in known])
        for split in (main, *others)
    }
    nearest = min(distance, key=distance.get)
    parts = ", ".join(f"{number(value)} points by {split.replace('_', ' ')}" for split, value in distance.items())
    lines.append(
        f"- The paper does not state its split. Table 1 lies nearest to ours by {nearest.replace('_', ' ')} (mean "
        f"distance over models and datasets: {parts}); frames at random seems likely, and the yardstick was set on it."
    )
    return lines


def frames_sentences(dataset: str, rows: pd.DataFrame) -> list[str]:
    """Return macro precision with the fewest and the most input frames, and SP-ResNet's lead, a line for each form."""
    rows = rows[rows["metric"] == "macro_precision"]
    return [form_sentence(dataset, rows[rows["form"] == form], form) for form in FORMS if form in set(rows["form"])]


def form_sentence(dataset: str, rows: pd.DataFrame, form: str) -> str:
    """Return the line of one of FORMS; rows: macro precisions."""
    values = {key: 100 * group.set_index("seed")["value"] for key, group in rows.groupby(["model", "frames"])}
    numbers = sorted(set(rows["frames"]))
    parts = [
        f"{model_name(model)} {' to '.join(interval(estimate(values[model, n])) for n in (numbers[0], numbers[-1]))} %"
        for model in dict.fromkeys(rows["model"])
    ]
    text = (
        f"- Macro precision with {numbers[0]} to {numbers[-1]} input frames, {form_name(form)}, {dataset}: "
        f"{', '.join(parts)}"
    )
    if set(COMPARED) <= set(rows["model"]):
        lead = {n: interval(estimate(values["sp_resnet", n] - values["resnet3x3", n])) for n in numbers}
        text += f"; SP-ResNet above ResNet_3x3 (points): {', '.join(f'{n}: {points}' for n, points in lead.items())}"
    return f"{text}."


def pair_sentences(
    confusions: Mapping[str, np.ndarray], objects: Sequence[str], dataset: str, names: tuple[str, str]
) -> list[str]:
    """Return how often two objects are given each other's name, by one dataset and combined; none without runs."""
    if not {dataset, "combined"} <= set(confusions) or not len(confusions[dataset]) or not set(names) <= set(objects):
        return []
    i, j = pair = tuple(sorted(objects.index(name) for name in names))
    counts, combined = confusions[dataset], confusions["combined"]
    rates = [interval(estimate([100 * run[a, b] / run[a].sum() for run in counts])) for a, b in ((i, j), (j, i))]
    together = f"{number(pair_shares(combined.sum(axis=0))[pair])} %" if len(combined) else "failed"
    one, other = (f"`{objects[k]}`" for k in pair)
    return [
        f"- Confused by {dataset}: {one} is named {other} in {rates[0]} % of its images, {other} {one} in {rates[1]} "
        f"%. Combined: {together} of both."
    ]


def confused_sentences(confusions: Mapping[str, np.ndarray], objects: Sequence[str]) -> list[str]:
    """Return the most confused pairs of each dataset."""
    lines, quoted = [], [code(name) for name in objects]
    for dataset, counts in confusions.items():
        total = counts.sum(axis=0)
        shares = pair_shares(total)
        order = [pair for pair in ranked_pairs(total) if shares[pair] > 0]
        named = [f"{quoted[i]} and {quoted[j]} {number(shares[i, j])} %" for i, j in order[:MOST_CONFUSED]]
        lines.append(
            f"- Most confused, {dataset} (images of both given the other's name): {', '.join(named) or 'no pair'}."
        )
    return lines


def other_ratios(settings: Mapping) -> dict[str, tuple[Mapping, float]]:
    """Return the yardstick's ratio on the other datasets, as `sentences.yardstick` takes it."""
    chosen, ratios = settings["yardstick"], {}
    split = images.split_name(chosen["protocol"])
    for dataset in MODALITIES:
        if dataset != chosen["condition"]:
            printed = [100 - precision(chosen[role], dataset) for role in ("model", "over")]
            block = chosen | {"condition": dataset, "protocol": f"{split}_{dataset}"}
            ratios[dataset] = (block, printed[0] / printed[1])
    return ratios


def training_sentence(trained: Sequence[Fit]) -> str:
    """Return how the runs of the networks ended."""
    last = sum(fit.best_epoch == fit.epochs for fit in trained)
    return f"- {sentences.stops(trained)} The best epoch, which is kept, was the last one in {last} of them."


def ending_sentences(fits: Mapping[str, Mapping[str, list[Fit]]]) -> list[str]:
    """Return per network which of its epochs were best, and the validation loss of the best one against the first."""
    lines = []
    for model, protocols in fits.items():
        runs = [fit for by_seed in protocols.values() for fit in by_seed if fit.best_epoch]
        if not runs:
            continue
        best = [fit.best_epoch for fit in runs]
        losses = np.array([fit.history["validation_loss"].iloc[[0, fit.best_epoch - 1]] for fit in runs])
        lines.append(
            f"- Training of {model_name(model)}, {len(runs)} runs of {max(fit.epochs for fit in runs)} epochs: best "
            f"epoch {np.median(best):.0f} (median; {min(best)} to {max(best)}), with a validation loss of "
            f"{number(np.median(losses[:, 1]))} (after one epoch {number(np.median(losses[:, 0]))})."
        )
    return lines


def all_fits(fits: Mapping[str, Mapping[str, list[Fit]]]) -> list[Fit]:
    """Return the fits of all networks and protocols in one list; fits: see `read_fits`."""
    return [fit for protocols in fits.values() for runs in protocols.values() for fit in runs]


def draw_laws(folder: Path, settings: Mapping) -> dict[str, str]:
    """Draw figures 7 and 9 of one cell of the scene: its laws, as the glove's scanner reads them.

    Returns name of the file without .png -> caption.

    Differs from paper: its figures 7 to 9 are measurements of the glove's own cells; here the scene's laws are drawn,
    without figure 8, the fatigue of a cell under 600 cycles, of which they have none.
    """
    scene = glove_scene.scene_of(settings)
    film, hz = scene["film"], scene["frame_hz"]
    rng = generator(scene["seed"], "calibration")

    def read(siemens: np.ndarray) -> np.ndarray:
        counts = glove_scene.scanned([siemens.reshape(len(siemens), -1, 1)], scene, rng)
        return glove_experiment.conductance(counts, scene["circuit"]["reference_ohm"]).mean(axis=1)

    force = np.linspace(0, SHOWN_N, 200)
    title = "Figure 7: a pressure cell of the scene"
    siemens = glove_scene.pressed_film(force, film)
    glove_figures.pressed_cell(folder / "figure7.png", force, siemens, title)
    captions = {"figure7": glove_captions.pressed_cell(force, siemens)}

    held_s = np.arange(round(HELD_S * hz)) / hz
    held = np.array(HELD_DEG)[(held_s * len(HELD_DEG) / HELD_S).astype(int)]
    bends, period_s = BENDS
    bent_s = np.arange(round(bends * period_s * hz)) / hz
    joint = [
        (
            time_s,
            read(np.repeat(glove_scene.bent_film(angle, film)[:, None], images.GLOVE["strain"].joint ** 2, axis=1)),
        )
        for time_s, angle in ((held_s, held), (bent_s, HELD_DEG[-1] * triangle(bent_s, period_s)))
    ]
    title = f"Figure 9: a joint of the scene, held at angles and bent {bends} times; its law has no fatigue"
    glove_figures.bent_joint(folder / "figure9.png", *joint, HELD_DEG, title)
    return captions | {"figure9": glove_captions.bent_joint(*joint, HELD_DEG)}


def triangle(time_s: np.ndarray, period_s: float) -> np.ndarray:
    """Return a course from 0 up to 1 and back in every period."""
    return 1 - np.abs(2 * (time_s / period_s % 1) - 1)


def draw_grasp(path: Path, table: pa.Table, objects: Sequence[str]) -> str:
    """Draw one frame in the middle of the first session of GRASPED, or of the first object; return the caption."""
    names, sessions = schemas.names(table["condition"]), schemas.names(table["recording"])
    grasped = GRASPED if GRASPED in objects else objects[0]
    rows = np.flatnonzero(names == grasped)
    rows = rows[sessions[rows] == sessions[rows[0]]]
    grasp = rows[len(rows) // 2]
    pictures = {
        dataset: schemas.matrix(table[dataset])[grasp].reshape(images.SIDE, images.SIDE) for dataset in MODALITIES
    }
    title = style.literal(f"Figure 10: tactile images, {grasped.replace('_', ' ')}, {sessions[grasp]}")
    glove_figures.tactile_images(path, pictures, images.GLOVE["strain"].place, title)
    return glove_captions.tactile_images(pictures, grasped)


def draw_sequences(workspace: Workspace, path: Path, settings: Mapping, objects: Sequence[str]) -> str:
    """Draw the conductance (mS) of pressure cells and wired joints of each last session; return the caption."""
    frames_path = paths.require(workspace.frames("glove"), "python -m pipeline.stages.ingest glove")
    frames = schemas.read(frames_path, columns=["condition", "recording", "pressure", "strain"])
    names, sessions = schemas.names(frames["condition"]), schemas.names(frames["recording"])
    ohm = settings["sensor"]["reference_ohm"]
    pressure, strain = (
        1e3 * glove_experiment.conductance(schemas.matrix(frames[c]), ohm) for c in ("pressure", "strain")
    )
    joints = glove_experiment.joint_means(strain.reshape(-1, 15, 9), images.GLOVE["strain"].joint).reshape(
        len(names), -1
    )
    values = np.column_stack([pressure, joints[:, joints.any(axis=0)]])
    sequences = {}
    for name in objects:
        rows = np.flatnonzero(names == name)
        last = rows[sessions[rows] == max(sessions[rows])]
        sequences[name] = values[last[-SEQUENCE_FRAMES:]].T
    title = f"Figure 13: the last {SEQUENCE_FRAMES} frames of each object's last session; below the line, joint means"
    glove_figures.tactile_sequences(path, sequences, glove_experiment.PRESSURE_CELLS, title)
    return glove_captions.tactile_sequences(sequences, glove_experiment.PRESSURE_CELLS)


def draw_confusions(
    folder: Path,
    name: str,
    settings: Mapping,
    confusions: Mapping[str, np.ndarray],
    models: Mapping[str, str],
    objects: Sequence[str],
    names: Mapping[str, str],
) -> dict[str, str]:
    """Draw <name>_<dataset>.png, the confusions of all seeds together, and return the captions by name without .png.

    models: dataset -> the model that predicted; names: dataset -> its name.
    """
    split, captions = next(iter(splits(settings))).replace("_", " "), {}
    for dataset, counts in confusions.items():
        runs = f"{len(counts)} {'run' if len(counts) == 1 else 'runs'}"
        model = model_name(models[dataset])
        title = f"{capitalised(names[dataset])}: predictions of {model}, split by {split}, {runs} together"
        glove_figures.confusion_matrix(folder / f"{name}_{dataset}.png", counts.sum(axis=0), objects, title)
        captions[f"{name}_{dataset}"] = glove_captions.confusion_matrix(counts, objects, names[dataset], model)
    return captions


def draw_learning(
    folder: Path, settings: Mapping, fits: Mapping[str, Mapping[str, list[Fit]]], names: Mapping[str, str]
) -> dict[str, str]:
    """Draw learning_curves.png of the main split and return its caption by name; none without a network.

    names: dataset -> its name.
    """
    protocols = main_protocols(settings)
    chosen = {
        model: {dataset: by_protocol[protocol] for dataset, protocol in protocols.items()}
        for model, by_protocol in fits.items()
    }
    if not chosen:
        return {}
    split = next(iter(splits(settings))).replace("_", " ")
    title = f"Validation loss, split by {split}, one line per seed (lower is better)"
    glove_figures.learning_curves(folder / "learning_curves.png", chosen, title)
    parts = []
    for dataset in protocols:
        runs = {model: by_dataset[dataset] for model, by_dataset in chosen.items()}
        parts.append(f"{capitalised(names[dataset])}: {sentences.learning_caption(runs, 'nats')}")
    return {"learning_curves": " ".join(parts)}
