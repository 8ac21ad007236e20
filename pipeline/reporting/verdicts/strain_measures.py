"""Measure what the claims of the latent-space paper are about, and say what was tried where one is not reproduced."""

import numpy as np
import pandas as pd

from pipeline.datasets import schemas
from pipeline.reporting.verdicts.rules import Evidence, NotTestable, complete, each, summary
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import number as digits
from pipeline.scoring.published import latent
from pipeline.scoring.results import R2
from pipeline.scoring.strain_results import errors_by_time

TASKS = ("task_1", "task_2")
LATENT = "latent of model-0"


def name_of(task: str) -> str:
    """Return task_1 as it is written."""
    return task.replace("_", " ")


def score(e: Evidence, model: str, task: str, metric: str = "error") -> pd.Series:
    """Return seed -> value."""
    return e.runs("strain", task, task, model, metric)


def lower(e: Evidence, one: str, other: str, task: str) -> pd.Series:
    """Return how far the error of `one` is below that of `other` in mm, by seed."""
    return score(e, other, task) - score(e, one, task)


def recorded(e: Evidence, model: str, split: str, task: str = "xy", metric: str = "error") -> pd.Series:
    """Return seed -> value on the recorded sensors; split: within_day, across_days or new_places."""
    day = "day_1" if split == "within_day" else "day_2"
    return e.runs("strain_recorded", f"{split}_{task}", day, model, metric)


def time_ratio(e: Evidence, task: str) -> pd.Series:
    """Return the training time of the direct LSTM over that of transfer, by seed."""
    return e.training_times("strain", "lstm_direct", task) / e.training_times("strain", "lstm_transfer", task)


def at_samples(e: Evidence, task: str, model: str, samples: int) -> pd.Series:
    """Return seed -> error in mm after training on so many samples."""
    e.require("strain")
    rows = e.study("samples")
    rows = rows[(rows["protocol"] == task) & (rows["model"] == model) & (rows["samples"] == samples)]
    return complete(rows.set_index("seed")["value"], f"{model_name(model)}, {samples:,} samples, {task}")


def sizes(e: Evidence) -> list[int]:
    """Return the sizes of the training set that were studied."""
    e.require("strain")
    return sorted(e.study("samples")["samples"].unique().tolist())


def few(e: Evidence) -> list[int]:
    """Return the sizes of at most a tenth of the largest."""
    tenth = [n for n in sizes(e) if n <= sizes(e)[-1] / 10]
    if not tenth:
        raise NotTestable("no training set of a tenth of the samples was studied")
    return tenth


def decoded(e: Evidence, task: str, target: str, from_states: bool) -> pd.Series:
    """Return seed -> R2 with which `target` can be read from model-0's latent space, or from the raw voltages."""
    e.require("strain")
    rows = e.study("drift")
    rows = rows[(rows["protocol"] == task) & (rows["target"] == target)]
    rows = rows[rows["input"] == LATENT] if from_states else rows[rows["input"].str.startswith("raw")]
    return complete(rows.set_index("seed")["value"], f"decoding of {target}, {task}")


def from_base(e: Evidence, base: str, task: str) -> pd.Series:
    """Return seed -> error in mm of transfer to a task from a network that was trained on the task `base`."""
    e.require("strain")
    rows = e.study("bases")
    rows = rows[(rows["protocol"] == task) & (rows["base"] == base) & (rows["model"] == "lstm_transfer")]
    return complete(rows.set_index("seed")["value"], f"transfer from {base} to {task}")


def strands_ratio(e: Evidence, task: str, strands: int) -> pd.Series:
    """Return seed -> error of transfer over that of direct training where both see so many strands."""
    rows = e.study("strands")
    rows = rows[(rows["protocol"] == task) & (rows["strands"] == strands)].set_index("seed")
    transfer, direct = (
        complete(rows.loc[rows["model"] == model, "value"], f"{model_name(model)}, {strands} strands, {task}")
        for model in ("lstm_transfer", "lstm_direct")
    )
    return transfer / direct


def strands(e: Evidence) -> list[int]:
    """Return the numbers of strands that were studied; raise NotTestable where there are not two of them."""
    e.require("strain")
    studied = sorted(e.study("strands")["strands"].unique().tolist())
    if len(studied) < 2:
        raise NotTestable("a single number of strands was studied")
    return studied


def fall_with_strands(e: Evidence, task: str) -> pd.Series:
    """Return how far the ratio of `strands_ratio` falls from the fewest strands to the most, by seed."""
    studied = strands(e)
    return strands_ratio(e, task, studied[0]) - strands_ratio(e, task, studied[-1])


def channel_correlation(e: Evidence, task: str) -> pd.Series:
    """Return the mean absolute correlation of two strands' voltages in each recording of a task."""

    def read() -> pd.Series:
        table = e.table("strain")
        recording, chosen = schemas.names(table["recording"]), schemas.names(table["condition"]) == task
        voltage = schemas.matrix(table["v"]).astype(float)
        pair = np.triu_indices(voltage.shape[1], 1)
        names = np.unique(recording[chosen])
        parts = {name: voltage[chosen & (recording == name)] for name in names}
        return pd.Series({name: np.abs(np.corrcoef(part.T)[pair]).mean() for name, part in parts.items()})

    e.require("strain")
    return e.once(("channel_correlation", task), read)


