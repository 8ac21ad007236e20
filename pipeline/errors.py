"""Bad input ends in one sentence, not in a traceback. So does a disk that is full or must not be written."""

import errno
import os
import re
import sys
from collections.abc import Callable
from pathlib import Path

from pipeline.parent import die_with_parent

# What ends a write through no fault of the code.
STORAGE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO)


class InputError(Exception):
    """Bad input: the message, one line, names the file and the line or key, what is wrong, and what to do."""

    def __init__(self, message: str):
        super().__init__(re.sub(r"\s*[\r\n]\s*", " ", message))  # it may quote a library's, which has more


def run_stage(main: Callable[[], None]) -> None:
    """Run a stage's `main`; an InputError, or a disk's, becomes its sentence on stderr and exit status 1.

    A stage that DVC started ends with it: otherwise the next `dvc repro` would find it still writing. It fails where
    params.yaml changed while it ran: DVC reads the file after the stage, and would take the results for those of the
    new values.
    """
    from pipeline import paths  # which needs InputError

    by_dvc = "DVC_STAGE" in os.environ
    if by_dvc:
        die_with_parent()
    settings = _content(paths.PARAMS)
    try:
        main()
        if by_dvc and _content(paths.PARAMS) != settings:
            raise InputError("params.yaml changed while this ran; run `dvc repro` again, for results of the new values")
    except InputError as error:
        sys.exit(f"error: {error}")
    except Exception as error:
        if storage_error(error) is None:
            raise
        sys.exit(f"error: {storage_error(error)}")


def _content(path: Path) -> bytes | None:
    """The bytes of a file, None without it."""
    return path.read_bytes() if path.is_file() else None


def storage_error(error: Exception) -> str | None:
    """The sentence for a full, read-only or failing disk; None for any other error."""
    # safetensors, written in Rust, says "(os error 28)".
    code = error.errno if isinstance(error, OSError) else int((re.findall(r"os error (\d+)", str(error)) or [0])[0])
    if code not in STORAGE:
        return None
    where = f"{error.filename}: " if isinstance(error, OSError) and error.filename else ""
    return (
        f"{where}{os.strerror(code)}; free or unlock the disk and run the command again "
        "(an unfinished file is never taken for a result)"
    )
