"""Speed-runs: `python -m pytest tests/benchmarks --speedruns` on an idle machine, `-k NETWORK` for some of them."""

import pytest
from benchmarks import made
from benchmarks.speedruns import former, runs

from pipeline.base import params, paths

EXPERIMENTS = {network: experiment for experiment, networks in former.settings().items() for network in networks}


@pytest.fixture(scope="module")
def speedruns(request, sizes, tmp_path_factory):
    """`speedruns(network)` trains a network by both recipes and returns its runs; skips where no dataset is there."""
    if not request.config.getoption("speedruns"):
        pytest.skip("takes about three quarters of an hour on two cores; ask for it with --speedruns")
    values = params.load()
    if sizes.name == "tiny":
        values, blocks = runs.brief(values)
        folder = tmp_path_factory.mktemp("speedruns")
        places = {experiment: made.dataset(folder / experiment, experiment, values) for experiment in blocks}
        seeds = runs.SEEDS[:2]
    else:
        blocks, seeds = former.settings(), runs.SEEDS
        places = {experiment: paths.dataset(experiment) for experiment in blocks}

    def train(network: str) -> list[runs.Run]:
        experiment = EXPERIMENTS[network]
        if reason := runs.missing(experiment, network, places[experiment], values):
            pytest.skip(reason)
        return runs.train_all(places[experiment], values, experiment, network, seeds, blocks)

    return train


@pytest.fixture
def table(results):
    """The table of all runs."""
    return results / "benchmarks" / "speedruns.csv"


@pytest.fixture
def trained(request, speedruns):
    """The runs of the network that a test is for, made before its row of benchmarks.csv is due."""
    return speedruns(request.param)


@pytest.mark.parametrize("trained", list(runs.LEAST), indirect=True)
def test_speedrun(trained, record, table):
    network = trained[0].network
    runs.write(table, trained)
    record(f"speedrun_{network}", **runs.figures(network, trained))


@pytest.fixture
def of_all(speedruns, table):
    """The runs of all networks, as tests before have written them."""
    made_before = runs.read(table)
    if absent := set(runs.LEAST) - {run.network for run in made_before}:
        pytest.skip(f"no speed-runs of {', '.join(sorted(absent))} yet")
    return made_before


def test_speedruns_geometric_mean(of_all, record):
    record("speedruns_geometric_mean", **runs.mean_figures(of_all))
