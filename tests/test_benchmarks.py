"""The benchmarks themselves: peers compute what we do, rows say what was met, exponents are right."""

import csv
import io
import itertools
import math
import re
import subprocess
import sys
from collections import Counter

import numpy as np
import pytest
import torch
from benchmarks import growth, inference_speed, made, measure, peers, report, repro_stages, rows, scale_cost
from benchmarks.speedruns import changes, former, runs
from benchmarks.test_benchmark_data import check_equal
from benchmarks.test_benchmark_repro import FORBIDDEN, clean_environment

from pipeline.base import params, paths
from pipeline.datasets import schemas
from pipeline.experiments import touch
from pipeline.learning import image_classifier, lomp_network
from pipeline.learning.lstm import Lstm
from pipeline.learning.regressors import Spec
from pipeline.learning.training import precision_on
from pipeline.logs import parse
from pipeline.models import esn, lomp_stream


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
    assert len(theirs) == report["array.log"]["lines"] - 1  # but the banner


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


@pytest.mark.slow
def test_exponents_and_earlier_points(tmp_path):
    assert growth.exponent([1, 4, 16], [3, 6, 12]) == pytest.approx(0.5)
    assert np.isnan(growth.exponent([1], [3]))
    line = [growth.Point("ingest", growth.DATA, size, "MB of log", 0.1 * size, 50.0) for size in (1, 4, 16)]
    other = [growth.Point("lomp_latency", growth.ELEMENTS, 25, "elements", 1.0, 10.0)]
    growth.write(tmp_path, line)
    growth.write(tmp_path, other)
    with open(tmp_path / "growth.csv", newline="") as file:
        found = list(csv.DictReader(file))
    assert [one["task"] for one in found] == ["ingest"] * 3 + ["lomp_latency"]
    assert float(found[0]["time_exponent"]) == pytest.approx(1) and float(found[0]["memory_exponent"]) == pytest.approx(
        0
    )
    assert {path.name for path in (tmp_path / "benchmarks").iterdir()} == {"data.png", "elements.png"}


@pytest.mark.slow
def test_the_report_shows_every_row_and_exponent(tmp_path):
    shared = {"unit": "s", "rounds": 3, "size": "full"}
    slow = rows.row("slow", what="a thing", ours=1.0, peer=11.9, peer_is="a loop", least_ratio=12, **shared)
    large = rows.row("large", what="a large thing", ours=1.5, most=2, **shared)
    rows.merge(tmp_path / "benchmarks.csv", [slow, large, rows.failed("broken", "full")])
    growth.write(tmp_path, [growth.Point("ingest", growth.DATA, n, "MB of log", 0.1 * n, 50.0) for n in (1, 4, 16)])
    scale_cost.write(tmp_path / "benchmarks" / "scale_cost.csv", [])
    report.write(tmp_path)
    text = (tmp_path / "benchmarks" / "README.md").read_text().replace("\N{NO-BREAK SPACE}", " ")
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines() if line.startswith("|")]
    assert ["a thing", "1 s", "11.9 s", "11.9", "12", "**no**", "1", "a loop"] in cells
    assert ["a large thing", "1.5 s", "-", "-", "at most 2 s", "yes", "1", "-"] in cells
    assert any(line[0] == "broken" and "**failed**" in line for line in cells)
    assert ["ingest", "1, 4, 16 MB of log", "0.1, 0.4, 1.6", "50, 50, 50", "1.00", "0.00"] in cells
    assert "- [data.png](data.png): With more data, the time of " in text
    assert "[scale_cost.csv](scale_cost.csv)\n\n" in text and "speedruns.csv" not in text
    assert all(f"- {name}: " in text for name in ("machine", "versions", "date"))


def test_what_one_setting_must_not_run():
    allowed = (
        "train_touch evaluate@touch latency@touch stress@touch render_touch collect render_stability"
        " render_rightsize judge page"
    )
    forbidden = "simulate_touch ingest_touch window@touch dataset@touch train_strain train_glove evaluate@strain"
    forbidden += " rightsize_touch render_strain physics_touch train_velostat_recorded"
    for stages, expected in ((allowed, False), (forbidden, True)):
        for stage in stages.split():
            assert bool(re.search(FORBIDDEN, stage)) == expected, stage


