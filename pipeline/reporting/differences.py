"""Collect where the code differs from the papers: the comments that say so."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from tactile import experiments
from tactile.base import paths

MARK = re.compile(r"Differs from paper:\s*(.*)")
FITTING = {
    "windows": ["regressors"],
    "series": ["lstm", "series_regressors"],
    "images": ["image_classifier"],
}  # by kind of input


def of_experiment(experiment: str, settings: Mapping) -> list[tuple[str, str]]:
    """Read the differences of one experiment from its paper: (file, text)."""
    names = [
        *(f"tactile/learning/{name}" for name in FITTING[experiments.module(experiment).KIND]),
        f"tactile/experiments/{experiment}",
        *written_for(experiment),
        *(f"tactile/models/{model}" for model in settings["models"]),
    ]
    return read(paths.CODE.parent, (f"{name}.py" for name in names))


def written_for(experiment: str) -> list[str]:
    """Return the files that write an experiment's simulated logs, draw its laws, or say what the paper leaves open."""
    names = f"scenes/{experiment}.py", f"scenes/{experiment}_*.py", f"reporting/{experiment}.py"
    found = [path for name in names for path in paths.CODE.parent.glob(f"pipeline/{name}")]
    return [path.relative_to(paths.CODE.parent).with_suffix("").as_posix() for path in found]


def read(folder: Path, names: Iterable[str]) -> list[tuple[str, str]]:
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
            differences.append((path.relative_to(folder).as_posix(), joined))
    return differences
