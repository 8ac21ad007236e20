"""Write reports/strain_recorded: real sensors with real drift, within a day and across days."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from pipeline.base import files
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.reporting import experiment, sentences, strain_captions
from pipeline.reporting.figures import strain as strain_figures
from pipeline.reporting.strain import TRANSFER_COSTS, score_table
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, table
from pipeline.scoring.results import Scores, read_predictions

SPLITS = {
    "within_day": "The first 70 % of 30 July train, its last 30 % test",
    "across_days": "30 July trains, 31 July tests, on the five strands that both days have",
    "new_places": "30 July trains, without the presses whose places 31 July repeats, and 31 July tests",
    "days_swapped": "31 July trains, 30 July tests, on the five strands that both days have",
    "failing_channel": "The first 70 % of 31 July train, its last 30 % test, with the strand that fails left in",
}
SHORT = {
    "within_day": "Within the day",
    "across_days": "Across days",
    "new_places": "Across days, new places",
    "days_swapped": "Across days, swapped",
    "failing_channel": "Within the second day, with a failing strand",
}
TASKS = {"xy": "place while pressed", "z": "pressed or not", "xyz": "all three, at all times: task 0 of transfer"}
YARDSTICK = {"x": 0.94, "y": 0.97}  # R2 a press that extra trees reach on hand-made differences (data README)
WANTED = {
    "within_day": 0.90,
    "across_days": 0.85,
    "new_places": 0.85,
    "days_swapped": 0.85,
}  # R2 a press in x and y, from raw voltages
HAND_MADE = "press_difference"  # not a model of raw voltages
EXPLORATORY = "lstm_highpass"  # chosen among four variants by scores of the second day, the models/ file has them
CHOSEN_ON = ("across_days", "new_places")  # splits that test on the day it was chosen on


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `strain_recorded`; see `experiment`."""
    accuracy = target / "accuracy"
    scores, latency, dataset, _, _ = experiment.read(workspace, "strain_recorded", settings)
    tested = {protocol: condition for protocol, condition, _ in scores.measured()}
    files.write_table(accuracy / "table.csv", score_table(scores, settings))
    files.write_text(accuracy / "table.md", score_text(scores, settings, tested))
    truth, press = schemas.matrix(dataset["y"]), dataset["press"].to_numpy()
    views = {}
    for protocol in tested:
        if protocol.endswith("_xy"):
            seed = settings["protocols"][protocol]["seeds"][0]
            part = schemas.names(dataset[schemas.split_column(protocol, seed)])
            rows = np.flatnonzero((part == "test") & (press >= 0))
            guesses = {
                model: read_predictions(workspace, "strain_recorded", model, protocol, seed, dataset)[rows]
                for model in settings["models"]
            }
            views[protocol] = (truth[rows], press[rows], guesses)
    distances = strain_figures.presses(accuracy / "figure.png", views)
    named = {SHORT[protocol.removesuffix("_xy")]: errors for protocol, errors in distances.items()}
    captions = {"figure": strain_captions.presses(named)}
    files.write_text(accuracy / "README.md", findings(scores, settings, tested, captions))
    panels = {protocol.replace("_", " "): (protocol, tested[protocol]) for protocol in views}
    measure = ("press_error", "Error per press (mm)")
    experiment.write_speed(workspace, target, settings, scores, latency, panels, measure, TRANSFER_COSTS)


def columns(task: str) -> dict[str, str]:
    """Return header by metric for a task."""
    if task == "z":
        return {"error": "Error (mm)", "r2_z": "R2"}
    axes = {f"press_r2_{axis}": f"R2 {axis}, per press" for axis in "xy"}
    return {"error": "Error (mm)", "r2_x": "R2 x", "r2_y": "R2 y"} | (axes if task == "xy" else {})


def protocols(settings: Mapping) -> list[tuple[str, str, str]]:
    """Return (protocol, split, task) for every protocol of params.yaml."""
    return [(name, *name.rsplit("_", 1)) for name in settings["protocols"]]


