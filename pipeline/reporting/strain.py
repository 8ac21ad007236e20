"""Write reports/strain: Table I beside the published numbers, figures, studies and findings."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.reporting import experiment, sentences, strain_captions
from pipeline.reporting.claims import sentences_of
from pipeline.reporting.figures import strain as strain_figures
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, number, size, table
from pipeline.scoring.published import latent
from pipeline.scoring.results import R2, Scores, estimate, read_fit, read_predictions, read_training_times
from pipeline.scoring.strain_results import (
    LATENT,
    TASKS,
    TIME_BINS,
    errors_by_time,
    read_latents,
    read_study,
    tested_rows,
)

WORDS = {"task_0": "xyz, what model-0 is trained on", "task_1": "z, 10 mm", "task_2": "xy, 140 x 80 mm"}
REPLICATES = {
    True: "each with another finger, motion, drift, noise and start",
    False: "each with another start, and another recording where a task has several",
}  # by whether the data are simulated
TRANSFER = ("lstm_transfer", "lstm_transfer_ridge")
TRANSFER_COSTS = (
    "Parameters and training times of the two transfer models are of the read-out alone; model-0, which they share, "
    "is trained before."
)

SCENE = (
    "Drift, noise, memory and sensitivity of the strands were fitted to recordings (reports/twins); motion, friction "
    "and clocks are plain numbers, chosen before any model was trained."
)


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `strain`; see `experiment`."""
    accuracy = target / "accuracy"
    scores, latency, dataset, _, _ = experiment.read(workspace, "strain", settings)
    models, tasks = list(settings["models"]), list(settings["protocols"])
    parameters = {
        (model, task): read_fit(workspace, "strain", model, task, block["seeds"][0]).parameters
        for model in models
        for task, block in settings["protocols"].items()
    }
    studies = {name: read_study(workspace, name) for name in ("samples", "drift", "capacity", "strands", "bases")}
    by_time = {
        task: {model: errors_by_time(workspace, settings, dataset, task, model) for model in models}
        for task in tasks
        if task != "task_0"
    }
    files.write_table(accuracy / "table1.csv", score_table(scores, settings))
    files.write_text(accuracy / "table1.md", table_one(scores, settings, parameters))
    for name, study in studies.items():
        files.write_table(accuracy / f"{name}.csv", study)
    captions = {}
    for task, figure in (("task_1", 5), ("task_2", 6)):
        if task in tasks:
            captions |= draw_performance(workspace, accuracy, settings, dataset, task, figure)
    changes = strain_figures.latent_space(accuracy / "figure7.png", read_latents(workspace))
    captions["figure7"] = strain_captions.latent_space(*changes)
    share = (np.arange(TIME_BINS) + 0.5) / TIME_BINS
    rows = tested_rows(dataset, "task_1", settings["protocols"]["task_1"]["seeds"][0])
    minutes = share * np.ptp(dataset["t_s"].to_numpy()[rows]) / 60
    strain_figures.error_over_time(accuracy / "time.png", by_time, minutes)
    captions["time"] = strain_captions.error_over_time(by_time)
    captions |= draw_studies(accuracy, settings, scores, studies)
    files.write_text(
        accuracy / "README.md",
        findings(workspace, scores, settings, studies, by_time, sentences_of(workspace, "strain", settings), captions),
    )

    train_s = {
        (model, task): read_training_times(workspace, "strain", model, task) for model in models for task in tasks
    }
    files.write_text(target / "speed" / "table1_times.md", table_times(train_s, settings))
    panels = {task.replace("_", " "): (task, task) for task in tasks}
    experiment.write_speed(
        workspace, target, settings, scores, latency, panels, ("error", "Error (mm)"), TRANSFER_COSTS
    )


def score_table(scores: Scores, settings: Mapping) -> pd.DataFrame:
    """Return one row per protocol, condition, model and metric that was scored, in full precision."""
    runs = [(p, c, model, metric) for (p, c, metric), model in product(scores.measured(), settings["models"])]
    return experiment.score_table(scores, runs)


