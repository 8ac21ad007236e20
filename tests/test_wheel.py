"""The wheel, installed alone in a fresh environment: its commands work in any folder, in the times they may take."""

import os
import resource
import shutil
import subprocess
import sys
import time
import tomllib
import urllib.request
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from builders import own_logs
from builders.devices import Device, until
from builders.project import ROOT

pytestmark = pytest.mark.slow

VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
INSTALL_S = 60  # of the tool alone, on an idle machine: 24 with pip's cache
CPU_S = {"check bench/pad": 3.0, "sheet bench/pad": 3.0, "demo": 4.0}  # of a command on an idle machine
LIBRARIES = "import pandas, scipy.stats, matplotlib.pyplot"
LIBRARIES_S = 1.2  # CPU-s of their import where check takes 3.1; on a slower machine they took 2.1 and check 5.5
BUSY = 1.5  # times as long where other processes run beside, as tests do: 1.2 of CPU-s, 2 of the installation
SETTINGS = """
touch.sensor: {rows: 3, cols: 4, pitch_mm: 10.0, element_mm: 9.0}
touch.label.map_rows: 9
touch.label.map_cols: 12
touch.models: {linear: {}}
"""


def install(folder: Path, extras: str = "") -> float:
    """Install the wheel in a folder into the environment there, and return the seconds that it took."""
    (wheel,) = folder.glob("*.whl")
    pip = [str(folder / "venv" / "bin" / "python"), "-m", "pip", "install", "-q", "-c", str(ROOT / "constraints.txt")]
    before = time.monotonic()
    subprocess.run([*pip, f"{wheel}{extras}"], check=True)
    return time.monotonic() - before


@pytest.fixture(scope="module")
def tactile(tmp_path_factory) -> Path:
    """The command `tactile` of the wheel, alone in an environment; skipped where pip gets no packages."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "pip", "wheel", "--no-deps", "-q", "-w", str(folder), str(ROOT)]
    built = subprocess.run(build, capture_output=True, text=True)
    if "No matching distribution found for hatchling" in built.stderr:
        pytest.skip("pip gets no packages to build the wheel with")
    assert built.returncode == 0, built.stderr
    subprocess.run([sys.executable, "-m", "venv", str(folder / "venv")], check=True)
    took_s = install(folder)
    print(f"installed in {took_s:.0f} s")
    assert took_s < BUSY * INSTALL_S
    return folder / "venv" / "bin" / "tactile"


@pytest.fixture(scope="module")
def empty(tmp_path_factory) -> Path:
    """A folder that holds a sensor's logs and nothing else."""
    folder = tmp_path_factory.mktemp("empty")
    own_logs.touch(folder / "bench" / "pad", 3, 4, 50.0, seconds=60.0, recordings=3)
    (folder / "bench" / "other").mkdir()
    for name in ("pad", "other"):
        (folder / "bench" / name / "settings.yaml").write_text(SETTINGS)
    time_s = 0.02 * np.arange(300)
    columns = {"time_s": time_s, "force_n": np.round(10 * np.sin(time_s) ** 2, 3)}
    columns |= {f"{axis}_mm": np.round(20 + 10 * np.sin(time_s / k), 3) for k, axis in enumerate("xyz", 1)}
    counts = np.random.default_rng(0).integers(0, 1024, (12, 300))
    pd.DataFrame(columns | {f"v{k}": row for k, row in enumerate(counts)}).to_csv(folder / "all.csv", index=False)
    shutil.copy(ROOT / "data" / "sample" / "double" / "two_touches" / "array.log", folder / "sample.log")
    return folder


def environment() -> dict[str, str]:
    """The environment of somebody who has installed nothing else: no path of this checkout."""
    return {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "GIT_"))}


