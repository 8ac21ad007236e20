"""MLflow holds a run for every training that the evidence keeps and a table shows, of a variant, too."""

import copy

import mlflow
import pytest
from builders import made_evidence
from builders.made_evidence import keep, scores

from pipeline.results import shards, shown
from pipeline.tracking import mlflow_runs
from tactile.base.paths import Workspace

COMBINED = ("glove", "random_frames_combined", "combined")
SETS = {
    "frames": {
        **{"experiment": "glove", "data": "all", "protocols": ["random_frames_combined"], "seeds": 2, "minutes": 1},
        "set": {"glove.models.sp_resnet.training.epochs": 4},
    },
    "long": {"like": "frames", "variant": "epochs_50", "set": {"glove.models.sp_resnet.training.epochs": 50}},
}
WIDE = {"like": "frames", "variant": "wide", "models": ["sp_resnet"], "set": {"glove.models.sp_resnet.width": 2.0}}
SIZES = {
    "like": "frames",
    "variants": {"tiny": {"models": ["sp_resnet"], "set": {"glove.models.sp_resnet.width": 0.1}}},
}
VALUES = {"experiments": ["glove"], "glove": {}}


@pytest.fixture(scope="module")
def tracked(tmp_path_factory):
    """A workspace whose evidence has two networks, the variant that README shows, and two later sets, in its store."""
    workspace = Workspace(tmp_path_factory.mktemp("tracked"))
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        made_evidence.write_sets(workspace, SETS)
        for seed in (0, 1):
            for budget, lost in (("full", 0.0), ("half", 0.125)):
                rows = scores(*COMBINED, {"resnet18": 0.9 + 0.02 * seed - lost, "sp_resnet": 0.75 - lost}, seed, budget)
                keep(workspace, f"frames-{seed}-{budget}", rows, f"commit{seed}", f"machine {seed}, a card")
            rows = scores(*COMBINED, {"sp_resnet": 0.99}, seed, variant="epochs_50")
            keep(workspace, f"long-{seed}-full", rows, "commit2")
        mlflow_runs.track(workspace, VALUES)
        first = {run.info.run_id for run in runs_of(workspace)}
        made_evidence.write_sets(workspace, SETS | {"wide": WIDE, "sizes": SIZES})
        keep(workspace, "wide-0-full", scores(*COMBINED, {"sp_resnet": 0.8}, 0, variant="wide"))
        keep(workspace, "sizes-0-full", scores(*COMBINED, {"sp_resnet": 0.6}, 0, "", variant="tiny"))
        mlflow_runs.track(workspace, VALUES)
        yield workspace, first


def runs_of(workspace) -> list:
    client = mlflow.MlflowClient(tracking_uri=f"sqlite:///{workspace.mlflow_database}")
    return list(client.search_runs([client.get_experiment_by_name("glove").experiment_id]))


def by_training(runs: list) -> dict[tuple, object]:
    """Return (model, variant, budget) -> run."""
    found = {tuple(run.data.tags[name] for name in ("model", "variant", "budget")): run for run in runs}
    assert len(found) == len(runs)
    return found


def absent(workspace, runs: list) -> list[shown.Cell]:
    """Return the numbers of the paper's table that are no metric of the run of their training."""
    results, lost = shown.evidence(workspace), []
    for column in shown.paper_table(results, "glove"):
        for cell in column.cells.values():
            of = tuple(name or "none" for name in cell.training)
            own = [run for run in runs if tuple(run.data.tags[name] for name in shown.OF) == of]
            values = [run.data.metrics.get(f"main/{cell.condition}.{cell.metric}") for run in own]
            lost += [cell] if values != [pytest.approx(results.estimate(*cell).mean)] else []
    return lost


def test_every_number_of_the_papers_table_is_a_metric_and_its_loss_is_seen(tracked):
    workspace, _ = tracked
    runs = runs_of(workspace)
    assert not absent(workspace, runs)
    shown_there = [run for run in runs if run.data.tags["readme"] == "true"]
    assert sorted(run.data.tags["variant"] for run in shown_there) == ["epochs_50", "none"]
    for lost in shown_there:
        (cell,) = absent(workspace, [run for run in runs if run is not lost])
        assert cell.model == lost.data.tags["model"]
    changed = copy.deepcopy(runs)
    for run in changed:
        run.data.metrics["main/combined.macro_precision"] += 1e-4
    assert len(absent(workspace, changed)) == 2