def table_one(scores: Scores, settings: Mapping, parameters: Mapping[tuple[str, str], int]) -> str:
    """Write table1.md: trained parameters and test error beside the published; parameters: (model, task) -> count."""
    text = [
        "# Table I: direct training and transfer\n",
        "Test error on the last 20 % of 30,000 samples: mean absolute (one output) or Euclidean (several), lower is "
        f"better. Ours: mean [95 % t interval] over seeds, {REPLICATES[settings['source'] == 'simulated']}. Published: "
        "the paper's one number, of one finger. All models are fitted to the same samples, all before the test part. "
        "Parameters: trained ones.\n",
    ]
    for task, block in settings["protocols"].items():
        text.append(f"## {task.replace('_', ' ')} ({WORDS[task]}), n = {len(block['seeds'])}\n")
        rows = [
            [
                model_name(model),
                size(latent(model, task, "parameters")).replace("not counted", "-"),
                size(parameters[model, task]),
                number(latent(model, task, "test error")),
                interval(scores.estimate(task, task, model, "error"), 3),
                interval(scores.estimate(task, task, model, "r2"), 3),
            ]
            for model in settings["models"]
        ]
        header = ["Model", "published parameters", "our parameters", "published error (mm)"]
        header += ["our error (mm)", "our R2"]
        text.append(table(header, rows))
    return "\n".join(text)


def table_times(train_s: Mapping[tuple[str, str], Sequence[float]], settings: Mapping) -> str:
    """Write table1_times.md: training time beside the published one; train_s: (model, task) -> seconds per seed."""
    text = [
        "# Table I: training time\n",
        "Median over seeds, one CPU thread. The published times may come from different devices (the authors' "
        "training script asks for a GPU, the transfer script for a CPU), so ratios are to be read with care.\n",
    ]
    for task in settings["protocols"]:
        rows = [
            [
                model_name(model),
                number(latent(model, task, "training time"), 0),
                f"{np.median(train_s[model, task]):.3g}",
            ]
            for model in settings["models"]
        ]
        text.append(f"## {task.replace('_', ' ')}\n")
        text.append(table(["Model", "published (s)", "ours (s)"], rows))
    return "\n".join(text)


def findings(
    workspace: Workspace,
    scores: Scores,
    settings: Mapping,
    studies: Mapping[str, pd.DataFrame],
    by_time: Mapping[str, Mapping[str, np.ndarray]],
    claims: Callable[..., list[str]],
    captions: Mapping[str, str],
) -> str:
    """Write README.md: verdicts on the claims, and sentences that are computed from the numbers.

    by_time: task -> model -> (seeds, TIME_BINS) errors in mm; claims: see `claims.sentences_of`; captions: name of a
    figure's file without .png -> text.
    """

    def verdicts(*starts: str) -> list[str]:
        return claims(*(f"{start}-{task}" for task in TASKS for start in starts))

    lines = [
        "# Drift-free latent space (strain): results\n",
        "Test error in mm, mean over seeds [95 % t interval]; a seed is a replicate "
        f"{REPLICATES[settings['source'] == 'simulated'].replace('each ', '')}. Verdicts are those of "
        "`reports/claims.md`, which says by which rules. "
        "[Table I](table1.md), [training times](../speed/table1_times.md), [speed](../speed/table2.md).\n",
        "## The paper's table\n",
        sentences.yardstick(scores, settings, SCENE),
        *task_sentences(scores, settings),
        "\n## What the paper asserts and does not test\n",
        *samples_sentences(studies["samples"]),
        *verdicts("few-samples", "samples-needed"),
        *drift_sentences(studies["drift"]),
        *verdicts(
            *(f"drift-{word}-{target}" for target in ("true-drift", "elapsed-time") for word in ("free", "less"))
        ),
        *time_sentences(by_time),
        *capacity_sentences(studies["capacity"]),
        *strands_sentences(studies["strands"]),
        *bases_sentences(studies["bases"]),
        *claims("base-task_1", "more-strands"),
        "\n## Figures\n",
    ]
    lines += sentences.figure_lines(captions)
    lines += sentences.differences_section(experiment.experiment_differences(workspace, "strain", settings))
    return "\n".join(lines) + "\n"


