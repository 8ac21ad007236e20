"""Write reports/glove_recorded: naming what a robot hand holds, from its touch and its joint angles."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.datasets import images
from pipeline.datasets.images import MODALITIES
from pipeline.reporting import experiment, glove_tables, sentences
from pipeline.reporting.glove import (
    WRONG,
    all_fits,
    confused_sentences,
    draw_confusions,
    draw_learning,
    ending_sentences,
    training_sentence,
)
from pipeline.reporting.glove_tables import METRICS
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, number, table
from pipeline.scoring.glove_results import (
    NETWORKS,
    gain,
    main_protocols,
    ranked,
    read_confusions,
    read_fits,
    score,
    splits,
)
from pipeline.scoring.results import Fit, Scores, estimate, read_csv

SPLITS = {
    "grasp": "Whole grasps, drawn by the seed",
    "time": "The first grasps of every object train, its last ones test",
    "random_frames": "Frames at random: frames of one grasp are on both sides",
}
WANTED = 75.0  # % of grasps named rightly from pressure alone
EXPECTED = {  # accuracy in % of others' models on final frames, five-fold over grasps
    "pressure": ("support-vector machine", 71.0),
    "strain": ("extra trees", 98.0),
}
DATASETS = {"pressure": "pressure", "strain": "joint angles", "combined": "combined"}


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `glove_recorded`; see `experiment`.

    Differs from paper: left open there and chosen here: batches of 32 images.
    """
    accuracy = target / "accuracy"
    scores, latency, dataset, _, _ = experiment.read(workspace, "glove_recorded", settings)
    objects, fits = images.classes(dataset), read_fits(workspace, "glove_recorded", settings)
    best = best_networks(scores, settings)
    confusions = read_confusions(workspace, "glove_recorded", settings, dataset, best)
    files.write_table(accuracy / "table.csv", glove_tables.score_table(scores, settings).drop(columns="published"))
    files.write_text(accuracy / "table.md", score_text(scores, settings, objects))
    captions = draw_confusions(accuracy, "confusion", settings, confusions, best, objects, DATASETS)
    captions |= draw_learning(accuracy, settings, fits, DATASETS)
    readme = findings(workspace, scores, settings, confusions, objects, read_probe(workspace), fits, captions)
    files.write_text(accuracy / "README.md", readme)
    panels = {DATASETS[modality]: (protocol, modality) for modality, protocol in main_protocols(settings).items()}
    experiment.write_speed(workspace, target, settings, scores, latency, panels, WRONG)


def best_networks(scores: Scores, settings: Mapping) -> dict[str, str]:
    """Return dataset -> the network with the highest accuracy in the main split; only datasets that have one."""
    split, best = next(iter(splits(settings))), {}
    for dataset in MODALITIES:
        order = ranked(scores, settings, f"{split}_{dataset}", "accuracy")
        networks = [model for model in order if model in (*NETWORKS, "sp_resnet_nogcam")]
        if networks:
            best[dataset] = networks[0]
    return best


def score_text(scores: Scores, settings: Mapping, objects: Sequence[str]) -> str:
    """Write table.md: accuracy and macro precision of every model, one table per split."""
    text = [
        f"# Recorded grasps: which of {len(objects)} objects is held\n",
        "Percent on the test part, mean [95 % t interval] over seeds; higher is better. Accuracy: share of grasps "
        "named rightly; macro precision: mean over objects of the share of grasps given that name that are it. "
        "The dataset `strain` has the joint angles. `Constant (mean)` predicts the most frequent object.\n",
    ]
    for split, protocols in splits(settings).items():
        seeds = len(settings["protocols"][protocols[0]]["seeds"])
        text.append(f"## {SPLITS[split]} (`{split}`), {seeds} {'seed' if seeds == 1 else 'seeds'}\n")
        cells = [(metric, f"{split}_{dataset}") for metric in ("accuracy", "macro_precision") for dataset in MODALITIES]
        rows = [
            [model_name(model), *(interval(score(scores, protocol, model, metric), 1) for metric, protocol in cells)]
            for model in settings["models"]
        ]
        header = [f"{METRICS[metric]}: {protocol.rsplit('_', 1)[1]}" for metric, protocol in cells]
        text.append(table(["Model", *header], rows))
    return "\n".join(text)


def findings(
    workspace: Workspace,
    scores: Scores,
    settings: Mapping,
    confusions: Mapping[str, np.ndarray],
    objects: Sequence[str],
    probe: pd.DataFrame,
    fits: Mapping[str, Mapping[str, list[Fit]]],
    captions: Mapping[str, str],
) -> str:
    """Write README.md: what was asked of the recordings, and what they say.

    confusions, captions: see `glove.findings`; probe: see `read_probe`.
    """
    main = next(iter(splits(settings)))
    best = best_networks(scores, settings)
    lines = [
        "# Recorded grasps (glove): results\n",
        f"Accuracy in % on the test part of the `{main}` split, mean over seeds [95 % t interval]; differences in "
        f"points, paired by seed. {len(objects)} objects; the dataset `strain` has the joint angles. "
        "[Table](table.md), [speed](../speed/table2.md).\n",
        *pressure_sentences(scores, best, main),
        *fusion_sentences(scores, best, main),
        *leak_sentences(scores, best, main, probe),
        *model_sentences(scores, settings, main),
        *time_sentences(scores, settings, best),
        *confused_sentences(confusions, objects),
        "- Each object was recorded in one session: whatever differs between sessions helps a model to name the "
        "object, in every split.",
        training_sentence(all_fits(fits)),
        *ending_sentences(fits),
        "\n## Figures\n",
        *sentences.figure_lines(captions),
        *sentences.differences_section(experiment.experiment_differences(workspace, "glove_recorded", settings)),
    ]
    return "\n".join(lines) + "\n"


