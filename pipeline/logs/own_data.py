"""Find out whether DVC would notice when your own files change: in data/own, and behind no link to a folder, it does.

DVC 3.67 follows a link to a file, and data/own itself where it is a link or a mounted disk. It skips links to folders:
results would go stale without a word. tests/logs/test_own_data.py holds DVC to this.
"""

import os
import shlex
from collections.abc import Iterable
from pathlib import Path

from pipeline.base.files import sha256
from pipeline.base.paths import Workspace


def unnoticed(workspace: Workspace, path: Path) -> str | None:
    """Say why DVC would not notice a change of `path`, a folder or a file, and what to do; None where it would."""
    path = path.absolute()
    own = _own(workspace, path)
    if own is None:
        target = path.resolve()
        return (
            f"{path} is not in data/own, so `dvc repro` would not notice when it changes; copy it there, or, which "
            f"takes no space, link its files: `{_linking(target, workspace.root / 'data' / 'own' / target.name)}`"
        )
    way = (path, *path.parents)
    links = [folder for folder in way[: way.index(own)] if folder.is_symlink() and folder.is_dir()]
    for parent, folders, files in os.walk(path):
        links += [Path(parent, name) for name in sorted(folders) if Path(parent, name).is_symlink()]
        if lost := [Path(parent, name) for name in sorted(files) if not Path(parent, name).exists()]:
            return f"{lost[0]} is a link that leads to nothing, where `dvc repro` stops; fix or remove it"
    if not links:
        return None
    link = links[0]
    return (
        f"{link} is a link to a folder, in which `dvc repro` would not notice a change; put the folder in its place, "
        "or, which takes no space, links to its files: "
        f"`rm {shlex.quote(str(link))} && {_linking(link.resolve(), link)}`"
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


def setting(workspace: Workspace, path: Path) -> str:
    """Return the name that params.yaml has for a folder or file in data/own: `data/own/...`."""
    path = path.absolute()
    return Path("data", "own", path.relative_to(_own(workspace, path))).as_posix()


def _own(workspace: Workspace, path: Path) -> Path | None:
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
