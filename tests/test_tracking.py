"""The store must mirror the files: one current run per protocol, model and seed, nothing twice, and nothing lost."""

import copy
import json
import os
import re
import shutil
import sqlite3
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd
import pytest
import yaml
from builders.made_results import EPOCHS, write_results
from builders.project import ROOT, Project
from mlflow.exceptions import INVALID_PARAMETER_VALUE, UNAUTHENTICATED, MlflowException

from pipeline import tracking
from pipeline.base import paths, store
from pipeline.base.errors import InputError, run_stage
from pipeline.stages import track

pytestmark = pytest.mark.slow


PARAMS = {
    "experiments": ["touch", "velostat_recorded"],
    "device": "auto",
    "touch": {
        "sensor": {"rows": 2, "cols": 3, "pitch_mm": 12.0},
        "ingest": {"highest_count": 1023, "max_touches": 2},
        "window": {"frames": 4, "frame_step": 2, "contact_threshold_n": 0.5},
        "label": {"map_rows": 20, "map_cols": 30, "tip_radius_mm": 5.0},
        "protocols": {"press": {"seeds": [0, 1]}, "random_window": {"seeds": [0]}},
        "models": {"linear": {}, "lomp": {"hidden": 8, "training": {"learning_rate": 1.0e-3}}},
        "latency": {"batches": [1, 256]},
    },
    "velostat_recorded": {"protocols": {"repetition": {"seeds": [0]}}, "models": {"linear": {}}},
}
RUNS = {
    ("touch", protocol, model, seed)
    for model in ("linear", "lomp")
    for protocol, seed in (("press", "0"), ("press", "1"), ("random_window", "0"))
}
LINEAR = ("touch", "press", "linear", "0")


def make_repository(root: Path, database: Path | None = None) -> None:
    """Results of PARAMS in `root`, and an empty store, if one is given to copy."""
    write_results(root, PARAMS)
    absent = root / "data" / "velostat_recorded"
    absent.mkdir()
    (absent / "ingest.json").write_text(json.dumps({"run": False, "reason": "recordings not downloaded"}))
    (root / "params.yaml").write_text(yaml.safe_dump(PARAMS))
    if database:
        (root / "mlruns").mkdir()
        shutil.copy(database, root / "mlruns" / "mlflow.db")


@pytest.fixture(scope="module")
def made_once(tmp_path_factory):
    """A repository with results and a store that already holds their runs (creating one takes seconds)."""
    root = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paths, "ROOT", root)
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        make_repository(root)
        (root / "mlruns").mkdir()
        client()
        shutil.copy(root / "mlruns" / "mlflow.db", root / "empty.db")
        track.track(PARAMS)
        yield root


@pytest.fixture
def repository(made_once, tmp_path, monkeypatch):
    """A fresh copy of the results beside an empty store."""
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    make_repository(tmp_path, made_once / "empty.db")
    return tmp_path


