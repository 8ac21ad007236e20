"""What the papers' scale would cost now, by network, in core-hours."""

import pytest

from benchmarks import made, scale_cost

MOST = {"touch": 8, "glove": 12}  # core-hours


@pytest.fixture(scope="module")
def costs(sizes, results, tmp_path_factory) -> list[scale_cost.Cost]:
    """The costs of all networks, which are also written to benchmarks/scale_cost.csv."""
    values = made.at_paper_scale(tmp_path_factory.mktemp("scale"))
    table = [cost for name in scale_cost.EXPERIMENTS for cost in scale_cost.costs(values, name, sizes.updates)]
    scale_cost.write(results / "benchmarks" / "scale_cost.csv", table)
    return table


@pytest.mark.parametrize("experiment", scale_cost.EXPERIMENTS)
def test_scale_cost(record, sizes, costs, experiment):
    own = [cost for cost in costs if cost.experiment == experiment]
    largest = max(own, key=lambda cost: cost.core_hours)
    record(
        f"scale_cost_{experiment}",
        what=f"{experiment}: all trainings of {len(own)} networks at the papers' scale, {own[0].runs} runs of "
        f"up to {max(cost.rows for cost in own)} rows; most, {largest.core_hours:.3g} core-h, by {largest.network}",
        unit="core-h",
        ours=sum(cost.core_hours for cost in own),
        most=MOST[experiment],
        rounds=1,
    )
