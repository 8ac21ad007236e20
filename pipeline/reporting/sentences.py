"""Write sentences that the findings of several experiments share, and collect where the code differs from a paper."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, number
from pipeline.scoring import classification
from pipeline.scoring.results import Estimate, Fit, Scores, estimate

MARK = re.compile(r"Differs from paper:\s*(.*)")


def replicates(settings: Mapping, specimen: str) -> str:
    """Say what differs between seeds; specimen: what a scene has several of, such as an array."""
    simulated = f"another {specimen}, other motions and noise, " if settings["source"] == "simulated" else ""
    return f"each with {simulated}another split and another start"


def yardstick(
    scores: Scores, settings: Mapping, rest: str, others: Mapping[str, tuple[Mapping, float]] | None = None
) -> str:
    """Return the line on the one ratio of errors that the scene's difficulty was set by, beside the published one.

    rest: what the scene's other settings come from; others: name -> block like the yardstick's and published value of
    ratios that were not set.
    """
    chosen = settings["yardstick"]
    if settings["source"] != "simulated":
        return "- The data are recorded, so no yardstick was used."
    if absent := [chosen[role] for role in ("model", "over") if chosen[role] not in settings["models"]]:
        return f"- Calibration target: {' and '.join(absent)} not among the models, so it cannot be compared."
    ours, published = error_ratio(scores, chosen), chosen["published"]
    not_set = [
        f"{name} {number(error_ratio(scores, block).mean)} ({number(printed)})"
        for name, (block, printed) in (others or {}).items()
        if block["model"] in settings["models"]
    ]
    metric = "" if chosen["metric"] == "error" else f" ({chosen['metric'].replace('_', ' ')})"
    return (
        "- Calibration target, the published number that the simulator was tuned to: "
        f"error{metric} of {model_name(chosen['model'])} over that of {model_name(chosen['over'])}, "
        f"{chosen['condition'].replace('_', ' ')}, protocol {chosen['protocol'].replace('_', ' ')}: "
        f"ours {interval(ours, 3)}, published {number(published, 3)} "
        f"({100 * (ours.mean / published - 1):+.0f} %). `{chosen['knob']}` was set by it, on validation parts "
        f"(`tactile calibrate --help`). {rest} What models score is a prediction of these."
        + (f" Such ratios that were not set (published): {'; '.join(not_set)}." if not_set else "")
    )


def error_ratio(scores: Scores, chosen: Mapping) -> Estimate:
    """Return the ratio of two models' errors over seeds; chosen: a block like `<experiment>.yardstick`."""
    errors = []
    for role in ("model", "over"):
        values = np.array(scores.runs(chosen["protocol"], chosen["condition"], chosen[role], chosen["metric"]))
        errors.append(1 - values if chosen["metric"] in classification.METRICS else values)
    return estimate(errors[0] / errors[1])


def stops(trained: Sequence[Fit]) -> str:
    """Return the sentence on how many of the runs trained in epochs ended as set."""
    reasons = [fit.stop_reason for fit in trained]
    return (
        f"Of {len(reasons)} runs trained in epochs, {reasons.count('completed')} went through their set number of "
        f"epochs and {reasons.count('diverged')} diverged."
    )


def figure_lines(captions: Mapping[str, str]) -> list[str]:
    """Return a line per figure with a link to it; captions: name of the file without .png -> caption."""
    return [f"- [{name}.png]({name}.png): {text}" for name, text in captions.items()]


def read_differences(folder: Path, names: Iterable[str]) -> list[tuple[str, str]]:
    """Read (file, text) of every mark, anywhere in a line, by file and line; names: files in `folder`.

    A comment goes on over following lines that are comments; in a docstring, up to an empty line or the end.
    """
    differences = []
    for path in sorted(folder / name for name in names):
        lines = path.read_text(encoding="utf-8").splitlines()
        for k, line in enumerate(lines):
            match = MARK.search(line)
            if not match:
                continue
            text = [match[1]]
            comment = "#" in line[: match.start(1)]
            for following in lines[k + 1 :]:
                following = following.strip()
                if '"""' in text[-1] or not following or following.startswith('"""') or MARK.search(following):
                    break
                if comment and not following.startswith("#"):
                    break
                text.append(following.lstrip("# "))
            joined = re.split(r'"""| Raises ', " ".join(text))[0].strip()
            differences.append((path.relative_to(folder.parent).as_posix(), joined))
    return differences


def differences_section(differences: Sequence[tuple[str, str]]) -> list[str]:
    """Return the lines on where our code departs from the papers; differences: (file, text)."""
    lines = [f"- `{file}`: {text}" for file, text in differences] or ["- Nowhere."]
    return ["\n## Where the code differs from the papers\n", *lines]
