"""Write files and folders that change only when all of their new content is written, and then at once.

A draft lies beside what it becomes, and its name has the process that writes it, so that two processes never write to
one draft. It is on the disk before it is renamed: else a loss of power could leave a renamed file empty. The draft of a
killed process is removed by the next one that writes to the same place.
"""

import bz2
import contextlib
import csv
import ctypes
import errno
import glob
import gzip
import hashlib
import os
import platform
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tactile.base import foreign
from tactile.base.errors import InputError, storage_code, storage_error

if TYPE_CHECKING:
    import pandas as pd

BLOCK = 1 << 20  # bytes of a log that are read at once
UNFINISHED = ".unfinished"  # ends the name of a draft
NO_SYNC = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)  # of file systems that cannot wait for their disk


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the block the draft of a file, which becomes `path` where the block ends without an error.

    Raises InputError where `path` cannot be a file.
    """
    draft = _draft(path)
    try:
        yield draft
        _on_disk(draft)
        os.replace(draft, path)
    except BaseException as error:
        draft.unlink(missing_ok=True)
        code = storage_code(error)
        if code is not None and getattr(error, "filename", None) in (None, str(draft)):  # libraries name no file
            raise OSError(code, os.strerror(code), str(path)) from error
        if code is None and isinstance(error, OSError) and error.filename == str(draft):
            raise _unwritable(path, error) from error
        raise
    _on_disk(path.parent)


def remove_folder(folder: Path, inside: Path) -> None:
    """Remove a folder with all its content, where it exists; InputError unless it lies below the folder `inside`."""
    place, room = folder.resolve(), inside.resolve()
    if place == room or not place.is_relative_to(room):
        raise InputError(f"{folder}: lies outside {inside}, so it is not removed; give it a name inside that folder")
    shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """Give the block a new, empty folder, which becomes `path` where the block ends without an error.

    Of two processes that write to one place the folder of the later one stays, whole. Raises InputError where `path`
    cannot be a folder.
    """
    draft = _draft(path)
    if path.is_symlink():  # which stays
        path = path.resolve()
        draft = _draft(path)
    if path.exists() and not path.is_dir():
        raise InputError(f"{path}: is a file, not a folder; give another place")
    try:
        draft.mkdir()
    except OSError as error:
        if storage_error(error):
            raise
        raise _unwritable(path, error) from error
    try:
        yield draft
        put_folder(draft, path)
    finally:
        remove_folder(draft, inside=path.parent)  # once it became `path`, it is the former folder


@contextlib.contextmanager
def changing_folder(path: Path) -> Iterator[Path]:
    """Give the block a new folder with what `path` holds, which becomes `path` where the block ends without an error.

    Files of the former folder are linked, not copied: the block replaces them and writes in none. Raises InputError
    where `path` cannot be a folder, or another process puts a file into it meanwhile.
    """
    with replacing_folder(path) as draft:
        held = _held(path)
        if path.is_dir():
            shutil.copytree(path, draft, symlinks=True, copy_function=_linked, dirs_exist_ok=True)
        yield draft
        if _held(path) != held:
            raise InputError(f"{path}: another process changed it meanwhile; run the command again")


def finished(paths: Iterable[Path]) -> Iterator[Path]:
    """Yield the paths that lie in no draft, such as one that a killed process has left among recordings."""
    return (path for path in paths if not any(part.endswith(UNFINISHED) for part in path.parts))


def _held(folder: Path) -> set[tuple[str, int]]:
    """Return the path and number of every file below a folder; its number is another one once it was replaced."""
    return {(str(path), path.lstat().st_ino) for path in folder.rglob("*") if not path.is_dir()}


def _linked(source: str, target: str) -> None:
    """Give a file a second name, or copy it where the file system has no such names."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def put_folder(draft: Path, path: Path) -> None:
    """Give a whole folder the name `path`, at once; what had that name gets the draft's, or is removed."""
    for place, _, names in os.walk(draft, topdown=False):
        for one in (Path(place, name) for name in (*names, "")):
            if not one.is_symlink() and (one.is_file() or one.is_dir()):
                _on_disk(one)
    _put(draft, path)
    _on_disk(path.parent)