def test_presses_of_made_frames_can_be_told_apart(tmp_path):
    import pyarrow.parquet

    from pipeline.datasets import windowing

    settings = made.touch_settings()
    frames = pyarrow.parquet.read_table(made.frames_file(tmp_path / "frames.parquet", 4000, settings))
    windows = windowing.windows_of(frames, settings["window"])
    presses = windows["press"].to_numpy()
    assert 15 < len(np.unique(presses)) < 35 and all(a <= b for a, b in itertools.pairwise(presses))


def test_the_dataset_of_pandas_equals_ours(tmp_path, monkeypatch):
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.setattr(params, "load", params.load)
    made.frames_file(paths.frames("touch"), 3000, made.touch_settings())
    measure.dataset(tmp_path, None)()
    measure.dataset_pandas(tmp_path, None)()
    check_equal(tmp_path)


SPEC = Spec(3, 2, 2, 4, 4)
TRAINING = {"learning_rate": 1e-2, "batch_size": 8, "max_epochs": 30, "patience": 2, "plateau": 1, "drop": 0.5}
SMALL = {  # of networks of touch, in place of the sizes of former.yaml
    "cnn": {"channels": [4], "hidden": [8]},
    "vgg": {"channels": [4] * 5},
    "convlstm": {"filters": 3},
    "rnn": {"layers": 1, "hidden": 4},
    "lomp": {"hidden": 4, "readout": [4], "neighbours": 4, "alpha": 1.0},
    "lomp_stream": {"hidden": 4, "readout": [4], "neighbours": 4, "alpha": 1.0},
}


def former_network(model: str, **training) -> former.FormerRegressor:
    """Return a small network of the former recipe, not yet trained."""
    present = made.touch_settings()["models"][model]
    return former.build(model, SPEC, {**SMALL[model], "training": TRAINING | training}, present)


def learnable(rows: int, streams: bool) -> tuple[np.ndarray, ...]:
    """Return windows of SPEC and maps that follow from them, of streams with `previous`, two windows a press."""
    x = np.random.default_rng(rows).uniform(0, 500, (rows, 3, 4)).astype(np.float32)
    y = np.repeat(x[:, -1], 4, axis=1) / 5
    numbers = np.arange(rows)
    return (x, y, np.where(numbers % 2, numbers - 1, -1)) if streams else (x, y)


@pytest.mark.parametrize("model", SMALL)
def test_the_former_recipe_learns_and_repeats_itself(model):
    fitted = []
    for _ in range(2):
        network = former_network(model, max_epochs=3)
        train, validation = (learnable(rows, network.streams) for rows in (24, 8))
        history = network.fit(train, validation, seed=1)
        fitted.append((history, network.predict(validation[0], *validation[2:])))
    (history, maps), again = fitted
    assert history == again[0] and np.array_equal(maps, again[1])
    assert maps.shape == (8, 16) and maps.dtype == np.float32
    least = min(row["validation_loss"] for row in history)
    assert np.mean((maps - validation[1]) ** 2) == pytest.approx(least, rel=1e-4)  # the best epoch's weights


def test_the_former_recipe_lowers_its_rate_and_stops_by_patience():
    optimiser = torch.optim.SGD([torch.nn.Parameter(torch.zeros(1))], lr=1.0)
    plateau = former.Plateau(optimiser, former.Recipe(1.0, 8, 30, patience=3, plateau=2, drop=0.5))
    losses = [1.0, 0.9, 0.895, 0.95, 0.95]  # the third gains less than SMALLEST_GAIN
    assert [plateau(epoch, loss) for epoch, loss in enumerate(losses, 1)] == [False] * 4 + [True]
    assert optimiser.param_groups[0]["lr"] == 0.5
    never_better = former_network("cnn", learning_rate=1e-9)
    assert len(never_better.fit(learnable(24, False), learnable(8, False), seed=0)) == 3  # the first, and patience


def test_former_weights_are_those_that_torch_draws():
    linear = torch.nn.Linear(5, 3)
    torch.nn.init.zeros_(linear.weight)  # as a recipe might that starts its last layer at zero
    anew = former.drawn_anew(torch.nn.Sequential(linear), "cnn", seed=4)[0]
    with torch.random.fork_rng():
        torch.manual_seed(4)
        assert torch.equal(torch.nn.Linear(5, 3).weight, anew.weight)
    assert not linear.weight.any()
    lomp = lomp_network.Lomp(SPEC, 16, [9], 4, 1.0)
    torch.nn.init.zeros_(lomp.readout[-1])
    drawn = former.drawn_anew(lomp, "lomp", seed=0)
    for weight, inputs in ((drawn.gate_state, 16), (drawn.readout[0], 32), (drawn.readout[1], 9)):
        assert 0.8 < float(weight.detach().abs().max()) * math.sqrt(inputs) <= 1
    assert not any(isinstance(layer, torch.nn.BatchNorm2d) for layer in former.vgg(SPEC, [4] * 5, 0))


