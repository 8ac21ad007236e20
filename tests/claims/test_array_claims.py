"""Claims on recordings of persons: folds are one result, persons are drawn anew, what a control passes is open."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from builders import made_array
from builders.made_array import FOLDS
from builders.project import ROOT

from pipeline.claims import entries, judge
from pipeline.claims.rules import BEYOND, CONTRADICTED, REPRODUCED, UNDECIDED, interval
from pipeline.results import one_table, shards
from pipeline.stages import shard
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

CLAIMS, PAPERS = entries.read(Workspace(ROOT), [entries.FOLDER / "lomp.yaml"])
BY_ID = {claim.id: claim for claim in CLAIMS}
ARRAY = PAPERS["lomp"].sources["array"]


@pytest.fixture(scope="module")
def evidence() -> one_table.Results:
    return made_array.results()


EXPECTED = {  # of these made-up numbers
    "growth-linear-array": CONTRADICTED,  # 1.31, where the paper says that it about doubles
    "growth-poly-array": CONTRADICTED,
    "rbf-one": CONTRADICTED,  # 4.7 % against 4.8 of the CNN
    **dict.fromkeys(["best-two-whole", "best-three", "conventional-two-whole"], BEYOND),
}


@pytest.mark.parametrize("name", [name for name, claim in BY_ID.items() if claim.experiment == "array_recorded"])
def test_claims_on_the_array_are_judged_and_name_a_control_that_fails(evidence, name):
    claim = BY_ID[name]
    assert claim.data == "recorded" and name.endswith("/recorded") and claim.control
    found, budget = judge.judged(claim, evidence)
    assert found.verdict == EXPECTED.get(name.split("/")[1], REPRODUCED), found
    assert (found.trainings, budget) == (15, judge.ANY)
    assert " in place of " in found.control and np.isfinite(found.control_value)
    if np.isfinite(list(claim.printed.values())).all() and claim.rule == "above":
        assert found.power > 0.9, "these persons differ little"


def test_the_claims_are_on_the_folds_of_the_evidence():
    sets = {name: shards.read_sets(Workspace(ROOT))[name] for name in ("array_recorded", "array_recorded_two")}
    assert [tuple(each.protocols) for each in sets.values()] == [tuple(ARRAY.protocol), tuple(ARRAY.splits["two_too"])]
    assert all(each.by_unit == each.protocols for each in sets.values()) and list(ARRAY.protocol) == FOLDS


def test_folds_are_one_result_and_its_error_is_over_all_frames(evidence):
    """Exact where units of a person do not differ: draws are of persons, each with as many frames as it has."""
    draws = evidence.draws("array_recorded", FOLDS, "two", "lomp", "rmse", "", "full")
    person = np.arange(10)
    square, frames = (6.1 * (1 + 0.1 * (person / 4.5 - 1))) ** 2, person + 1
    whole = np.sqrt(square @ frames / frames.sum())
    assert interval(draws).mean == pytest.approx(whole, rel=1e-4) and interval(draws).runs == 1000
    assert draws[0:].mean() == pytest.approx(whole, rel=0.01)
    picked = np.random.default_rng(0).integers(10, size=(4000, 10))
    drawn = np.sqrt((square * frames)[picked].sum(axis=1) / frames[picked].sum(axis=1))
    assert draws.std() == pytest.approx(drawn.std(), rel=0.1)
    by_person = evidence.draws("array_recorded", FOLDS, "two", "lomp", "touches_found", "", "full")
    shares = 0.92 * (1 + 0.1 * (person / 4.5 - 1))
    assert interval(by_person).mean == pytest.approx(shares @ frames / frames.sum())
    assert interval(by_person).low < by_person.mean() < interval(by_person).mean, "few draws have as many of the best"


def test_models_and_conditions_are_paired_by_person(evidence):
    """All errors of a person are as much too high, so that ratios do not differ between draws."""
    ours, other, one = (
        evidence.draws("array_recorded", FOLDS, condition, model, "rmse", "", "full")
        for condition, model in (("two", "lomp"), ("two", "cnn"), ("one", "lomp"))
    )
    assert ours.std() > 0.1 and (other / ours).std() < 1e-9 and (ours / one).std() < 1e-9


def test_no_person_is_tested_by_two_splits_of_one_result(evidence):
    with pytest.raises(InputError, match="two of fold_0, two_too_0 test on unit_P0_0"):
        evidence.draws("array_recorded", ["fold_0", "two_too_0"], "two", "cnn", "rmse", "", "full")


def test_rows_by_unit_of_a_variant_are_not_those_of_the_tables(evidence):
    alone, tables = (evidence.draws("array_recorded", FOLDS, "two", "lomp", "rmse", name, "full") for name in
                     ("alpha_0", ""))  # fmt: skip
    assert (alone / tables).to_numpy() == pytest.approx(7.9 / 6.1)
    assert evidence.draws("array_recorded", FOLDS, "two", "lomp", "rmse", "alpha_1", "full").empty


def test_a_claim_waits_for_every_fold():
    found, _ = judge.judged(BY_ID["lomp/best-two/recorded"], made_array.results(drop="vgg"))
    assert (found.verdict, found.reason) == (UNDECIDED, "waits for rmse of VGG-16 (fold_3, two)")
    found, _ = judge.judged(BY_ID["lomp/best-two/recorded"], made_array.results(drop="constant"))
    wait = "its control waits for rmse of Constant (mean) (fold_3, two); "
    assert found.verdict == UNDECIDED and found.reason.startswith(wait)


def test_folds_without_rows_by_unit_are_no_result():
    rows = [row for row in made_array.results().table.to_dict("records") if not row["metric"].endswith("_of_unit")]
    found, _ = judge.judged(BY_ID["lomp/best-two/recorded"], one_table.Results(pd.DataFrame(rows)))
    assert found.verdict == UNDECIDED and "by unit, which makes 5 splits one result" in found.reason


@pytest.mark.parametrize(
    ("errors", "verdict", "words", "value"),
    [
        ({"rbf": (4.7, 5.5, 9.4)}, CONTRADICTED, "decided by LoMP against RBF-Net", 8 / 10.9),
        ({"constant": (8.5, 6.0, 12.6)}, UNDECIDED, "its control passes, too", 8 / 6),
        ({"constant": (8.5, 9.0, 12.6)}, REPRODUCED, "6 of 6 hold", 8 / 9),
    ],
)
def test_what_a_control_passes_is_undecided(errors, verdict, words, value):
    found, _ = judge.judged(BY_ID["lomp/best-two/recorded"], made_array.results(**errors))
    assert found.verdict == verdict and words in found.reason
    assert (found.control, found.control_value) == ("Constant (mean) in place of LoMP", pytest.approx(value, rel=0.02))


def test_a_control_takes_the_place_of_its_model_alone(evidence):
    """Not of a variant, which stands for what was changed; of a fit to other frames, it does."""
    claim = BY_ID["lomp/message-passing-array/recorded"]
    without, _ = judge.judged(replace(claim, values={"two contacts": claim.values["two contacts"]}), evidence)
    assert without.control_value == pytest.approx(7.9 / 8.1) and without.verdict == REPRODUCED
    claim = BY_ID["lomp/domain-shift-gap-array/recorded"]
    found, _ = judge.judged(claim, evidence)
    assert found.ours == pytest.approx(2.8 / 2.9, rel=1e-6)
    assert found.control_value == pytest.approx(0.2 / 1.3, rel=1e-6) and found.verdict == REPRODUCED


def test_the_row_of_a_claim_says_folds_persons_and_trainings(evidence):
    table = judge.table([BY_ID["lomp/best-two/recorded"]], evidence)
    row = table.iloc[0]
    assert (row["data"], row["protocol"], row["seeds"]) == ("recorded", "fold_0 to fold_4", 1000)
    assert row["over"] == "resamplings of persons, 15 trainings"
    low, high = interval(evidence.draws("array_recorded", FOLDS, "two", "linear", "rmse", "", "full"))[1:3]
    assert row["ours"] == pytest.approx(8.0 / 6.1) and 0.05 < (high - low) / low


@pytest.mark.parametrize(
    ("data", "words"), [("arrays", "'arrays'"), ("array\n    control: lomp", "'str' object has no attribute 'items'")]
)
def test_what_names_no_recordings_or_no_control_is_said(workspace, tmp_path, data, words):
    file = tmp_path / "mine.yaml"
    file.write_text(f"paper: lomp\nclaims:\n  - id: mine\n    text: A.\n    source: I\n    data: {data}\n"
                    "    above: two.lomp\n")  # fmt: skip
    with pytest.raises(InputError) as error:
        entries.read(workspace, [entries.FOLDER / "lomp.yaml", file])
    assert words in str(error.value) and "claim mine" in str(error.value)


def test_a_set_that_is_a_variant_keeps_its_rows_by_unit_as_its_own():
    """Beside those of the tables, which have the same names; a pair of objects, which is no unit, is left out."""
    rows = made_array.table()
    rows = rows[rows["model"].eq("lomp") & ~rows["variant"].str.startswith("alpha_0")]
    written = rows.assign(variant=rows["variant"].astype(object).where(rows["variant"] != ""))  # scores have none
    pair = written.head(1).assign(metric="confusion", variant="cup_and_can")
    varied = shard.in_variant(pd.concat([written.assign(value=2 * written["value"]), pair]), "twice")
    assert set(varied["metric"]) == set(rows["metric"]) and len(varied) == len(rows)
    tables = shard.in_variant(written, "")
    assert tables["variant"].tolist() == rows["variant"].tolist()
    results = one_table.Results(pd.concat([tables, varied]))
    twice, once = (
        results.draws("array_recorded", FOLDS, "two", "lomp", "touches_found", name, "") for name in ("twice", "")
    )
    assert (twice / once).to_numpy() == pytest.approx(2)
    values, _ = results.found("array_recorded", "fold_0", "two", "lomp", "rmse", "twice", "")
    assert values.tolist() == [12.2] * 3
