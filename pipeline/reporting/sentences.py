"""Write sentences that the findings of several experiments share, and collect where the code differs from a paper."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, number
from pipeline.scoring.results import Fit, Scores

MARK = re.compile(r"Differs from paper:\s*(.*)")


def yardstick(scores: Scores, settings: Mapping, run: tuple[str, str], words: str, unit: str) -> str:
    """Return the line on the one number that the scene's difficulty was set by, beside the published one.

    run: its protocol and condition; words: condition, metric and split; unit: `%` shows a fraction in percent.
    """
    chosen = settings["yardstick"]
    if settings["source"] != "simulated":
        return "- The data are recorded, so no yardstick was used."
    if chosen["model"] not in settings["models"]:
        return f"- Yardstick of the scene: {chosen['model']} is not among the models, so it cannot be compared."
    ours, published = scores.estimate(*run, chosen["model"], chosen["metric"]), chosen["published"]
    if unit == "%":
        ours, published = ours.percent(), 100 * published
    return (
        f"- Yardstick of the scene, the one number that it was set by: {model_name(chosen['model'])}, {words}: ours "
        f"{interval(ours)}, published {number(published)} {unit} ({100 * (ours.mean / published - 1):+.0f} %). All "
        "other numbers are predictions."
    )


def stops(trained: Sequence[Fit]) -> str:
    """Return the sentence on how many of the runs trained in epochs stopped for which reason."""
    reasons = [fit.stop_reason for fit in trained]
    return (
        f"Of {len(reasons)} runs trained in epochs, {reasons.count('patience')} stopped by patience, "
        f"{reasons.count('max_epochs')} reached the allowed number of epochs and {reasons.count('diverged')} diverged."
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