def run(tactile: Path, folder: Path, *words: str) -> tuple[str, float]:
    """Run a command in a folder; return what it printed and the CPU seconds it took."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([tactile, *words], cwd=folder, env=environment(), capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


MADE = {  # command -> words that it prints, and a file that it makes
    "--version": (f"tactile {VERSION}\n", None),
    "help sheet": ("tactile sheet", None),
    "models": ("touch/lomp_stream", None),
    "demo": ("double-two_touches.gif", "predictions/demo/double-two_touches.png"),
    "check bench/pad": ("ready: `tactile try bench/pad`", "data/touch/check.png"),
    "sheet bench/pad": ("hysteresis", None),
    "import all.csv bench/other/single/run0 --of touch": ("array.log", "bench/other/single/run0/array.log"),
    "predict touch/lomp_stream sample.log": ("written to predictions/sample", "predictions/sample/summary.json"),
    "export touch/lomp_stream lomp": ("written to lomp", "lomp/card.json"),
    "inspect lomp": ("network.safetensors", None),
}


@pytest.mark.parametrize("words", MADE)
def test_a_command_works_in_any_folder(tactile, empty, words):
    said, made = MADE[words]
    printed, _ = run(tactile, empty, *words.split())
    assert said in printed and (made is None or (empty / made).is_file()), printed


def test_what_an_extra_or_a_checkout_has_is_named(tactile, empty):
    absent = "error: {} is not installed; run `pip install 'tactile-reproduction[{}]'`\n".format
    for words, sentence in (
        ("track", "error: there is no command 'track'; known: "),
        ("export touch/lomp_stream as_onnx --onnx", absent("torch", "train")),
    ):
        done = subprocess.run([tactile, *words.split()], cwd=empty, env=environment(), capture_output=True, text=True)
        assert done.returncode in (1, 2) and done.stderr.startswith(sentence), (words, done.stderr)


def test_a_replay_is_shown_live(tactile, empty):
    command = [tactile, "live", "touch/lomp_stream", "--replay", "sample.log", "--loop", "--http-port", "0"]
    with subprocess.Popen(command, cwd=empty, env=environment(), stderr=subprocess.PIPE, text=True) as process:
        address = next(word for line in process.stderr for word in line.split() if word.startswith("http://"))
        with urllib.request.urlopen(address) as page:
            assert b"<html" in page.read()
        process.terminate()


def test_a_device_is_recorded(tactile, empty):
    device = Device(empty / "port")
    command = [tactile, "record", str(device.path), "new.log"]
    with subprocess.Popen(command, cwd=empty, env=environment(), stderr=subprocess.PIPE, text=True) as process:
        assert "recording" in process.stderr.readline()
        device.print(b"1,2,3\n")
        until(lambda: (empty / "new.log").is_file() and (empty / "new.log").read_bytes() == b"1,2,3\n")
        process.terminate()
    device.unplug()


def test_commands_of_a_bench_are_quick_and_load_no_torch(tactile, empty):
    python = tactile.parent / "python"
    slower = max(1.0, min(run(python, empty, "-c", LIBRARIES)[1] for _ in range(3)) / LIBRARIES_S)
    print(f"this machine takes {slower:.2f} times as long")
    for words, most in CPU_S.items():
        run(tactile, empty, *words.split())  # compiles and caches
        least = min(run(tactile, empty, *words.split())[1] for _ in range(3))
        print(f"{words}: {least:.1f} CPU-s")
        assert least < slower * BUSY * most, words
    of_check = environment() | {"PYTHONPROFILEIMPORTTIME": "1"}
    done = subprocess.run([tactile, "check", "bench/pad"], cwd=empty, env=of_check, capture_output=True, text=True)
    loaded = {line.rpartition("|")[2].strip() for line in done.stderr.splitlines()}
    assert done.returncode == 0 and "tactile.drawing.check" in loaded and "torch" not in loaded


def test_models_of_ones_own_are_trained_with_the_extra(tactile, empty):
    done = subprocess.run([tactile, "try", "bench/pad"], cwd=empty, env=environment(), capture_output=True, text=True)
    assert done.returncode == 1 and "run `pip install 'tactile-reproduction[train]'`" in done.stderr
    print(f"torch installed in {install(tactile.parents[2], '[train]'):.0f} s")
    for command in ("try", "own"):
        said, _ = run(tactile, empty, command, "bench/pad")
        assert "reports/own/bench/pad/README.md" in said
    made = empty / "build/own/bench/pad/trained/linear"
    assert (made / "card.json").is_file()
    run(tactile, empty, "predict", str(made), "bench/pad", "--out", "pad")
    assert (empty / "pad" / "predictions.parquet").is_file()
