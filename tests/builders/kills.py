"""Kill a command before each change that it makes to files, in forks of this process.

Python tells an audit hook of every change but one, the exchange of two folders: a kill comes before and after it, too.
"""

import io
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from tactile.base import files

CHANGES = ("os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.symlink", "os.link", "os.truncate")
REMOVES = ("os.remove", "os.rmdir")  # of rmtree, which names what is in a folder that it has opened
WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT
LIMIT_S = 60


class Ended(NamedTuple):
    """How a fork ended."""

    code: int  # exit status, or minus the signal's number
    said: str  # what it printed
    changes: list[str]  # of files below the watched folder


class Running:
    """A fork that runs a call, and is killed before change number `kill_at` of files below a folder."""

    def __init__(self, call: Callable[[], object], below: Path, notes: Path, kill_at: int = 0):
        """Start the fork; notes: a folder for what it prints and does."""
        notes.mkdir(exist_ok=True)
        self.place = notes / f"{time.monotonic_ns()}"
        self.process = os.fork()
        if not self.process:
            _run(call, below, self.place, kill_at)

    def ended(self) -> Ended:
        """Wait for its end; an AssertionError where it takes longer than LIMIT_S."""
        deadline = time.monotonic() + LIMIT_S
        while not (found := os.waitpid(self.process, os.WNOHANG))[0]:
            if time.monotonic() > deadline:
                os.kill(self.process, signal.SIGKILL)
                os.waitpid(self.process, 0)
                raise AssertionError(f"not done in {LIMIT_S} s")
            time.sleep(0.002)
        said, changes = (self.place.with_suffix(end).read_text(errors="replace") for end in (".said", ".changes"))
        return Ended(os.waitstatus_to_exitcode(found[1]), said, changes.splitlines())


def run(call: Callable[[], object], below: Path, notes: Path, kill_at: int = 0) -> Ended:
    """Run a call in a fork, and wait for its end."""
    return Running(call, below, notes, kill_at).ended()


def tree(place: Path) -> dict[str, bytes] | bytes | None:
    """Return the content of a file, or of all files of a folder; None where there is neither."""
    if place.is_dir():
        return {str(path.relative_to(place)): path.read_bytes() for path in sorted(place.rglob("*")) if path.is_file()}
    return place.read_bytes() if place.exists() else None


def drafts(folder: Path) -> list[str]:
    """Return what is below a folder that the next call should have removed."""
    return sorted(path.name for path in folder.rglob("*") if path.name.endswith((files.UNFINISHED, ".former")))


def sweep(
    call: Callable[[], object], put: Callable[[], object], target: Path, notes: Path, most: int = 1000,
    read: Callable[[Path], object] = tree,
) -> int:  # fmt: skip
    """Kill a call before each change, `most` of them at the most, and return how many kills there were.

    put: restores what there was before the call; target: what it writes, in a folder of its own; read: what counts of
    it. After every kill the target is what it was or what it becomes, and the call then succeeds, ends as a quiet one
    and leaves no draft.
    """
    put()
    quiet = run(call, target.parent, notes)
    assert quiet.code == 0, quiet.said
    whole, count = read(target), len(quiet.changes)
    assert whole is not None and count
    assert run(call, target.parent, notes).code == 0
    twice = read(target)
    chosen = range(1, count + 1) if count <= most else sorted({1 + k * (count - 1) // (most - 1) for k in range(most)})
    for number in chosen:
        put()
        before = read(target)
        killed = run(call, target.parent, notes, number)
        assert killed.code == -signal.SIGKILL, (number, killed.said)
        at = f"kill before change {number} of {count}, {quiet.changes[number - 1]}"
        left = read(target)
        assert left in (before, whole), at
        again = run(call, target.parent, notes)
        assert again.code == 0 and "Traceback" not in again.said, f"{at}: {again.said}"
        assert read(target) == (twice if left == whole else whole), at
        assert not drafts(target.parent), f"{at}: {drafts(target.parent)}"
    return len(chosen)


def _run(call: Callable[[], object], below: Path, place: Path, kill_at: int) -> None:
    """Do what a fork does, and end it."""
    code = 70
    try:
        said, changes = (os.open(place.with_suffix(end), os.O_WRONLY | os.O_CREAT) for end in (".said", ".changes"))
        for number in (1, 2):
            os.dup2(said, number)
        sys.stdout, sys.stderr = (
            io.TextIOWrapper(io.FileIO(said, "w", closefd=False), write_through=True) for _ in "oe"
        )
        _watch(str(below.resolve()), changes, kill_at)
        call()
        code = 0
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 0 if error.code is None else 1
        if isinstance(error.code, str):
            print(error.code, file=sys.stderr)
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        os._exit(code)


def _watch(below: str, changes: int, kill_at: int) -> None:
    """Note every change of files below a folder, and kill this process before one of them."""
    count = 0

    def noted(said: str) -> None:
        nonlocal count
        count += 1
        os.write(changes, f"{said}\n".encode(errors="backslashreplace"))
        if count == kill_at:
            os.kill(os.getpid(), signal.SIGKILL)

    def heard(event: str, given: tuple) -> None:
        if event in CHANGES or (event == "open" and isinstance(given[2], int) and given[2] & WRITES):
            if isinstance(given[0], (str, bytes, os.PathLike)):
                of_folder = [each for each in given[1:] if isinstance(each, int) and each >= 0 and event in REMOVES]
                place = os.readlink(f"/proc/self/fd/{of_folder[0]}") if of_folder else os.getcwd()
                path = os.path.normpath(os.path.join(place, os.fsdecode(given[0])))
                if path == below or path.startswith(below + os.sep):
                    noted(f"{event} {os.path.basename(path)}")

    exchanged = files._exchanged

    def exchange(one: Path, other: Path) -> bool:
        noted(f"exchange of {other.name}")
        done = exchanged(one, other)
        noted(f"after the exchange of {other.name}")
        return done

    files._exchanged = exchange
    sys.addaudithook(heard)
