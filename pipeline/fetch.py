"""Download a named source, or copy it from a local folder: `python -m pipeline.fetch velostat_recorded`.

Every file is checked against its SHA-256 before it gets its name, and files that are already right are
left alone, so an interrupted call is simply repeated.
"""

import argparse
import http.client
import sys
from pathlib import Path
from urllib.request import urlopen

from pipeline import sources
from pipeline.errors import InputError, run_stage

TIMEOUT_S = 60
LARGEST_FILE = 256 << 20  # bytes; the largest recording has 4 MB


def fetch(name: str, from_folder: Path | None = None) -> tuple[int, int]:
    """Put every file of source `name` into `sources.folder(name)`.

    Files come from `from_folder` (laid out like the source) if given, from the public address otherwise.
    Returns how many files were written and how many were already right. Raises InputError if a file is
    missing, cannot be downloaded or is not the expected one; what was written before stays.
    """
    target = sources.folder(name)
    if from_folder is not None and not from_folder.is_dir():
        raise InputError(f"{from_folder}: no such folder; give the folder that holds the files of {name}")
    written = kept = 0
    for path, digest in sources.files(name).items():
        goal = target / path
        if not goal.resolve().is_relative_to(target.resolve()):
            raise InputError(f"{path}: leaves the folder {target}; mend pipeline/{name}.sha256")
        if goal.is_file() and sources.sha256(goal) == digest:
            kept += 1
            continue
        goal.parent.mkdir(parents=True, exist_ok=True)
        part = goal.with_name(goal.name + ".part")
        origin = sources.address(name, path) if from_folder is None else str(from_folder / path)
        part.write_bytes(_download(origin) if from_folder is None else _read(from_folder / path, from_folder, name))
        found = sources.sha256(part)
        if found != digest:
            part.unlink()
            raise InputError(
                f"{origin}: SHA-256 is {found}, expected {digest}; get the file of the pinned commit"
            )
        part.replace(goal)
        written += 1
        print(f"{name}: {path}", file=sys.stderr)
    return written, kept


def _download(address: str) -> bytes:
    try:
        with urlopen(address, timeout=TIMEOUT_S) as response:
            content = response.read(LARGEST_FILE + 1)
    except (OSError, http.client.HTTPException) as error:
        raise InputError(f"{address}: download failed ({error}); retry, or use --from FOLDER") from error
    if len(content) > LARGEST_FILE:
        raise InputError(f"{address}: more than {LARGEST_FILE} bytes; this is not the recording, use --from FOLDER")
    return content


def _read(path: Path, folder: Path, name: str) -> bytes:
    for candidate in (path, folder / path.name):  # laid out like the source, or all in one folder
        if candidate.is_file():
            return candidate.read_bytes()
    raise InputError(f"{path}: not found; --from needs a folder with every file of {name}")


def main() -> None:
    """Command line: a source's name and, instead of the download, a local folder."""
    parser = argparse.ArgumentParser(
        prog="python -m pipeline.fetch", description="Get a named public source."
    )
    parser.add_argument("name", help=f"one of: {', '.join(sorted(sources.SOURCES))}")
    parser.add_argument(
        "--from", dest="from_folder", type=Path, metavar="FOLDER", help="copy, do not download"
    )
    arguments = parser.parse_args()
    written, kept = fetch(arguments.name, arguments.from_folder)
    print(f"{arguments.name}: {written} files written, {kept} already there, all SHA-256 right")
    print(f"licence: {sources.source(arguments.name).licence}")


if __name__ == "__main__":
    run_stage(main)
