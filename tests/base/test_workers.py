"""Local processes: one thread each; one that is killed, or gets no memory, is one sentence that names its task."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import psutil
import pytest
from builders.project import ROOT
from builders.tasks import slow
from tqdm import tqdm

from tactile.base import errors, processes, workers
from tactile.base.errors import InputError

ABSURD = 1 << 50  # bytes: more than any machine has


def square(number, report):
    report(1, 1, 0.5)
    return number * number, os.environ["OMP_NUM_THREADS"]


def killed(times, report):
    report(1, 3, 0.5)
    if times:
        os.kill(os.getpid(), signal.SIGKILL)


def greedy(kind, folder, report):
    """Ask for ABSURD memory; numpy, torch and pyarrow each refuse it in words of their own."""
    with open(folder / "tries", "a") as tries:
        tries.write(f"{os.getpid()}\n")
    if kind == "numpy":
        np.empty(ABSURD, np.uint8)
    elif kind == "torch":
        import torch

        torch.empty(ABSURD, dtype=torch.uint8)
    else:
        import pyarrow

        pyarrow.allocate_buffer(ABSURD)


def wrong(number, report):
    return {}[number]


def unsendable(number, report):
    return threading.Lock()


@pytest.fixture
def run(monkeypatch):
    """`run(function, {key: arguments}, processes)`: the results and the bar."""

    def results(function, tasks: dict, processes: int = 2, **more) -> tuple[dict, tqdm]:
        monkeypatch.setenv("WORKERS", str(processes))
        with tqdm(total=len(tasks) * more.get("steps", 1), desc="train it") as bar:
            return dict(workers.run(function, tasks, bar, **more)), bar

    return results


@pytest.mark.slow
def test_tasks_run_with_one_thread_and_give_what_they_return(run):
    found, bar = run(square, {key: (key,) for key in range(5)})
    assert found == {key: (key * key, "1") for key in range(5)} and bar.n == 5


def reporting(times, report):
    for _ in range(times):
        report(1, 1, 0.5)


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2])
def test_the_bar_knows_the_steps_of_each_task(monkeypatch, processes):
    """Tasks that stop early, too, leave it where all of their steps are done."""
    monkeypatch.setenv("WORKERS", str(processes))
    steps = {"constant": 1, "network": 7, "stopped": 5}
    tasks = {"constant": (0,), "network": (7,), "stopped": (2,)}
    with tqdm(total=13) as bar:
        assert len(list(workers.run(reporting, tasks, bar, steps=steps))) == 3
        assert bar.n == 13


BLAS = """
import os
import sys

import numpy  # before a worker can limit what it starts
from threadpoolctl import threadpool_info
from tqdm import tqdm

from tactile.base import workers

def threads(number, report):
    return [library["num_threads"] for library in threadpool_info()]

if __name__ == "__main__":
    print(threads(0, None))
    with tqdm(total=2, disable=True) as bar:
        print([threads for _, threads in workers.run(threads, {0: (0,), 1: (1,)}, bar)])
"""


@pytest.mark.slow
def test_a_process_has_one_thread_where_its_stage_has_loaded_numpy(tmp_path):
    (tmp_path / "stage.py").write_text(BLAS)
    environment = os.environ | {"PYTHONPATH": str(ROOT), "WORKERS": "2"}
    for name in processes.ONE_THREAD:
        environment[name] = "2"
    done = subprocess.run([sys.executable, "stage.py"], cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.stdout.splitlines() == ["[2]", "[[1], [1]]"], done.stdout + done.stderr


@pytest.mark.slow
def test_a_killed_process_is_one_sentence_that_names_its_task(run):
    with pytest.raises(InputError) as lost:
        run(killed, {("press", seed): (seed == 2,) for seed in range(4)}, steps=3)
    said = str(lost.value)
    assert said.startswith("train it, press 2: its process ended without a result, as one does that is killed")
    assert "free memory" in said and "run the command again" in said


@pytest.mark.slow
@pytest.mark.parametrize("kind, processes", [("numpy", 1), ("pyarrow", 1), ("torch", 2)])
def test_a_task_without_memory_is_one_sentence(run, tmp_path, kind, processes):
    with pytest.raises(InputError, match=r"^train it, (press|slide) 0: not enough memory \(.*; free memory"):
        run(greedy, {(name, 0): (kind, tmp_path) for name in ("press", "slide")}, processes)
    tries = (tmp_path / "tries").read_text().split()
    assert 1 <= len(tries) <= processes
    if processes == 2:
        assert not any(psutil.pid_exists(int(pid)) for pid in tries)


def test_a_stage_without_memory_is_one_sentence():
    with pytest.raises(SystemExit) as end:
        errors.run_stage(lambda: np.empty(ABSURD, np.uint8), ROOT / "params.yaml")
    assert end.value.code.startswith("error: not enough memory (Unable to allocate 1.00 PiB for an array")


def test_other_errors_say_nothing_of_memory():
    for error in (RuntimeError("mat1 and mat2 shapes cannot be multiplied"), OSError(28, "No space left"), KeyError(1)):
        assert errors.memory_error(error) is None


@pytest.mark.slow
def test_an_error_of_the_code_says_where_it_happened(run):
    with pytest.raises(KeyError) as error:
        run(wrong, {"a": (1,), "b": (2,)})
    assert "return {}[number]" in str(error.value.__cause__)


@pytest.mark.slow
def test_a_result_that_cannot_be_sent_is_an_error(run):
    with pytest.raises(TypeError, match="cannot pickle '_thread.lock' object"):
        run(unsendable, {"a": (1,), "b": (2,)})


def test_no_process_is_left_where_one_task_fails(run, tmp_path):
    tasks = {key: (tmp_path,) for key in "ab"}
    tasks["c"] = (tmp_path, "one argument too many")
    with pytest.raises(TypeError):
        run(slow, tasks, 3)
    assert not any(psutil.pid_exists(int(path.name)) for path in tmp_path.iterdir())


STAGE = """
import os
import sys
import time
from pathlib import Path
from tqdm import tqdm
from builders.tasks import slow
from tactile.base import workers
from tactile.base.errors import run_stage

def main():
    with tqdm(total=2) as bar:
        list(workers.run(slow, {key: (Path(sys.argv[1]),) for key in "ab"}, bar))

if __name__ == "__main__":
    run_stage(main, Path("params.yaml"))
elif len(sys.argv) == 3:  # a process that starts, which imports the stage for seconds
    Path(sys.argv[1], str(os.getpid())).touch()
    time.sleep(float(sys.argv[2]))
"""


@pytest.mark.slow
@pytest.mark.parametrize("processes, importing", [(2, []), (2, ["5"])], ids=["two", "two that start"])
def test_ctrl_c_ends_a_stage_quietly(tmp_path, processes, importing):
    """As a terminal does it: SIGINT to the stage and all of its processes."""
    (tmp_path / "stage.py").write_text(STAGE)
    started = tmp_path / "started"
    started.mkdir()
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}", "WORKERS": str(processes)}
    command = [sys.executable, str(tmp_path / "stage.py"), str(started), *importing]
    stage = subprocess.Popen(
        command,
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # tests in the background ignore it
    )
    deadline = time.monotonic() + 120
    while len(list(started.iterdir())) < processes:
        assert time.monotonic() < deadline and stage.poll() is None
        time.sleep(0.05)
    os.killpg(stage.pid, signal.SIGINT)
    _, said = stage.communicate(timeout=120)
    assert stage.returncode == 130
    assert "Traceback" not in said and "Error" not in said and "Interrupt" not in said, said
    assert not any(psutil.pid_exists(int(path.name)) for path in started.iterdir())
