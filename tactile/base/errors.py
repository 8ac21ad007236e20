"""Turn bad input, a full or locked disk, a lack of memory and an absent library into one sentence, not a traceback."""

import errno
import io
import os
import re
import signal
import sys
import unicodedata
from collections.abc import Callable
from pathlib import Path

from tactile.base.processes import die_with_parent

# Errors that end a write through no fault of the code.
STORAGE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO)
# Of a name that cannot be that of a file or folder here, as somebody may have given it.
NAMES: tuple[int, ...] = (errno.ENAMETOOLONG, errno.ELOOP, errno.ENOTDIR, errno.EISDIR, errno.ENXIO, errno.ENODEV)
NAMES += (errno.EBUSY, errno.EILSEQ, errno.ESTALE, errno.ETXTBSY)
FULL = (errno.ENOSPC, errno.EDQUOT)  # these also cut the files that DVC writes in place

SHOWN = 200  # characters of a name that is too long
PIPE_CLOSED = 141  # exit status that a shell gives a command which writes to a closed pipe

# Words of torch and of the system for what Python calls MemoryError.
NO_MEMORY = re.compile(r"can't allocate memory|cannot allocate memory|out of memory|bad_alloc", re.IGNORECASE)

HIDDEN = ("Cc", "Cf", "Cn", "Co", "Cs", "Zl", "Zp")  # categories of signs that are not seen as they are


class InputError(Exception):
    """Bad input: the message, one line, names the file and the line or key, what is wrong, and what to do.

    What it quotes may hold signs that move a terminal's cursor or turn its text: they are shown as Python escapes them.
    """

    def __init__(self, message: str):
        line = " ".join(part.strip() for part in re.split(r"[\r\n]+", message))  # a library's may have several
        super().__init__("".join(ascii(c)[1:-1] if unicodedata.category(c) in HIDDEN else c for c in line).strip())


def run_stage(main: Callable[[], None], params: Path) -> None:
    """Run a stage's `main`; bad input, a disk and a lack of memory become a sentence on stderr and exit status 1.

    Ctrl-C, and a reader that closes the pipe, print nothing and end with the status that a shell gives them. A stage
    that DVC started ends when DVC does: otherwise the next `dvc repro` would find the stage still writing. The stage
    fails where the settings, of `params` and the files beside it, changed while it ran: DVC reads them after the stage,
    and would take the results for results of the new values.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # names of folders that a terminal's or a file's encoding lacks
            stream.reconfigure(errors="backslashreplace")
    by_dvc = "DVC_STAGE" in os.environ
    if by_dvc:
        die_with_parent()
    settings = _settings(params)
    try:
        main()
        print(end="", flush=True)  # also where there is no standard output
        if by_dvc and (changed := sorted(name for name, _ in settings ^ _settings(params))):
            raise InputError(
                f"{changed[0]} changed while this ran; run `dvc repro` again, for results of the new values"
            )
    except InputError as error:
        sys.exit(f"error: {error}")
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
    except BrokenPipeError:  # who read has seen enough, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(PIPE_CLOSED)
    except Exception as error:
        from tactile.base import extras  # here: only an error needs it

        sentence = storage_error(error) or name_error(error) or extras.sentence(error)
        if sentence is None and (reason := memory_error(error)) is not None:
            sentence = f"{reason}; free memory or make the settings smaller, and run the command again"
        if sentence is None:
            raise
        sys.exit(f"error: {sentence}")


def name_error(error: BaseException) -> str | None:
    """Return the sentence for a name that the system refuses; None for any other error."""
    if not (isinstance(error, OSError) and error.filename and error.errno in NAMES):
        return None
    name = str(error.filename)
    shown = name if len(name) <= SHOWN else f"{name[:SHOWN]}..."
    return f"{shown}: {os.strerror(error.errno)}; give another name or place"


def memory_error(error: BaseException) -> str | None:
    """Return the words for an error that means a lack of memory; None for any other error."""
    by_words = isinstance(error, (RuntimeError, OSError)) and NO_MEMORY.search(str(error))
    if not (isinstance(error, MemoryError) or by_words):
        return None
    return f"not enough memory ({str(error).splitlines()[0] if str(error) else type(error).__name__})"


def _settings(path: Path) -> set[tuple[str, bytes]]:
    """Return (name, content) of params.yaml, which is `path`, and of every file in the folder `params` beside it."""
    files = [path, *(path.parent / "params").glob("*.yaml")]
    return {(file.relative_to(path.parent).as_posix(), file.read_bytes()) for file in files if file.is_file()}


def storage_code(error: BaseException) -> int | None:
    """Return the number of the error of a full, read-only or failing disk; None for any other error."""
    # safetensors, written in Rust, says "(os error 28)".
    code = error.errno if isinstance(error, OSError) else int((re.findall(r"os error (\d+)", str(error)) or [0])[0])
    return code if code in STORAGE else None


def storage_error(error: Exception) -> str | None:
    """Return the sentence for a full, read-only or failing disk; None for any other error."""
    code = storage_code(error)
    if code is None:
        return None
    where = f"{error.filename}: " if isinstance(error, OSError) and error.filename else ""
    cut = "; if DVC then calls .dvc/tmp/rwlock corrupted, remove that file" if code in FULL else ""
    return (
        f"{where}{os.strerror(code)}; free or unlock the disk and run the command again "
        f"(an unfinished file is never taken for a result{cut})"
    )