def client() -> tracking.MlflowClient:
    return tracking.MlflowClient(tracking_uri=os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{store.database()}")


def all_runs(tracking_uri: str | None = None) -> list:
    """Every run of the store, deleted ones as well."""
    source = tracking.MlflowClient(tracking_uri=tracking_uri) if tracking_uri else client()
    experiments = [experiment.experiment_id for experiment in source.search_experiments()]
    return list(source.search_runs(experiments, run_view_type=tracking.ViewType.ALL)) if experiments else []


def active_runs(only_current: bool = False) -> dict:
    """(experiment, protocol, model, seed) -> active runs with these tags; all, or those of the present results."""
    by_key: dict = {}
    for run in all_runs():
        tags = run.data.tags
        wanted = not only_current or tags.get(store.current_tag()) == "true"
        if run.info.lifecycle_stage == "active" and wanted:
            by_key.setdefault(tuple(tags.get(name) for name in store.COLUMNS[:4]), []).append(run)
    return by_key


def counted(runs: dict) -> dict:
    return {key: len(of_key) for key, of_key in runs.items()}


def logged(runs: list) -> dict:
    """Run id -> all that must never change: params, every point of every metric, and every file."""
    source = client()
    return {
        run.info.run_id: (
            run.data.params,
            {
                name: [(p.step, p.value) for p in source.get_metric_history(run.info.run_id, name)]
                for name in run.data.metrics
            },
            {file: file.read_bytes() for file in sorted(Path(run.info.artifact_uri).rglob("*")) if file.is_file()},
        )
        for run in runs
    }


def receipt() -> pd.DataFrame:
    return pd.DataFrame(json.loads(store.receipt().read_text())["runs"])


def change_score(root: Path, by: float = 0.25) -> None:
    """A different value in the first row of scores.csv: that of LINEAR."""
    change(paths.scores("touch"), "value", lambda value: value + by, rows=[0])


def change(file: Path, column: str, by, rows=slice(None)) -> None:
    """Apply `by` to a column of a table."""
    table = pd.read_csv(file)
    table.loc[rows, column] = by(table.loc[rows, column])
    table.to_csv(file, index=False)


def params_with(**models) -> dict:
    """PARAMS with other settings of its models."""
    params = copy.deepcopy(PARAMS)
    params["touch"]["models"] |= models
    return params


def test_one_run_per_model_and_seed_with_curves_and_metrics(made_once):
    runs = active_runs()
    assert counted(runs) == counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)
    run = runs["touch", "press", "lomp", "1"][0]
    assert run.info.run_name == "lomp press seed 1"
    assert run.info.status == "FINISHED"
    assert run.data.metrics["single.rmse"] == 9.5
    assert run.data.metrics["latency.p50_ms"] == 0.5
    assert run.data.metrics["train_s"] == 2.0
    assert run.data.params["training.learning_rate"] == "0.001"
    assert run.data.params["parameters"] == "17"
    assert run.data.tags["git_commit"].startswith("unknown")
    history = client().get_metric_history(run.info.run_id, "validation_loss")
    assert [(point.step, point.value) for point in history] == [(n, 10.0 / n) for n in range(1, EPOCHS + 1)]
    files = {file.path for file in client().list_artifacts(run.info.run_id, "model")}
    assert {"model/history.csv", "model/fit.json", "model/estimator.skops", "model/card.json"} < files


def test_a_run_says_what_made_it(made_once):
    (run,) = active_runs()["touch", "press", "lomp", "1"]
    assert (Path(run.info.artifact_uri) / "params.yaml").read_text() == (made_once / "params.yaml").read_text()
    assert run.data.params["touch.label.map_rows"] == "20" and run.data.params["device"] == "auto"
    assert run.data.params["hidden"] == "8"
    assert not [name for name in run.data.params if "models" in name or "velostat" in name or "latency" in name]


def test_many_and_long_settings_are_logged(repository):
    params = params_with()
    params["touch"]["simulate"] = {f"setting_{k}": k for k in range(250)} | {"places": list(range(3000))}
    track.track(params)
    (run,) = active_runs()[LINEAR]
    assert {run.data.params[f"touch.simulate.setting_{k}"] for k in range(250)} == {str(k) for k in range(250)}
    short = run.data.params["touch.simulate.places"]
    assert len(short) <= 6000 and short.startswith("[0, 1, 2,") and re.search(r"\.\.\. [0-9a-f]{8}$", short)


def test_second_call_adds_nothing(made_once, capsys, monkeypatch):
    before = store.database().read_bytes(), store.receipt().read_bytes()
    monkeypatch.delattr(track, "_track")  # all that would import MLflow
    track.track(PARAMS)
    assert (store.database().read_bytes(), store.receipt().read_bytes()) == before
    assert "6 runs, nothing changed since they were tracked" in capsys.readouterr().out


def test_a_store_that_others_wrote_to_is_looked_through_without_reading_results(repository, capsys, monkeypatch):
    track.track(PARAMS)
    own = client().create_run(client().get_experiment_by_name("touch").experiment_id, run_name="my own").info.run_id
    before = logged(all_runs())
    with monkeypatch.context() as patch:
        patch.delattr(tracking, "read_runs")
        track.track(PARAMS)
    assert logged(all_runs()) == before and own in before
    assert "6 runs, all found in the store" in capsys.readouterr().out


def test_a_damaged_receipt_is_written_anew(repository, capsys):
    track.track(PARAMS)
    for content in ("", "[]", "{}", '{"runs": [1]}', '{"runs": [{}], "origin": 1}', "[" * 100_000):
        store.receipt().write_text(content)
        track.track(PARAMS)
        assert "0 runs logged, 6 found again" in capsys.readouterr().out
        assert len(receipt()) == 6


def test_the_code_that_decides_how_files_become_runs_is_there():
    assert {"tracking.py", "stages/track.py"} <= set(store.CODE)
    assert [name for name in store.CODE if not (paths.CODE / name).is_file()] == []


def test_an_experiment_that_was_not_run_is_one_line(repository, capsys):
    track.track(PARAMS)
    lines = [line for line in capsys.readouterr().out.splitlines() if "velostat_recorded" in line]
    assert len(lines) == 1 and "recordings not downloaded" in lines[0]


