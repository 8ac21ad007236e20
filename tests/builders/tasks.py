"""Define tasks for local processes, in a module that every process can import."""

import os
import time
from pathlib import Path
from typing import Any


def slow(folder: Path, report: Any) -> None:
    """Leave a file named after the process in `folder`, then take a minute."""
    (folder / str(os.getpid())).touch()
    time.sleep(60)
