"""The store must mirror the files: one active run per protocol, model and seed, and nothing added twice."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from pipeline import paths, track, tracking
from pipeline.errors import InputError

EPOCHS = 5
PARAMS = {
    "experiments": ["touch", "velostat_recorded"],
    "touch": {
        "label": {"map_rows": 20},
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


def write_results(root: Path) -> None:
    """What the stages before `track` leave behind, with made-up numbers."""
    touch = root / "data" / "touch"
    (touch / "latency").mkdir(parents=True)
    scores, times = [], []
    for model in ("linear", "lomp"):
        for protocol, seed in (("press", 0), ("press", 1), ("random_window", 0)):
            folder = touch / "models" / model / f"{protocol}-{seed}"
            folder.mkdir(parents=True)
            rows = range(1, 2 if model == "linear" else EPOCHS + 1)
            pd.DataFrame(
                {
                    "epoch": rows,
                    "train_loss": [9.0 / row for row in rows],
                    "validation_loss": [10.0 / row for row in rows],
                    "learning_rate": 1.0e-3,
                }
            ).to_csv(folder / "history.csv", index=False)
            fit = {
                "stop_reason": "closed_form",
                "best_epoch": len(rows),
                "epochs": len(rows),
                "parameters": 17,
                "macs": None,
                "settings": PARAMS["touch"]["models"][model],
            }
            (folder / "fit.json").write_text(json.dumps(fit))
            (folder / "model.skops").write_bytes(f"{model} {protocol} {seed}".encode())
            scores += [("touch", protocol, "single", model, seed, "rmse", "kPa", 8.5 + seed, 40)]
            times += [(model, protocol, seed, 2.0)]
    columns = ["experiment", "protocol", "condition", "model", "seed", "metric", "unit", "value", "n"]
    pd.DataFrame(scores, columns=columns).to_csv(touch / "scores.csv", index=False)
    for model, table in pd.DataFrame(times, columns=["model", "protocol", "seed", "train_s"]).groupby("model"):
        table.drop(columns="model").to_csv(touch / "latency" / f"{model}.train.csv", index=False)
    pd.DataFrame(
        [("touch", model, batch, 1, 0.5, 0.7, 17, 17, 999) for model in ("linear", "lomp") for batch in (1, 256)],
        columns="experiment model batch threads p50_ms p95_ms params macs size_bytes".split(),
    ).to_csv(touch / "latency" / "latency.csv", index=False)
    (touch / "ingest.json").write_text('{"run": true}')
    absent = root / "data" / "velostat_recorded"
    absent.mkdir()
    (absent / "ingest.json").write_text(json.dumps({"run": False, "reason": "recordings not downloaded"}))


@pytest.fixture(scope="module")
def made_once(tmp_path_factory):
    """A repository with results and a store that already holds their runs (creating one takes seconds)."""
    root = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(paths, "ROOT", root)
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        write_results(root)
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
    shutil.copytree(made_once / "data", tmp_path / "data")
    (tmp_path / "mlruns").mkdir()
    shutil.copy(made_once / "empty.db", tmp_path / "mlruns" / "mlflow.db")
    return tmp_path


def client() -> tracking.MlflowClient:
    return tracking.MlflowClient(tracking_uri=f"sqlite:///{tracking.store_folder() / 'mlflow.db'}")


def active_runs() -> dict:
    """(experiment, protocol, model, seed) -> the active runs with these tags."""
    store = client()
    found: dict = {}
    for experiment in store.search_experiments():
        for run in store.search_runs([experiment.experiment_id]):
            tags = run.data.tags
            key = tuple(tags.get(name) for name in ("experiment", "protocol", "model", "seed"))
            found.setdefault(key, []).append(run)
    return found


def receipt() -> pd.DataFrame:
    return pd.read_csv(tracking.receipt(), dtype=str)


def change_score(root: Path) -> None:
    """A different value in the first row of scores.csv: touch, press, linear, seed 0."""
    file = root / "data" / "touch" / "scores.csv"
    table = pd.read_csv(file)
    table.loc[0, "value"] += 0.25
    table.to_csv(file, index=False)


def test_one_run_per_model_and_seed_with_curves_and_metrics(made_once):
    runs = active_runs()
    assert {key: len(found) for key, found in runs.items()} == dict.fromkeys(RUNS, 1)
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
    logged = {file.path for file in client().list_artifacts(run.info.run_id, "model")}
    assert logged == {"model/history.csv", "model/fit.json", "model/model.skops"}


def test_second_call_adds_nothing(made_once, capsys):
    database = tracking.store_folder() / "mlflow.db"
    before = database.read_bytes(), tracking.receipt().read_bytes()
    track.track(PARAMS)
    assert (database.read_bytes(), tracking.receipt().read_bytes()) == before
    assert "0 runs logged, 6 unchanged, 0 superseded" in capsys.readouterr().out


def test_an_experiment_that_was_not_run_is_one_line(made_once, capsys):
    track.track(PARAMS)
    lines = [line for line in capsys.readouterr().out.splitlines() if "velostat_recorded" in line]
    assert len(lines) == 1 and "recordings not downloaded" in lines[0]


def test_a_lost_database_is_filled_again_with_the_same_contents(made_once, repository):
    track.track(PARAMS)
    first = pd.read_csv(made_once / "mlruns" / "tracked.csv", dtype=str)
    shared = ["experiment", "protocol", "model", "seed", "content"]
    assert receipt()[shared].equals(first[shared])
    assert set(receipt()["run_id"]).isdisjoint(first["run_id"])
    assert receipt()["content"].nunique() == len(RUNS)


def test_changed_score_replaces_exactly_that_run(repository):
    track.track(PARAMS)
    before = receipt()
    change_score(repository)
    track.track(PARAMS)
    changed = before["run_id"] != receipt()["run_id"]
    assert before[changed][["protocol", "model", "seed"]].to_numpy().tolist() == [["press", "linear", "0"]]
    runs = active_runs()
    assert {key: len(found) for key, found in runs.items()} == dict.fromkeys(RUNS, 1)
    assert runs["touch", "press", "linear", "0"][0].data.metrics["single.rmse"] == 8.75


def test_retrained_model_file_changes_the_content_of_its_run_only(repository):
    before = tracking.read_runs("touch", PARAMS)
    (paths.run_folder("touch", "lomp", "press", 1) / "model.skops").write_bytes(b"other weights")
    after = tracking.read_runs("touch", PARAMS)
    changed = [new.key for old, new in zip(before, after, strict=True) if old.content != new.content]
    assert changed == [("touch", "press", "lomp", "1")]


def test_a_run_whose_files_were_deleted_is_logged_again(repository):
    track.track(PARAMS)
    lost = active_runs()["touch", "press", "lomp", "0"][0].info
    shutil.rmtree(lost.artifact_uri)
    track.track(PARAMS)
    (found,) = active_runs()["touch", "press", "lomp", "0"]
    assert found.info.run_id != lost.run_id
    assert (Path(found.info.artifact_uri) / "model" / "model.skops").is_file()


def test_wall_times_alone_change_nothing(repository):
    before = tracking.read_runs("touch", PARAMS)
    file = paths.latency("touch")
    table = pd.read_csv(file)
    table["p50_ms"] *= 2
    table.to_csv(file, index=False)
    after = tracking.read_runs("touch", PARAMS)
    assert [run.content for run in before] == [run.content for run in after]
    assert before[0].timings != after[0].timings


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
    params = json.loads(json.dumps(PARAMS))
    change(params["touch"])
    after = tracking.read_runs("touch", params)
    assert {
        old.model for old, new in zip(before, after, strict=True) if old.params_hash != new.params_hash
    } == different


def test_unlisted_models_and_interrupted_runs_are_retired_but_the_users_own_runs_stay(repository):
    track.track(PARAMS)
    store = client()
    experiment = store.get_experiment_by_name("touch").experiment_id
    own = store.create_run(experiment, run_name="my own").info.run_id
    unfinished = active_runs()["touch", "press", "lomp", "0"][0].info.run_id
    store.update_run(unfinished, status="RUNNING")  # as a call leaves it that is killed half-way
    fewer = {**PARAMS, "touch": {**PARAMS["touch"], "models": {"lomp": PARAMS["touch"]["models"]["lomp"]}}}
    track.track(fewer)
    runs = active_runs()
    assert [run.info.run_id for run in runs.pop((None, None, None, None))] == [own]
    assert {key: len(found) for key, found in runs.items()} == {key: 1 for key in RUNS if key[2] == "lomp"}
    assert runs["touch", "press", "lomp", "0"][0].info.run_id != unfinished


def test_runs_of_an_unlisted_experiment_are_retired(repository):
    track.track(PARAMS)
    track.track({**PARAMS, "experiments": ["velostat_recorded"]})
    assert not active_runs()
    assert receipt().empty


@pytest.mark.parametrize(
    ("file", "named"),
    [
        ("data/touch/ingest.json", "data/touch/ingest.json"),
        ("data/touch/scores.csv", "data/touch/scores.csv"),
        ("data/touch/latency/latency.csv", "data/touch/latency/latency.csv"),
        ("data/touch/latency/lomp.train.csv", "data/touch/latency/lomp.train.csv"),
        ("data/touch/models/lomp/press-1/history.csv", "data/touch/models/lomp/press-1/history.csv"),
        ("data/touch/models/lomp/press-1/fit.json", "data/touch/models/lomp/press-1/fit.json"),
        ("data/touch/models/lomp/press-1/model.skops", "data/touch/models/lomp/press-1: holds no model file"),
    ],
)
def test_missing_file_is_named_and_nothing_is_logged(repository, file, named):
    (repository / file).unlink()
    with pytest.raises(InputError, match=named):
        track.track(PARAMS)
    assert not active_runs()
    assert not tracking.receipt().exists()


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
    assert "python -m pipeline.track" in str(caught.value)


def test_file_that_is_no_database_is_one_sentence(repository):
    (repository / "mlruns" / "mlflow.db").write_text("not a database" * 100)
    with pytest.raises(InputError, match="^mlruns/mlflow.db: the MLflow store cannot be used") as caught:
        track.track(PARAMS)
    assert "\n" not in str(caught.value)


def test_a_store_that_locks_half_way_is_one_sentence_and_loses_nothing(repository, monkeypatch):
    calls = []

    def log_artifacts(self, *arguments, original=tracking.MlflowClient.log_artifacts):
        calls.append(arguments)
        if len(calls) == 3:
            raise tracking.MlflowException("(sqlite3.OperationalError) database is locked\n[SQL: INSERT]")
        return original(self, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(tracking.MlflowClient, "log_artifacts", log_artifacts)
        with pytest.raises(InputError, match="database is locked.*run `python -m pipeline.track` again") as caught:
            track.track(PARAMS)
    assert "\n" not in str(caught.value)
    assert not tracking.receipt().exists()
    track.track(PARAMS)
    assert {key: len(found) for key, found in active_runs().items()} == dict.fromkeys(RUNS, 1)


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
