"""Claims by scale: which verdict stands first, and what stands beside it."""

import pandas as pd
import pytest

from pipeline.base import params, paths
from pipeline.base.params_file import set_values
from pipeline.claims import entries, judge
from pipeline.reporting import claims

COLUMNS = ["id", "kind", "data", "verdict", "ours", "scale"]


def table(*rows) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=COLUMNS)


PRESENT = table(
    ("lomp/a", "sentence", "simulated", "undecided", 1.0, "laptop"),
    ("lomp/b", "sentence", "simulated", "reproduced", 2.0, "laptop"),
    ("lomp/c", "number", "simulated", "contradicted", 3.0, "both"),
    ("lomp/a/recorded", "sentence", "recorded", "contradicted", 4.0, "laptop"),
    ("lomp/d", "number", "simulated", "not testable", 5.0, "laptop"),
    ("lomp/e", "number", "simulated", "not testable", 6.0, "laptop"),
)
AT_PAPERS = table(
    ("lomp/a", "sentence", "simulated", "reproduced", 1.5, "paper"),
    ("lomp/b", "sentence", "simulated", "not testable", float("nan"), "paper"),
    ("lomp/a/recorded", "sentence", "recorded", "undecided", 4.5, "paper"),
    ("lomp/d", "number", "simulated", "not testable", 5.5, "paper"),
    ("lomp/e", "number", "simulated", "not testable", float("nan"), "paper"),
)


def test_the_papers_scale_comes_first_where_it_could_test_a_claim():
    rows = claims.by_scale(PRESENT, AT_PAPERS).set_index("id")
    assert list(rows["verdict"]) == ["reproduced", "reproduced", "contradicted", "undecided", *["not testable"] * 2]
    assert list(rows["ours"]) == [1.5, 2.0, 3.0, 4.5, 5.5, 6.0]
    assert list(rows["scale"]) == ["paper", "laptop", "both", "paper", "paper", "laptop"]


def test_all_verdicts_stand_beside_each_other():
    rows = claims.by_scale(PRESENT, AT_PAPERS).set_index("id")
    beside = rows[list(claims.BY_SCALE)]
    assert tuple(beside.loc["lomp/a"]) == ("undecided", "reproduced", "undecided")
    assert tuple(beside.loc["lomp/b"]) == ("reproduced", "not testable", "")
    assert tuple(beside.loc["lomp/c"]) == ("contradicted", "contradicted", "")
    assert tuple(beside.loc["lomp/a/recorded"]) == ("", "undecided", "undecided")
    assert "than here: 1 of 1 claims that were judged at both" in claims.changed_by_scale(rows.reset_index())


def test_without_a_run_at_the_papers_scale_the_present_one_stands():
    rows = claims.by_scale(PRESENT, AT_PAPERS.iloc[:0])
    assert list(rows["verdict"]) == list(PRESENT["verdict"])
    assert list(rows["paper_scale_verdict"]) == ["", "", "contradicted", "", "", ""]


def test_recorded_claims_are_counted_before_simulated_ones_and_apart():
    rows = claims.count_rows(PRESENT.assign(paper="lomp"), ["paper"])
    assert [row[:2] for row in rows] == [
        ["recorded", "LoMP (touch)"],
        ["recorded", "all"],
        ["simulated", "LoMP (touch)"],
        ["simulated", "all"],
        ["all", ""],
    ]
    assert [row[-1] for row in rows] == ["1", "1", "5", "5", "6"]


def test_on_own_logs_a_claim_is_of_recorded_data():
    values = params.load()
    claim, *_ = entries.read()[0]
    assert judge.on_own_logs(claim, values) == claim and claim.data == "simulated"
    own = judge.on_own_logs(claim, {"touch": {"source": "data/own/mine"}})
    assert (own.id, own.data, own.tried) == (f"{claim.id}/recorded", "recorded", "")


@pytest.mark.parametrize(
    ("changes", "scale"), [({}, "laptop"), ({"paper": "touch"}, "paper"), ({"touch.window.stride": 7}, "other")]
)
def test_the_scale_is_that_of_the_settings(changes, scale, tmp_path):
    copy = tmp_path / "params.yaml"
    copy.write_text(paths.PARAMS.read_text())
    set_values(params.parsed(paths.SCALES / "paper.yaml") if "paper" in changes else changes, copy)
    values = params.load(copy)
    assert params.scale_of("touch", values["touch"]) == scale
    assert params.scale_of("velostat_recorded", values["velostat_recorded"]) == "both"
