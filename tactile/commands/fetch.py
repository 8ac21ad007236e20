"""List public recordings, or download those of one source.

`tactile fetch` lists the sources, `tactile fetch NAME` downloads one, `tactile fetch NAME --from FOLDER` copies it.
Every file is checked against its SHA-256 before it gets its name. An interrupted call is simply repeated: files that
are right stay, and the download that was interrupted goes on where it stopped.

Examples:

    tactile fetch
    tactile fetch velostat_recorded
"""

import argparse
import http.client
import shutil
from collections.abc import Mapping
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from tqdm import tqdm

from tactile import experiments
from tactile.base import arguments
from tactile.base.errors import InputError, storage_error
from tactile.base.paths import Workspace
from tactile.experiments import facts
from tactile.logs import sources

TIMEOUT_S = 60
BLOCK = 1 << 16  # bytes between two moves of the bar
LARGEST_FILE = 256 << 20  # bytes; the largest recording has 4 MB


def state(workspace: Workspace, name: str) -> str:
    """Return how much of a source is downloaded: absent, partly (how many files are right), or complete."""
    target, right, wrong, absent = sources.folder(workspace, name), 0, 0, 0
    for path, digest in sources.files(name).items():
        there = {one: target / one for one in sources.members(path)}
        present = sum(file.is_file() for file in there.values())
        absent += len(there) - present
        if present == len(there) and sources.digest(there) == digest:
            right += present
        elif present == len(there):
            wrong += present
    if not absent and not wrong:
        return "complete"
    of = number(name)
    return f"partly: {right} of {of} files{f', {wrong} wrong' if wrong else ''}" if absent < of else "absent"


def number(name: str) -> int:
    """Return how many files a source has."""
    return sum(len(sources.members(path)) for path in sources.files(name))