def task_sentences(scores: Scores, settings: Mapping) -> list[str]:
    """Return transfer against direct training, beside the paper."""
    models, lines = ("lstm_direct", *TRANSFER), []
    for task in TASKS:
        name = task.replace("_", " ").capitalize()
        if absent := [model for model in models if model not in settings["models"]]:
            lines.append(f"- {name}: cannot be compared without {', '.join(absent)}.")
            continue
        direct, transfer, solved = (scores.estimate(task, task, model, "error") for model in models)
        printed = latent("lstm_transfer", task, "test error") / latent("lstm_direct", task, "test error")
        better = "no worse than" if solved.mean <= transfer.mean else "worse than"
        lines.append(
            f"- {name}: direct {interval(direct)} mm, transfer {interval(transfer)} mm: "
            f"{transfer.mean / direct.mean:.2f} times (paper: {printed:.2f} times). The closed-form read-out has "
            f"{interval(solved)} mm, {better} the one trained by Adam."
        )
    return lines


def samples_sentences(samples: pd.DataFrame) -> list[str]:
    """Return the sizes of the training set at which transfer, trained by Adam, has the lower mean error."""
    lines = []
    for task, rows in samples.groupby("protocol", sort=True):
        errors = rows.groupby(["model", "samples"])["value"].apply(estimate)
        direct, transfer = errors["lstm_direct"], errors["lstm_transfer"]
        sizes = sorted(direct.index)
        least, most = sizes[0], sizes[-1]
        lines.append(
            f"- Fewer samples, {task.replace('_', ' ')}: {strain_captions.ahead(direct, transfer)} ({least} samples: "
            f"direct {interval(direct[least])}, transfer {interval(transfer[least])} mm; {most:,}: "
            f"{interval(direct[most])} and {interval(transfer[most])} mm)."
        )
    return lines


def drift_sentences(drift: pd.DataFrame) -> list[str]:
    """Return how well time and drift can be read from the latent space and from the raw voltages."""
    lines = []
    for (task, target), rows in drift.groupby(["protocol", "target"], sort=True):
        r2 = rows.groupby("input", sort=False)["value"].apply(estimate, scale=R2)
        raw = next(name for name in r2.index if name.startswith("raw"))
        lines.append(
            f"- Drift-free, {task.replace('_', ' ')}: {target} can be read from model-0's latent space with R2 "
            f"{interval(r2[LATENT])}, from the raw voltages with {interval(r2[raw])}."
        )
    return lines


def time_sentences(by_time: Mapping[str, Mapping[str, np.ndarray]]) -> list[str]:
    """Return whether errors grow; by_time: see `findings`."""
    lines = []
    for task, models in by_time.items():
        parts = [
            f"{model_name(model)} {number(estimate(runs[:, 0]).mean)} to {number(estimate(runs[:, -1]).mean)} mm"
            for model, runs in models.items()
        ]
        lines.append(
            f"- Time since training, {task.replace('_', ' ')}: from the first to the last tenth of the test part "
            f"(20 min) the error goes: {', '.join(parts)}."
        )
    return lines


def capacity_sentences(capacity: pd.DataFrame) -> list[str]:
    """Return the smallest LSTM within one standard error of the best."""
    lines = []
    for task, rows in capacity.groupby("protocol", sort=True):
        lowest, fewest, mean = strain_captions.enough_units(rows)
        text = f"- Capacity, {task.replace('_', ' ')}: {lowest} units are the best, {number(mean[lowest], 3)} mm"
        if fewest != lowest:
            text += f"; {fewest} are the fewest within one standard error of that, {number(mean[fewest], 3)} mm"
        lines.append(f"{text}. The paper uses 50.")
    return lines


def strands_sentences(strands: pd.DataFrame) -> list[str]:
    """Return the error of transfer over that of direct training, with each number of strands."""
    lines = []
    for task, rows in strands.groupby("protocol", sort=True):
        parts = [f"{count}: {interval(ratio)}" for count, ratio in strain_captions.strand_ratios(rows).items()]
        lines.append(
            f"- Strands, {task.replace('_', ' ')}: transfer over direct training, by the number of strands that all "
            f"models see: {', '.join(parts)}."
        )
    return lines


