"""List the claims of the latent-space paper (strain), on the simulated finger and on recorded strain sensors."""

from functools import partial
from itertools import chain

from pipeline.reporting.verdicts.rules import (
    CONSTRUCTION,
    COUNT,
    Claim,
    Judge,
    all_positive,
    at_most,
    calibration_claim,
    count,
    positive,
    printed_claim,
    untestable,
)
from pipeline.reporting.verdicts.strain_measures import (
    TASKS,
    at_samples,
    channel_correlation,
    decoded,
    error_ratio,
    fall_with_strands,
    few,
    from_base,
    loss,
    lower,
    name_of,
    printed_ratio,
    recorded,
    score,
    time_ratio,
    why_bases,
    why_correlation,
    why_drift,
    why_error,
    why_ratio,
    why_recorded,
    why_reservoir,
    why_samples,
    why_states,
    why_strands,
    why_time,
)
from pipeline.scoring.published import latent
from pipeline.scoring.results import R2

FREE_R2 = 0.1  # drift that can be read from the latent space with less than this is none
MEAN_DISTANCE_MM = 2.5  # of a place that is uniform in the 10 mm of task 1 from their mean
SAME = 0.1  # an error that is at most this share above another is no worse
NAMES = {"lstm_direct": "Direct training", "lstm_transfer": "Transfer"}
claim, printed = partial(Claim, "latent"), partial(printed_claim, "latent")


def no_worse(model: str, other: str, task: str) -> Judge:
    """Return the judge of: the error of `model`, by seed, is at most SAME above that of `other`."""
    return lambda e: at_most(score(e, model, task) / score(e, other, task), 1 + SAME)


def no_worse_recorded(model: str, split: str, other: str, other_split: str) -> Judge:
    """Return the judge of: a model on a split of the recordings is no worse than another one on another split."""
    return lambda e: at_most(recorded(e, model, split) / recorded(e, other, other_split), 1 + SAME)


def parameters(model: str, task: str) -> Judge:
    """Return the judge of the count of trained parameters."""
    return lambda e: count(e.fits("strain", model, task)[0].parameters, latent(model, task, "parameters"))


def faster(task: str) -> Judge:
    """Return the judge of: transfer trains in less time than direct training."""
    return lambda e: positive(time_ratio(e, task), above=1.0)


def few_samples(task: str) -> Judge:
    """Return the judge of: transfer has the lower error with each of the small training sets."""
    return lambda e: all_positive(
        {
            f"{n:,} samples": at_samples(e, task, "lstm_direct", n) - at_samples(e, task, "lstm_transfer", n)
            for n in few(e)
        }
    )


def fewer_needed(task: str) -> Judge:
    """Return the judge of: the error of direct training grows more where the samples are few."""
    return lambda e: positive(loss(e, task, "lstm_direct") - loss(e, task, "lstm_transfer"))


def states_carry(task: str) -> Judge:
    """Return the judge of: a read-out of model-0's states has a lower error than one of raw voltages."""
    return lambda e: positive(lower(e, "lstm_transfer", "ridge", task))


def drift_free(task: str, target: str) -> Judge:
    """Return the judge of: the target cannot be read from the latent space."""
    return lambda e: at_most(decoded(e, task, target, True), FREE_R2, scale=R2)


def drift_less(task: str, target: str) -> Judge:
    """Return the judge of: the target is read from the latent space less well than from the raw voltages."""
    return lambda e: positive(decoded(e, task, target, False) - decoded(e, task, target, True))


# One record per claim: key, section and unit; the sentence; how it is judged, and the rest.
# fmt: off


