"""Every score in MLflow, and what a paper prints beside it, is that of the tables: of each condition and variant."""

import copy
import csv
import functools
from collections import defaultdict

import numpy as np
import pandas as pd
import pytest
import yaml
from builders.made_results import write_results
from builders.project import ROOT

from pipeline.results import claim_inputs, one_table, shards, shown
from pipeline.tracking import mlflow_runs
from tactile.base import params
from tactile.base.files import sha256, write_table
from tactile.base.paths import Workspace

COMPARED = ("rmse", "error", "macro_precision", "accuracy")  # scores that runs are compared by
LOG_SCALE = ("rmse", "error")  # their mean over seeds is geometric
NAMES = {  # as the papers print them
    **{"linear": "Linear Regression", "poly": "Polynomial Regression", "tree": "Decision Tree Regression"},
    **{"rbf": "RBF-Net", "cnn": "CNN", "vgg": "VGG-16", "convlstm": "ConvLSTM", "rnn": "RNN", "lomp": "LoMP"},
    **{"lstm_direct": "Direct training", "lstm_transfer": "Transfer learning"},
    **{"naive_bayes": "Naive Bayes", "glove tree": "Decision Tree", "resnet18": "ResNet-18", "mobilenet": "MobileNet"},
    **{"resnet3x3": "ResNet_3x3", "sp_resnet_nogcam": "SP-ResNet (no GCAM)", "sp_resnet": "SP-ResNet"},
}
PLACES = {"single": "single touch", "double": "double touch", "task_1": "task 1", "task_2": "task 2"}
PRINTED = {  # experiment -> metric here, and as a paper prints it, of which so many are one of ours
    "touch": ("rmse", "lomp", "RMSE", 1),
    "strain": ("error", "latent", "test error", 1),
    "glove": ("macro_precision", "sp_resnet", "precision", 100),
}