def pressure_sentences(scores: Scores, best: Mapping[str, str], main: str) -> list[str]:
    """Return whether pressure alone names three of four grasps."""
    if "pressure" not in best:
        return ["- Pressure alone: there is no network without a failed run."]
    reached = score(scores, f"{main}_pressure", best["pressure"], "accuracy")
    words = "reached" if reached.mean >= WANTED else f"missed by {number(WANTED - reached.mean, 1)} points"
    if reached.low <= WANTED <= reached.high:
        words += " in the mean; the interval includes it"
    other, value = EXPECTED["pressure"]
    return [
        f"- Pressure alone: {model_name(best['pressure'])} is the best network with {interval(reached, 1)} %; "
        f"{WANTED:.0f} % is {words} ({other}, to be expected: {value:.0f} %)."
    ]


def fusion_sentences(scores: Scores, best: Mapping[str, str], main: str) -> list[str]:
    """Return what pressure adds to the joint angles."""
    lines = []
    for model in dict.fromkeys(best[dataset] for dataset in ("strain", "combined") if dataset in best):
        alone, both = (score(scores, f"{main}_{dataset}", model, "accuracy") for dataset in ("strain", "combined"))
        more = gain(scores, (f"{main}_combined", model), (f"{main}_strain", model), "accuracy")
        other, value = EXPECTED["strain"]
        lines.append(
            f"- Joint angles alone, {model_name(model)}: {interval(alone, 1)} % ({other}, to be expected: {value:.0f} "
            f"%); combined {interval(both, 1)} %. Pressure adds {interval(more)} points."
        )
    return lines


def read_probe(workspace: Workspace) -> pd.DataFrame:
    """Read probe.csv: accuracy of extra trees on joint angles as recorded, and on parts of them; one row per seed."""
    made_by = "python -m pipeline.studies.joint_angles glove_recorded"
    return read_csv(workspace.probe("glove_recorded"), ["input", "seed", "metric", "value"], made_by)


def leak_sentences(scores: Scores, best: Mapping[str, str], main: str, probe: pd.DataFrame) -> list[str]:
    """Return what the accuracy that others have from joint angles alone comes from."""
    other, value = EXPECTED["strain"]
    lines = []
    if "combined" in best:
        both = score(scores, f"{main}_combined", best["combined"], "accuracy")
        words = "reached" if both.mean >= value else f"missed by {number(value - both.mean, 1)} points"
        lines.append(
            f"- Combined against the {value:.0f} % to be expected of joint angles as recorded: "
            f"{model_name(best['combined'])} {interval(both, 1)} %, {words}."
        )
    inputs = {name: estimate(100 * rows["value"]) for name, rows in probe.groupby("input", sort=False)}
    if inputs:
        parts = "; ".join(f"{name} {interval(accuracy, 1)} %" for name, accuracy in inputs.items())
        lines.append(
            f"- Joint angles as recorded give the object away by more than its size. Accuracy of {other} on: {parts}. "
            "Three joints never move in a grasp, but rest at angles that differ by thousandths of a degree from one "
            "object's minutes to another's. Images have steps of 0.2 degrees and more and do not show that."
        )
    return lines


def model_sentences(scores: Scores, settings: Mapping, main: str) -> list[str]:
    """Return the order of all models, and what the constant model has."""
    lines = []
    for dataset in MODALITIES:
        order = ranked(scores, settings, f"{main}_{dataset}", "accuracy")
        parts = [f"{model_name(model)} {interval(value, 1)}" for model, value in order.items() if model != "constant"]
        failed = [model_name(model) for model in settings["models"] if model not in order]
        text = f"- Order of the models, {DATASETS[dataset]} (%): {', '.join(parts)}"
        lines.append(text + (f"; runs failed for {', '.join(failed)}." if failed else "."))
    if "constant" in settings["models"]:
        floor = score(scores, f"{main}_pressure", "constant", "accuracy")
        lines.append(f"- The constant model (the most frequent object) has {interval(floor, 1)} %.")
    return lines


def time_sentences(scores: Scores, settings: Mapping, best: Mapping[str, str]) -> list[str]:
    """Return how the best networks do in the other splits."""
    main, *others = splits(settings)
    lines = []
    for split in others:
        parts = [
            f"{DATASETS[dataset]} {interval(score(scores, f'{split}_{dataset}', model, 'accuracy'), 1)} % against "
            f"{interval(score(scores, f'{main}_{dataset}', model, 'accuracy'), 1)} % by {main} ({model_name(model)})"
            for dataset, model in best.items()
        ]
        lines.append(f"- {SPLITS[split]} (`{split}`): {'; '.join(parts)}.")
    return lines
