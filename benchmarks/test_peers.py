"""The benchmarks themselves: peers compute what we do, rows say what was met, and the figures can be measured."""

import csv
import importlib.util
import io
import re

import numpy as np
import pytest
import torch

from benchmarks import growth, made, peers, report, repro_stages, rows
from benchmarks.test_benchmark_repro import FORBIDDEN
from tactile.experiments import touch
from tactile.learning import lomp_network
from tactile.learning.lstm import Lstm
from tactile.learning.spec import Spec
from tactile.logs import parse
from tactile.models import esn


def test_stacked_peer_equals_lomp():
    torch.manual_seed(0)
    ours = lomp_network.Lomp(Spec(3, 2, 4, 6, 4), 8, [5], 8, 0.3)
    x = torch.randn(6, 3, 8)
    theirs = peers.StackedLomp(ours)
    torch.testing.assert_close(ours(x), theirs(x), rtol=1e-5, atol=1e-5)
    gradients = []
    for network in (ours, theirs):
        ours.zero_grad()
        network(x).square().sum().backward()
        gradients.append([weight.grad.clone() for weight in ours.parameters()])
    for mine, peer in zip(*gradients, strict=True):
        torch.testing.assert_close(mine, peer, rtol=1e-4, atol=1e-5)


def test_plain_lstm_equals_ours():
    ours, plain = Lstm(6, 5, 2), peers.PlainLstm(6, 5, 2)
    plain.load_state_dict(ours.state_dict())
    x = torch.randn(1, 20, 6)
    torch.testing.assert_close(ours(x), plain(x))


def test_reservoir_peer_equals_ours():
    model = esn.build(Spec(10, 1, 6, 1, 2), units=20, spectral_radius=0.9, leak=0.3, input_scale=0.5, ridge=1e-6)
    system, x = model.make(6, 0), np.random.default_rng(0).normal(size=(50, 6)).astype(np.float32)
    theirs = peers.reservoir_states(system, 0.3, x)
    np.testing.assert_allclose(model.advance(system, x[None], None)[0], theirs, rtol=1e-4, atol=1e-5)


def test_readout_peer_finds_the_least_squares():
    torch.manual_seed(0)
    latent, readout = torch.randn(300, 3), torch.nn.Linear(3, 1, bias=False)
    true = torch.tensor([[1.0, -0.5, 0.25]])
    peers.readout_epochs(readout, latent, latent @ true.T, epochs=200, drop_epoch=125)
    torch.testing.assert_close(readout.weight.data, true, rtol=0, atol=0.01)


def test_a_made_log_has_its_faults_and_can_be_aligned(tmp_path):
    settings = made.touch_settings()
    folder = made.recording(tmp_path / "logs" / "single" / "run0", 0.8)
    assert 0.6e6 < (folder / "array.log").stat().st_size < 1e6
    frames, rejects, report = touch.read_recording(folder, settings)
    reasons = report["array.log"]["rejects"]
    assert (
        reasons[parse.TEXT] == 1 and reasons[parse.COLUMNS] and reasons[parse.OUT_OF_RANGE] and reasons[parse.DUPLICATE]
    )
    # Boot times, in us, are all that the clocks differ by.
    assert report["array.log"]["clocks"][0]["offset_ms"] == pytest.approx(3000, abs=15)
    assert report["cnc.log"]["clocks"][0]["offset_ms"] == pytest.approx(6000, abs=15)
    assert frames.num_rows > 0.95 * report["array.log"]["lines"]
    theirs = peers.read_log(folder / "array.log", touch.array_format(settings).names)
    lines = report["array.log"]["lines"] - 1  # but the banner
    assert len(theirs) == lines
    for peer in ("polars", "duckdb"):
        if importlib.util.find_spec(peer):  # of the extra `benchmarks`
            rows = getattr(peers, f"read_log_{peer}")(folder / "array.log", touch.array_format(settings).names)
            assert 0.99 * lines < rows <= lines


