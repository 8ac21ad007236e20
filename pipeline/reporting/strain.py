"""What reports/strain and reports/strain_recorded say: Table I beside the published numbers, studies, findings."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.base import paths
from pipeline.reporting import sentences
from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import interval, number, size, table
from pipeline.scoring.results import PUBLISHED, Estimate, Scores, estimate, read_csv

PRINTED = {"lstm_direct": "Direct training", "lstm_transfer": "Transfer learning"}
TASKS = {"task_0": "xyz, what model-0 is trained on", "task_1": "z, 10 mm", "task_2": "xy, 140 x 80 mm"}
SET_ON = "set on the validation part by a network not trained on it (that of the tables is)"
TIME_BINS = 10  # of the test part
FREE_R2 = 0.1  # below it, what the latent space tells of drift is called nothing
TRANSFER = ("lstm_transfer", "lstm_transfer_ridge")
TRANSFER_COSTS = (
    "Parameters and training times of the two transfer models are of the read-out alone; model-0, which they share, "
    "is trained before."
)


def published() -> dict[tuple[str, str, str], float]:
    """Table I: (model, task, metric) -> value; metric: parameters, training time (s), test error (mm)."""
    rows = pd.read_csv(PUBLISHED)
    rows = rows[rows["paper"] == "latent"]
    keys = {printed: key for key, printed in PRINTED.items()}
    return {
        (keys[row.model], row.condition.replace(" ", "_"), row.metric): float(row.value) for row in rows.itertuples()
    }


def score_table(scores: Scores, settings: Mapping) -> pd.DataFrame:
    """A row for every protocol, condition, model and metric that was scored, in full precision."""
    rows = [
        (protocol, condition, model, metric, *scores.estimate(protocol, condition, model, metric))
        for protocol, condition, metric in scores.measured()
        for model in settings["models"]
    ]
    names = ["protocol", "condition", "model", "metric", "mean", "low", "high", "runs", "failed"]
    return pd.DataFrame(rows, columns=names)


def table_one(scores: Scores, settings: Mapping, parameters: Mapping[tuple[str, str], int]) -> str:
    """table1.md: trainable parameters and test error beside the published ones; parameters: (model, task) -> count."""
    paper = published()
    text = [
        "# Table I: direct training and transfer\n",
        "Test error on the last 20 % of 30,000 samples: mean absolute (one output) or Euclidean (several), lower is "
        "better. Ours: mean [95 % t interval] over seeds, each another start on the same recording. Published: the "
        "paper's one number. Parameters: trained ones.\n",
    ]
    for task, block in settings["protocols"].items():
        text.append(f"## {task.replace('_', ' ')} ({TASKS[task]}), n = {len(block['seeds'])}\n")
        rows = [
            [
                model_name(model),
                size(paper.get((model, task, "parameters"), np.nan)).replace("not counted", "-"),
                size(parameters[model, task]),
                number(paper.get((model, task, "test error"), np.nan)),
                interval(scores.estimate(task, task, model, "error"), 3),
                interval(scores.estimate(task, task, model, "r2"), 3),
            ]
            for model in settings["models"]
        ]
        header = ["Model", "published parameters", "our parameters", "published error (mm)"]
        header += ["our error (mm)", "our R2 (1)"]
        text.append(table(header, rows))
    return "\n".join(text)


def table_times(train_s: Mapping[tuple[str, str], Sequence[float]], settings: Mapping) -> str:
    """table1_times.md: training time beside the published one; train_s: (model, task) -> seconds a seed."""
    paper = published()
    text = [
        "# Table I: training time\n",
        "Median over seeds, one CPU thread. The published times may come from different devices (the authors' "
        "training script asks for a GPU, the transfer script for a CPU), so ratios are to be read with care.\n",
    ]
    for task in settings["protocols"]:
        rows = [
            [
                model_name(model),
                number(paper.get((model, task, "training time"), np.nan), 0),
                f"{np.median(train_s[model, task]):.3g}",
            ]
            for model in settings["models"]
        ]
        text.append(f"## {task.replace('_', ' ')}\n")
        text.append(table(["Model", "published (s)", "ours (s)"], rows))
    return "\n".join(text)


def read_study(name: str) -> pd.DataFrame:
    """One table of the stage `study`."""
    return read_csv(
        paths.experiment_folder("strain") / "study" / f"{name}.csv",
        ["protocol", "seed", "value"],
        "python -m pipeline.studies.latent strain",
    )


def read_latents() -> pd.DataFrame:
    """t_s and the states of model-0 on task 2."""
    return read_csv(
        paths.experiment_folder("strain") / "study" / "latents.csv", ["t_s"], "python -m pipeline.studies.latent strain"
    )


def mean_error(truth: np.ndarray, guess: np.ndarray) -> float:
    """Mean distance in mm over the outputs that were predicted; truth, guess: (n, 3), NaN where not predicted."""
    asked = np.isfinite(guess).any(axis=0)
    return float(np.linalg.norm((guess - truth)[:, asked], axis=1).mean())


def findings(
    scores: Scores, settings: Mapping, studies: Mapping[str, pd.DataFrame], late: Mapping, differences: Sequence
) -> str:
    """README.md: verdicts in sentences that are computed from the numbers; late: see `time_sentences`."""
    task = settings["yardstick"]["condition"]
    lines = [
        "# Drift-free latent space (strain): results\n",
        "Test error in mm, mean over seeds [95 % t interval]. [Table I](table1.md), [training times]"
        "(../speed/table1_times.md), [speed](../speed/table2.md).\n",
        "## The paper's table\n",
        sentences.yardstick(scores, settings, (task, task), f"{task.replace('_', ' ')}, {SET_ON}", "mm"),
    ]
    for task in ("task_1", "task_2"):
        lines += task_sentences(scores, settings, task)
    lines.append("\n## What the paper asserts and does not test\n")
    lines += samples_sentences(studies["samples"])
    lines += drift_sentences(studies["drift"])
    lines += time_sentences(late)
    lines += capacity_sentences(studies["capacity"])
    lines.append("\n## Figures\n")
    captions = {
        "figure5": "task 1, direct training",
        "figure6": "task 2, direct training",
        "figure7": "the latent space",
        "figure8_task_1": "direct training and transfer, task 1",
        "figure8_task_2": "direct training and transfer, task 2",
        "samples": "error against the number of training samples",
        "drift": "what can be decoded from voltages and latent space",
        "time": "error against time since training ended",
        "capacity": "error against the size of the LSTM",
    }
    lines += [f"- [{name}.png]({name}.png): {text}" for name, text in captions.items()]
    lines += sentences.differences_section(differences)
    return "\n".join(lines) + "\n"


def task_sentences(scores: Scores, settings: Mapping, task: str) -> list[str]:
    """Transfer against direct training, beside the paper."""
    models = ("lstm_direct", *TRANSFER)
    if absent := [model for model in models if model not in settings["models"]]:
        return [f"- {task.replace('_', ' ').capitalize()}: cannot be compared without {', '.join(absent)}."]
    paper = published()
    direct, transfer, solved = (scores.estimate(task, task, model, "error") for model in models)
    name = task.replace("_", " ").capitalize()
    ratio = transfer.mean / direct.mean
    printed = paper["lstm_transfer", task, "test error"] / paper["lstm_direct", task, "test error"]
    better = "no worse than" if solved.mean <= transfer.mean else "worse than"
    return [
        f"- {name}: direct {interval(direct)} mm, transfer {interval(transfer)} mm: {ratio:.2f} times "
        f"(paper: {printed:.2f} times). The closed-form read-out has {interval(solved)} mm, {better} the one "
        "trained by Adam."
    ]


def _mean(group: pd.DataFrame) -> Estimate:
    return estimate(group["value"])


def samples_sentences(samples: pd.DataFrame) -> list[str]:
    """At which sizes of the training set transfer, trained as published, is ahead of direct training."""
    lines = []
    for task, own in samples.groupby("protocol", sort=True):
        found = own.groupby(["model", "samples"])["value"].apply(estimate)
        direct, transfer = found["lstm_direct"], found["lstm_transfer"]
        sizes = sorted(direct.index)
        ahead = [f"{n:,}" for n in sizes if transfer[n].mean < direct[n].mean]
        behind = [f"{n:,}" for n in sizes if f"{n:,}" not in ahead]
        if not ahead:
            verdict = "direct training is ahead at every size: that transfer needs fewer samples is not reproduced"
        elif not behind:
            verdict = f"transfer is ahead at every size, so the curves do not cross up to {sizes[-1]:,} samples"
        else:
            verdict = f"transfer is ahead at {' / '.join(ahead)} samples, direct training at {' / '.join(behind)}"
        least, most = sizes[0], sizes[-1]
        lines.append(
            f"- Fewer samples, {task.replace('_', ' ')}: {verdict} ({least} samples: direct {interval(direct[least])}, "
            f"transfer {interval(transfer[least])} mm; {most:,}: {interval(direct[most])} and "
            f"{interval(transfer[most])} mm)."
        )
    return lines


def drift_sentences(drift: pd.DataFrame) -> list[str]:
    """Whether time and drift can be read from the latent space."""
    lines = []
    for (task, target), own in drift.groupby(["protocol", "target"], sort=True):
        found = own.groupby("input", sort=False)["value"].apply(estimate)
        raw = next(name for name in found.index if name.startswith("raw"))
        latent = found["latent of model-0"]
        verdict = "less than" if latent.mean < found[raw].mean else "no less than"
        if latent.low <= found[raw].mean <= latent.high:
            verdict = "not to be told apart"
        free = f"the latent space {'is' if latent.mean < FREE_R2 else 'is not'} free of it"
        if latent.low < FREE_R2 <= latent.high:
            free = "whether the latent space is free of it is undecided"
        lines.append(
            f"- Drift-free, {task.replace('_', ' ')}: {target} can be read from model-0's latent space with R2 "
            f"{interval(latent)}, {verdict} from the raw voltages ({interval(found[raw])}): {free}."
        )
    return lines


def time_sentences(late: Mapping[str, Mapping[str, tuple[Estimate, Estimate]]]) -> list[str]:
    """Whether errors grow; late: task -> model -> (error in the first tenth, in the last tenth of the test part)."""
    lines = []
    for task, models in late.items():
        parts = [
            f"{model_name(model)} {number(first.mean)} to {number(last.mean)} mm"
            for model, (first, last) in models.items()
        ]
        lines.append(
            f"- Time since training, {task.replace('_', ' ')}: from the first to the last tenth of the test part "
            f"(20 min) the error goes: {', '.join(parts)}."
        )
    return lines


def capacity_sentences(capacity: pd.DataFrame) -> list[str]:
    """The smallest LSTM within one standard error of the best."""
    lines = []
    for task, own in capacity.groupby("protocol", sort=True):
        groups = own.groupby("units")["value"]
        mean, error = groups.mean(), groups.std(ddof=1) / np.sqrt(groups.size())
        best = mean.idxmin()
        small = min(units for units in mean.index if mean[units] <= mean[best] + error[best])
        lines.append(
            f"- Capacity, {task.replace('_', ' ')}: {small} units are the fewest within one standard error of the best "
            f"({best} units, {number(mean[best], 3)} mm; {small}: {number(mean[small], 3)} mm); the paper uses 50."
        )
    return lines
