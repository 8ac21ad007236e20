"""`dvc repro`: with nothing to do, after one setting, and in full."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from builders.project import ROOT, Project

from benchmarks import repro_stages

# A change of one model of `touch` must not run what makes its data, nor another experiment.
FORBIDDEN = r"simulate|ingest|window|dataset|probe|count"
FORBIDDEN += r"|train_stag|@(?!touch$)|_(touch|strain)$"


@pytest.fixture(scope="module")
def miniature(tmp_path_factory):
    """The pipeline at miniature scale, run once, and how long that took; not in the background as in the tests."""
    project = Project(tmp_path_factory.mktemp("miniature"))
    began = time.perf_counter()
    project.dvc("repro")
    return project, time.perf_counter() - began


def test_repro_nothing_changed(benchmark, record):
    """In this checkout, where everything is up to date."""
    dvc = [sys.executable, "-m", "dvc"]
    status = subprocess.run([*dvc, "status", "--json"], cwd=ROOT, check=True, capture_output=True)
    # The page shows the benchmarks: the first round brings it up to date. DVC always runs `this_machine`.
    stale = {name for name in json.loads(status.stdout) if not name.startswith("evidence/")} - {"page", "this_machine"}
    assert not stale, f"{', '.join(sorted(stale))}: not up to date; run `dvc repro` first"
    run = [*dvc, "repro", "--quiet"]
    benchmark.pedantic(lambda: subprocess.run(run, cwd=ROOT, check=True), rounds=3, warmup_rounds=1)
    seconds = benchmark.stats.stats.median
    record(
        "repro_nothing_changed",
        what="`dvc repro` with nothing to do, all experiments",
        unit="s",
        ours=seconds,
        most=8,
        rounds=3,
    )


def test_repro_one_setting(record, miniature):
    project, whole = miniature
    project.set({"touch.models.tree.min_samples_leaf": 7})
    folders = {path.name: path.stat().st_ino for path in (project.folder / "data" / "touch" / "models").iterdir()}
    began = time.perf_counter()
    ran = re.findall(r"Running stage '(\S+?)'", project.dvc("repro").stdout)
    seconds = time.perf_counter() - began
    assert {"train@touch", "evaluate@touch", "render@touch"} <= set(ran), ran
    after = {path.name: path.stat().st_ino for path in (project.folder / "data" / "touch" / "models").iterdir()}
    assert [name for name in folders if after[name] != folders[name]] == ["tree"], "another model was trained again"
    extra = [stage for stage in ran if re.search(FORBIDDEN, stage)]
    record(
        "repro_one_setting",
        what="`dvc repro` at miniature scale after one setting of one model of touch",
        peer_is="the whole pipeline at miniature scale",
        unit="s",
        ours=seconds,
        peer=whole,
        rounds=1,
    )
    record(
        "repro_one_setting_stages",
        what=f"stages run that do not depend on that model ({len(ran)} ran): {', '.join(extra) or 'none'}",
        unit="stages",
        ours=len(extra),
        most=0,
        rounds=1,
    )


@pytest.fixture
def clone(request, sizes, tmp_path):
    """A fresh clone of the last commit, with the recorded data of this checkout, and its environment.

    At tiny size it is the pipeline at miniature scale.
    """
    if not request.config.getoption("full_repro"):
        pytest.skip("takes a quarter of an hour; ask for it with --full-repro")
    if sizes.name == "tiny":
        project = Project(tmp_path)
        return project.folder, project.environment
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(tmp_path / "clone")], check=True)
    for source in (ROOT / "data" / "sources").glob("*/*"):
        target = tmp_path / "clone" / source.relative_to(ROOT)
        if not target.exists():
            target.symlink_to(source)
    return tmp_path / "clone", clean_environment(tmp_path / "clone")


def test_repro_full(clone, record, results, capfd):
    cores = repro_stages.busy_of(Path("/proc/stat").read_text())[1]
    with capfd.disabled():  # minutes: what DVC prints is shown as it comes
        samples = repro_stages.repro(*clone, sys.stdout)
    table = repro_stages.rows(samples, cores)
    repro_stages.write(results / "benchmarks" / "repro_stages.csv", table)
    record(
        "repro_full",
        what="`dvc repro` in a fresh clone, all experiments",
        unit="min",
        ours=sum(minutes for _, minutes, *_ in table),
        most=17,
        rounds=1,
        threads=cores,
    )
    record(
        "repro_idle_share",
        what="the same: share of the core-seconds of all cores in which none of them worked",
        unit="of 1",
        ours=repro_stages.idle_share(table, cores),
        most=0.1,
        rounds=1,
        threads=cores,
    )


def clean_environment(clone) -> dict[str, str]:
    """The environment of a shell: these benchmarks have limited theirs to one thread."""
    limits = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "WORKERS")
    return {key: value for key, value in os.environ.items() if key not in limits} | {"PYTHONPATH": str(clone)}