def test_a_lost_database_is_filled_again_with_the_same_contents(made_once, repository):
    track.track(PARAMS)
    first = pd.DataFrame(json.loads((made_once / "mlruns" / "tracked.json").read_text())["runs"])
    shared = ["experiment", "protocol", "model", "seed", "content"]
    assert receipt()[shared].equals(first[shared])
    assert set(receipt()["run_id"]).isdisjoint(first["run_id"])
    assert receipt()["content"].nunique() == len(RUNS)
    store.database().unlink()
    track.track(PARAMS)
    assert counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)


def test_another_result_is_another_run_and_the_first_stays_as_it_was(repository):
    track.track(PARAMS)
    first, before = receipt(), logged(all_runs())
    change_score(repository)
    track.track(PARAMS)
    assert logged(all_runs()).items() >= before.items()
    (new,) = active_runs(only_current=True)[LINEAR]
    (old,) = (run for run in active_runs()[LINEAR] if run.info.run_id != new.info.run_id)
    assert old.info.run_id in set(first["run_id"]) and old.data.tags[store.current_tag()] == "false"
    assert (new.data.metrics["single.rmse"], old.data.metrics["single.rmse"]) == (8.75, 8.5)
    assert counted(active_runs()) == {key: 1 + (key == LINEAR) for key in RUNS}
    assert counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)


def test_old_settings_find_their_runs_again(repository):
    track.track(PARAMS)
    first = receipt()
    other = params_with(lomp={"hidden": 16, "training": {"learning_rate": 1.0e-3}})
    write_results(repository, other)
    track.track(other)
    both = logged(all_runs())
    assert len(both) == 9  # three of lomp are new
    is_lomp = first["model"] == "lomp"
    assert ((first["run_id"] != receipt()["run_id"]) == is_lomp).all()
    write_results(repository, PARAMS)
    track.track(PARAMS)
    assert receipt().equals(first) and logged(all_runs()) == both
    assert {run.info.run_id for found in active_runs(only_current=True).values() for run in found} == set(
        first["run_id"]
    )


def test_a_deleted_run_is_restored(repository, capsys):
    track.track(PARAMS)
    first, before = receipt(), logged(all_runs())
    client().delete_run(first["run_id"][0])
    track.track(PARAMS)
    assert receipt().equals(first) and logged(all_runs()) == before
    assert counted(active_runs()) == dict.fromkeys(RUNS, 1)
    assert "0 runs logged, 6 found again (of them 1 restored" in capsys.readouterr().out


def test_runs_that_former_versions_deleted_are_restored(repository):
    """They have no tag of a checkout."""
    track.track(PARAMS)
    first = receipt()
    for run in all_runs():
        client().delete_tag(run.info.run_id, store.current_tag())
        client().delete_tag(run.info.run_id, "checkout")
        client().delete_run(run.info.run_id)
    track.track(PARAMS)
    assert receipt().equals(first)
    assert counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)


def test_a_deleted_experiment_comes_back(repository):
    track.track(PARAMS)
    first = receipt()
    client().delete_experiment(client().get_experiment_by_name("touch").experiment_id)
    track.track(PARAMS)
    assert receipt().equals(first)
    assert counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)


def test_retrained_model_file_changes_the_content_of_its_run_only(repository):
    before = tracking.read_runs("touch", PARAMS)
    (paths.run_folder("touch", "lomp", "press", 1) / "estimator.skops").write_bytes(b"other weights")
    after = tracking.read_runs("touch", PARAMS)
    changed = [new.key for old, new in zip(before, after, strict=True) if old.content != new.content]
    assert changed == [("touch", "press", "lomp", "1")]


def test_a_run_whose_files_were_deleted_gets_them_again(repository):
    track.track(PARAMS)
    before = logged(all_runs())
    (lossy,) = active_runs()["touch", "press", "lomp", "0"]
    shutil.rmtree(lossy.info.artifact_uri)
    track.track(PARAMS)
    assert logged(all_runs()) == before


def test_times_measured_anew_are_a_further_point_of_the_same_run(repository, capsys):
    track.track(PARAMS)
    first = receipt()
    for factor in (2, 2):
        change(paths.latency("touch"), "p50_ms", lambda value, factor=factor: value * factor)
        track.track(PARAMS)
    assert "(of them 0 restored, 6 with new times)" in capsys.readouterr().out
    assert receipt().equals(first)
    (run,) = active_runs()[LINEAR]
    assert run.data.metrics["latency.p50_ms"] == pd.read_csv(paths.latency("touch"))["p50_ms"][0] == 2.0
    points = client().get_metric_history(run.info.run_id, "latency.p50_ms")
    assert [(point.step, point.value) for point in points] == [(0, 0.5), (1, 1.0), (2, 2.0)]
    assert [point.value for point in client().get_metric_history(run.info.run_id, "train_s")] == [2.0]


