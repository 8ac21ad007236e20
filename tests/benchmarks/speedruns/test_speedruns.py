"""Speed-runs: `python -m pytest tests/benchmarks --speedruns` on an idle machine, `-k NETWORK` for some of them."""

from pathlib import Path
from typing import NamedTuple

import pytest
from benchmarks import made
from benchmarks.speedruns import changes, former, runs

from pipeline.base import params, paths

EXPERIMENTS = {network: experiment for experiment, networks in former.settings().items() for network in networks}


class Prepared(NamedTuple):
    """What trainings need: params.yaml, former.yaml, a dataset per experiment, seeds."""

    values: dict
    blocks: dict
    datasets: dict[str, Path]
    seeds: tuple[int, ...]

    def of(self, network: str) -> tuple[Path, dict, str, str, tuple[int, ...]]:
        """Return the first arguments of `train_all`; skips where what it needs is not there."""
        experiment = EXPERIMENTS[network]
        if reason := runs.missing(experiment, network, self.datasets[experiment], self.values):
            pytest.skip(reason)
        return self.datasets[experiment], self.values, experiment, network, self.seeds


@pytest.fixture(scope="module")
def prepared(request, sizes, tmp_path_factory):
    """The datasets of this checkout; at tiny size small ones, and trainings of two epochs."""
    if not request.config.getoption("speedruns"):
        pytest.skip("takes about an hour on two cores; ask for it with --speedruns")
    if sizes.name == "tiny":
        values, blocks = runs.brief(params.load())
        folder = tmp_path_factory.mktemp("speedruns")
        datasets = {experiment: made.dataset(folder / experiment, experiment, values) for experiment in blocks}
        return Prepared(values, blocks, datasets, runs.SEEDS[:2])
    blocks = former.settings()
    return Prepared(params.load(), blocks, {experiment: paths.dataset(experiment) for experiment in blocks}, runs.SEEDS)


@pytest.fixture
def table(results):
    """The table of all runs."""
    return results / "benchmarks" / "speedruns.csv"


@pytest.fixture
def trained(request, prepared):
    """The runs of the network that a test is for, made before its row of benchmarks.csv is due."""
    return runs.train_all(*prepared.of(request.param), prepared.blocks)


@pytest.mark.parametrize("trained", list(runs.LEAST), indirect=True)
def test_speedrun(trained, record, table):
    network = trained[0].network
    runs.write(table, trained)
    record(f"speedrun_{network}", **runs.figures(network, trained))


@pytest.fixture
def of_all(prepared, table):
    """The runs of all networks, as tests before have written them."""
    made_before = runs.read(table)
    if absent := set(runs.LEAST) - {run.network for run in made_before}:
        pytest.skip(f"no speed-runs of {', '.join(sorted(absent))} yet")
    return made_before


def test_speedruns_geometric_mean(of_all, record):
    record("speedruns_geometric_mean", **runs.mean_figures(of_all))


@pytest.mark.parametrize("network", list(dict.fromkeys(change.network for change in changes.CHANGES)))
def test_changes(network, prepared, table):
    whole = [run for run in runs.read(table) if run.network == network]
    if not whole:
        pytest.skip(f"no speed-runs of {network} yet")
    without = changes.train_all(*prepared.of(network))
    changes.write(table.with_name("changes.csv"), changes.gains(without, whole))