def test_a_new_set_of_a_variant_is_a_run(tracked):
    workspace, first = tracked
    runs = by_training(runs_of(workspace))
    assert {key for key, run in runs.items() if run.info.run_id not in first} == {
        ("sp_resnet", "wide", "full"),
        ("sp_resnet", "tiny", "none"),
    }
    wide, tiny = runs["sp_resnet", "wide", "full"], runs["sp_resnet", "tiny", "none"]
    assert wide.info.run_name == "SP-ResNet, random_frames_combined, wide, full budget, 1 seed"
    assert (wide.data.params["width"], tiny.data.params["width"]) == ("2.0", "0.1")
    assert wide.data.params["variant"] == "wide" and wide.data.params["training.epochs"] == "4"
    assert tiny.data.tags["shards"] == "sizes-0-full" and "train_loss" not in tiny.data.metrics


def test_marks_say_what_people_are_shown(tracked):
    workspace, _ = tracked
    marks = {
        key: "".join(str(int(run.data.tags[name] == "true")) for name in ("current", "shown", "compared", "readme"))
        for key, run in by_training(runs_of(workspace)).items()
    }
    assert marks == {
        ("resnet18", "none", "full"): "1111",
        ("resnet18", "none", "half"): "1000",
        ("sp_resnet", "none", "full"): "1100",
        ("sp_resnet", "none", "half"): "1000",
        ("sp_resnet", "epochs_50", "full"): "1111",
        ("sp_resnet", "wide", "full"): "1100",
        ("sp_resnet", "tiny", "none"): "1100",
    }


def test_a_run_has_origin_curve_and_seconds_of_its_shards_alone(tracked):
    workspace, _ = tracked
    run = by_training(runs_of(workspace))["resnet18", "none", "full"]
    tags = {"shards": "frames-0-full; frames-1-full", "git_commit": "commit0; commit1"}
    tags |= {"machine": "machine 0, a card; machine 1, a card", "timed_on": "machine 0, a card"}
    assert run.data.tags.items() >= tags.items() and "git_changed" not in run.data.tags
    assert run.data.metrics["more/train_s"] == 10.0, "the mean with 11 s of another machine would be of none"
    assert run.info.end_time - run.info.start_time == 10_000
    client = mlflow.MlflowClient(tracking_uri=f"sqlite:///{workspace.mlflow_database}")
    for loss, first in (("train_loss", 1.5), ("validation_loss", 2.5)):  # means of seeds 0 and 1
        points = client.get_metric_history(run.info.run_id, loss)
        assert {point.step: point.value for point in points} == {1: first, 2: first / 2}
    assert run.data.metrics["errors/combined.macro_precision"] == pytest.approx(0.09)


def test_an_epoch_that_a_seed_lacks_has_no_mean(tracked, tmp_path):
    """Else the end of a curve would be of the seeds that went on alone."""
    workspace, _ = tracked
    kept = shown.curves(workspace, ["frames-0-full", "frames-1-full"])
    of = {"model": "resnet18", "protocol": "random_frames_combined"}
    whole = list(mlflow_runs._curve([kept], of))
    shorter = kept[~((kept["seed"] == 1) & (kept["epoch"] == 2))]
    assert {step for *_, step in whole} == {1, 2} and {step for *_, step in mlflow_runs._curve([shorter], of)} == {1}


def test_other_shards_of_the_same_scores_are_another_run(tracked):
    workspace, _ = tracked
    results = shown.evidence(workspace)
    before = {run.tags["content"] for run in mlflow_runs.evidence(workspace, results)["glove"]}
    index = shards.folder(workspace) / "index.csv"
    former = index.read_text()
    index.write_text(former.replace("commit2", "commit3"))
    after = {run.tags["content"] for run in mlflow_runs.evidence(workspace, results)["glove"]}
    index.write_text(former)
    assert len(before - after) == len(after - before) == 1
