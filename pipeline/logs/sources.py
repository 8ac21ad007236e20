"""List the public recordings that a user downloads by name; their licences keep them out of this repository.

A source is a list of files at one pinned commit of a public repository, which the facts of its experiment name. The
SHA-256 of every file is in `pipeline/logs/<name>.sha256`, one line `<digest>  <path>` per file, as `sha256sum` writes
it.
"""

from pathlib import Path
from urllib.parse import quote

from pipeline.base.errors import InputError
from pipeline.base.facts import Source
from pipeline.base.files import sha256
from pipeline.base.paths import Workspace


def files(name: str) -> dict[str, str]:
    """Return the SHA-256 (64 hex digits) of every file of a source, by its path inside the source's folder."""
    lines = Path(__file__).with_name(f"{name}.sha256").read_text().splitlines()
    return {path: digest for digest, path in (line.split(maxsplit=1) for line in lines)}


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
    at, listed = folder(workspace, name), files(name)
    present = [path for path in listed if (at / path).is_file()]
    if not present:
        return False
    for path, digest in listed.items():
        if path not in present or sha256(at / path) != digest:
            wrong = "is not the recorded file (its SHA-256 differs)" if path in present else "is missing"
            raise InputError(
                f"{at / path}: {wrong}; run `tactile fetch {name}`, which gets what is missing or "
                f"wrong, or remove all of {at} to go on without these recordings"
            )
    return True