def bases_sentences(bases: pd.DataFrame) -> list[str]:
    """Return the errors of transfer from networks that were trained on another task."""
    lines = []
    for task, rows in bases.groupby("protocol", sort=True):
        errors = rows.groupby(["model", "base"])["value"].apply(estimate)
        parts = [
            f"{model_name(model)}, model-0 trained on {base.replace('_', ' ')}: {interval(error)} mm"
            for (model, base), error in errors.items()
        ]
        lines.append(f"- Transfer to {task.replace('_', ' ')}: {'; '.join(parts)}.")
    return lines


def draw_performance(
    workspace: Workspace, folder: Path, settings: Mapping, dataset: pa.Table, task: str, figure: int
) -> dict[str, str]:
    """Draw figure 5 or 6, and the task's part of figure 8; return name of the file without .png -> caption."""
    seed = settings["protocols"][task]["seeds"][0]
    rows = tested_rows(dataset, task, seed)
    compared = [model for model in ("lstm_direct", "lstm_transfer") if model in settings["models"]]
    guesses = {model: read_predictions(workspace, "strain", model, task, seed, dataset)[rows] for model in compared}
    time_s = dataset["t_s"].to_numpy()[rows]
    volts, truth = (schemas.matrix(dataset[name])[rows] for name in ("v", "y"))
    outputs = [k for k in range(3) if all(np.isfinite(guess[:, k]).all() for guess in guesses.values())]
    run = f"{task.replace('_', ' ')}, test part, seed {seed}"
    captions = {}
    if "lstm_direct" in compared:
        title, direct = f"Figure {figure}: direct training, {run}", {"lstm_direct": guesses["lstm_direct"]}
        path = folder / f"figure{figure}.png"
        errors = strain_figures.performance(path, title, time_s, volts, truth, direct, outputs)
        captions[path.stem] = strain_captions.performance(errors, task, strain_figures.SHOWN_S)
        if task == "task_1":
            path = folder / "figure5_drift.png"
            drift = strain_figures.drifting(path, f"Readings of the strands, {run}", time_s, volts)
            captions[path.stem] = strain_captions.drifting(*drift, strain_figures.DRIFT_S)
    title = f"Figure 8: direct training and transfer, {run}"
    path = folder / f"figure8_{task}.png"
    errors = strain_figures.performance(path, title, time_s, volts[:, :0], truth, guesses, outputs)
    return captions | {path.stem: strain_captions.performance(errors, task, strain_figures.SHOWN_S)}


def draw_studies(
    folder: Path, settings: Mapping, scores: Scores, studies: Mapping[str, pd.DataFrame]
) -> dict[str, str]:
    """Draw samples.png, capacity.png, strands.png and drift.png; return their captions by name without .png."""
    floor = {}
    if "constant" in settings["models"]:
        floor = {task: scores.estimate(task, task, "constant", "error").mean for task in settings["study"]["tasks"]}
    labels = {"title": "Fewer samples: error against the size of the training set", "xlabel": "Training samples"}
    strain_figures.curves(folder / "samples.png", studies["samples"], "samples", "model", labels, floor)
    labels = {"title": "Capacity: error of direct training against the size of the LSTM", "xlabel": "Units of the LSTM"}
    strain_figures.curves(folder / "capacity.png", studies["capacity"], "units", None, labels, floor)
    labels = {"title": "Strands: error against how many of them all models see", "xlabel": "Strands"}
    strain_figures.curves(folder / "strands.png", studies["strands"], "strands", "model", labels, floor)
    grouped = studies["drift"].groupby(["protocol", "target", "input"], sort=False)["value"]
    strain_figures.decoding(folder / "drift.png", {key: estimate(values) for key, values in grouped})
    return {
        "samples": strain_captions.samples(studies["samples"]),
        "capacity": strain_captions.capacity(studies["capacity"]),
        "strands": strain_captions.strands(studies["strands"]),
        "drift": strain_captions.decoding(studies["drift"]),
    }