def test_former_settings_are_of_networks_of_the_tables():
    blocks = former.settings()
    values = params.load()
    assert set(runs.LEAST) == set().union(*blocks.values()) and list(blocks) == list(runs.PROTOCOLS)
    for experiment, networks in blocks.items():
        assert set(networks) == set(scale_cost.networks(values, experiment))
        assert all(former.Recipe(**block["training"]).max_epochs > 1 for block in networks.values())


@pytest.fixture
def small_values():
    """params.yaml and former.yaml with small networks of touch and short trainings."""
    values, blocks = runs.brief(params.load())
    models = values["touch"]["models"]
    values["touch"] = values["touch"] | {"models": models | {name: models[name] | SMALL[name] for name in SMALL}}
    blocks["touch"] = {name: block | SMALL[name] for name, block in blocks["touch"].items()}
    return values, blocks


def test_both_recipes_are_clocked_on_the_same_data(tmp_path, small_values, monkeypatch):
    monkeypatch.setenv("WORKERS", "1")
    values, blocks = small_values
    path = made.dataset(tmp_path, "touch", values)
    made_runs = runs.train_all(path, values, "touch", "cnn", (0,), blocks)
    assert [(run.recipe, run.protocol, run.seed, run.epochs) for run in made_runs] == [
        ("former", "press", 0, 2),
        ("present", "press", 0, 2),
        ("shortened", "press", 0, 2),
    ]
    assert all(run.updates >= 2 and run.core_seconds > 0 and run.unit == "kPa" for run in made_runs)
    assert all(0 < run.validation_error < 100 for run in made_runs)


def test_the_former_recipe_sees_every_third_image(tmp_path, small_values):
    values, _ = small_values
    path = made.dataset(tmp_path, "glove", values)
    table = schemas.read(path, columns=["condition", "recording", "split_session_pressure_0"])
    objects, sessions, part = (schemas.names(column) for column in table.columns)
    training = np.flatnonzero(part == "train")
    seen = training[runs.every_third(path, "session_pressure", 0)]
    assert len(training) == 4 * 3 * 6  # objects, sessions, images
    assert set(Counter(zip(objects[seen], sessions[seen], strict=True)).values()) == {2}
    assert np.diff(seen)[::2].tolist() == [3] * 12


def test_errors_of_maps_and_of_classes():
    class Fixed:
        def __init__(self, predicted):
            self.predicted = np.array(predicted, np.float32)

        def predict(self, x):
            return self.predicted

    x = np.zeros((2, 1, 4), np.float32)
    maps = np.array([[1.0, 2.0], [3.0, 4.0]])
    assert runs.error_of(Fixed(maps + [[3, 4], [3, 4]]), (x, maps)) == pytest.approx(math.sqrt(12.5))
    classes = np.array([[1.0, 0.0], [0.0, 1.0]])
    found = runs.error_of(Fixed([[0.5, 0.5], [0.75, 0.25]]), (x, classes))
    assert found == pytest.approx(-(math.log(0.5) + math.log(0.25)) / 2)
    assert math.isfinite(runs.error_of(Fixed([[0.0, 1.0], [0.0, 1.0]]), (x, classes)))


def speedrun(network: str, error: float, seconds: float) -> list[runs.Run]:
    """Return two seeds of a network by both recipes: the former has an error of 4 kPa in 60 s."""
    return [
        run
        for seed in (0, 1)
        for run in (
            runs.Run(network, "former", "press", seed, 9, 90, 60.0, 4.0 + seed - 0.5, "kPa"),
            runs.Run(network, "present", "press", seed, 3, 30, seconds, error, "kPa"),
        )
    ]