def _draft(path: Path) -> Path:
    """Return the place of this process's draft of a path, which is free, and remove the drafts of dead processes."""
    machine = f"-{platform.node()}{UNFINISHED}"
    if path.name in ("", ".."):
        raise InputError(f"{path}: is a folder that nothing can take the place of; give the name of a new one in it")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_name(f"{path.name}.{os.getpid()}{machine}")
        with contextlib.suppress(FileNotFoundError):
            draft.lstat()  # OSError of a name that is too long, ValueError of one with a NUL
        for other in path.parent.glob(glob.escape(path.name) + ".*" + glob.escape(machine)):
            number = other.name.removeprefix(f"{path.name}.").removesuffix(machine)
            if number.isdecimal() and (other == draft or not _runs(int(number))):
                other.unlink() if other.is_file() else remove_folder(other, inside=path.parent)
    except (OSError, ValueError) as error:  # a name that is too long, that has a NUL, or below a file or /proc
        if isinstance(error, OSError) and storage_error(error):
            raise
        raise _unwritable(path, error) from error
    return draft


def _unwritable(path: Path, error: Exception) -> InputError:
    """Return the sentence for a place at which nothing can be written, such as one below /proc."""
    reason = getattr(error, "strerror", None) or error
    return InputError(f"{path}: cannot be written ({reason}); give another place")


def _runs(process: int) -> bool:
    """Is there such a process on this machine? Yes, where that cannot be asked."""
    try:
        if os.name == "posix":
            os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # it is another user's
        return True
    return True


def _put(draft: Path, path: Path) -> None:
    """Give a folder the name `path`, at once; what had that name gets the draft's, or is removed."""
    try:
        draft.rename(path)
    except OSError:
        if not path.is_dir():
            raise
        if not _exchanged(draft, path):  # a kill between the next two lines leaves the former folder as NAME.former
            former = path.with_name(path.name + ".former")
            remove_folder(former, inside=path.parent)
            path.rename(former)
            draft.rename(path)
            remove_folder(former, inside=path.parent)


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange the names of two places at once; False where the system or the file system cannot."""
    here, exchange = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of Linux, RENAME_SWAP of macOS
    places = os.fsencode(one), os.fsencode(other)
    try:
        if sys.platform == "darwin":
            return ctypes.CDLL(None).renamex_np(*places, exchange) == 0
        return sys.platform == "linux" and ctypes.CDLL(None).renameat2(here, places[0], here, places[1], exchange) == 0
    except AttributeError:  # a C library without the call
        return False


def _on_disk(path: Path) -> None:
    """Wait until the disk has what a file holds, or which names a folder has."""
    if os.name == "nt" and path.is_dir():
        return  # Windows opens no folder
    of_folder = os.O_DIRECTORY if path.is_dir() else 0  # nothing in it is read
    opened = os.open(path, os.O_RDWR if os.name == "nt" else os.O_RDONLY | of_folder)
    try:
        os.fsync(opened)
    except OSError as error:
        if error.errno not in NO_SYNC:
            raise
    finally:
        os.close(opened)


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence]) -> None:
    """Write a header and rows in UTF-8, numbers in full precision."""
    with replacing(path) as draft, open(draft, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)


def write_table(path: Path, table: "pd.DataFrame", missing: str = "") -> None:
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
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        start = file.read(3)
    with foreign.reading(path, "a whole log, where it is compressed", "compress it again"):
        packed = gzip.open if start.startswith(b"\x1f\x8b") else bz2.open if start == b"BZh" else open
        with packed(path, "rb") as file:
            block = file.read(BLOCK).removeprefix(b"\xef\xbb\xbf")
            while block:
                digest.update(block.translate(None, b"\r\n"))
                block = file.read(BLOCK)
    return digest.hexdigest()


def _shortest(value: float) -> str:
    """Return the shortest text that reads back as the same number."""
    return repr(float(value))