def listing(workspace: Workspace) -> str:
    """Return all sources with files, size, state, licence and address, as lines of text."""
    rows = [("source", "files", "size", "state", "licence")]
    for name, source in experiments.having("source").items():
        size = f"{source.size / 1e6:.1f} MB"
        rows.append((name, str(number(name)), size, state(workspace, name), source.licence))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(f"{text:<{width}}" for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines += ["", "from, at pinned commits:"]
    for name, source in experiments.having("source").items():
        lines.append(f"  {name}: https://github.com/{source.repository}/tree/{source.commit}/{source.folder}")
    lines += [
        "",
        "get one: tactile fetch NAME; from a local copy of it: --from FOLDER behind the name",
    ]
    return "\n".join(lines)


def fetch(workspace: Workspace, name: str, from_folder: Path | None = None) -> tuple[int, int]:
    """Put every file of source `name` into `sources.folder(name)`.

    Files come from `from_folder` (laid out like the source) if given, from the public address otherwise.
    Returns how many files were written and how many were already right. Raises InputError if a file is
    missing, cannot be downloaded or is not the expected one; what was written before stays.
    """
    target, listed = sources.folder(workspace, name), sources.files(name)
    if from_folder is not None and not from_folder.is_dir():
        raise InputError(f"{from_folder}: no such folder; give the folder that holds the files of {name}")
    written = kept = 0
    with tqdm(total=facts(name).source.size, desc=name, unit="B", unit_scale=True) as bar:
        for path, digest in listed.items():
            goals = {one: target / one for one in sources.members(path)}
            if not all(goal.resolve().is_relative_to(target.resolve()) for goal in goals.values()):
                raise InputError(f"{path}: leaves the folder {target}; fix tactile/logs/{name}.sha256")
            bar.set_postfix_str(f"file {written + kept + 1} of {number(name)}", refresh=False)
            if all(goal.is_file() for goal in goals.values()) and sources.digest(goals) == digest:
                kept += len(goals)
                bar.update(sum(goal.stat().st_size for goal in goals.values()))
                continue
            parts = {one: goal.with_name(goal.name + ".part") for one, goal in goals.items()}
            next(iter(goals.values())).parent.mkdir(parents=True, exist_ok=True)
            resumed = any(part.is_file() for part in parts.values())
            origin = _get(name, parts, from_folder, bar)
            if from_folder is None and resumed and sources.digest(parts) != digest:
                for part in parts.values():  # the old parts were not the starts of these files
                    part.unlink()
                _get(name, parts, from_folder, bar)
            got = sources.digest(parts)
            if got != digest:
                for part in parts.values():
                    part.unlink()
                what = origin if len(parts) == 1 else path
                raise InputError(f"{what}: SHA-256 is {got}, expected {digest}; get the file of the pinned commit")
            for one, part in parts.items():
                part.replace(goals[one])
            written += len(parts)
    return written, kept


def _get(name: str, parts: Mapping[str, Path], from_folder: Path | None, bar: tqdm) -> str | Path:
    """Put the files of a source that `parts` names where it says; return where the last came from."""
    for path, part in parts.items():
        if from_folder is None:
            origin = sources.address(facts(name).source, path)
            _download(origin, part, bar)
        else:
            origin = _found(from_folder / path, from_folder, name, alone=len(parts) == 1)
            shutil.copyfile(origin, part)
            bar.update(part.stat().st_size)
    return origin


def _download(address: str, part: Path, bar: tqdm) -> None:
    """Download the file at `address` into `part`, from where `part` ends; where it raises InputError, `part` stays."""
    have = part.stat().st_size if part.is_file() else 0
    request = Request(address, headers={"Range": f"bytes={have}-"} if have else {})
    advice = "repeat the command, which goes on from there, or use --from FOLDER"
    try:
        with urlopen(request, timeout=TIMEOUT_S) as response:
            goes_on = response.status == http.HTTPStatus.PARTIAL_CONTENT
            have = have if goes_on else 0  # a server may send all of it again
            wanted = have + (response.length or 0)
            bar.update(have)
            with part.open("ab" if goes_on else "wb") as file:
                while block := response.read(BLOCK):
                    have += file.write(block)
                    bar.update(len(block))
                    if have > LARGEST_FILE:
                        break
    except HTTPError as error:
        if error.code == http.HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE:
            return  # `part` is as long as the file already: its SHA-256 says whether it is the file
        raise InputError(f"{address}: download failed ({error}); {advice}") from error
    except (OSError, http.client.HTTPException) as error:
        if storage_error(error) is not None:
            raise
        raise InputError(f"{address}: download failed ({error}); {advice}") from error
    if have > LARGEST_FILE:
        part.unlink()
        raise InputError(f"{address}: more than {LARGEST_FILE} bytes; this is not the recording, use --from FOLDER")
    if have < wanted:
        raise InputError(f"{address}: the connection ended after {have} of {wanted} bytes; {advice}")


def _found(path: Path, folder: Path, name: str, alone: bool) -> Path:
    """Return `path`, or the file of its name in `folder`: laid out like the source, or all in one folder.

    alone: whether its name tells it from the others; that of a numbered file does not.
    """
    for candidate in (path, *([folder / path.name] if alone else [])):
        if candidate.is_file():
            return candidate
    raise InputError(f"{path}: not found; --from needs a folder with every file of {name}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the source and the local folder to the parser of this command."""
    known = sorted(experiments.having("source"))
    parser.add_argument("name", nargs="?", **arguments.one_of("source", known), help="a source; without it, the list")
    parser.add_argument("--from", dest="from_folder", type=Path, metavar="FOLDER", help="copy, do not download")


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """List the sources, or fetch the one named on the command line."""
    if given.name is None:
        if given.from_folder is not None:
            raise InputError(f"--from: name the source too, one of {', '.join(experiments.having('source'))}")
        print(listing(workspace))
        return
    written, kept = fetch(workspace, given.name, given.from_folder)
    print(f"{given.name}: {written} files written, {kept} already there, all SHA-256 right")
    print(f"licence: {facts(given.name).source.licence}")