def score_text(scores: Scores, settings: Mapping, tested: Mapping[str, str]) -> str:
    """Write table.md: one table per split and task; tested: protocol -> the condition (day) that was tested on."""
    text = [
        "# Recorded strain sensors: place and depth of a press from voltages\n",
        "Mean [95 % t interval] over seeds on the test part. Per press: a press is predicted as the mean over the "
        "second half of its samples. Higher R2 and lower error are better. Seeds are starts of a model on the same "
        "recordings of one set of strands. All models are fitted to the same samples, all before the test part. "
        "Exploratory: the model was chosen among four variants by their scores on this test day.\n",
    ]
    for protocol, split, task in protocols(settings):
        text.append(
            f"## {SPLITS[split]}; {TASKS[task]} ({task}), {len(settings['protocols'][protocol]['seeds'])} seeds\n"
        )
        names = columns(task)
        rows = [
            [
                model_name(model) + (" (exploratory)" if model == EXPLORATORY and split in CHOSEN_ON else ""),
                *(
                    interval(scores.estimate(protocol, tested[protocol], model, metric), 2 if metric == "error" else 3)
                    for metric in names
                ),
            ]
            for model in settings["models"]
        ]
        text.append(table(["Model", *names.values()], rows))
    return "\n".join(text)


def findings(scores: Scores, settings: Mapping, tested: Mapping[str, str], captions: Mapping[str, str]) -> str:
    """Write README.md: what was asked of the recordings, and what they say. captions: of the figures, by file name."""
    lines = [
        "# Recorded strain sensors: results\n",
        "[Table](table.md), [speed](../speed/table2.md).\n",
    ]
    lines += [f"- {SHORT[split]}: {SPLITS[split].replace('The first', 'the first')}." for split in WANTED]
    for split, wanted in WANTED.items():
        protocol = f"{split}_xy"
        if protocol not in tested:
            continue
        press_r2 = {
            model: [scores.estimate(protocol, tested[protocol], model, f"press_r2_{axis}") for axis in "xy"]
            for model in settings["models"]
        }
        if HAND_MADE in press_r2:
            x, y = press_r2[HAND_MADE]
            expected = f" (expected {YARDSTICK['x']} and {YARDSTICK['y']})" if split != "new_places" else ""
            lines.append(
                f"- {SHORT[split]}: the yardstick, extra trees on hand-made differences, has R2 {interval(x, 3)} in x "
                f"and {interval(y, 3)} in y per press{expected}."
            )
        raw = {m: pair for m, pair in press_r2.items() if m != HAND_MADE and not any(r2.failed for r2 in pair)}
        best = max(raw, key=lambda m: min(r2.mean for r2 in raw[m]))
        x, y = raw[best]
        least = min(x.mean, y.mean)
        words = f"above {wanted:.2f} in both" if least >= wanted else f"{wanted - least:.3f} below {wanted:.2f}"
        chosen = ", exploratory (chosen among four variants on this test day)" if best == EXPLORATORY else ""
        lines.append(
            f"- {SHORT[split]}: of the models on raw voltages {model_name(best)} is best"
            f"{chosen if split in CHOSEN_ON else ''}: R2 {interval(x, 3)} in x and {interval(y, 3)} in y per press, "
            f"{words}."
        )
        if "lstm_direct" in raw and best != "lstm_direct":
            x, y = raw["lstm_direct"]
            lines.append(
                f"- {SHORT[split]}: the paper's LSTM, which sees the same voltages, has {interval(x, 3)} and "
                f"{interval(y, 3)}: drift that lies in the offsets is not removed by training on one day."
            )
    lines.append(
        "- The rule by which the yardstick finds a press in the voltages was changed once after a test score of "
        "it had been seen (0.928 and 0.961 within the day, one seed). Settings of the other models were chosen on the "
        f"validation part alone, but for {model_name(EXPLORATORY)}: four variants of it were scored on 31 July after "
        "training on 30 July, and the best was kept; validation within a day could not choose. The split with the days "
        "swapped was added after that choice and tests on presses that had no part in it, though of a day that had "
        "trained the variants, on the same strands. A confirmation needs another finger and other days; none is public."
    )
    lines.append(
        "- The robot's random places start from the same seed on both days: the places of 31 July are the first places "
        "of 30 July, in the same order. A model that remembers the order could gain by that; the split `new_places` "
        "trains without those presses and shows how much."
    )
    lines += ["\n## Figures\n", *sentences.figure_lines(captions)]
    return "\n".join(lines) + "\n"