def test_a_speed_run_counts_only_where_the_target_is_reached(tmp_path):
    good, bad = speedrun("lomp", 4.03, 15.0), speedrun("rnn", 4.05, 60.0)
    assert runs.outcome(good).reached and not runs.outcome(bad).reached  # 4.04 kPa is the most
    row = rows.row("speedrun_lomp", size="full", **runs.figures("lomp", good))
    assert (row.ratio, row.met, row.ours, row.peer) == (4.0, "yes", 15.0, 60.0) and "4 kPa" in row.what
    missed = rows.row("speedrun_rnn", size="full", **runs.figures("rnn", bad))
    assert missed.ratio == 0 and missed.ours == math.inf and "not reached" in missed.what
    both = rows.row("mean", size="full", **runs.mean_figures([*good, *bad]))
    assert both.ratio == 0 and both.met == "no" and "1 of 2" in both.what
    fine = rows.row("mean", size="full", **runs.mean_figures([*good, *speedrun("rnn", 3.0, 60.0)]))
    assert fine.ratio == pytest.approx(2) and fine.met == "no"
    path = tmp_path / "speedruns.csv"
    runs.write(path, bad)
    runs.write(path, good)
    runs.write(path, better := speedrun("rnn", 3.0, 10.0))
    assert runs.read(path) == [*better, *good]


def test_a_shortened_training_is_what_reaching_the_target_costs():
    made_runs = speedrun("rnn", 3.0, 60.0)
    sooner = [run._replace(recipe="shortened", core_seconds=20.0, validation_error=4.02) for run in made_runs[1::2]]
    row = rows.row("speedrun_rnn", size="full", **runs.figures("rnn", [*made_runs, *sooner]))
    assert row.ratio == 3.0 and "4.02 in 30 updates, 3 with the epochs of params.yaml" in row.what
    late = [run._replace(validation_error=4.05) for run in sooner]
    assert not runs.outcome([*made_runs, *late]).reached


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    """`datasets(experiment, values)` is a small dataset, made once."""
    folder, known = tmp_path_factory.mktemp("datasets"), {}

    def dataset(experiment: str, values: dict):
        if experiment not in known:
            known[experiment] = made.dataset(folder / experiment, experiment, values)
        return known[experiment]

    return dataset


@pytest.mark.parametrize("number", range(len(changes.CHANGES)))
def test_a_change_that_is_taken_back_gives_another_network_and_is_there_again_after_it(
    datasets, small_values, number, monkeypatch
):
    monkeypatch.setattr(lomp_stream.StreamingLomp, "largest_gradient", 1e-6)  # small networks have small gradients
    values, _ = small_values
    change = changes.CHANGES[number]
    if change.what == changes.PRODUCTS and precision_on(torch.device("cpu"), "bfloat16") == "float32":
        pytest.skip("this processor has no instructions for products in bfloat16: they are in float32")
    experiment = next(name for name in runs.PROTOCOLS if change.network in values[name]["models"])
    place, run = (datasets(experiment, values), values, experiment), (runs.PROTOCOLS[experiment][0], 0)
    before = runs.train(*place, change.network, {}, runs.PRESENT, *run)
    without = changes.train(*place, number, *run)
    after = runs.train(*place, change.network, {}, runs.PRESENT, *run)
    assert (without.network, without.recipe) == (change.network, change.what)
    assert without.validation_error != before.validation_error == after.validation_error


def test_gains_are_means_over_the_same_seeds(tmp_path):
    present = speedrun("cnn", 3.0, 20.0)
    without = [runs.Run("cnn", "a change", "press", 1, 3, 30, 30.0, 3.6, "kPa")]
    (gain,) = changes.gains(without, [*present, runs.Run("cnn", "present", "press", 2, 3, 30, 1.0, 1.0, "kPa")])
    assert gain == changes.Gain("cnn", "a change", 1, "kPa", 3.0, 3.6, 20.0, 30.0)
    path = tmp_path / "changes.csv"
    for rows_written in ([gain._replace(network="lomp")], [gain], [gain]):
        changes.write(path, rows_written)
    with open(path, newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["network"] for line in lines] == ["cnn", "lomp"] and float(lines[0]["error_without"]) == 3.6


def test_the_papers_scale_costs_what_its_amounts_say(tmp_path):
    values = made.at_paper_scale(tmp_path)
    assert scale_cost.training_rows(values, "touch", "lomp_stream") == round(0.8 * 331_000)
    assert scale_cost.training_rows(values, "glove", "sp_resnet") == round(0.8 * 16 * 950)
    values["touch"]["models"]["cnn"]["training"]["rest_share"] = 0.5
    seen = scale_cost.training_rows(values, "touch", "cnn")
    assert seen == pytest.approx(264_800 * (0.753 + 0.5 * 0.247), abs=1)
    values["touch"]["models"]["cnn"]["training"]["epochs"] = 3
    values["touch"]["protocols"]["random_window"]["passes"] = 2
    cost = scale_cost.cost(values, "touch", "cnn", seconds=1e-3)
    assert cost.runs == 10 and cost.epochs == 5 * 3 + 5 * 2 * 3
    assert cost.core_hours == pytest.approx(1e-3 * seen * 45 / 3600)
    assert params.load() == params.load(paths.PARAMS)  # of the checkout, as it was


