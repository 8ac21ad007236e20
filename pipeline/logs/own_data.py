"""Your own files: in data/own, and behind no link to a folder, DVC notices when they change.

DVC 3.67 reads what a link to a file leads to, and data/own where it is a link or a mounted disk itself. It skips links
to folders: results would go stale without a word. tests/logs/test_own_data.py holds DVC to this.
"""

import os
import shlex
from pathlib import Path

from pipeline.base import paths


def unnoticed(path: Path) -> str | None:
    """Say why DVC would not notice a change of `path`, a folder or a file, and what to do; None where it would."""
    path = path.absolute()
    own = _own(path)
    if own is None:
        target = path.resolve()
        return (
            f"{path} is not in data/own, so `dvc repro` would not notice when it changes; copy it there, or, which "
            f"takes no space, link its files: `{_linking(target, paths.ROOT / 'data' / 'own' / target.name)}`"
        )
    way = (path, *path.parents)
    links = [one for one in way[: way.index(own)] if one.is_symlink() and one.is_dir()]
    for parent, folders, files in os.walk(path):
        links += [Path(parent, name) for name in sorted(folders) if Path(parent, name).is_symlink()]
        if lost := [Path(parent, name) for name in sorted(files) if not Path(parent, name).exists()]:
            return f"{lost[0]} is a link that leads to nothing, where `dvc repro` stops; mend or remove it"
    if not links:
        return None
    link = links[0]
    return (
        f"{link} is a link to a folder, in which `dvc repro` would not notice a change; put the folder in its place, "
        "or, which takes no space, links to its files: "
        f"`rm {shlex.quote(str(link))} && {_linking(link.resolve(), link)}`"
    )


def setting(path: Path) -> str:
    """Give a folder or file in data/own the name that params.yaml has for it: `data/own/...`."""
    path = path.absolute()
    return Path("data", "own", path.relative_to(_own(path))).as_posix()


def _own(path: Path) -> Path | None:
    """The folder above `path` (absolute), or `path`, that is data/own; None where none is, or `..` is in between."""
    own = paths.ROOT / "data" / "own"
    for folder in (path, *path.parents):
        if folder.name == "..":  # leads elsewhere than the text says, where what is before it is a link
            return None
        if own.exists() and folder.exists() and folder.samefile(own):
            return folder
    return None


def _linking(target: Path, link: Path) -> str:
    """The command that makes `link` a folder like `target`, with links to its files."""
    return f"cp -rs {shlex.quote(str(target))} {shlex.quote(str(link))}"
