"""Shards whose scores under stress have blocks, and older ones that have none, are both read."""

import pandas as pd
import pytest
from builders import stress_rows

from pipeline.results import shards
from pipeline.stages import shard
from tactile.base import files
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

PLACE = ("repetition", "all")


def rows(blocks: str = "", seed: int = 0) -> pd.DataFrame:
    made = {"constant": lambda at, seed: 10.0, "linear": lambda at, seed: 2.0 + at}
    return stress_rows.rows("velostat_recorded", PLACE, made, {"noise": [0, 1]}, (seed,)).assign(blocks=blocks)


def test_files_with_blocks_and_older_ones_are_read_together(tmp_path):
    workspace = Workspace(tmp_path)
    stress_rows.keep(workspace, "velostat_recorded-0-full", rows().drop(columns="blocks"))
    stress_rows.keep(workspace, "velostat_recorded-1-full", rows("4:5 0.25:3", 1))
    stress_rows.keep(workspace, "velostat_recorded-2-full", rows("", 2))
    found = shards.stress(workspace)
    assert list(found.columns) == shards.STRESS and found.columns[-1] == "blocks" and len(found) == 12
    assert found.groupby("seed")["blocks"].unique().map(list).to_dict() == {0: [""], 1: ["4:5 0.25:3"], 2: [""]}
    assert found["value"].tolist() == rows()["value"].tolist() * 3


@pytest.mark.parametrize("blocks", ["4", "4:5;1:2", "4:0", "x:1"])
def test_blocks_that_are_none_are_named_with_their_line(tmp_path, blocks):
    workspace, table = Workspace(tmp_path), rows("4:5")
    table.loc[table.index[2], "blocks"] = blocks
    stress_rows.keep(workspace, "velostat_recorded-0-full", table)
    with pytest.raises(InputError, match=r"velostat_recorded-0-full.csv, line 4: blocks are .* run `tactile evidence"):
        shards.stress(workspace)


def test_a_shard_keeps_blocks_of_the_protocols_that_are_scored_by_unit_alone(tmp_path):
    own, metric = Workspace(tmp_path), "error"
    table = pd.DataFrame({"model": ["ridge"] * 3, "metric": [metric, "r2", metric], "severity": 0, "value": 1.0})
    table = table.assign(experiment="strain_recorded", seed=0, blocks=["4:5", "", "3:2"])
    table["protocol"] = ["within_day_xy", "within_day_xy", "across_days_xy"]
    files.write_table(own.stress("strain_recorded"), table)
    results = pd.DataFrame({"model": ["ridge"], "variant": [""], "budget": [""]})
    found = shard.stress_rows(own, "strain_recorded", results, ["across_days_xy"])
    assert list(found.columns) == shards.STRESS and found["blocks"].tolist() == ["", "3:2"]
    files.write_table(own.stress("strain_recorded"), table.assign(blocks=""))
    assert shard.stress_rows(own, "strain_recorded", results, [])["blocks"].tolist() == ["", ""]
