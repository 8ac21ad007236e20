"""The one door for bytes that this program did not write: whatever a reader raises becomes one sentence.

A library's reader lets pass what the parts raise that it calls, some twenty types. Their list is never complete, so
none is kept: every call of such a reader stands in a block of `reading`, or in a function that `apart` runs, which
tests/test_architecture.py holds.
"""

import functools
import multiprocessing
import os
import threading
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeVar

from tactile.base.errors import InputError
from tactile.base.processes import die_with_parent

QUOTED = 200  # characters of a library's message
# Measured readings seldom shrink to a tenth when they are packed; zip and gzip reach a thousandth.
PACKED, SMALL = 200, 64 << 20  # times that an archive may grow, bytes up to which it may grow more
Result = TypeVar("Result")
DONE, REFUSED, FAILED, NO_MEMORY, LATE, ENDED = range(6)  # what comes of the process that reads


@contextmanager
def reading(path: Path | str, what: str, remedy: str, largest: int | None = None) -> Iterator[None]:
    """Turn any exception of the block into InputError "PATH: not WHAT (reason); REMEDY"; InputError passes as it is.

    what: such as "a whole workbook"; largest: bytes that the file may have, which is asked before the block.
    """
    if largest is not None and (size := _size(path)) is not None and size > largest:
        raise InputError(f"{path}: {size} bytes are more than {what} can have ({largest}); {remedy}")
    try:
        yield
    except InputError:
        raise
    except FileNotFoundError as error:
        raise InputError(f"{path}: not found; {remedy}") from error
    except MemoryError as error:
        raise InputError(f"{path}: takes more memory to read than there is; {remedy}") from error
    except Exception as error:
        raise InputError(f"{path}: not {what} ({reason(error)}); {remedy}") from error


def apart(
    path: Path,
    what: str,
    remedy: str,
    function: Callable[..., Result],
    *arguments: object,
    memory: int,
    seconds: float,
    **named: object,
) -> Result:
    """Return what `function` of a module, called in a process of its own, returns; errors as `reading`.

    A damaged file crashes some readers, with the process that they are in, and a file of a megabyte may unpack to all
    memory. InputError, too, where reading takes `seconds`, or more than `memory` bytes beyond what the process has (on
    Linux). The process stays for the next file: its start takes a second.
    """
    with _ONE_AT_A_TIME:
        if not _reader(os.getpid()).process.is_alive():
            _reader.cache_clear()
        reader, kind = _reader(os.getpid()), ENDED
        try:
            kind, answer = reader.asked(seconds, memory, function, arguments, named)
        finally:
            if kind in (NO_MEMORY, LATE, ENDED):  # also after Ctrl-C: its answer must not become the next file's
                reader.end()
                _reader.cache_clear()
    if kind == DONE:
        return answer
    if kind == REFUSED:
        raise InputError(answer)
    if kind == NO_MEMORY:
        more = f"takes more than {memory >> 20} MiB of memory to read, and the data cannot need that"
        raise InputError(f"{path}: {more}; {remedy}")
    if kind == LATE:
        raise InputError(f"{path}: takes more than {seconds:g} s to read; {remedy}")
    raise InputError(f"{path}: not {what} ({answer}); {remedy}")


def check_archive(path: Path, what: str, remedy: str) -> None:
    """Raise InputError for a zip file that is damaged, or that unpacks, as it says, to far more than readings do."""
    with reading(path, what, remedy), zipfile.ZipFile(path) as archive:
        unpacked, size = sum(member.file_size for member in archive.infolist()), path.stat().st_size
        if unpacked > max(SMALL, PACKED * size):
            raise InputError(
                f"{path}: its {size} bytes unpack to {unpacked}, and readings do not shrink to 1/{PACKED}; {remedy}"
            )


def reason(error: BaseException) -> str:
    """Return what an exception says, in printable characters, or its type where it says nothing."""
    said = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return "".join(each if each.isprintable() else " " for each in said[:QUOTED])


class _Reader:
    """A process that calls functions, one after the other."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")  # a fork would have the threads' locks
        self._ours, theirs = context.Pipe()
        self.process = context.Process(target=_answer, args=(theirs,), daemon=True)
        self.process.start()
        theirs.close()

    def asked(self, seconds: float, *call: object) -> tuple[int, Any]:
        """Return what came of a call, DONE to ENDED, and what was returned or said."""
        try:
            self._ours.send(call)
            if not self._ours.poll(seconds):
                return LATE, None
            return self._ours.recv()
        except (EOFError, ConnectionError):
            return ENDED, "it crashes the reader"

    def end(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.join()
        self._ours.close()


_ONE_AT_A_TIME = threading.Lock()


@functools.lru_cache(1)
def _reader(_process: int) -> _Reader:
    """Return the process that reads for this process, the same until a file crashes it; a fork gets its own."""
    return _Reader()


def _answer(ours: Connection) -> None:
    """Call functions that come through a pipe, and send what they return or say."""
    die_with_parent()
    while True:
        try:
            memory, function, arguments, named = ours.recv()
        except EOFError:  # the other end is closed
            return
        try:
            _limit(memory)
            ours.send((DONE, function(*arguments, **named)))
        except InputError as error:
            ours.send((REFUSED, str(error)))
        except MemoryError:
            ours.send((NO_MEMORY, None))
        except Exception as error:  # of a library that reads: see `reading`
            ours.send((FAILED, reason(error)))
        _limit(None)  # the next call may import a library first


def _limit(memory: int | None) -> None:
    """Let this process take `memory` bytes more than it has, None: any; beyond that a MemoryError comes. On Linux."""
    size = Path("/proc/self/statm")
    if size.is_file():
        import resource  # Windows has no such module

        _, most = resource.getrlimit(resource.RLIMIT_AS)
        wanted = most if memory is None else int(size.read_text().split()[0]) * resource.getpagesize() + memory
        resource.setrlimit(resource.RLIMIT_AS, (wanted if most == resource.RLIM_INFINITY else min(wanted, most), most))


def _size(path: Path | str) -> int | None:
    try:
        return Path(path).stat().st_size
    except (OSError, ValueError):  # which the reader tells
        return None
