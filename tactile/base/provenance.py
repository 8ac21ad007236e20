"""Say what the results were made with: the commit of the working tree, and the settings that dvc.lock noted."""

import json
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from importlib import metadata
from pathlib import Path

from ruamel.yaml import YAML

from tactile.base import foreign, paths
from tactile.base.errors import InputError
from tactile.base.installed import BROUGHT, INSTALLED, PACKAGE
from tactile.base.params import file_of
from tactile.base.paths import Workspace

UNKNOWN = "unknown (not a git checkout)"


def git_state(workspace: Workspace, of: Sequence[str] = (".", ":!dvc.lock", ":!reports")) -> tuple[str, str]:
    """Return the commit of the working tree, and "true" if what `of` names differs from it, else "false".

    `dvc.lock` and `reports/` do not count: the pipeline itself has just written them. Code that tools/pack.py packed is
    of the commit that its pack.json names.
    """
    try:
        top, commit = _git(workspace, "rev-parse", "--show-toplevel", "HEAD").split("\n")
        if Path(top) != workspace.root.resolve():  # a copy that lies inside somebody else's repository
            raise ValueError
        changes = _git(workspace, "status", "--porcelain", "--", *of)
    except (OSError, ValueError, subprocess.CalledProcessError):
        pack = paths.CODE.parent / "pack.json"
        with foreign.reading(pack, "a note of the commit", "pack again"):
            packed = pack.is_file() and json.loads(pack.read_text(encoding="utf-8"))["commit"]
        return (packed, "false") if packed else (UNKNOWN, UNKNOWN)
    return commit, "true" if changes else "false"


def code() -> tuple[str, str]:
    """Return the commit of this code and whether it was changed, as `git_state`; of an installed wheel its version."""
    if BROUGHT == INSTALLED:
        return f"version {version()}", "false"
    return git_state(Workspace(paths.CODE.parent))


def version() -> str:
    """Return the version of this project that is installed."""
    return metadata.version(PACKAGE)


def check_settings(workspace: Workspace, experiments: Iterable[str], params: dict) -> None:
    """Raise InputError if DVC made the results of `experiments` with other settings than `params`.

    Results that dvc.lock does not know, such as those of stages run by hand, cannot be checked.
    """
    path = workspace.root / "dvc.lock"
    if not path.is_file():
        return
    with foreign.reading("dvc.lock", "whole", "delete it and run `dvc repro`"):
        stages = YAML(typ="safe").load(path.read_text(encoding="utf-8"))["stages"].values()
        made_with = {
            out["path"]: {key: value for file in stage.get("params", {}).values() for key, value in file.items()}
            for stage in stages
            for out in stage.get("outs", [])
        }
    for experiment in experiments:
        for output in (workspace.scores(experiment), workspace.models(experiment)):
            file = output.relative_to(workspace.root).as_posix()
            for dotted, value in made_with.get(file, {}).items():
                wanted: object = params
                for key in dotted.split("."):
                    wanted = wanted.get(key) if isinstance(wanted, Mapping) else None
                if key := _difference(value, wanted, dotted):
                    raise InputError(
                        f"{file_of(key)}, {key}: {file} was made with another value, says dvc.lock; run `dvc repro`"
                    )


def _git(workspace: Workspace, *arguments: str) -> str:
    command = ["git", "-C", str(workspace.root), *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def _difference(made_with: object, wanted: object, where: str) -> str | None:
    """Return the dotted key of the first setting in which two blocks differ, None if there is none."""
    if isinstance(made_with, Mapping) and isinstance(wanted, Mapping):
        for key in [*made_with, *wanted]:
            if key not in made_with or key not in wanted:
                return f"{where}.{key}"
            if deeper := _difference(made_with[key], wanted[key], f"{where}.{key}"):
                return deeper
        return None
    return None if made_with == wanted else where