@pytest.mark.parametrize("experiment, network", [("touch", "lomp_stream"), ("glove", "sp_resnet_nogcam")])
def test_seconds_of_an_update_are_those_of_its_rows(small_values, experiment, network):
    values, _ = small_values
    assert 1e-6 < scale_cost.seconds_per_row(values, experiment, network, updates=2) < 1


def test_noise_has_the_shapes_of_its_task():
    x, y, previous = scale_cost.noise(SPEC, 6, streams=True)
    assert x.shape == (8, 3, 4) and y.shape == (8, 16) and previous.tolist() == [-1, 0, 1, 2, -1, 4, 5, 6]
    x, y = scale_cost.noise(image_classifier.spec_of(5), 8, streams=False)
    assert x.shape == (8, 1, 1024) and runs.one_hot(y)


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
    assert table == [
        (repro_stages.BEFORE, 0.1, 4.0, 8.0),
        ("settings", 0.5, 56.0, 4.0),
        ("train@cnn", 0.5, 15.0, 45.0),
    ]
    assert repro_stages.idle_share(table, cores=2) == pytest.approx(57 / 132)


@pytest.mark.slow
def test_a_repro_is_watched_while_it_runs(tmp_path):
    work = "import time; end = time.process_time() + {}\nwhile time.process_time() < end: pass"
    for name, seconds in (("idle", 0), ("busy", 0.5)):
        (tmp_path / f"{name}.py").write_text(work.format(seconds) + f"\nopen('{name}.txt', 'w').write('done')")
    stages = "".join(
        f"  {name}:\n    cmd: {sys.executable} {name}.py\n    deps: [{name}.py{before}]\n    outs: [{name}.txt]\n"
        for name, before in (("idle", ""), ("busy", ", idle.txt"))
    )
    (tmp_path / "dvc.yaml").write_text(f"stages:\n{stages}")
    environment = clean_environment(tmp_path) | {"DVC_NO_ANALYTICS": "1", "DVC_SITE_CACHE_DIR": str(tmp_path / "site")}
    init = [sys.executable, "-m", "dvc", "init", "--no-scm", "--quiet"]
    subprocess.run(init, cwd=tmp_path, env=environment, check=True)
    out = io.StringIO()
    table = repro_stages.rows(repro_stages.repro(tmp_path, environment, out), cores=2)
    assert [stage for stage, *_ in table] == [repro_stages.BEFORE, "idle", "busy"]
    assert table[2][2] > 0.4 and "Running stage 'busy'" in out.getvalue()
    (tmp_path / "busy.py").write_text("raise SystemExit(3)")
    with pytest.raises(subprocess.CalledProcessError):
        repro_stages.repro(tmp_path, environment, out)


def test_growth_reaches_ten_times_the_data_where_that_is_quick():
    sizes = growth.FULL
    for task in growth.TENFOLD:
        factors = sizes.factors_of(task)
        assert factors[-1] == 10 * factors[-2] and task in measure.TASKS and task in growth.LOOKS
        assert [sizes.repeats_of(task, factor) for factor in factors] == [3, 3, 3, 1]
    assert sizes.factors_of("lomp_epoch") == [1, 4, 16]


@pytest.mark.slow
def test_predictions_are_timed_side_by_side(tmp_path):
    speeds = inference_speed.speeds(params.load(), "touch", "lomp_stream", tmp_path, rounds=1)
    assert len({speed.runs_on for speed in speeds}) == 4 and all(0 < speed.p50_ms < 1000 for speed in speeds)
    assert 0 < speeds[0].zeros < 1 and speeds[2].mb > 2 * speeds[3].mb
    inference_speed.write(tmp_path / "inference.csv", speeds)
    with open(tmp_path / "inference.csv", newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["runs_on"] for line in lines] == [speed.runs_on for speed in speeds]
    assert lines[0]["mb"] == "" and float(lines[2]["p50_ms"]) == speeds[2].p50_ms


@pytest.mark.parametrize("task", ["cnn_epoch", "lomp_epoch", "lomp_predictions", "lomp_updates"])
def test_what_is_measured_of_networks_runs(task, tmp_path):
    measure.TASKS[task](tmp_path, 4)()
