"""What is shown: of the evidence, of one budget, of the variant that stands for a model, with its shards."""

import pandas as pd
import pytest
from builders import made_evidence
from builders.made_evidence import keep, scores

from pipeline.results import one_table, published, shards, shown
from tactile.base.paths import Workspace
from tactile.experiments import facts

SETS = {
    "glove_frames": {
        **{"experiment": "glove", "data": "all", "protocols": ["random_frames_combined"], "seeds": 3, "minutes": 1},
        "set": {"glove.models.sp_resnet.training.epochs": 4, "glove.models.resnet18.training.epochs": 5},
    },
    "glove_long": {
        **{"like": "glove_frames", "variant": "epochs_50", "models": ["sp_resnet"]},
        "set": {"glove.models.sp_resnet.training.epochs": 50, "glove.window.stride": 1},
    },
    "glove_sizes": {
        "like": "glove_frames",
        "variants": {
            "narrow": {"models": ["sp_resnet"], "set": {"glove.models.sp_resnet.width": 0.25}},
            "narrower": {"like": "narrow", "set": {"glove.models.sp_resnet.width": 0.1}},
            "other_base": {"models": ["sp_resnet"], "set": {"glove.models.resnet18.width": 2}},
        },
    },
}
COMBINED = ("glove", "random_frames_combined", "combined")


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Two networks at both budgets, three seeds, the paper's variant of one of them, and sizes without a budget."""
    workspace = Workspace(tmp_path_factory.mktemp("kept"))
    made_evidence.write_sets(workspace, SETS)
    for seed in range(3):
        for budget, lost in (("full", 0.0), ("half", 0.1)):
            rows = scores(*COMBINED, {"resnet18": 0.96 - lost, "sp_resnet": 0.93 - lost}, seed, budget)
            keep(workspace, f"glove_frames-{seed}-{budget}", rows, f"commit{seed // 2}", f"machine {seed % 2}")
        rows = scores(*COMBINED, {"sp_resnet": 0.99}, seed, variant="epochs_50")
        keep(workspace, f"glove_long-{seed}-full", rows, "commit9")
        rows = scores(*COMBINED, {"sp_resnet": 0.5}, seed, "", variant="narrow")
        keep(workspace, f"glove_sizes-{seed}-full", rows)
    return workspace


def test_the_variant_of_the_paper_stands_for_its_model(kept):
    results = shown.evidence(kept)
    *others, combined = shown.paper_table(results, "glove")
    assert [column.split for column in others] == ["", ""] and not any(column.cells for column in others)
    assert combined.split == "random_frames_{condition}" and combined.own == [], "verdicts are by session"
    assert {model: cell.variant for model, cell in combined.cells.items()} == {"resnet18": "", "sp_resnet": "epochs_50"}
    assert results.estimate(*combined.cells["sp_resnet"]).mean == pytest.approx(0.99)
    of = "glove", "random_frames_combined"
    assert shown.readme(results, "glove") == {(*of, "resnet18", "", "full"), (*of, "sp_resnet", "epochs_50", "full")}


def test_without_that_variant_its_cell_is_empty_and_no_other_one_stands_there(kept):
    rows = shown.evidence(kept).table
    results = one_table.Results(rows[rows["variant"] != "epochs_50"])
    *_, combined = shown.paper_table(results, "glove")
    assert list(combined.cells) == ["resnet18"]


def test_a_split_with_more_models_stands_in_for_the_papers(workspace):
    made_evidence.write_sets(workspace, {})
    rows = scores("touch", "random_window", "double", {"cnn": 9.0}, 0)
    rows += scores("touch", "press", "double", {"cnn": 12.0, "lomp": 8.0}, 0)
    keep(workspace, "any-0-full", rows)
    single, double = shown.paper_table(shown.evidence(workspace), "touch")
    assert (single.split, single.cells) == ("", {})
    assert double.split == "press" and list(double.cells) == ["cnn", "lomp"] and double.own == ["cnn"]


@pytest.mark.parametrize(("present", "other"), [("half", "full"), ("full", "half")])
def test_a_variants_budget_is_not_that_of_the_tables(workspace, present, other):
    """A variant at another budget neither hides the models nor is hidden by them."""
    rows = scores(*COMBINED, {"sp_resnet": 0.9}, 0, present)
    rows += scores(*COMBINED, {"sp_resnet": 0.8}, 0, other, "changed")
    rows += scores(*COMBINED, {"tree": 0.7}, 0, "", "solved")
    keep(workspace, "any-0-full", rows)
    results, place = shown.evidence(workspace), COMBINED[:2]
    wanted = {"": present, "changed": other, "solved": present}
    assert {variant: results.shown(*place, variant) for variant in wanted} == wanted
    for model, variant, value in (("sp_resnet", "", 0.9), ("sp_resnet", "changed", 0.8), ("tree", "solved", 0.7)):
        assert results.runs(*COMBINED, model, "macro_precision", variant).tolist() == [value]
    listed = [(name, at) for name in wanted for at in ("full", "half", "") if shown.is_shown(results, *place, name, at)]
    assert {(name, at) for name, at in listed if at} == {("", present), ("changed", other), ("solved", present)}
    assert ("solved", "") in listed


