"""Run a stage or command of this code as a process of its own, in a workspace."""

import os
import subprocess
import sys
from pathlib import Path

from tactile.base import paths, processes
from tactile.base.errors import InputError


def run(root: Path, module: str, *arguments: str, quiet: bool = False) -> None:
    """Run a module of this code in a workspace; InputError where it fails: its message is on the screen."""
    further = os.environ.get("PYTHONPATH")  # packages that evidence/run.py has put beside the code
    places = [str(paths.CODE.parent), *([further] if further else [])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(places)}
    command = [sys.executable, "-P", "-m", module, *arguments, "--root", str(root)]
    ended = processes.die_with_parent if os.name == "posix" else None
    done = subprocess.run(command, env=environment, stdout=subprocess.DEVNULL if quiet else None, preexec_fn=ended)
    if done.returncode:
        raise InputError(f"{root}: `{module} {' '.join(arguments)}` failed; its message is above")
