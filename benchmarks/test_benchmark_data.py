"""Reading a large log, and making a dataset of frames, against pandas."""

import os
import time

import numpy as np
import pyarrow.parquet
import pytest

from benchmarks import made, peers
from benchmarks.measure import measured
from tactile.base.paths import Workspace
from tactile.experiments import touch
from tactile.logs import parse


@pytest.fixture(scope="module")
def recording(sizes, tmp_path_factory):
    """A folder with made.LOGS/run0/*.log, the array's log of the size asked for."""
    folder = tmp_path_factory.mktemp("recording")
    made.recording(folder / made.LOGS / "run0", sizes.log_mb)
    return folder


def test_ingest(race, record, sizes, recording):
    folder = recording / made.LOGS / "run0"
    path, fmt = folder / "array.log", touch.array_format(made.touch_settings())
    rows, rejects = parse.read_log(path, fmt)
    assert rows.num_rows + rejects.num_rows == sum(1 for _ in path.open("rb")) and rejects.num_rows > 3
    del rows, rejects
    seconds, peer, single, limit = race(
        lambda: parse.read_log(path, fmt),
        lambda: peers.read_log(path, fmt.names),
        lambda: peers.read_log(path, fmt.names, threads=1),
        lambda: peers.parse_log(path, fmt.names),
        rounds=3,
    )
    mb, threads = path.stat().st_size / 1e6, os.cpu_count()
    what = f"a touch log of {mb:.0f} MB to typed rows and rejects, all checks: {mb / seconds:.0f} MB/s"
    shared = {"unit": "s", "rounds": 3, "threads": threads}
    peer_is = "pandas.read_csv, no checks"
    record("ingest_read", what=what, peer_is=peer_is, ours=seconds, peer=peer, least_ratio=2, **shared)
    alone = f"{peer_is}, one thread (as before pandas 3.1)"
    record("ingest_read_one_thread", what=what, peer_is=alone, ours=seconds, peer=single, **shared)
    parser = "pyarrow alone, which ours parses with, in pieces on all cores, no checks: the limit"
    record("ingest_read_limit", what=what, peer_is=parser, ours=seconds, peer=limit, **shared)
    disk = seconds_to_read(path)
    record(
        "ingest_disk",
        what=f"{what}; the ratio is the share of the disk's {mb / disk:.0f} MB/s",
        peer_is="reading the file from the disk, nothing else",
        ours=seconds,
        peer=disk,
        **shared,
    )


@pytest.mark.parametrize("peer", ["pandas", "polars", "duckdb"])
def test_ingest_cpu(record, sizes, recording, peer):
    """What the reading costs, on however many cores: a peer can be sooner done by working on more of them."""
    if peer != "pandas":
        pytest.importorskip(peer, reason=f"{peer} is not installed: pip install -c constraints.txt '.[benchmarks]'")
    path, fmt = recording / made.LOGS / "run0" / "array.log", touch.array_format(made.touch_settings())
    read = {"pandas": peers.read_log, "polars": peers.read_log_polars, "duckdb": peers.read_log_duckdb}[peer]
    taken = [[cpu_seconds(parse.read_log, path, fmt), cpu_seconds(read, path, fmt.names)] for _ in range(4)][1:]
    ours, theirs = np.median(taken, axis=0).tolist()
    what = f"the same {path.stat().st_size / 1e6:.0f} MB, in seconds of all cores together"
    shared = {"unit": "CPU-s", "rounds": 3, "threads": os.cpu_count()}
    record(f"ingest_cpu_{peer}", what=what, peer_is=f"{peer}, no checks", ours=ours, peer=theirs, **shared)


