"""Compute the shards of a pack (`python -m tools.pack`) on this machine, which needs no network, DVC or git.

OUT is laid out as evidence/, and every shard that its index.csv names is whole, however this ends. Data of different
sets are made side by side; a shard begins as soon as its data are there. What has not ended after the minutes is
killed, and the same call again computes what is missing. run.json has the seconds of every job.
"""

import argparse
import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from tactile.base.processes import ONE_THREAD, die_with_parent, processor

HERE = Path(__file__).resolve().parent
WORK, SITE = HERE / "work", HERE / "site"
NO_CARD = {"CUDA_VISIBLE_DEVICES": ""}
LOOK_S, SHOWN_LINES = 0.1, 15
NAME_OF_CARD = "import torch; print(torch.cuda.get_device_name() if torch.cuda.is_available() else '')"
USE_CARD = "import torch; torch.zeros(1, device='cuda').sum().item()"
MPS = "nvidia-cuda-mps-control"
MPS_S = 30
PACKAGES = ("numpy", "pandas", "pyarrow", "scikit-learn", "scipy", "torch")  # whose version may change a number


class Job(NamedTuple):
    """A process to run: its name, arguments, cores, whether it may use the card, and the job that must end before."""

    name: str
    arguments: tuple[str, ...]
    cores: int
    card: bool
    after: str = ""


class Runner:
    """Runs jobs side by side on a number of cores, and writes how they ended to run.json after each."""

    def __init__(self, out: Path, cores: int, on_card: int, about: dict):
        """on_card: processes that may use the card at the same time; about: what run.json says of the machine."""
        self.out, self.cores, self.on_card, self.about = out, cores, on_card, about
        self.waiting: list[Job] = []
        self.running: dict[Job, tuple[subprocess.Popen, float]] = {}
        self.ended: dict[str, dict] = {}
        self.environment: dict[str, str] = {}
        self.card: dict[str, str] = {}  # variables of processes that use it

    def look(self) -> None:
        """Note what has ended, and begin in their order the jobs for which there is room."""
        for job, (process, since) in list(self.running.items()):
            if process.poll() is not None:
                del self.running[job]
                status = "done" if process.returncode == 0 else f"failed ({process.returncode})"
                self.end(job, status, time.monotonic() - since)
        for job in list(self.waiting):
            before = self.ended.get(job.after, {}).get("status", "done" if not job.after else "")
            if before not in ("", "done"):
                self.waiting.remove(job)
                self.end(job, f"not begun: {job.after} {before}")
            elif before:
                if sum(each.cores for each in self.running) + job.cores > self.cores:
                    break  # later ones wait, too: a job of several cores would never find them free
                if job.card and sum(each.cores for each in self.running if each.card) + job.cores > self.on_card:
                    continue
                self.waiting.remove(job)
                self.running[job] = self.begin(job), time.monotonic()

    def begin(self, job: Job) -> subprocess.Popen:
        """Start a job in a process group of its own."""
        variables = self.environment | {"WORKERS": str(job.cores)} | (self.card if job.card else NO_CARD)
        command = [sys.executable, "-P", "-m", "pipeline.stages.shard", *job.arguments, "--root", str(WORK)]
        with open(self.out / "logs" / f"{job.name}.txt", "w") as log:
            return subprocess.Popen(
                command, cwd=WORK, env=variables, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                start_new_session=True, preexec_fn=die_with_parent,
            )  # fmt: skip

    def end(self, job: Job, status: str, seconds: float | None = None) -> None:
        """Note how a job ended; of one that failed show the last lines."""
        self.ended[job.name] = {"seconds": None if seconds is None else round(seconds, 1), "status": status}
        if status.startswith("failed"):
            log = (self.out / "logs" / f"{job.name}.txt").read_text(errors="replace").splitlines()
            print(f"{job.name}: {status}", *log[-SHOWN_LINES:], sep="\n  ", flush=True)
        self.note()

    def note(self) -> None:
        """Write run.json."""
        draft = self.out / "run.json.unfinished"
        draft.write_text(json.dumps(self.about | {"jobs": self.ended}, indent=1) + "\n")
        os.replace(draft, self.out / "run.json")

    def kill(self, status: str) -> None:
        """Kill what runs, with the processes that it has started."""
        for process, _ in self.running.values():
            os.killpg(process.pid, signal.SIGKILL)
        for job, (process, since) in self.running.items():
            self.end(job, status if process.wait() else "done", time.monotonic() - since)
        for job in self.waiting:
            self.end(job, "not begun")
        self.running, self.waiting = {}, []