def test_seconds_of_solved_models_are_no_budget(workspace):
    """They were computed beside networks at the full budget, or alone, which tells nothing of the networks here."""
    keep(workspace, "nets-0-half", scores("touch", "press", "double", {"lomp": 9.0, "linear": 14.0}, 0, "half"))
    keep(workspace, "solved-0-full", scores("touch", "press", "double", {"linear": 14.0}, 0))
    seconds = [{"shard": "solved-0-full", "model": "linear", "protocol": "press", "seed": 0, "epochs": 1, "train_s": 3}]
    shards.upsert(shards.folder(workspace) / "times.csv", shards.TIMES, "solved-0-full", seconds)
    results = shown.evidence(workspace)
    assert "full" in set(results.table["budget"]) and results.shown("touch", "press") == "half"
    assert results.runs("touch", "press", "double", "lomp", "rmse").tolist() == [9.0]


def test_the_look_is_shown_where_there_is_no_evidence_alone(kept):
    results = shown.evidence(kept)
    assert shown.is_shown(results, "glove", "session_combined", "", "look")
    assert not shown.is_shown(results, "glove", "session_combined", "", "")
    assert not shown.is_shown(results, "glove", "random_frames_combined", "", "look")
    assert shown.is_shown(shown.evidence(kept, ["glove"]), "glove", "random_frames_combined", "", "look"), "own logs"


def test_a_number_names_its_shards_commits_and_machines(kept):
    results, index = shown.evidence(kept), shards.table(shards.folder(kept) / "index.csv", shards.INDEX)
    cell = shown.paper_table(results, "glove")[-1].cells["resnet18"]
    rows = results.rows(**cell._asdict())
    names = [f"glove_frames-{seed}-full" for seed in range(3)]
    assert shown.origin(index, rows["shard"]) == (names, ["commit0", "commit1"], ["machine 0", "machine 1"])
    curves = shown.curves(kept, [*names, "glove_sizes-0-full"])
    assert set(curves["shard"]) == set(names) and len(curves) == 3 * 2 * 2


@pytest.mark.parametrize(
    ("shard", "model", "variant", "wanted"),
    [
        ("glove_frames-0-full", "sp_resnet", "", {"training.epochs": {"4"}}),
        ("glove_frames-0-full", "resnet18", "", {"training.epochs": {"5"}}),
        ("glove_long-2-full", "sp_resnet", "epochs_50", {"training.epochs": {"50"}, "window.stride": {"1"}}),
        ("glove_sizes-1-full", "sp_resnet", "narrow", {"training.epochs": {"4"}, "width": {"0.25"}}),
        ("glove_sizes-1-full", "sp_resnet", "narrower", {"training.epochs": {"4"}, "width": {"0.1"}}),
        ("glove_sizes-1-full", "sp_resnet", "other_base", {"training.epochs": {"4"}, "models.resnet18.width": {"2"}}),
        ("gone-0-full", "sp_resnet", "", {}),
    ],
)
def test_what_a_set_changes_is_said_of_its_own_model(kept, shard, model, variant, wanted):
    assert shown.changed(shards.read_sets(kept), [shard], model, variant) == wanted


def test_two_sets_of_one_number_say_both_values(kept):
    names = ["glove_frames-0-full", "glove_long-0-full"]
    found = shown.changed(shards.read_sets(kept), names, "sp_resnet", "")
    assert found["training.epochs"] == {"4", "50"}


@pytest.mark.parametrize("experiment", ["touch", "strain", "glove"])
def test_the_facts_of_a_paper_name_what_it_prints(experiment):
    """Every condition has a number of every model, and a variant stands for a model of the table on its protocols."""
    paper = facts(experiment).paper
    for condition in paper.conditions:
        for model in published.PRINTED[paper.key]:
            assert pd.notna(published.number(paper.key, model, condition, paper.printed)), (condition, model)
    protocols = {split.format(condition=condition) for split in paper.splits for condition in paper.conditions}
    for protocol, model in paper.variants:
        assert protocol in protocols and model in published.PRINTED[paper.key]