@pytest.mark.parametrize(
    ("change", "different"),
    [
        (lambda touch: touch["label"].update(map_rows=10), {"linear", "lomp"}),
        (lambda touch: touch["models"]["lomp"].update(hidden=9), {"lomp"}),
        (lambda touch: touch["latency"].update(batches=[1]), set()),
    ],
)
def test_params_hash_covers_what_decides_the_run(repository, change, different):
    before = tracking.read_runs("touch", PARAMS)
    params = params_with()
    change(params["touch"])
    write_results(repository, params)
    after = tracking.read_runs("touch", params)
    assert {
        old.model for old, new in zip(before, after, strict=True) if old.params_hash != new.params_hash
    } == different


def test_unlisted_models_and_experiments_are_no_longer_current(repository):
    track.track(PARAMS)
    before = logged(all_runs())
    own = client().create_run(client().get_experiment_by_name("touch").experiment_id, run_name="my own").info.run_id
    fewer = params_with()
    del fewer["touch"]["models"]["linear"]
    track.track(fewer)
    assert counted(active_runs(only_current=True)) == {key: 1 for key in RUNS if key[2] == "lomp"}
    track.track({**PARAMS, "experiments": ["velostat_recorded"]})
    assert not active_runs(only_current=True) and receipt().empty
    assert [run.info.run_id for run in active_runs().pop((None, None, None, None))] == [own]
    assert {run: content for run, content in logged(all_runs()).items() if run != own} == before


def test_an_interrupted_run_is_marked_and_logged_anew(repository):
    track.track(PARAMS)
    (unfinished,) = active_runs()[LINEAR]
    client().update_run(unfinished.info.run_id, status="RUNNING")  # as a call leaves it that is killed half-way
    track.track(PARAMS)
    assert client().get_run(unfinished.info.run_id).info.status == "KILLED"
    (new,) = active_runs(only_current=True)[LINEAR]
    assert new.info.run_id != unfinished.info.run_id and new.info.status == "FINISHED"


@pytest.fixture
def two_checkouts(made_once, tmp_path, monkeypatch):
    """A function that makes one of two checkouts, which use one store, the present one."""
    shutil.copy(made_once / "empty.db", tmp_path / "shared.db")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tmp_path / 'shared.db'}")
    for name in ("first", "second"):
        make_repository(tmp_path / name)
    return lambda name: monkeypatch.setattr(paths, "ROOT", tmp_path / name)


def test_checkouts_share_a_store_and_leave_each_others_runs_alone(two_checkouts):
    two_checkouts("first")
    track.track(PARAMS)
    before, tags, of_first = logged(all_runs()), {store.current_tag()}, receipt()

    two_checkouts("second")
    other = params_with(lomp={"hidden": 16, "training": {"learning_rate": 1.0e-3}})
    write_results(paths.ROOT, other)
    change(paths.latency("touch"), "p50_ms", lambda value: value * 3)
    track.track(other)
    after = logged(all_runs())
    assert after.items() >= before.items() and len(after) == 9
    assert counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)
    shared = set(of_first["run_id"]) & set(receipt()["run_id"])
    assert len(shared) == 3  # linear's: the same content
    track.track({**other, "experiments": ["velostat_recorded"]})  # a clone without these results
    assert not active_runs(only_current=True)

    two_checkouts("first")
    tags.add(store.current_tag())
    assert len(tags) == 1
    assert {run.info.run_id for found in active_runs(only_current=True).values() for run in found} == set(
        of_first["run_id"]
    )
    track.track(PARAMS)
    assert logged(all_runs()) == after and receipt().equals(of_first)


def test_another_store_gets_all_runs_though_nothing_changed(repository, made_once, monkeypatch, tmp_path):
    track.track(PARAMS)
    shutil.copy(made_once / "empty.db", tmp_path / "other.db")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tmp_path / 'other.db'}")
    track.track(PARAMS)
    assert counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)
    shutil.copy(made_once / "empty.db", tmp_path / "other.db")  # the server lost all
    track.track(PARAMS)
    assert counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)