def error_ratio(e: Evidence, task: str) -> pd.Series:
    """Return the error of transfer over that of direct training, by seed."""
    return score(e, "lstm_transfer", task) / score(e, "lstm_direct", task)


def printed_ratio(task: str) -> float:
    """Return the printed error of transfer over that of direct training."""
    return latent("lstm_transfer", task, "test error") / latent("lstm_direct", task, "test error")


def loss(e: Evidence, task: str, model: str) -> pd.Series:
    """Return the error with the most of the few samples over that with all of them, by seed."""
    return at_samples(e, task, model, few(e)[-1]) / at_samples(e, task, model, sizes(e)[-1])


# What was tried where a claim is not reproduced.


def by_age(e: Evidence, model: str, task: str) -> tuple[float, float]:
    """Return the error in mm in the first and in the last tenth of the test part, mean over seeds."""
    score(e, model, task)

    def read() -> tuple[float, float]:
        first, *_, last = errors_by_time(e.values["strain"], e.table("strain"), task, model).mean(axis=0)
        return first, last

    return e.once(("by_age", model, task), read)


def why_error(task: str):
    """Return the paragraph on the errors of one task."""

    def why(e: Evidence) -> str:
        chosen = e.values["strain"]["yardstick"]
        errors = each(
            ("constant", "ridge", "esn", "lstm_direct", "lstm_transfer", "lstm_transfer_ridge"),
            lambda m: summary(score(e, m, task), 3),
        )
        first, last = by_age(e, "lstm_direct", task)
        solved = score(e, "lstm_transfer_ridge", task).mean() - score(e, "lstm_transfer", task).mean()
        return (
            f"Errors (mm): {errors}. The scene was fitted to recordings of other strands, and `{chosen['knob']}` was "
            f"set by {model_name(chosen['model'])} over {model_name(chosen['over'])}, {name_of(chosen['condition'])}, "
            "on validation parts; motion and friction are plain numbers. The parts of a recording differ: from the "
            "first to the last tenth of the test part direct training goes from "
            f"{digits(first)} to {digits(last)} mm. The paper says neither how its finger slips nor how far its "
            f"strands relax and drift, which set the level. Solving transfer's read-out in closed form in place of "
            f"Adam changes it by {digits(solved, 3)} mm; model-0, whose states it reads, explains "
            f"{100 * score(e, 'lstm_direct', 'task_0', 'r2').mean():.0f} % of the variance of task 0."
        )

    return why


def why_ratio(e: Evidence) -> str:
    """Say the ratio of errors in both tasks."""
    parts = [f"{name_of(task)} {summary(error_ratio(e, task))} (paper: {printed_ratio(task):.2f})" for task in TASKS]
    return (
        f"Error of transfer over that of direct training: {'; '.join(parts)}. On task 2 a constant place has "
        f"{digits(score(e, 'constant', 'task_2').mean())} mm on our surface, the paper's two models "
        f"{digits(latent('lstm_direct', 'task_2', 'test error'), 0)} and "
        f"{digits(latent('lstm_transfer', 'task_2', 'test error'), 0)} mm on one of the same size: the less a model "
        f"finds, the less there is to lose. Ours explains {100 * score(e, 'lstm_direct', 'task_2', 'r2').mean():.0f} % "
        f"of the variance, transfer {100 * score(e, 'lstm_transfer', 'task_2', 'r2').mean():.0f} %."
    )


def why_samples(task: str):
    """Return the paragraph on the size of the training set."""

    def why(e: Evidence) -> str:
        models = ("lstm_direct", "lstm_transfer", "lstm_transfer_ridge")
        rows = [f"{n:,}: " + " / ".join(digits(at_samples(e, task, m, n).mean()) for m in models) for n in sizes(e)]
        states = e.values["strain"]["models"]["lstm_direct"]["units"]
        epochs = e.values["strain"]["models"]["lstm_transfer"]["training"]["epochs"]
        return (
            f"Error in mm, direct / transfer trained by Adam / transfer in closed form, by training samples: "
            f"{'; '.join(rows)}. Transfer reads {states} states, which its closed form fits too closely with as few "
            f"samples as states; Adam, with one update an epoch, has made {epochs} updates. Direct training has the "
            "same number of updates. Model-0 itself has seen all samples of task 0 at every size, which the paper's "
            "count of samples leaves out."
        )

    return why