@functools.cache
def published() -> dict[tuple[str, str, str, str], float]:
    """Return (paper, model, condition, metric) -> value, as published.csv calls them."""
    with open(ROOT / "pipeline" / "results" / "published.csv", newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    return {(row["paper"], row["model"], row["condition"], row["metric"]): float(row["value"]) for row in rows}


def printed(experiment: str, model: str, condition: str, metric: str) -> float | None:
    """Return what published.csv says of a score, in our unit."""
    ours, paper, theirs, size = PRINTED.get(experiment, ("", "", "", 1))
    name = NAMES.get(f"{experiment} {model}", NAMES.get(model))
    wanted = (paper, name, PLACES.get(condition, condition), theirs)
    value = published().get(wanted) if ours == metric else None
    return None if value is None else value / size


def by_hand(folder) -> dict[tuple, dict[str, float]]:
    """Return (experiment, model, protocol, variant, budget) -> metric of MLflow -> value, from the evidence's files."""
    seeds = defaultdict(dict)
    for path in sorted((folder / "results").glob("*.csv")):
        whole = path.name.endswith("-half.csv") and path.with_name(path.name.replace("-half", "-full")).exists()
        with open(path, newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                if row["metric"] in COMPARED and (row["budget"] or not whole):  # else that of the full shard counts
                    of = (row[name] or "none" for name in ("protocol", "variant", "budget"))
                    run = row["experiment"], row["model"], *of
                    seeds[run, row["condition"], row["metric"]][row["seed"]] = float(row["value"])
    found = defaultdict(dict)
    for (run, condition, metric), values in seeds.items():
        each = np.array([*values.values()])
        each = each[np.isfinite(each)]  # of the seeds that did not fail
        mean = np.exp(np.mean(np.log(each))) if metric in LOG_SCALE else np.mean(each)
        found[run][f"main/{condition}.{metric}"] = float(mean)
        if (value := printed(run[0], run[1], condition, metric)) is not None:
            found[run][f"published/{condition}.{metric}"] = value
    return found


def tracked(runs: dict[str, list]) -> dict[tuple, dict[str, float]]:
    """Return what MLflow is given, as `by_hand`."""
    told = {}
    for experiment, each in runs.items():
        for run in each:
            key = experiment, *(run.tags[name] for name in ("model", "protocol", "variant", "budget"))
            assert key not in told and run.tags["experiment"] == experiment
            told[key] = {name: value for name, value, _ in run.points if name.startswith(("main/", "published/"))}
    return told


def assert_same(told: dict[tuple, dict], wanted: dict[tuple, dict]) -> None:
    assert told.keys() == wanted.keys()
    for run, metrics in wanted.items():
        assert told[run] == pytest.approx(metrics, rel=1e-9, nan_ok=True), run


def of_evidence(workspace) -> dict[str, list]:
    return mlflow_runs.evidence(workspace, shown.evidence(workspace))


def test_every_score_of_the_evidence_is_that_of_its_files_and_of_the_one_table():
    told, wanted = tracked(of_evidence(Workspace(ROOT))), by_hand(ROOT / "evidence")
    assert_same(told, wanted)
    assert sum("published/" in name for metrics in told.values() for name in metrics) > 40
    values = params.load(ROOT / "params.yaml")
    table = one_table.results(Workspace(ROOT), one_table.of_own_logs(values))
    for (experiment, model, protocol, *further), metrics in told.items():
        variant, at = ("" if name == "none" else name for name in further)
        for name, value in metrics.items():
            group, _, score = name.partition("/")
            condition, _, metric = score.rpartition(".")
            if group == "main":
                there = table.estimate(experiment, protocol, condition, model, metric, variant, budget=at)
                assert there.mean == pytest.approx(value, rel=1e-9, nan_ok=True), (experiment, model, name)


@pytest.fixture
def made(workspace):
    """A workspace whose evidence has three conditions, three seeds, and variants of models."""
    rows = [
        ("touch", protocol, condition, model, variant, budget, seed, "rmse", "kPa", level * (1 + seed) + 10 * k, 9)
        for k, condition in enumerate(("single", "double", "slide"))
        for seed in range(3)
        for model, variant, protocol, budget, level in (
            ("lomp", "", "press", "full", 2.0),
            ("lomp", "", "press", "half", 3.0),
            ("lomp", "", "random_window", "full", 4.0),
            ("lomp", "lomp_half", "press", "full", 50.0),
            ("linear", "", "press", "", 7.0),
            ("linear", "linear_1_frame", "press", "", 90.0),
        )
    ]
    names = "experiment protocol condition model variant budget seed metric unit value n".split()
    table = pd.DataFrame(rows, columns=names).reindex(columns=claim_inputs.COLUMNS).astype({"seed": "Int64"})
    folder = shards.folder(workspace)
    (folder / "results").mkdir(parents=True)
    write_table(folder / "results" / "made-0-full.csv", table, "nan")
    line = {"shard": "made-0-full", "sha256": sha256(folder / "results" / "made-0-full.csv")}
    shards.upsert(folder / "index.csv", shards.INDEX, "made-0-full", [line])
    (folder / "shards.yaml").write_text((ROOT / "evidence" / "shards.yaml").read_text())
    (folder / "times.csv").write_text((ROOT / "evidence" / "times.csv").read_text())
    return workspace


def test_conditions_and_variants_are_apart(made):
    told = tracked(of_evidence(made))
    assert_same(told, by_hand(shards.folder(made)))
    assert told["touch", "lomp", "press", "none", "full"] == pytest.approx(
        {
            **{"main/single.rmse": 48 ** (1 / 3), "main/double.rmse": (12 * 14 * 16) ** (1 / 3)},
            **{"main/slide.rmse": (22 * 24 * 26) ** (1 / 3)},
            **{"published/single.rmse": 2.17, "published/double.rmse": 7.49},
        }
    )
    half = (50 * 100 * 150) ** (1 / 3)
    assert told["touch", "lomp", "press", "lomp_half", "full"]["main/single.rmse"] == pytest.approx(half)
    assert len(told) == 6


def test_a_training_of_the_look_has_the_scores_of_its_own_seed_and_condition(tmp_path):
    settings = copy.deepcopy(params.load(ROOT / "params.yaml")["touch"])
    settings |= {"models": {"linear": {}, "cnn": {}}, "protocols": {"press": {"seeds": [0, 1]}}}
    settings |= {"latency": {"batches": [1, 256]}}
    values, workspace = {"experiments": ["touch"], "touch": settings | {"budget": 1.0}}, Workspace(tmp_path)
    write_results(tmp_path, values)
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(values))
    scores = pd.read_csv(workspace.scores("touch"))
    more = [scores, scores.assign(condition="double", value=scores["value"] * 3)]
    more.append(scores.assign(metric="r2", unit="1", value=0.5))
    pd.concat(more).sample(frac=1, random_state=0).to_csv(workspace.scores("touch"), index=False)
    for model in settings["models"]:
        of_model = [run for run in mlflow_runs.look(workspace, "touch", values) if run.tags["model"] == model]
        assert [run.tags["seed"] for run in of_model] == ["0", "1"]
        for run in of_model:
            single = scores[(scores["model"] == model) & (scores["seed"] == int(run.tags["seed"]))]["value"].item()
            points = {name: value for name, value, _ in run.points if name.startswith(("main/", "published/"))}
            one, two = (printed("touch", model, name, "rmse") for name in ("single", "double"))
            wanted = {"main/single.rmse": single, "main/double.rmse": 3 * single}
            assert points == pytest.approx(wanted | {"published/single.rmse": one, "published/double.rmse": two})
