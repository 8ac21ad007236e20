"""Write files and folders that change only when all of their new content is written, and then at once.

A killed stage leaves a draft beside them, `<name>.unfinished`, which the next call writes anew.
"""

import bz2
import csv
import gzip
import hashlib
import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from pipeline.base.errors import InputError

BLOCK = 1 << 20  # bytes of a log that are read at once


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the block the draft of a file, which becomes `path` where the block ends without an error."""
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(path.name + ".unfinished")
    yield draft
    os.replace(draft, path)


def remove_folder(folder: Path, inside: Path) -> None:
    """Remove a folder with all its content, where it exists; InputError unless it lies below the folder `inside`."""
    place, room = folder.resolve(), inside.resolve()
    if place == room or not place.is_relative_to(room):
        raise InputError(f"{folder}: lies outside {inside}, so it is not removed; give it a name inside that folder")
    shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """Give the block a new, empty folder, which becomes `path` where the block ends without an error."""
    draft = path.with_name(path.name + ".unfinished")
    remove_folder(draft, inside=path.parent)
    draft.mkdir(parents=True)
    yield draft
    remove_folder(path, inside=path.parent)
    draft.rename(path)


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence]) -> None:
    """Write a header and rows in UTF-8, numbers in full precision."""
    with replacing(path) as draft, open(draft, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)


def write_table(path: Path, table, missing: str = "") -> None:
    """Write a pandas table without its index as CSV, numbers in full precision; `missing` stands for NaN."""
    with replacing(path) as draft:
        table.to_csv(draft, index=False, lineterminator="\n", na_rep=missing, float_format=_shortest)


def write_text(path: Path, text: str) -> None:
    """Write text in UTF-8 with Unix line ends on every machine."""
    with replacing(path) as draft:
        draft.write_text(text, encoding="utf-8", newline="\n")


def sha256(path: Path) -> str:
    """Return the digest of a file."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def content_sha256(path: Path) -> str:
    """Return the digest of what a log says, so that its copies are one log whatever they are called.

    It is that of the unpacked bytes (gzip, bzip2) without line ends and without the byte order mark of an editor.
    """
    with open(path, "rb") as file:
        start = file.read(3)
    packed = gzip.open if start.startswith(b"\x1f\x8b") else bz2.open if start == b"BZh" else open
    digest = hashlib.sha256()
    with packed(path, "rb") as file:
        block = file.read(BLOCK).removeprefix(b"\xef\xbb\xbf")
        while block:
            digest.update(block.translate(None, b"\r\n"))
            block = file.read(BLOCK)
    return digest.hexdigest()


def _shortest(value: float) -> str:
    """Return the shortest text that reads back as the same number."""
    return repr(float(value))
