"""Pack all that `dvc repro` has made into one archive, or take such an archive in place of running it.

`tactile bundle write FILE.zip` packs what dvc.lock names and DVC's cache holds (logs, datasets, models, predictions)
with the reports, the settings and dvc.lock. `tactile bundle restore FILE.zip`, in a checkout of the same commit, puts
it all in its place: `dvc repro` has nothing to run then but `track`, which writes the runs for MLflow.
"""

import argparse
import re
import shutil
import tempfile
import zipfile
from pathlib import Path

from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace

REMOTE, OBJECTS = "bundle", "objects"  # DVC's name of the archive's folder, and that folder
OBJECT = re.compile(OBJECTS + r"/files/md5/[0-9a-f]{2}/[0-9a-f]{30}(\.dir)?")  # a file of DVC's; no other is unpacked
BESIDE = ("dvc.lock", "params", "params.yaml", "reports")  # what lies in git, for those who have the archive alone


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what the command takes to its parser."""
    parser.add_argument("what", choices=["write", "restore"])
    parser.add_argument("file", type=Path, help="the archive, a .zip file")


def repository(workspace: Workspace, objects: Path):
    """Return DVC's view of this checkout with a folder as its only remote."""
    from dvc.repo import Repo

    return Repo(workspace.root, config={"remote": {REMOTE: {"url": str(objects)}}})


def write(workspace: Workspace, file: Path) -> int:
    """Write the archive; return how many files of DVC's cache are in it. InputError where something was not run."""
    with tempfile.TemporaryDirectory(dir=file.parent) as folder:
        objects = Path(folder) / OBJECTS
        objects.mkdir()
        with repository(workspace, objects) as repo:
            if lost := sorted(str(out) for out in repo.index.outs if out.use_cache and out.changed_cache()):
                raise InputError(f"{lost[0]}: not in DVC's cache, and {len(lost) - 1} more; run `dvc repro` first")
            count = repo.push(remote=REMOTE)
        draft = Path(folder) / file.name
        with zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name in BESIDE:
                for path in (workspace.root / name, *sorted((workspace.root / name).rglob("*"))):
                    archive.write(path, path.relative_to(workspace.root))
            for path in sorted(objects.rglob("*")):
                archive.write(path, path.relative_to(folder))
        draft.replace(file)
    return count


def restore(workspace: Workspace, file: Path) -> None:
    """Put what an archive holds in its place. InputError where there is none, or it is of another commit."""
    if not file.is_file():
        raise InputError(f"{file}: there is no such file; `tactile bundle write {file.name}` writes it")
    with tempfile.TemporaryDirectory(dir=file.parent) as folder:
        try:
            with zipfile.ZipFile(file) as archive:
                if archive.read("dvc.lock") != (workspace.root / "dvc.lock").read_bytes():
                    wrong = "its dvc.lock is not that of this checkout; `git checkout` the commit it is of"
                    raise InputError(f"{file}: {wrong}")
                for name in filter(OBJECT.fullmatch, archive.namelist()):
                    target = Path(folder) / name
                    target.parent.mkdir(parents=True, exist_ok=True)
                    with archive.open(name) as source, open(target, "wb") as copy:
                        shutil.copyfileobj(source, copy)
        except (zipfile.BadZipFile, KeyError) as error:
            wrong = f"not an archive that `tactile bundle write {file.name}` wrote, or cut short ({error})"
            raise InputError(f"{file}: {wrong}") from error
        with repository(workspace, Path(folder) / OBJECTS) as repo:
            repo.pull(remote=REMOTE)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Write or restore the archive that was named."""
    if given.what == "write":
        count = write(workspace, given.file)
        print(f"{given.file}: {count} files, {given.file.stat().st_size / 1e6:.0f} MB")
    else:
        restore(workspace, given.file)
        print(f"{given.file}: restored; `dvc status` names what is not up to date")