def test_rows_say_what_was_met_and_replace_each_other(tmp_path):
    path = tmp_path / "benchmarks.csv"
    shared = {"what": "a thing", "unit": "s", "rounds": 3, "size": "full"}
    fast = rows.row("fast", ours=1.0, peer=12.0, peer_is="a loop", least_ratio=12, **shared)
    slow = rows.row("slow", ours=1.0, peer=11.9, peer_is="a loop", least_ratio=12, **shared)
    large = rows.row("large", ours=2.1, most=2, **shared)
    none = rows.row("none", ours=0, most=0, **shared)
    assert [one.met for one in (fast, slow, large, none)] == ["yes", "no", "no", "yes"]
    either = [
        rows.row("either", peer=12.0, peer_is="a loop", least_ratio=ratio, most=most, ours=1.0, **shared)
        for ratio, most in ((12, 1), (13, 1), (12, 0.9), (13, 0.9))
    ]
    assert [one.met for one in either] == ["yes", "yes", "yes", "no"]
    assert [one.target for one in either] == [1, 1, 12, 0.9]
    assert fast.ratio == 12 and large.ratio == "" and "torch" in fast.versions
    rows.merge(path, [fast, slow])
    rows.merge(path, [rows.failed("fast", "full"), large])
    with open(path, newline="") as file:
        found = list(csv.DictReader(file))
    assert [(one["name"], one["met"]) for one in found] == [("fast", "failed"), ("slow", "no"), ("large", "no")]
    assert float(found[1]["ratio"]) == 11.9 and found[0]["ours"] == ""


def test_the_report_shows_every_row_and_exponent(tmp_path):
    shared = {"unit": "s", "rounds": 3, "size": "full"}
    slow = rows.row("slow", what="a thing", ours=1.0, peer=11.9, peer_is="a loop", least_ratio=12, **shared)
    large = rows.row("large", what="a large thing", ours=1.5, most=2, **shared)
    rows.merge(tmp_path / "benchmarks.csv", [slow, large, rows.failed("broken", "full")])
    growth.write(tmp_path, [growth.Point("ingest", growth.DATA, n, "MB of log", 0.1 * n, 50.0) for n in (1, 4, 16)])
    report.write(tmp_path)
    text = (tmp_path / "benchmarks" / "README.md").read_text().replace("\N{NO-BREAK SPACE}", " ")
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    assert ["a thing", "1 s", "11.9 s", "11.9", "12", "**no**", "1", "a loop"] in cells
    assert ["a large thing", "1.5 s", "-", "-", "at most 2 s", "yes", "1", "-"] in cells
    assert any(line[0] == "broken" and "**failed**" in line for line in cells)
    assert ["ingest", "1, 4, 16 MB of log", "0.1, 0.4, 1.6", "50, 50, 50", "1.00", "0.00"] in cells
    assert "- [data.png](data.png): With more data, the time of " in text
    assert "speedruns.csv" not in text
    assert all(f"- {name}: " in text for name in ("machine", "versions", "date"))


def test_what_one_setting_must_not_run():
    allowed = (
        "train@touch evaluate@touch latency@touch stress@touch render@touch collect render_stability"
        " render_studies judge page"
    )
    forbidden = "simulate@touch ingest@touch window@touch dataset@touch train@strain train@glove evaluate@strain"
    forbidden += " render@strain train@velostat_recorded probe"
    for stages, expected in ((allowed, False), (forbidden, True)):
        for stage in stages.split():
            assert bool(re.search(FORBIDDEN, stage)) == expected, stage


STAT = """cpu  1000 200 300 9000 50 0 7 0 0 0
cpu0 500 100 150 4500 25 0 3 0 0 0
cpu1 500 100 150 4500 25 0 4 0 0 0
intr 1
"""


def test_stages_of_a_repro_have_their_core_seconds():
    assert repro_stages.busy_of(STAT) == (15.0, 2)
    printed = "Running stage 'settings':\n> python\n'data.dvc' didn't change\nRunning stage 'train@cnn':\n\nDone\n"
    clock = iter([(0.0, 100.0), (6.0, 104.0), (36.0, 160.0), (66.0, 175.0)])
    out = io.StringIO()
    samples = repro_stages.watch(
        printed.splitlines(keepends=True), out, lambda stage: repro_stages.Sample(stage, *next(clock))
    )
    assert out.getvalue() == printed
    table = repro_stages.rows(samples, cores=2)
    assert table == [(repro_stages.BEFORE, 0.1, 4.0, 8.0), ("settings", 0.5, 56.0, 4.0), ("train@cnn", 0.5, 15.0, 45.0)]
    assert repro_stages.idle_share(table, cores=2) == pytest.approx(57 / 132)
