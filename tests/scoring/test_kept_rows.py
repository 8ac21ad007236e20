"""What figures draw is kept in a small table, and it is of the runs that the table of results has."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from builders import kept_scores, made_reports
from builders.project import ROOT

from pipeline.results import kept, shards
from tactile import experiments, tasks
from tactile.base.paths import Workspace
from tactile.datasets import schemas, series
from tactile.scoring import classification
from tactile.scoring.estimates import read_predictions, read_windows

HERE = Workspace(ROOT)


@pytest.fixture(scope="module", params=experiments.NAMES)
def made(request, tmp_path_factory):
    """Return workspace, experiment, settings and kept table of an experiment that is made up."""
    workspace, experiment = Workspace(tmp_path_factory.mktemp(request.param)), request.param
    workspace.experiment_folder(experiment).mkdir(parents=True)
    settings = made_reports.settings_of(experiment)
    made_reports.write(workspace, experiment, settings, failed="linear")
    return workspace, experiment, settings, kept.table(workspace, experiment, settings)


def scored(workspace, experiment, settings, protocol, seed, model) -> dict:
    """Return condition -> the main score of a run, by the functions that the stage evaluate calls."""
    table = read_windows(workspace, experiment)
    predicted = read_predictions(workspace, experiment, model, protocol, seed, table)
    test = schemas.names(table[schemas.split_column(protocol, seed)]) == "test"
    module, metric = experiments.module(experiment), experiments.facts(experiment).metric
    if module.KIND == "images":
        truth = np.eye(len(set(table["label"].to_pylist())))[table["label"].to_numpy()[test]]
        return {
            protocol.rsplit("_")[-1]: dict(row[::2] for row in classification.scores(truth, predicted[test]))[metric]
        }
    if module.KIND == "windows":
        names, y = schemas.names(table["condition"]), schemas.matrix(table["y"])
        parts = {name: test & (names == name) for name in np.unique(names[test])}
        parts |= dict.fromkeys(module.FACTS.pooled if len(parts) > 1 else (), test)
        return {
            name: tasks.of(experiment).score(module, y[at], predicted[at], settings)[0][2] for name, at in parts.items()
        }
    task, found = module.task(protocol, settings), {}
    for piece in series.read(workspace.dataset(experiment), task, protocol, seed):
        guess = predicted[piece.rows[piece.part == "test"]][:, list(task.outputs)]
        found[piece.condition] = tasks.of(experiment).score(piece, guess, task)[0][2]
    return found


def test_scores_of_what_is_kept_are_those_of_the_predictions(made):
    workspace, experiment, settings, table = made
    found = kept_scores.of(experiment, table)
    images = experiments.module(experiment).KIND == "images"
    protocols = settings["protocols"] if images else set(experiments.facts(experiment).drawn)
    runs = [(name, seed) for name in settings["protocols"] if name in protocols
            for seed in (settings["protocols"][name]["seeds"] if images else [kept.FIRST])]  # fmt: skip
    for run in runs:
        for model in settings["models"]:
            here = found[(found["protocol"] == run[0]) & (found["seed"] == run[1]) & (found["model"] == model)]
            known = scored(workspace, experiment, settings, *run, model)
            assert here.set_index("condition")["value"].to_dict() == pytest.approx(known, rel=1e-6, nan_ok=True), run
    assert len(found) >= len(runs) * len(settings["models"])


def test_a_table_is_written_the_same_twice_and_is_small(made, tmp_path):
    workspace, experiment, settings, table = made
    for name in "ab":
        kept.write(tmp_path / name, kept.table(workspace, experiment, settings))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()
    read = kept.read(tmp_path / "a", experiment)
    pd.testing.assert_frame_equal(read.to_pandas(), table.to_pandas())
    assert (tmp_path / "a").stat().st_size < kept.LARGEST


def test_people_s_own_logs_are_drawn_where_they_are(made):
    workspace, experiment, settings, table = made
    if "source" in settings:
        assert kept.table(workspace, experiment, settings | {"source": "data/own/mine"}).num_rows == 0
    assert table.num_rows and table.schema.equals(kept.none(experiment).schema)


def test_only_the_first_seed_and_drawn_protocols_have_more_than_counts(made):
    workspace, experiment, settings, table = made
    later = {name: block | {"seeds": block["seeds"][1:]} for name, block in settings["protocols"].items()}
    rows = kept.table(workspace, experiment, settings | {"protocols": later})
    images = experiments.module(experiment).KIND == "images"
    assert bool(rows.num_rows) == images and kept.READING not in set(schemas.names(rows["model"]))
    others = {name: block for name, block in settings["protocols"].items()
              if name not in experiments.facts(experiment).drawn}  # fmt: skip
    rows = kept.table(workspace, experiment, settings | {"protocols": others})
    assert bool(rows.num_rows) == (images and bool(others))


def test_shards_of_the_budget_that_is_shown_are_drawn_and_of_one_run_the_first(tmp_path):
    workspace, written = Workspace(tmp_path), {}
    for shard, protocol, model, number in (
        ("a-0-half", "task_1", "esn", 1), ("a-0-full", "task_1", "esn", 2), ("b-0-full", "task_1", "esn", 3),
        ("b-0-full", "task_1", "ridge", 4), ("a-0-half", "task_2", "esn", 5), ("c-0-full", "task_2", "esn", 6),
    ):  # fmt: skip
        row = {"protocol": protocol, "seed": 0, "model": model, "window": number}
        written.setdefault(shard, []).append(row)
    for shard, rows in written.items():
        path = shards.kept_file(workspace, shard)
        path.parent.mkdir(parents=True, exist_ok=True)
        kept.write(path, pa.Table.from_pylist(rows, kept.none("strain").schema))
        line = dict.fromkeys(shards.INDEX, "") | {"shard": shard, "experiment": "strain", "budget": shard[4:]}
        line |= {"kept_sha256": shards.kept_sha256(workspace, shard)}
        shards.upsert(shards.folder(workspace) / "index.csv", shards.INDEX, shard, [line])
    found = kept.of_evidence(workspace, "strain", {"task_1": "full", "task_2": "half"})
    assert sorted(found["window"]) == [2, 4, 5]
    assert kept.of_evidence(workspace, "glove", {"task_1": "full"}).empty


COMMITTED = sorted(path.stem for path in (ROOT / "evidence" / "kept").glob("*.parquet"))
KEPT = {row["shard"]: path for row, path in shards.checked(HERE, shards.kept_file)}


def test_every_kept_file_is_indexed_and_small():
    assert sorted(KEPT) == COMMITTED
    assert all(path.stat().st_size <= kept.LARGEST for path in KEPT.values())


@pytest.mark.parametrize("name", COMMITTED)
def test_what_a_shard_keeps_has_the_scores_of_its_rows(name):
    """So no picture disagrees with a table: both are of the same predictions."""
    rows = pd.read_csv(shards.result_file(HERE, name), keep_default_na=False, na_values=["", "nan"])
    experiment = rows["experiment"].iloc[0]
    found = kept_scores.of(experiment, kept.read(KEPT[name], experiment))
    both = found.merge(rows[rows["variant"].isna()], on=kept_scores.KEY, suffixes=("", "_of_row"))
    assert len(both) == len(found) > 0
    exact = experiments.module(experiment).KIND == "images"
    np.testing.assert_allclose(both["value"], both["value_of_row"], rtol=1e-12 if exact else 1e-6)
