"""The one door for bytes that this program did not write: whatever a reader raises becomes one sentence.

A library's reader lets pass what the parts raise that it calls, some twenty types. Their list is never complete, so
none is kept: every call of such a reader stands in a block of `reading`, which tests/test_architecture.py holds.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.base.errors import InputError

QUOTED = 200  # characters of a library's message


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


def reason(error: BaseException) -> str:
    """Return what an exception says, in printable characters, or its type where it says nothing."""
    said = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return "".join(each if each.isprintable() else " " for each in said[:QUOTED])


def _size(path: Path | str) -> int | None:
    try:
        return Path(path).stat().st_size
    except (OSError, ValueError):  # which the reader tells
        return None
