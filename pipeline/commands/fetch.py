"""List public recordings, or download those of one source.

`tactile fetch` lists the sources, `tactile fetch NAME` downloads one, `tactile fetch NAME --from FOLDER` copies it.
Every file is checked against its SHA-256 before it gets its name. An interrupted call is simply repeated: files that
are right stay, and the download that was interrupted goes on where it stopped.
"""

import argparse
import http.client
import shutil
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

from tqdm import tqdm

from pipeline import experiments
from pipeline.base.errors import InputError, storage_error
from pipeline.base.files import sha256
from pipeline.base.paths import Workspace
from pipeline.experiments import facts
from pipeline.logs import sources

TIMEOUT_S = 60
BLOCK = 1 << 16  # bytes between two moves of the bar
LARGEST_FILE = 256 << 20  # bytes; the largest recording has 4 MB


def state(workspace: Workspace, name: str) -> str:
    """Return how much of a source is downloaded: absent, partly (how many files are right), or complete."""
    listed, target = sources.files(name), sources.folder(workspace, name)
    present = [path for path in listed if (target / path).is_file()]
    right = sum(sha256(target / path) == listed[path] for path in present)
    if right == len(listed):
        return "complete"
    wrong = f", {len(present) - right} wrong" if right < len(present) else ""
    return f"partly: {right} of {len(listed)} files{wrong}" if present else "absent"


def listing(workspace: Workspace) -> str:
    """Return all sources with files, size, state, licence and address, as lines of text."""
    rows = [("source", "files", "size", "state", "licence")]
    for name, source in experiments.having("source").items():
        size = f"{source.size / 1e6:.1f} MB"
        rows.append((name, str(len(sources.files(name))), size, state(workspace, name), source.licence))
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
            goal = target / path
            if not goal.resolve().is_relative_to(target.resolve()):
                raise InputError(f"{path}: leaves the folder {target}; fix pipeline/logs/{name}.sha256")
            bar.set_postfix_str(f"file {written + kept + 1} of {len(listed)}", refresh=False)
            if goal.is_file() and sha256(goal) == digest:
                kept += 1
                bar.update(goal.stat().st_size)
                continue
            goal.parent.mkdir(parents=True, exist_ok=True)
            part = goal.with_name(goal.name + ".part")
            if from_folder is None:
                origin, resumed = sources.address(facts(name).source, path), part.is_file()
                _download(origin, part, bar)
                if resumed and sha256(part) != digest:  # the old part was not the start of this file
                    part.unlink()
                    _download(origin, part, bar)
            else:
                origin = _found(from_folder / path, from_folder, name)
                shutil.copyfile(origin, part)
                bar.update(part.stat().st_size)
            got = sha256(part)
            if got != digest:
                part.unlink()
                raise InputError(f"{origin}: SHA-256 is {got}, expected {digest}; get the file of the pinned commit")
            part.replace(goal)
            written += 1
    return written, kept


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


def _found(path: Path, folder: Path, name: str) -> Path:
    """Return `path`, or the file of its name in `folder`: laid out like the source, or all in one folder."""
    for candidate in (path, folder / path.name):
        if candidate.is_file():
            return candidate
    raise InputError(f"{path}: not found; --from needs a folder with every file of {name}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the source and the local folder to the parser of this command."""
    known = sorted(experiments.having("source"))
    parser.add_argument("name", nargs="?", choices=known, help="a source; without it, the list")
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
