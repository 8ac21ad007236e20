"""Find out whether files of one's own are followed: those in data/own by DVC, those behind no link to a folder by all.

DVC 3.67 follows a link to a file, and data/own itself where it is a link or a mounted disk. It skips links to folders:
results would go stale without a word. tests/logs/test_own_data.py holds DVC to this.
"""

import os
import shlex
from collections.abc import Iterable
from pathlib import Path

from tactile.base.files import sha256
from tactile.base.paths import Workspace


def unnoticed(workspace: Workspace, path: Path) -> str | None:
    """Say why DVC would not notice a change of `path`, a folder or a file, and what to do; None where it would."""
    path = path.absolute()
    own = own_folder(workspace, path)
    if own is None:
        target = path.resolve()
        return (
            f"{path} is not in data/own, so `dvc repro` would not notice when it changes; copy it there, or, which "
            f"takes no space, link its files: `{_linking(target, workspace.root / 'data' / 'own' / target.name)}`"
        )
    way = (path, *path.parents)
    links = [folder for folder in way[: way.index(own)] if folder.is_symlink() and folder.is_dir()]
    return _not_followed(links[0]) if links else linked(path)


def linked(folder: Path) -> str | None:
    """Return a sentence on a link in a folder that leads to nothing, or to another folder; None where none does."""
    links = []
    for parent, folders, names in os.walk(folder):
        links += [Path(parent, name) for name in sorted(folders) if Path(parent, name).is_symlink()]
        if lost := [Path(parent, name) for name in sorted(names) if not Path(parent, name).exists()]:
            return f"{lost[0]} is a link that leads to nothing; fix or remove it"
    return _not_followed(links[0]) if links else None


def _not_followed(link: Path) -> str:
    return (
        f"{link} is a link to a folder, which is not followed; put the folder in its place, or, which takes no space, "
        f"links to its files: `rm {shlex.quote(str(link))} && {_linking(link.resolve(), link)}`"
    )


def copied(recordings: Iterable[Path], log: str) -> str | None:
    """Say which recordings, folders with a sensor's log that is called so, are copies of one; None where none is."""
    sizes: dict[int, list[Path]] = {}
    for path in recordings:
        if (path / log).is_file() and (size := (path / log).stat().st_size):
            sizes.setdefault(size, []).append(path)
    alike: dict[str, list[str]] = {}
    for paths in sizes.values():
        for path in paths if len(paths) > 1 else ():
            alike.setdefault(sha256(path / log), []).append("/".join(path.parts[-2:]))
    copies = [names for names in alike.values() if len(names) > 1]
    if not copies:
        return None
    more = f" (and {len(copies) - 1} more logs that are there more than once)" if len(copies) > 1 else ""
    return (
        f"{', '.join(copies[0][:-1])} and {copies[0][-1]} have the same {log}, byte for byte{more}; keep one of them "
        "and remove the others, as training and test would share it"
    )


def argument(workspace: Workspace, folder: Path) -> str:
    """Return what `tactile try` and `own` take for a folder of logs, when they are called in the workspace."""
    path = Path(os.path.abspath(folder))  # without ..
    if own := own_folder(workspace, path):
        return Path("data", "own", path.relative_to(own)).as_posix()
    root = Path(os.path.abspath(workspace.root))
    if path.is_relative_to(root) and path != root:
        return path.relative_to(root).as_posix()
    return f"{shlex.quote(str(path))} --root {shlex.quote(str(path.parent))}"


def own_folder(workspace: Workspace, path: Path) -> Path | None:
    """Return `path` (absolute) or the folder above it that is data/own; None without one, or with `..` in between."""
    own = workspace.root / "data" / "own"
    for folder in (path, *path.parents):
        if folder.name == "..":  # leads elsewhere than the text says where the folder before it is a link
            return None
        if own.exists() and folder.exists() and folder.samefile(own):
            return folder
    return None


def _linking(target: Path, link: Path) -> str:
    """Return the command that makes `link` a folder like `target`, with links to its files."""
    return f"cp -rs {shlex.quote(str(target))} {shlex.quote(str(link))}"