def test_ingest_stage(record, sizes, recording):
    """The whole stage: three logs read, aligned, written as Parquet."""
    folder = recording / made.LOGS / "run0"
    runs = [(measured("ingest", recording), measured("read_log_pandas", folder)) for _ in range(3)]
    ours, peer = (float(np.median([run[k]["seconds"] for run in runs])) for k in (0, 1))
    mb = sum(path.stat().st_size for path in folder.iterdir()) / 1e6
    shared = {"peer_is": "pandas.read_csv of the array's log alone, no checks", "rounds": 3, "threads": os.cpu_count()}
    record(
        "ingest_stage",
        what=f"the stage: {mb:.0f} MB of logs of three devices to aligned frames in Parquet, {mb / ours:.0f} MB/s",
        unit="s",
        ours=ours,
        peer=peer,
        **shared,
    )
    ours, peer = (max(run[k]["mb"] for run in runs) / 1e3 for k in (0, 1))
    record("ingest_memory", what="largest memory of the stage", unit="GB", ours=ours, peer=peer, most=2, **shared)


def test_memory_of_two_recordings(record, sizes, tmp_path):
    """Two processes read them at once, where the machine has the memory."""
    for run in ("run0", "run1"):
        made.recording(tmp_path / made.LOGS / run, 1.28 * sizes.log_mb)
    held = measured("ingest", tmp_path)["mb"] / 1e3
    what = f"largest memory of the stage, two recordings of {1.28 * sizes.log_mb:.0f} MB"
    record("ingest_memory_two", what=what, unit="GB", ours=held, most=1.5, rounds=1, threads=os.cpu_count())


def test_memory_of_predict(record, sizes, tmp_path):
    """Also that of the imports counts, which `measured` leaves out."""
    hz = 50
    folder = made.recording(tmp_path / made.LOGS / "run0", sizes.hours * 3600 * hz * made.LINE_BYTES / 1e6, hz)
    for truth in ("load_cell.log", "cnc.log"):
        (folder / truth).unlink()
    run = measured("predict", tmp_path)
    what = f"largest memory of `tactile predict touch/lomp_stream LOGS`, {sizes.hours:g} h at {hz} Hz, imports included"
    shared = {"rounds": 1, "threads": 1}
    record("predict_memory", what=what, unit="MB", ours=run["mb"] + run["imports_mb"], most=700, **shared)
    what = f"the same: readings a second, of {sizes.hours * 3600 * hz:.0f}"
    record("predict_speed", what=what, unit="1/s", ours=sizes.hours * 3600 * hz / run["seconds"], **shared)


def test_dataset(record, sizes, tmp_path, monkeypatch):
    workspace = Workspace(tmp_path)
    made.frames_file(workspace.frames("touch"), sizes.frames, made.touch_settings())
    runs = [measured("dataset", tmp_path) for _ in range(3)]
    seconds = float(np.median([run["seconds"] for run in runs]))
    rows = pyarrow.parquet.ParquetFile(workspace.dataset("touch")).metadata.num_rows
    record(
        "dataset",
        what=f"window + dataset, both stages with their files: {sizes.frames} frames to {rows} windows, all of a press",
        unit="s",
        ours=seconds,
        rounds=3,
    )
    memory = max(run["mb"] for run in runs)
    limit = 3 * uncompressed_mb(workspace.dataset("touch"))
    record(
        "dataset_memory",
        what="largest memory of window + dataset; the target is 3 times the uncompressed dataset",
        peer_is="3 times the Parquet file's uncompressed size",
        unit="MB",
        ours=memory,
        peer=limit,
        most=limit,
        rounds=3,
    )


def cpu_seconds(function, *arguments) -> float:
    """Seconds that all threads of this process worked in a call."""
    began = time.process_time()
    function(*arguments)
    return time.process_time() - began


def seconds_to_read(path) -> float:
    """Seconds to read a file that is not in the page cache, in order, in blocks of 4 MiB."""
    with path.open("rb", buffering=0) as file:
        os.fsync(file.fileno())
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
        began = time.perf_counter()
        while file.read(1 << 22):
            pass
        return time.perf_counter() - began


def uncompressed_mb(path) -> float:
    """Size of a Parquet file's columns before compression."""
    metadata = pyarrow.parquet.ParquetFile(path).metadata
    return sum(metadata.row_group(k).total_byte_size for k in range(metadata.num_row_groups)) / 1e6
