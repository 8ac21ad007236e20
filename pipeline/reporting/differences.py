"""The comments in the code that say where it departs from a paper."""

import re
from pathlib import Path

MARK = re.compile(r"(?:^|#)\s*Differs from paper:\s*(.*)")


def read_differences(folder: Path) -> list[tuple[str, str]]:
    """(file, text) of every comment in folder/**/*.py that starts with the mark, by file and line.

    A comment goes on over following lines that are comments; in a docstring, up to an empty line or the end.
    """
    found = []
    for path in sorted(folder.rglob("*.py")):
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
            found.append((path.relative_to(folder.parent).as_posix(), joined))
    return found