def install() -> None:
    """Put the packages that came along into SITE, those that are not here in that very version."""
    sys.path.insert(0, str(SITE))
    wanted = []
    for wheel in sorted((HERE / "wheels").glob("*.whl")):
        name, carried = wheel.name.split("-")[:2]
        try:
            here = version(name)
        except PackageNotFoundError:
            here = None
        if here != carried:
            wanted.append(str(wheel))
    if wanted:
        options = ["--quiet", "--no-index", "--no-deps", "--upgrade", "--disable-pip-version-check"]
        command = [sys.executable, "-m", "pip", "install", *options, "--target", str(SITE), *wanted]
        if subprocess.run(command).returncode:
            sys.exit("error: pip could not install the packages in wheels/; its message is above")


def make_workspace(out: Path) -> None:
    """Make WORK, in which the shards are computed: a workspace whose folder of evidence is `out`."""
    (out / "logs").mkdir(parents=True, exist_ok=True)
    shutil.copy(HERE / "evidence" / "shards.yaml", out)
    WORK.mkdir(exist_ok=True)
    for link, place in {"params.yaml": HERE / "params.yaml", "params": HERE / "params", "evidence": out}.items():
        (WORK / link).unlink(missing_ok=True)
        (WORK / link).symlink_to(place)


def computed(out: Path, commit: str) -> set[str]:
    """Return the names of the shards that are in `out`; they must be of this commit."""
    if not (out / "index.csv").exists():
        return set()
    with open(out / "index.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    if others := {row["commit"] for row in rows} - {commit}:
        sys.exit(f"error: {out} has shards of commit {min(others)}, and this pack is of {commit}; name another --out")
    return {row["shard"] for row in rows}


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that may change a number."""
    found = {"python": sys.version.split()[0]}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            sys.exit(f"error: this machine lacks {name}, which does not travel with a pack; install it")
    return found


def name_of_card(environment: Mapping[str, str]) -> str:
    """Return the name of the card that torch sees, or nothing."""
    done = subprocess.run([sys.executable, "-c", NAME_OF_CARD], env=environment, capture_output=True, text=True)
    return done.stdout.strip()


@contextmanager
def sharing_card(environment: Mapping[str, str]) -> Iterator[dict[str, str]]:
    """Give the variables by which processes use the card at the same time, by NVIDIA's MPS; none where it fails.

    Without it they take turns. No setting of the card is changed, and the daemon ends with the block.
    """
    control = shutil.which(MPS)
    if control is None:
        yield {}
        return
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        places = {f"CUDA_MPS_{name}_DIRECTORY": f"{folder}/{name.lower()}" for name in ("PIPE", "LOG")}
        for place in places.values():
            Path(place).mkdir()
        variables = dict(environment) | places
        quiet = {"env": variables, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        daemon = subprocess.Popen(
            [control, "-f"], stdin=subprocess.DEVNULL, start_new_session=True, preexec_fn=die_with_parent, **quiet
        )
        try:
            yield places if works(quiet) else {}
        finally:
            try:
                subprocess.run([control], input=b"quit\n", timeout=MPS_S, **quiet)
                daemon.wait(MPS_S)
            except (OSError, subprocess.TimeoutExpired):
                os.killpg(daemon.pid, signal.SIGKILL)
                daemon.wait()


def works(options: Mapping) -> bool:
    """Tell whether a process can compute on the card with these options of subprocess."""
    try:
        return subprocess.run([sys.executable, "-c", USE_CARD], timeout=MPS_S, **options).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def jobs_of(shards: list[dict], cores: int, card: bool) -> tuple[list[Job], list[Job]]:
    """Return the jobs that make data, which share the cores, and those that compute shards."""
    data = list(dict.fromkeys(each["data"] for each in shards if each["data"]))
    share = max(1, cores // max(1, len(data)))
    making = [Job(f"data_{name}", (name,), share, card=False) for name in data]
    computing = []
    for each in shards:
        arguments, processes = (each["set"], str(each["seed"]), each["budget"]), min(each["processes"], cores)
        after = f"data_{each['data']}" if each["data"] else ""
        computing.append(Job(name_of(each), arguments, processes, card and each["card"], after))
    return making, computing


def name_of(shard: Mapping) -> str:
    """Return the name of a shard, by which the index knows it."""
    return f"{shard['set']}-{shard['seed']}-{shard['budget']}"


def table(ended: Mapping[str, Mapping]) -> str:
    """Return the jobs, their seconds and how they ended, a line each."""
    width = max(map(len, ended), default=3)
    lines = [f"{name:{width}} {each['seconds'] or '':>8} {each['status']}" for name, each in ended.items()]
    return "\n".join([f"{'job':{width}} {'seconds':>8} status", *lines])


def main() -> None:
    """Compute the shards until all have ended or the minutes are over."""
    began = time.monotonic()
    cores = len(os.sched_getaffinity(0))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, required=True, help="what has not ended then is killed")
    parser.add_argument("--out", type=Path, required=True, help="folder of what was computed")
    parser.add_argument("--workers", type=int, default=cores, help=f"processes that compute at the same time ({cores})")
    parser.add_argument("--gpu-processes", type=int, help="those of them that use the card (all)")
    parser.add_argument("--card", choices=["auto", "no"], default="auto", help="no: train on the processor alone")
    given = parser.parse_args()
    if min(given.workers, given.gpu_processes or 1) < 1:
        sys.exit("error: --workers and --gpu-processes: expected 1 or more")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    pack, out = json.loads((HERE / "pack.json").read_text()), given.out.resolve()
    make_workspace(out)
    there = computed(out, pack["commit"])
    install()
    about = {"commit": pack["commit"], "machine": processor(), "card": "", "cores": given.workers}
    runner = Runner(out, given.workers, given.gpu_processes or given.workers, about | {"versions": versions()})
    runner.ended |= {name: {"seconds": None, "status": "there already"} for name in sorted(there)}
    runner.environment = os.environ | ONE_THREAD | {"TQDM_MININTERVAL": "10"}
    given_path = [os.environ["PYTHONPATH"]] if os.environ.get("PYTHONPATH") else []
    runner.environment["PYTHONPATH"] = os.pathsep.join([str(HERE), str(SITE), *given_path])
    making, computing = jobs_of(
        [each for each in pack["shards"] if name_of(each) not in there], given.workers, given.card != "no"
    )
    try:
        runner.waiting = making
        runner.look()  # data are made while the card is looked at
        if any(job.card for job in computing):
            runner.about["card"] = name_of_card(runner.environment)
        with sharing_card(runner.environment) if runner.about["card"] else nullcontext({}) as variables:
            runner.card = variables
            runner.about["card_shared"] = bool(variables)
            runner.waiting += computing
            while runner.waiting or runner.running:
                if time.monotonic() > began + 60 * given.minutes:
                    runner.kill("killed: the minutes are over")
                else:
                    runner.look()
                    time.sleep(LOOK_S)
    finally:
        runner.kill("killed")
        runner.note()
    for draft in out.rglob("*.unfinished"):
        draft.unlink()
    print(table(runner.ended))
    if any(each["status"].startswith("failed") for each in runner.ended.values()):
        sys.exit(1)


if __name__ == "__main__":
    main()
