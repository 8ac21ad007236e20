"""Full and read-only disks, and killed processes: nothing unfinished is taken for done."""

import errno
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from builders.project import ROOT, copy_project

from tactile.base import errors
from tactile.base.errors import InputError
from tactile.commands import fetch
from tactile.logs import sources

# Runs stages one after the other, each in a fork in which no file can grow beyond its limit, as on a full disk.
LIMITED = """
import importlib, json, os, resource, sys
from tactile.base import arguments
import torch, pyarrow.csv, pyarrow.parquet, scipy.stats, sklearn.tree, tqdm
jobs = json.loads(sys.argv[1])
modules = {stage: importlib.import_module(stage) for _, stage, *_ in jobs}
for number, (limit, stage, *given) in enumerate(jobs):
    heard, said = os.pipe()  # a file's size is limited, a pipe's is not
    child = os.fork()
    if not child:
        os.close(heard)
        os.dup2(said, 2)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        sys.argv = [stage, *given]
        arguments.run(modules[stage].main)
        os._exit(0)
    os.close(said)
    with open(heard) as pipe, open(f"stderr{number}", "w") as file:
        file.write(pipe.read())
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
STAGES = {
    "simulate@glove": ["pipeline.stages.simulate", "glove"],
    "ingest@glove": ["tactile.stages.ingest", "glove"],
    "dataset@glove": ["tactile.stages.dataset", "glove"],
    "train@glove": ["tactile.stages.train", "glove"],
    "window@touch": ["tactile.stages.window", "touch"],
    "dataset@touch": ["tactile.stages.dataset", "touch"],
    "train@touch": ["tactile.stages.train", "touch"],
    "evaluate@touch": ["tactile.stages.evaluate", "touch"],
    "collect": ["pipeline.stages.collect"],
}


def outputs(project, stage: str) -> dict[str, bytes]:
    """Path -> content of every file that DVC takes for an output of the stage."""
    entry = yaml.safe_load((project.folder / "dvc.lock").read_text())["stages"][stage]
    found = {}
    for out in entry["outs"]:
        path = project.folder / out["path"]
        files = [path] if path.is_file() else sorted(one for one in path.rglob("*") if one.is_file())
        found |= {file.relative_to(project.folder).as_posix(): file.read_bytes() for file in files}
    return found


def test_a_full_disk_is_one_sentence_and_leaves_the_old_files_or_none(miniature, tmp_path):
    project = copy_project(miniature, tmp_path)
    project.environment["PYTHONDONTWRITEBYTECODE"] = "1"  # Python takes half a file of bytecode for whole
    with open(project.folder / "tactile" / "stages" / "train.py", "a") as code:
        code.write("# changed: without this nothing would be trained\n")
    before = {stage: outputs(project, stage) for stage in STAGES}
    # The first write fails, or the largest file at its last tenth.
    limits = {stage: (1, max(map(len, files.values())) * 9 // 10) for stage, files in before.items()}
    jobs = [(limit, *command) for stage, command in STAGES.items() for limit in limits[stage]]
    done = project.run("-c", LIMITED, json.dumps(jobs))
    codes = done.stdout.split()[-len(jobs) :]
    for number, (job, code) in enumerate(zip(jobs, codes, strict=True)):
        message = (project.folder / f"stderr{number}").read_text()
        assert code == "1" and "Traceback" not in message, (job, message)
        assert message.splitlines()[-1].startswith("error: ") and "File too large" in message, (job, message)
    for stage, files in before.items():
        for path, content in outputs(project, stage).items():
            assert files[path] == content, f"{stage} left {path} changed"


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (OSError(errno.ENOSPC, "x", "data/a.csv"), "data/a.csv: No space left on device; free or unlock the disk"),
        (PermissionError(errno.EACCES, "x", "data"), "data: Permission denied; free or unlock the disk"),
        (RuntimeError("I/O error: No space left on device (os error 28)"), "No space left on device; free or unlock"),
        (FileNotFoundError(errno.ENOENT, "x", "data"), None),
        (ValueError("28"), None),
    ],
)
def test_only_a_disks_errors_become_its_sentence(error, sentence):
    found = errors.storage_error(error)
    assert found is None if sentence is None else found.startswith(sentence)


def test_an_error_of_the_code_keeps_its_traceback():
    def stage():
        raise FileNotFoundError(errno.ENOENT, "x", "data")

    with pytest.raises(FileNotFoundError):
        errors.run_stage(stage, Path("params.yaml"))


ORPHAN = '''
import os, subprocess, sys, time
stage = """
import time
from pathlib import Path
from tactile.base.errors import run_stage
run_stage(lambda: print(1, flush=True) or time.sleep(60), Path("params.yaml"))
"""
child = subprocess.Popen([sys.executable, "-c", stage])
print(child.pid, flush=True)
child.wait()
'''


@pytest.mark.slow
def test_a_stage_ends_with_the_dvc_that_started_it():
    """DVC killed alone, as the system does when memory is short: its stage must not write on beside the next one."""
    environment = os.environ | {"DVC_STAGE": "train", "PYTHONPATH": str(ROOT)}
    starter = subprocess.Popen([sys.executable, "-c", ORPHAN], env=environment, stdout=subprocess.PIPE, text=True)
    stage = int(starter.stdout.readline())
    assert starter.stdout.readline() == "1\n"
    starter.kill()
    starter.wait()
    deadline = time.monotonic() + 120
    while alive(stage):
        assert time.monotonic() < deadline, "the stage still runs"
        time.sleep(0.05)


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


def test_a_full_disk_says_what_it_does_to_dvc():
    assert "if DVC then calls .dvc/tmp/rwlock corrupted, remove that file" in errors.storage_error(OSError(28, "x"))
    assert "rwlock" not in errors.storage_error(PermissionError(errno.EACCES, "x", "data"))


@pytest.mark.parametrize("name", ["../outside.txt", "/tmp/outside.txt", "a/../../outside.txt"])
def test_a_source_cannot_leave_its_folder(workspace, name, monkeypatch):
    monkeypatch.setattr(sources, "files", lambda source: {name: "0" * 64})
    monkeypatch.setattr(fetch, "_download", lambda *arguments: pytest.fail("asked for a file outside"))
    with pytest.raises(InputError, match="leaves the folder"):
        fetch.fetch(workspace, "velostat_recorded")