def table_claims(task: str) -> list[Claim]:
    """List the numbers of Table I on one task."""
    words = name_of(task)
    times = latent("lstm_direct", task, "training time") / latent("lstm_transfer", task, "training time")
    return [
        *(
            claim(f"parameters-{model}-{task}", "III-A, Table I", "count",
                f"{name} has {latent(model, task, 'parameters'):,.0f} parameters to tune on {words}.",
                parameters(model, task), latent(model, task, "parameters"), kind=COUNT)
            for model, name in NAMES.items()
        ),
        *(
            printed(f"error-{model}-{task}", "IV-A, Table I", "mm",
                f"{name} has a test error of {latent(model, task, 'test error'):g} mm on {words}.",
                partial(score, model=model, task=task), latent(model, task, "test error"), why=why_error(task))
            for model, name in NAMES.items()
        ),
        printed(f"accuracy-ratio-{task}", "Table I", "1",
            f"On {words} the error of transfer is {printed_ratio(task):.2f} times that of direct training.",
            partial(error_ratio, task=task), printed_ratio(task), why=why_ratio),
        printed(f"time-ratio-{task}", "Table I", "1",
            f"On {words} direct training takes {times:.2f} times as long as transfer.",
            partial(time_ratio, task=task), times, measured=True, why=why_time),
        claim(f"time-less-{task}", "Table I", "1",
            f"On {words} transfer trains in less time than direct training (time of direct training over its own).",
            faster(task), times, kind=CONSTRUCTION, measured=True, why=why_time),
    ]


def comparison_claims() -> list[Claim]:
    """List what the paper concludes from Table I."""
    return [
        claim("time-absolute", "Table I", "s",
            "Direct training takes 344 s, transfer 93 s on task 1.",
            untestable("the paper's machine is not at hand; times of another device do not compare"),
            latent("lstm_direct", "task_1", "training time"), measured=True),
        claim("direct-better-task_1", "IV-B, Table I", "mm",
            "Direct training leads to better accuracy than transfer on task 1.",
            lambda e: positive(lower(e, "lstm_direct", "lstm_transfer", "task_1")),
            latent("lstm_transfer", "task_1", "test error") - latent("lstm_direct", "task_1", "test error")),
        claim("transfer-better-task_2", "IV-B, Table I", "1",
            "On task 2 transfer is as good as direct training or better (its error at most 10 % above).",
            no_worse("lstm_transfer", "lstm_direct", "task_2"), printed_ratio("task_2"), why=why_ratio),
        claim("gap-shrinks", "IV-B", "1",
            "The gap between direct training and transfer is smaller on the more complex task 2 than on task 1.",
            lambda e: positive(error_ratio(e, "task_1") - error_ratio(e, "task_2")),
            printed_ratio("task_1") - printed_ratio("task_2"), why=why_ratio),
        claim("task_2-harder", "IV-A", "1",
            "Task 2 is much more complex than task 1, and learned less well (difference of R2, direct training).",
            lambda e: positive(score(e, "lstm_direct", "task_1", "r2") - score(e, "lstm_direct", "task_2", "r2"))),
        claim("task_0-poor", "III-B, IV-A", "1",
            "Task 0, all three motions together, is learned less accurately than task 2 (difference of R2).",
            lambda e: positive(score(e, "lstm_direct", "task_2", "r2") - score(e, "lstm_direct", "task_0", "r2"))),
        claim("redundant-strands", "IV-A", "1",
            "The strands are more correlated, hence more redundant, in task 1 than in task 2.",
            lambda e: positive(channel_correlation(e, "task_1") - channel_correlation(e, "task_2"), "recordings"),
            why=why_correlation),
    ]


def study_claims(task: str) -> list[Claim]:
    """List what the paper asserts and does not test, on one task."""
    words, drift = name_of(task), []
    for target in ("true drift", "elapsed time"):
        drift += [
            claim(f"drift-free-{target.replace(' ', '-')}-{task}", "I-A, IV-B", "1",
                f"The latent space is free of drift: {target} cannot be read from it (R2 below 0.1), {words}.",
                drift_free(task, target), why=why_drift(task)),
            claim(f"drift-less-{target.replace(' ', '-')}-{task}", "IV-B", "1",
                f"The latent space removes drift: {target} is read from it less well than from voltages, {words}.",
                drift_less(task, target), why=why_drift(task)),
        ]
    return [
        claim(f"few-samples-{task}", "I-A, IV-B", "mm",
            f"With few samples (up to a tenth) transfer is more accurate than direct training, {words}.",
            few_samples(task), why=why_samples(task)),
        claim(f"samples-needed-{task}", "IV-B", "1",
            f"Transfer needs fewer samples: a tenth of them costs it less of its accuracy, {words}.",
            fewer_needed(task), why=why_samples(task)),
        claim(f"states-carry-{task}", "I-A, IV-B", "mm",
            f"The recycled layers carry what a new task needs: a read-out is below one of voltages, {words}.",
            states_carry(task), why=why_states),
        *drift,
        claim(f"reservoir-{task}", "V", "1",
            f"A reservoir is a viable candidate in place of the LSTM: no worse than transfer (10 %), {words}.",
            no_worse("esn", "lstm_transfer", task), why=why_reservoir),
    ]