def why_drift(task: str):
    """Return the paragraph on what can be decoded."""

    def why(e: Evidence) -> str:
        drift = e.study("drift")
        parts = []
        for target in sorted(drift[drift["protocol"] == task]["target"].unique()):
            raw, states = decoded(e, task, target, False), decoded(e, task, target, True)
            parts.append(f"{target}: {summary(states, scale=R2)} (raw voltages: {summary(raw, scale=R2)})")
        age = each(("lstm_direct", "lstm_transfer"), lambda m: " to ".join(map(digits, by_age(e, m, task))))
        return (
            f"R2 of a linear decoder on held-out blocks of time, {name_of(task)}: {'; '.join(parts)}. Nothing in the "
            "loss asks the states to forget the drift: they are trained for the place alone, and a read-out that knows "
            "the drift can subtract it. That they hold it does not mean that it harms: from the first to the last "
            f"tenth of the test part errors go from (mm) {age}. The paper infers freedom from drift from the "
            "accuracy of its read-outs and does not test it."
        )

    return why


def why_reservoir(e: Evidence) -> str:
    """Say how the reservoir does beside the other models."""
    models, parts = ("ridge", "esn", "lstm_direct", "lstm_transfer"), []
    for task in TASKS:
        errors = each(models, lambda m, task=task: summary(score(e, m, task), 3))
        age = each(models[1:], lambda m, task=task: " to ".join(map(digits, by_age(e, m, task))))
        parts.append(f"{name_of(task)}: {errors}, from the first to the last tenth of the test part {age}")
    block = e.values["strain"]["models"]["esn"]
    return (
        f"Errors (mm), {'; '.join(parts)}. The reservoir has {block['units']} random units (spectral radius "
        f"{block['spectral_radius']}, leak {block['leak']}), the same for both tasks; the paper names reservoirs as a "
        "candidate and tries none."
    )


def why_states(e: Evidence) -> str:
    """Say how the read-out of model-0's states does beside one of raw voltages."""
    models, frames = ("ridge", "lstm_direct", "lstm_transfer", "lstm_transfer_ridge"), e.values["strain"]["window"]
    parts = [f"{name_of(task)}: {each(models, lambda m, task=task: summary(score(e, m, task), 3))}" for task in TASKS]
    return (
        f"Errors (mm), {'; '.join(parts)}. Ridge sees the last {frames['frames']} samples. On task 1 a linear function "
        "of these comes as near as the LSTM that is trained for the task, and model-0, trained for three outputs at "
        "once, keeps less of the depth than they hold; on task 2, where the past counts, its states are worth more."
    )


def why_correlation(e: Evidence) -> str:
    """Say the correlations of the strands."""
    parts = [f"{name_of(t)} {summary(channel_correlation(e, t), 3)}" for t in TASKS]
    return f"Mean absolute correlation of two strands, over the recordings of a task: {'; '.join(parts)}."


def why_bases(e: Evidence) -> str:
    """Say the errors of transfer from networks of other tasks."""
    rows = e.study("bases")
    parts = [
        f"to {name_of(task)} from {name_of(base)} {summary(from_base(e, base, task))}"
        for task, base in rows[["protocol", "base"]].drop_duplicates().itertuples(index=False)
    ]
    return (
        "Judged by transfer to task 2: from task 1 its error is larger than from task 0. "
        f"Errors of transfer (mm), read-out trained by Adam: {'; '.join(parts)}. The network of task 1 is the one that "
        "direct training on task 1 gave, with as many units and samples as model-0."
    )


def why_strands(e: Evidence) -> str:
    """Say the error of transfer over that of direct training, by the number of strands."""
    parts = [
        f"{name_of(task)}: " + ", ".join(f"{n} strands {summary(strands_ratio(e, task, n))}" for n in strands(e))
        for task in TASKS
    ]
    return (
        "Judged by the fall of the error of transfer over that of direct training, from the fewest strands to the "
        f"most, on both tasks: {'; '.join(parts)}. Model-0 and direct training were trained "
        "in parallel streams, which is faster than the paper's one sequence and forgets what lies before a stream."
    )


def why_recorded(e: Evidence) -> str:
    """Say the errors on the recorded sensors."""
    models = ("constant", "ridge", "esn", "lstm_direct", "lstm_transfer", "lstm_highpass")
    parts = [
        f"{split.replace('_', ' ')}: {each(models, lambda m, split=split: summary(recorded(e, m, split)))}"
        for split in ("within_day", "across_days")
    ]
    return (
        f"Errors of the place while pressed (mm), {'; '.join(parts)}. Across days all models see the five strands that "
        "both days have. The last of them is an LSTM that sees only how voltages change: what it keeps from one day to "
        "the next and the paper's LSTM loses lies in the offsets of the voltages. One day of training gives an LSTM no "
        "reason to ignore them."
    )


def why_time(e: Evidence) -> str:
    """Say the training times."""
    parts = [
        f"{name_of(t)} {np.median(e.training_times('strain', 'lstm_direct', t)):.3g} s and "
        f"{np.median(e.training_times('strain', 'lstm_transfer', t)):.3g} s"
        for t in TASKS
    ]
    return (
        f"Median training times, direct and transfer: {'; '.join(parts)}. Here the frozen layers are run once and only "
        "the read-out is trained on their states, so transfer gains more than in the paper, whose toolbox may have run "
        "them in every epoch (its two scripts also ask for different devices)."
    )