def test_one_process_at_a_time_writes(repository, capsys):
    with ThreadPoolExecutor() as pool:
        with store.one_at_a_time():
            waiting = pool.submit(track.track, PARAMS)
            with pytest.raises(TimeoutError):
                waiting.result(timeout=1)
            assert not active_runs()
        waiting.result(timeout=60)
    assert "waiting for another `python -m pipeline.stages.track` to end" in capsys.readouterr().out
    assert counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)


def test_a_damaged_id_of_the_checkout_is_drawn_anew(repository):
    first = store.checkout()
    assert re.fullmatch("[0-9a-f]{8}", first) and store.checkout() == first
    (repository / "mlruns" / "checkout").write_bytes(b"' or\xff")
    assert re.fullmatch("[0-9a-f]{8}", store.checkout()) and store.checkout() != first


def test_only_a_copy_below_dvcs_folder_is_taken_for_one(repository, monkeypatch, tmp_path_factory):
    """DVC_ROOT is also set where a stage of another project starts this one."""
    other = tmp_path_factory.mktemp("other")
    monkeypatch.setenv("DVC_ROOT", str(other))
    assert store.workspace() == repository and not store.in_temporary_copy()
    copied = other / ".dvc" / "tmp" / "exps" / "standalone" / "tmpx"
    copied.mkdir(parents=True)
    monkeypatch.setattr(paths, "ROOT", copied)
    assert store.workspace() == other and store.in_temporary_copy()


HOSTILE = ["double (two fingers)", "90°", "a,b", "a;b", "a_b", "größer", "..up", "中文", "007", "NA", "x" * 300, " "]


def test_conditions_of_any_name_are_logged_apart(repository):
    table = pd.read_csv(paths.scores("touch"))
    linear = (table["model"] == "linear") & (table["protocol"] == "press") & (table["seed"] == 0)
    rows = [table[linear].assign(condition=name, value=float(k)) for k, name in enumerate(HOSTILE)]
    pd.concat([table, *rows]).to_csv(paths.scores("touch"), index=False)
    track.track(PARAMS)
    (run,) = active_runs()[LINEAR]
    given = {name.removesuffix(".rmse"): value for name, value in run.data.metrics.items() if name.endswith(".rmse")}
    true_names = {name: run.data.tags.get(f"condition.{name}", name) for name in given}
    assert {true_names[name]: value for name, value in given.items()} == {
        "single": 8.5,
        **{name: float(k) for k, name in enumerate(HOSTILE)},
    }
    assert all(re.fullmatch(r"\w[\w.\- ]*", name) for name in given)
    assert {"a_b", "größer", "中文", "007", "NA"} <= set(given)  # MLflow takes these as they are


def test_a_name_that_looks_like_a_changed_one_is_changed_too():
    changed = tracking._allowed("a,b")
    assert changed != "a,b" and tracking._allowed(changed) != changed
    assert len({tracking._allowed(name) for name in (*HOSTILE, changed)}) == len(HOSTILE) + 1


@pytest.mark.parametrize(
    ("file", "named"),
    [
        ("data/touch/ingest.json", "data/touch/ingest.json"),
        ("data/touch/scores.csv", "data/touch/scores.csv"),
        ("data/touch/speed/latency.csv", "data/touch/speed/latency.csv"),
        ("data/touch/latency/lomp.train.csv", "data/touch/latency/lomp.train.csv"),
        ("data/touch/models/lomp/press-1/history.csv", "data/touch/models/lomp/press-1/history.csv"),
        ("data/touch/models/lomp/press-1/fit.json", "data/touch/models/lomp/press-1/fit.json"),
        ("data/touch/models/lomp/press-1/estimator.skops", "data/touch/models/lomp/press-1: holds no model file"),
    ],
)
def test_missing_file_is_named_and_nothing_is_logged(repository, file, named):
    (repository / file).unlink()
    with pytest.raises(InputError, match=named):
        track.track(PARAMS)
    assert not active_runs()
    assert not store.receipt().exists()


def test_missing_rows_and_keys_are_named(repository):
    scores = paths.scores("touch")
    table = pd.read_csv(scores)
    table[table["seed"] == 0].to_csv(scores, index=False)
    with pytest.raises(InputError, match=r"scores.csv: no row for protocol press, model linear, seed 1"):
        tracking.read_runs("touch", PARAMS)
    table.to_csv(scores, index=False)
    fit = paths.run_folder("touch", "linear", "press", 0) / "fit.json"
    fit.write_text(json.dumps({"stop_reason": "closed_form"}))
    with pytest.raises(InputError, match=r"press-0/fit.json: key 'best_epoch' is missing"):
        tracking.read_runs("touch", PARAMS)