def assumption_claims() -> list[Claim]:
    """List what the paper assumes of model-0 and of the number of sensors, and does not test."""
    return [
        claim("base-task_1", "IV-A", "mm",
            "A redundant task such as task 1 is not fit to train model-0.",  # it serves task 2 less well than task 0
            lambda e: positive(from_base(e, "task_1", "task_2") - from_base(e, "task_0", "task_2")), why=why_bases),
        claim("more-strands", "IV-B, V", "1",
            "The more sensors there are, the greater the advantage of transfer.",  # its error over direct training's
            lambda e: all_positive({name_of(task): fall_with_strands(e, task) for task in TASKS}), why=why_strands),
    ]


def untestable_claims() -> list[Claim]:
    """List the claims that neither the paper nor this project can test."""
    return [
        claim("reinforcement", "I-A, V", "1",
            "Latent states serve reinforcement learning and closed-loop control.",
            untestable("there is no control task, in the paper or here")),
    ]


def recorded_claims() -> list[Claim]:
    """List the claims that the recorded sensors can test."""
    on_recordings = partial(claim, data="recorded")
    return [
        on_recordings("transfer-recorded", "IV-B, Table I", "1",
            "Transfer is as good as direct training or better on a place in the plane (its error at most 10 % above).",
            no_worse_recorded("lstm_transfer", "within_day", "lstm_direct", "within_day"), printed_ratio("task_2"),
            why=why_recorded),
        printed("accuracy-ratio-recorded", "Table I", "1",
            "On a place in the plane the error of transfer is 0.96 times that of direct training.",
            lambda e: recorded(e, "lstm_transfer", "within_day") / recorded(e, "lstm_direct", "within_day"),
            printed_ratio("task_2"), data="recorded", why=why_recorded),
        on_recordings("direct-better-recorded-z", "IV-B, Table I", "mm",
            "Direct training leads to better accuracy than transfer on the depth.",
            lambda e: positive(
                recorded(e, "lstm_transfer", "within_day", "z") - recorded(e, "lstm_direct", "within_day", "z")
            )),
        on_recordings("states-carry-recorded", "I-A, IV-B", "mm",
            "The recycled layers carry what a new task needs: their read-out is below one of raw voltages.",
            lambda e: positive(recorded(e, "ridge", "within_day") - recorded(e, "lstm_transfer", "within_day")),
            why=why_recorded),
        on_recordings("drift-free-recorded", "I-A, IV-B", "1",
            "The latent space is free of drift: a read-out of it is no worse on the next day (10 %).",
            no_worse_recorded("lstm_transfer", "across_days", "lstm_transfer", "within_day"), why=why_recorded),
        on_recordings("lstm-drift-recorded", "I, V", "1",
            "An LSTM makes up for the drift of the sensors: its error is no worse on the next day (10 %).",
            no_worse_recorded("lstm_direct", "across_days", "lstm_direct", "within_day"), why=why_recorded),
        on_recordings("reservoir-recorded", "V", "1",
            "A reservoir is a viable candidate in place of the LSTM: no worse than transfer (10 %), within a day.",
            no_worse_recorded("esn", "within_day", "lstm_transfer", "within_day"), why=why_recorded),
    ]


def claims() -> list[Claim]:
    """List every claim that is looked at, in the order of the paper."""
    return [
        *chain.from_iterable(map(table_claims, TASKS)),
        calibration_claim("latent", "Table I",
            "On task 1 the error of direct training is 0.17 times that of the mean place.",
            latent("lstm_direct", "task_1", "test error") / MEAN_DISTANCE_MM),
        *comparison_claims(),
        *chain.from_iterable(map(study_claims, TASKS)),
        *assumption_claims(),
        *untestable_claims(),
        *recorded_claims(),
    ]
