"""Kill the miniature pipeline at random moments; every restart must go on and end with the hashes of a quiet run.

    python tests/kill.py [KILLS] [SEED]

20 kills take about as long as four runs of the miniature. A kill is SIGKILL, to DVC with all that it started (as when
the power fails) or to DVC alone (as when memory is short). After each one, everything that dvc.lock records must have
the hash that it has in a quiet run; at the end, everything must, and MLflow must hold every run once.

DVC does not write dvc.lock at once: a kill in that moment leaves a part of it, which the next `dvc repro` refuses. What
docs/own_sensor.md says for this case is done then (delete dvc.lock: what was made comes from DVC's cache), and said.
"""

import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import yaml
from builders.project import Project, lock, mlflow_runs, run_miniature

GONE_S = 20  # within which all that DVC started must be gone


def start(project: Project, log: Path) -> subprocess.Popen:
    """`dvc repro` in a process group of its own."""
    with open(log, "w") as file:
        return subprocess.Popen(
            [sys.executable, "-m", "dvc", "repro"],
            cwd=project.folder,
            env=project.environment,
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )


def kill(process: subprocess.Popen, alone: bool) -> None:
    """SIGKILL; an AssertionError if anything of the group is left after GONE_S."""
    if alone:
        process.kill()
    else:
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + GONE_S
    while True:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return
        assert time.monotonic() < deadline, f"a stage outlived the kill of its dvc (process group {process.pid})"
        time.sleep(0.1)


def cut_short(project: Project) -> bool:
    """Is dvc.lock only a part of itself, as a kill leaves it that comes while DVC writes it?"""
    path = project.folder / "dvc.lock"
    if not path.exists():
        return False
    try:
        stages = yaml.safe_load(path.read_text())["stages"]
        return not all(len(out["md5"]) >= 32 for stage in stages.values() for out in stage.get("outs", []))
    except (yaml.YAMLError, KeyError, TypeError, AttributeError):
        return True


def compare(project: Project, wanted: dict) -> int:
    """The number of outputs in dvc.lock; an AssertionError if one is not as in the quiet run."""
    found = lock(project) if (project.folder / "dvc.lock").exists() else {}
    wrong = sorted(path for path, value in found.items() if wanted.get(path) != value)
    assert not wrong, f"not as in a quiet run: {', '.join(wrong)}"
    return len(found)


def disturb(project: Project, kills: int, seconds: float, rng: random.Random, wanted: dict, first: int) -> int:
    """Run the pipeline to its end with up to `kills` kills, at moments up to `seconds` apart; returns how many."""
    done, log = 0, project.folder.parent / "repro.log"
    while done < kills:
        process = start(project, log)
        wait = rng.uniform(0, seconds)
        try:
            assert process.wait(timeout=wait) == 0, log.read_text()[-4000:]
            break
        except subprocess.TimeoutExpired:
            alone = rng.random() < 0.5
            kill(process, alone)
        done += 1
        stages = re.findall(r"Running stage '(\S+)'", log.read_text())
        cut = cut_short(project)
        if cut:
            (project.folder / "dvc.lock").unlink()
        recorded = compare(project, wanted)
        found = "dvc.lock was cut short" if cut else f"{recorded} of {len(wanted)} outputs recorded, all the same"
        print(
            f"kill {first + done}: {'dvc alone' if alone else 'whole group'}, {wait:.1f} s after the start, "
            f"in {stages[-1] if stages else 'no stage'}; {found}",
            flush=True,
        )
    project.dvc("repro")
    assert compare(project, wanted) == len(wanted), "outputs are missing"
    return done


def main() -> None:
    """The quiet run, then disturbed runs until all kills are done."""
    given = [int(value) for value in sys.argv[1:]]
    kills, seed = (given + [20, 0][len(given) :])[:2]
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as folder:
        started = time.monotonic()
        quiet = run_miniature(Path(folder) / "quiet")
        seconds = time.monotonic() - started
        wanted, runs = lock(quiet), mlflow_runs(quiet)
        print(f"quiet run: {len(wanted)} outputs in {seconds:.0f} s", flush=True)
        done = round_ = 0
        while done < kills:
            round_ += 1
            project = Project(Path(folder) / f"disturbed{round_}")
            # A run of the pipeline takes about ten kills.
            done += disturb(project, kills - done, seconds / 5, rng, wanted, done)
            assert mlflow_runs(project) == runs, "MLflow does not hold every run once"
            print(f"disturbed run {round_} ended as the quiet one", flush=True)
    print(f"{done} kills in {round_} runs, {time.monotonic() - started:.0f} s: same hashes, nothing half-written")


if __name__ == "__main__":
    main()