def test_results_of_other_settings_are_refused(repository):
    with pytest.raises(InputError, match="fit.json: was made with other settings than touch.models.lomp"):
        track.track(params_with(lomp={"hidden": 16, "training": {"learning_rate": 1.0e-3}}))
    made_with = {"device": "auto", "touch": {**PARAMS["touch"], "label": dict(PARAMS["touch"]["label"])}}
    stage = {"outs": [{"path": "data/touch/scores.csv"}], "params": {"params.yaml": made_with}}
    (repository / "dvc.lock").write_text(yaml.safe_dump({"stages": {"evaluate@touch": stage}}))
    track.track(PARAMS)
    changed = params_with()
    changed["touch"]["label"]["map_rows"] = 10
    with pytest.raises(InputError, match=r"^params.yaml, touch.label.map_rows: data/touch/scores.csv was made with"):
        track.track(changed)
    with pytest.raises(InputError, match=r"^params.yaml, device: data/touch/scores.csv was made with another value"):
        track.track({**PARAMS, "device": "cpu"})
    (repository / "dvc.lock").write_text("stages: {evaluate@touch: {outs: [{pa")
    with pytest.raises(InputError, match="^dvc.lock: was cut short or damaged"):
        track.track({**PARAMS, "device": "cpu"})


def test_moved_repository_is_one_sentence(made_once, tmp_path, monkeypatch):
    shutil.copytree(made_once, tmp_path / "moved")
    monkeypatch.setattr(paths, "ROOT", tmp_path / "moved")
    with pytest.raises(InputError, match="moved or copied.*delete the folder mlruns"):
        track.track(PARAMS)


def test_unusable_store_is_one_sentence(repository, monkeypatch):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:9")  # the discard port: nobody listens
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
    with pytest.raises(InputError, match="^http://127.0.0.1:9: the MLflow store cannot be used") as caught:
        track.track(PARAMS)
    assert "\n" not in str(caught.value)
    assert "start the server" in str(caught.value) and "python -m pipeline.stages.track" in str(caught.value)


@pytest.mark.parametrize(
    "uri",
    [
        "http://reviewer:s3cret@127.0.0.1:9",
        "http://reviewer:s3cret%2F1@127.0.0.1:9",
        "http://reviewer:s3cret/1@127.0.0.1:9",
        "http://reviewer:s3cret?1@127.0.0.1:9",
        "http://s3cret@127.0.0.1:9/path",
        "http://reviewer:s3cret@127.0.0.1:port",
        "http://127.0.0.1:9/?password=s3cret",
        "postgresql://reviewer:s3cret@127.0.0.1:9/runs",
        "sqlit://reviewer:s3cret@host/runs",
    ],
)
def test_a_password_is_never_shown(repository, uri, monkeypatch, capfd, caplog):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "1")
    with pytest.raises(SystemExit) as ended:
        run_stage(lambda: track.track(PARAMS))
    message = str(ended.value)
    assert message.startswith("error: ") and "MLFLOW_TRACKING_URI" in message and "\n" not in message
    assert "s3cret" not in message + "".join(capfd.readouterr()) + caplog.text
    assert not [
        path for path in (repository / "mlruns").rglob("*") if path.is_file() and b"s3cret" in path.read_bytes()
    ]


def test_file_that_is_no_database_is_one_sentence(repository):
    store.database().write_text("not a database" * 100)
    with pytest.raises(InputError, match="^mlruns/mlflow.db: the MLflow store cannot be used") as caught:
        track.track(PARAMS)
    assert "\n" not in str(caught.value) and "move the damaged file away" in str(caught.value)


@pytest.mark.parametrize(
    ("error", "uri", "advice"),
    [
        (MlflowException("(sqlite3.OperationalError) database is locked\n[SQL: INSERT]"), None, "close what else uses"),
        (MlflowException("Detected out-of-date database schema (found)"), None, "`mlflow db upgrade`"),
        (MlflowException("(sqlite3.OperationalError) attempt to write a readonly database"), None, "unlock the disk"),
        (OSError(28, "No space left on device", "mlruns/artifacts"), None, "free or unlock the disk"),
        (MlflowException("Invalid value", error_code=INVALID_PARAMETER_VALUE), None, "change the name or value"),
        (MlflowException("", error_code=UNAUTHENTICATED), "http://host", "set MLFLOW_TRACKING_USERNAME and"),
        (MlflowException("no answer"), "http://host", "start the server or fix MLFLOW_TRACKING_URI"),
    ],
)
def test_the_advice_is_for_the_cause(repository, monkeypatch, error, uri, advice):
    if uri:
        monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
        monkeypatch.setattr(tracking.MlflowClient, "search_experiments", lambda self, **_: None)
    with pytest.raises(InputError, match=advice) as caught, tracking.opened():
        raise error
    assert "\n" not in str(caught.value) and "()" not in str(caught.value)


