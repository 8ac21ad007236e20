"""Bad input ends in one sentence, not in a traceback."""

import sys
from collections.abc import Callable


class InputError(Exception):
    """Bad input: the message names the file and the line or key, what is wrong, and what to do."""


def run_stage(main: Callable[[], None]) -> None:
    """Run a stage's `main`; an InputError becomes its sentence on stderr and exit status 1."""
    try:
        main()
    except InputError as error:
        sys.exit(f"error: {error}")
