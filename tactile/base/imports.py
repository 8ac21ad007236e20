"""Find the files of this project that a file imports, without running any: their text is parsed.

A room is a folder of tactile/ or of pipeline/, where there is one. Rooms and files are named by their path below the
repository, `tactile/models` and `tactile/models/cnn.py`.
"""

import ast
from collections.abc import Collection, Mapping
from functools import cache
from pathlib import Path

from tactile.base import paths
from tactile.base.errors import InputError

HOUSES = ("tactile", "pipeline")
# Rooms whose __init__ imports a file of the room by a name that params.yaml or dvc.yaml gives.
DOORS = ("tactile/experiments", "tactile/models", "pipeline/scenes", "tactile/tasks")
NO_NUMBER = ("tactile/base", "tactile/settings")  # rooms that can change no number: what they refuse is not run


def room(file: str) -> str:
    """Return the room of a file."""
    return Path(file).parent.as_posix()


def imported_names(file: str) -> frozenset[str]:
    """Return the dotted names of all that a file imports, at its top or inside a function.

    Raises InputError for `from . import ...`, which does not name the room.
    """
    return _names(file, (paths.CODE.parent / file).read_text(encoding="utf-8"))


def imports(file: str) -> set[str]:
    """Return the files of this project that Python runs for a file's imports, less an __init__ that does nothing."""
    files = _files_of_names(paths.CODE.parent, imported_names(file))
    return {other for other in files if Path(other).name != "__init__.py" or imported_names(other)}


def closure(
    file: str, behind: Mapping[str, Collection[str]] | None = None, unused: Collection[tuple[str, str]] = ()
) -> set[str]:
    """Return a file and all that it imports, directly or not.

    `behind`: room of DOORS -> the files that its __init__ comes to, without it every file of the room; `unused`: pairs
    of rooms, of which the first one's imports from the second are left out.
    """
    behind = behind or {name: _files_of(name) for name in DOORS}
    seen, todo = set(), [file]
    while todo:
        current = todo.pop()
        if current in seen:
            continue
        seen.add(current)
        here = room(current)
        files = {other for other in imports(current) if (here, room(other)) not in unused}
        if here in DOORS and Path(current).name == "__init__.py":
            files = {other for other in files if room(other) != here} | set(behind[here])
        todo += files
    return seen


def _files_of(name: str) -> list[str]:
    """Return the files of a room."""
    return [path.relative_to(paths.CODE.parent).as_posix() for path in (paths.CODE.parent / name).glob("*.py")]


@cache
def _files_of_names(root: Path, names: frozenset[str]) -> frozenset[str]:
    """Return the files below `root` that the dotted names come to. Every model and stage asks for the same ones."""
    files = set()
    for name in names:
        steps = name.split(".") if name.split(".")[0] in HOUSES else []
        for k in range(1, len(steps) + 1):
            place = "/".join(steps[:k])
            both = f"{place}.py", f"{place}/__init__.py"
            files |= {other for other in both if (root / other).is_file()}
    return frozenset(files)


@cache
def _names(file: str, text: str) -> frozenset[str]:
    """Return the dotted names that a file of this text imports."""
    names = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                where = f"{file}, line {node.lineno}"
                raise InputError(f"{where}: an import from '.'; name the room, `from tactile.<room> import ...`")
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(names)