def test_a_store_that_fails_half_way_loses_nothing(repository, monkeypatch):
    calls = []

    def log_artifacts(self, *arguments, original=tracking.MlflowClient.log_artifacts):
        calls.append(arguments)
        if len(calls) == 3:
            raise MlflowException("(sqlite3.OperationalError) database is locked\n[SQL: INSERT]")
        return original(self, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(tracking.MlflowClient, "log_artifacts", log_artifacts)
        with pytest.raises(
            InputError, match="database is locked.*run `python -m pipeline.stages.track` again"
        ) as caught:
            track.track(PARAMS)
    assert "\n" not in str(caught.value)
    assert not store.receipt().exists()
    track.track(PARAMS)
    finished = [run for found in active_runs().values() for run in found if run.info.status == "FINISHED"]
    assert len(finished) == len(RUNS) and len(all_runs()) == len(RUNS) + 1
    assert counted(active_runs(only_current=True)) == dict.fromkeys(RUNS, 1)


class Tiny:
    """A repository in which DVC runs a stage of made-up results and `track`."""

    LINEAR_AND_TREE = {"linear": {}, "tree": {"min_samples_leaf": 5, "max_features": 1.0}}

    def __init__(self, folder: Path):
        self.project = Project(folder)
        self.folder, self.environment = self.project.folder, self.project.environment
        self.project.set({"experiments": ["touch"], "touch.models": self.LINEAR_AND_TREE})
        for name in (".gitignore", "tests/builders/made_results.py"):
            shutil.copy(ROOT / name, self.folder)
        entry = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"]["track"]
        entry["deps"] = [dep for dep in entry["deps"] if not dep.startswith("data/") or dep.startswith("data/touch/")]
        made = ["scores.csv", "ingest.json", "speed/latency.csv"]
        made += [path for model in self.LINEAR_AND_TREE for path in (f"models/{model}", f"latency/{model}.train.csv")]
        made += ["frames.parquet"]
        results = {
            "cmd": "python made_results.py",
            "deps": ["made_results.py"],
            "params": ["device", "touch"],
            "outs": [f"data/touch/{path}" for path in made],
        }
        (self.folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": {"results": results, "track": entry}}))
        for name in [name for name in self.environment if name.startswith("GIT_")]:
            del self.environment[name]
        shutil.rmtree(self.folder / ".dvc")  # that of a project without git
        self.git("init", "-q")
        self.git("config", "user.name", "test")
        self.git("config", "user.email", "test@example.org")
        self.project.dvc("init", "--quiet")
        self.repro()

    def git(self, *arguments: str) -> str:
        command = ["git", *arguments]
        return subprocess.run(
            command, cwd=self.folder, env=self.environment, check=True, capture_output=True, text=True
        ).stdout

    def repro(self, **environment: str) -> subprocess.CompletedProcess:
        """`dvc repro`, then a commit of what it wrote."""
        before = dict(self.environment)
        self.environment.update(environment)
        done = self.project.dvc("repro")
        self.environment.clear()
        self.environment.update(before)
        self.git("add", "-A")
        self.git("commit", "-q", "--allow-empty", "-m", "results")
        return done

    def tree(self, leaf: int) -> None:
        self.project.set({"touch.models.tree.min_samples_leaf": leaf})

    def runs(self, filter_string: str = "", database: str = "mlruns/mlflow.db") -> dict[str, str]:
        """Run id -> smallest leaf of the tree, of the tree's runs on the split by press with seed 0."""
        source = tracking.MlflowClient(tracking_uri=f"sqlite:///{self.folder / database}")
        wanted = " and ".join(
            ["tags.model = 'tree' and tags.protocol = 'press' and tags.seed = '0'", *filter(None, [filter_string])]
        )
        found = source.search_runs([source.get_experiment_by_name("touch").experiment_id], wanted)
        return {run.info.run_id: run.data.params["min_samples_leaf"] for run in found}

    def marked(self, database: Path) -> int:
        """The number of current runs; read without MLflow, which goes on with a database that was deleted."""
        with sqlite3.connect(database) as source:
            rows = source.execute("select count(*) from tags where key = ? and value = 'true'", [self.current_tag()])
            return rows.fetchone()[0]

    def current_tag(self) -> str:
        return f"current.{(self.folder / 'mlruns' / 'checkout').read_text().strip()}"


@pytest.fixture(scope="module")
def tiny(tmp_path_factory):
    return Tiny(tmp_path_factory.mktemp("tiny"))


def test_repro_with_other_settings_leaves_both_sets_of_runs_and_git_clean(tiny):
    tiny.tree(5)
    tiny.repro()
    first = tiny.runs("params.min_samples_leaf = '5'")
    assert len(first) == 1
    tiny.tree(9)
    done = tiny.repro()
    assert "3 runs logged, 3 found again" in done.stdout, done.stdout
    assert set(tiny.runs().values()) >= {"5", "9"} and tiny.runs().items() >= first.items()
    current = f"tags.`{tiny.current_tag()}`"
    assert set(tiny.runs(f"{current} = 'true'").values()) == {"9"}
    assert first.items() <= tiny.runs(f"{current} = 'false'").items()
    tiny.tree(5)
    tiny.repro()  # the results come back from DVC's run-cache
    assert tiny.runs(f"{current} = 'true'") == first
    lock = (tiny.folder / "dvc.lock").read_bytes()
    tiny.project.dvc("repro")
    assert (tiny.folder / "dvc.lock").read_bytes() == lock and b"mlruns" not in lock
    assert tiny.git("status", "--porcelain") == ""


def test_repro_with_nothing_to_do_imports_no_mlflow(tiny):
    tiny.repro()
    done = tiny.repro(PYTHONPROFILEIMPORTTIME="1")
    assert "nothing changed since they were tracked" in done.stdout
    assert "pipeline.base.store" in done.stderr and not re.search(r"\| +(mlflow|pandas)\b", done.stderr)


def test_runs_of_queued_experiments_survive_in_the_checkouts_store(tiny):
    tiny.tree(5)
    tiny.repro()
    before = tiny.runs()
    names = {}
    for leaf in ("11", "13"):
        tiny.project.dvc(
            "exp", "run", "--queue", "-n", f"leaf-{leaf}", "-S", f"touch.models.tree.min_samples_leaf={leaf}"
        )
    tiny.project.dvc("exp", "run", "--run-all", "-j", "2")
    for leaf in ("11", "13"):
        names[leaf] = tiny.runs(f"tags.dvc_experiment = 'leaf-{leaf}'")
        assert list(names[leaf].values()) == [leaf]
    assert tiny.runs().items() > before.items()
    assert set(tiny.runs(f"tags.`{tiny.current_tag()}` = 'true'").values()) == {"5"}
    tiny.project.dvc("exp", "apply", "leaf-11")
    tiny.repro()
    assert tiny.runs(f"tags.`{tiny.current_tag()}` = 'true'") == names["11"]


def test_an_up_to_date_repro_fills_a_lost_store_and_another_one(tiny):
    tiny.repro()
    shutil.rmtree(tiny.folder / "mlruns")
    done = tiny.repro()
    assert "Stage 'results' didn't change" in done.stdout
    expected = tiny.marked(tiny.folder / "mlruns" / "mlflow.db")
    assert expected > 0
    other = tiny.folder.parent / "other.db"
    done = tiny.repro(MLFLOW_TRACKING_URI=f"sqlite:///{other}")
    assert "Stage 'results' didn't change" in done.stdout
    assert tiny.marked(other) == expected


def test_git_state_reports_commit_and_changes(tmp_path, monkeypatch):
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    for name in [name for name in os.environ if name.startswith("GIT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert tracking.git_state()[0] == "unknown (not a git checkout)"
    identity = ["-c", "user.name=test", "-c", "user.email=test@example.org"]
    (tmp_path / "params.yaml").write_text("a: 1\n")
    for command in (["init", "-q"], ["add", "."], [*identity, "commit", "-q", "-m", "first"]):
        subprocess.run(["git", "-C", str(tmp_path), *command], check=True)
    (tmp_path / "dvc.lock").write_text("written by the pipeline\n")
    commit, dirty = tracking.git_state()
    assert len(commit) == 40 and dirty == "false"
    (tmp_path / "params.yaml").write_text("a: 2\n")
    assert tracking.git_state() == (commit, "true")
    inside = tmp_path / "copy"
    inside.mkdir()
    monkeypatch.setattr(paths, "ROOT", inside)
    assert tracking.git_state()[0] == "unknown (not a git checkout)"


def test_telemetry_is_off():
    assert os.environ["MLFLOW_DISABLE_TELEMETRY"] == "true"
