"""List the public recordings that a user downloads by name; their licences keep them out of this repository.

A source is a list of files at one pinned commit of a public repository, which the facts of its experiment name. The
SHA-256 of every file is in `tactile/logs/<name>.sha256`, one line `<digest>  <path>` per file, as `sha256sum` writes
it. Thousands of files that are numbered have one line, with a path such as `a/{0000..0372}.npz` and the digest that
`sha256sum a/{0000..0372}.npz | sha256sum` writes.
"""

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote

from tactile.base.errors import InputError
from tactile.base.facts import Source
from tactile.base.files import sha256
from tactile.base.paths import Workspace

NUMBERED = re.compile(r"\{([0-9]+)\.\.([0-9]+)\}")


def files(name: str) -> dict[str, str]:
    """Return the SHA-256 (64 hex digits) of every file, or numbered files, of a source by the path in its folder."""
    lines = Path(__file__).with_name(f"{name}.sha256").read_text().splitlines()
    return {path: digest for digest, path in (line.split(maxsplit=1) for line in lines)}


def members(path: str) -> list[str]:
    """Return the paths of the files that a path of `files` names: one, or those that are numbered."""
    if (found := NUMBERED.search(path)) is None:
        return [path]
    first, last = found.groups()
    before, after = path[: found.start()], path[found.end() :]
    return [f"{before}{number:0{len(first)}d}{after}" for number in range(int(first), int(last) + 1)]


def digest(there: Mapping[str, Path]) -> str:
    """Return the digest, as `files` has it, of files by their paths in the source; there: where each of them lies."""
    lines = {path: sha256(at) for path, at in there.items()}
    if len(lines) == 1:
        return next(iter(lines.values()))
    return hashlib.sha256("".join(f"{each}  {path}\n" for path, each in lines.items()).encode()).hexdigest()


def address(origin: Source, path: str) -> str:
    """Return the public address of one file, at the pinned commit."""
    place = quote(f"{origin.folder}/{path}")
    return f"https://raw.githubusercontent.com/{origin.repository}/{origin.commit}/{place}"


def folder(workspace: Workspace, name: str) -> Path:
    """Return `data/sources/<name>`, where `tactile fetch <name>` puts the files."""
    return workspace.sources / name


def is_complete(workspace: Workspace, name: str) -> bool:
    """Return whether `folder(name)` has all files of a source (True) or none (False).

    Raises InputError that names the first file that is missing beside others, or whose SHA-256 is another.
    """
    at = folder(workspace, name)
    listed = {path: {one: at / one for one in members(path)} for path in files(name)}
    missing = {one for there in listed.values() for one, file in there.items() if not file.is_file()}
    if len(missing) == sum(map(len, listed.values())):
        return False
    for path, expected in files(name).items():
        there = listed[path]
        if (lost := next((one for one in there if one in missing), None)) or digest(there) != expected:
            wrong = "is missing" if lost else "is not the recorded file (its SHA-256 differs)"
            if not lost and len(there) > 1:
                wrong = "are not the recorded files (their SHA-256 differs)"
            raise InputError(
                f"{at / (lost or path)}: {wrong}; run `tactile fetch {name}`, which gets what is missing or "
                f"wrong, or remove all of {at} to go on without these recordings"
            )
    return True
