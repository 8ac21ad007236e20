"""MLflow must hold one run of each content, each with its own weights; nothing twice, and nothing lost.

What was trained here is made up; the evidence is the committed one.
"""

import contextlib
import copy
import json
import os
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
from pathlib import Path
from urllib.parse import parse_qs

import mlflow
import numpy as np
import pandas as pd
import pytest
import yaml
from builders import kills, live_models, readme_tables
from builders.devices import until
from builders.made_results import EPOCHS, fit_linear, write_results
from builders.project import ROOT
from scipy.stats import gmean

from pipeline.results import shards
from pipeline.tracking import mlflow_runs
from tactile.base import params, provenance
from tactile.base.errors import InputError, run_stage
from tactile.base.paths import Workspace
from tactile.inference import card as cards
from tactile.inference import consistent, mlflow_store, packages, predictor, training_logs

pytestmark = pytest.mark.slow

PARAMS = {
    "experiments": ["touch", "velostat_recorded"],
    "device": "auto",
    "touch": {
        "sensor": {"rows": 2, "cols": 3, "pitch_mm": 12.0, "element_mm": 11.5},
        "ingest": live_models.TOUCH["ingest"],
        "window": live_models.TOUCH["window"] | {"frames": 4, "contact_threshold_n": 0.5},
        "label": {"map_rows": 3, "map_cols": 5, "tip_radius_mm": 5.0},
        "budget": 1.0,
        "protocols": {"press": {"seeds": [0, 1]}},
        "models": {"linear": {}, "lomp": {"hidden": 8, "training": {"learning_rate": 1.0e-3}}},
        "latency": {"batches": [1, 256]},
    },
    "velostat_recorded": {"budget": 1.0, "protocols": {"repetition": {"seeds": [0]}}, "models": {"linear": {}}},
}
SEEDS = (0, 1)
KILLS = 5
LINEAR = ("linear", "0")
LOGS = [cards.Log(name="single/run000", sha256="0" * 64, parts=["train"])]


def write_repository(root: Path) -> None:
    """Write results of PARAMS into `root`: made-up scores, and a linear model for each seed that predicts its own."""
    write_results(root, PARAMS)
    absent = root / "data" / "velostat_recorded"
    absent.mkdir(exist_ok=True)
    (absent / "ingest.json").write_text(json.dumps({"run": False, "reason": "recordings not downloaded"}))
    (root / "params.yaml").write_text(yaml.safe_dump(PARAMS))
    for seed in SEEDS:
        fit_linear(PARAMS["touch"], seed, root / "data" / "touch" / "models" / "linear" / f"press-{seed}")


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Workspace:
    return Workspace(tmp_path_factory.mktemp("tracked"))


@pytest.fixture(scope="module")
def tracked(workspace):
    """A repository whose runs are in its store; creating one takes seconds, so all tests share it."""
    root = workspace.root
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        patch.setattr(training_logs, "added", lambda *given: given[2].model_copy(update={"logs": LOGS}))
        write_repository(root)
        mlflow_runs.track(workspace, PARAMS)
        yield root


def client(workspace) -> mlflow.MlflowClient:
    return mlflow.MlflowClient(tracking_uri=f"sqlite:///{workspace.mlflow_database}")


def all_runs(workspace) -> dict:
    """Run id -> run, deleted ones as well."""
    source = client(workspace)
    found = source.search_runs([source.get_experiment_by_name("touch").experiment_id], run_view_type=3)
    return {run.info.run_id: run for run in found}


def current(workspace) -> dict:
    """(model, seed) -> the one run that is current."""
    runs = [run for run in all_runs(workspace).values() if run.data.tags["current"] == "true"]
    runs = [run for run in runs if run.info.lifecycle_stage == "active"]
    by_key = {(run.data.tags["model"], run.data.tags["seed"]): run for run in runs}
    assert len(by_key) == len(runs) == 4
    return by_key


def new_runs(workspace, values: dict = PARAMS) -> list:
    """Track, and return the runs that this added; those that were there must be as before, but for `current`."""
    before = all_runs(workspace)
    mlflow_runs.track(workspace, values)
    after = all_runs(workspace)
    for run_id, run in before.items():
        assert after[run_id].data.metrics.keys() == run.data.metrics.keys()
        assert after[run_id].data.params == run.data.params
        assert after[run_id].info.lifecycle_stage == run.info.lifecycle_stage
    return [run for run_id, run in after.items() if run_id not in before]


def change(file: Path, column: str, value, row: int = 0) -> str:
    """Set one cell of a table, and return the former text of the file."""
    former = file.read_text()
    table = pd.read_csv(file)
    table.loc[row, column] = value
    table.to_csv(file, index=False)
    return former


def test_a_run_says_what_was_trained_and_how_well_it_does(workspace, tracked):
    run = current(workspace)["lomp", "1"]
    assert run.info.run_name == "LoMP, press, seed 1" and run.info.status == "FINISHED"
    assert run.info.end_time - run.info.start_time == 2000  # the training's seconds in ms
    assert run.data.params == {
        **{"model": "LoMP", "protocol": "press", "variant": "none", "budget": "look", "seed": "1"},
        **{"hidden": "8", "training.learning_rate": "0.001"},
    }
    scores = {"main/single.rmse": 9.5, "published/single.rmse": 2.17, "more/parameters": 17.0, "more/train_s": 2.0}
    assert run.data.metrics.items() >= (scores | {"more/latency.batch_256.p50_ms": 0.5}).items()
    tags = {"unit.rmse": "kPa", "stop_reason": "closed_form", "budget": "look", "shown": "true", "readme": "false"}
    tags["git_commit"] = provenance.git_state(workspace)[0]
    assert run.data.tags.items() >= tags.items()
    curve = client(workspace).get_metric_history(run.info.run_id, "validation_loss")
    assert [(point.step, point.value) for point in curve] == [(n, 10.0 / n) for n in range(1, EPOCHS + 1)]
    files = {file.path for file in client(workspace).list_artifacts(run.info.run_id)}
    assert files == {"model", "params.yaml", "fit.json", "history.csv"}
    note = run.data.tags["mlflow.note.content"]
    assert "float32 (n, 6) in counts" in note and "float32 (n, 3, 5) in kPa" in note
    about = client(workspace).get_experiment_by_name("touch").tags["mlflow.note.content"]
    assert about.startswith("Touch: a run per model") and "`unit.<metric>`" in about


@pytest.mark.parametrize("seed", SEEDS)
def test_every_run_opens_with_its_own_weights(workspace, tracked, tmp_path, monkeypatch, seed):
    run = current(workspace)["linear", str(seed)]
    readings = np.random.default_rng(9).integers(0, 1024, (12, 6)).astype(np.float32)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tracked / 'mlflow.db'}")
    opened = mlflow.pyfunc.load_model(f"runs:/{run.info.run_id}/model")
    packages.make(workspace, PARAMS, "touch", "linear", "press", seed, tmp_path / "ours")
    ours = predictor.load(tmp_path / "ours").predict(readings)
    np.testing.assert_array_equal(opened.predict(readings), ours)
    assert ours.shape == (12, 3, 5) and np.isfinite(ours[-1]).all()
    folder, origin = packages.locate(workspace, run.info.run_id, PARAMS, tmp_path / "from_mlflow")
    assert origin == "from MLflow" and consistent.read(folder).seed == seed
    assert consistent.read(folder).logs == LOGS, "for predict not to score them"
    np.testing.assert_array_equal(predictor.load(folder).predict(readings), ours)
    assert sorted(file.name for file in folder.iterdir()) == ["card.json", "estimator.skops"]


def test_a_second_call_adds_nothing_and_prints_the_comparison(workspace, tracked, capsys):
    assert not new_runs(workspace)
    said = capsys.readouterr().out
    assert "velostat_recorded: not run here (recordings not downloaded)" in said
    number = client(workspace).get_experiment_by_name("touch").experiment_id
    start, _, query = said.strip().splitlines()[-2].partition("/runs?")
    where = f"http://127.0.0.1:5055/#/experiments/{number}"
    assert start.endswith(f": 0 of 4 runs are new in MLflow; compare them at {where}")
    assert parse_qs(query, strict_parsing=True) == {
        "workflowType": ["machine_learning"],
        "searchFilter": ["tags.current = 'true' and tags.compared = 'true' and tags.protocol = 'press'"],
        "orderByKey": ["metrics.`main/single.rmse`"],
        "orderByAsc": ["true"],
        "compareRunsMode": ["CHART"],
    }


def test_another_result_adds_a_run_and_the_old_one_stays(workspace, tracked):
    first = current(workspace)[LINEAR].info.run_id
    change(workspace.latency("touch"), "p50_ms", 0.9)
    assert not new_runs(workspace)  # times are no part of a result
    former = change(workspace.scores("touch"), "value", 8.75)
    weights = workspace.run_folder("touch", "lomp", "press", 1) / "estimator.skops"
    trained = weights.read_bytes()
    weights.write_bytes(b"trained anew")
    new = {(run.data.tags["model"], run.data.tags["seed"]): run for run in new_runs(workspace)}
    assert new.keys() == {LINEAR, ("lomp", "1")} and new[LINEAR].data.metrics["main/single.rmse"] == 8.75
    assert current(workspace)[LINEAR].info.run_id == new[LINEAR].info.run_id
    assert all_runs(workspace)[first].data.tags["current"] == "false"
    workspace.scores("touch").write_text(former)
    weights.write_bytes(trained)
    assert (
        not new_runs(workspace) and current(workspace)[LINEAR].info.run_id == first
    )  # the old result again is the old run again


def test_a_failed_run_is_logged(workspace, tracked):
    former = change(workspace.scores("touch"), "value", np.nan)
    history = workspace.run_folder("touch", "linear", "press", 0) / "history.csv"
    curve = change(history, "validation_loss", np.inf)
    (new,) = new_runs(workspace)
    assert np.isnan(new.data.metrics["main/single.rmse"]) and new.info.status == "FINISHED"
    assert "validation_loss" not in new.data.metrics and new.data.metrics["train_loss"] == 9.0
    history.write_text(curve)
    workspace.scores("touch").write_text(former)
    assert not new_runs(workspace)


def test_what_was_deleted_or_left_half_way_is_logged_anew(workspace, tracked):
    deleted, unfinished = current(workspace)[LINEAR].info.run_id, current(workspace)["linear", "1"].info.run_id
    client(workspace).delete_run(deleted)
    client(workspace).update_run(unfinished, status="RUNNING")  # as a call leaves it that is killed
    assert len(new_runs(workspace)) == 2 and not new_runs(workspace)
    assert client(workspace).get_run(unfinished).info.status == "KILLED"
    assert client(workspace).get_run(deleted).info.lifecycle_stage == "deleted"
    assert not {deleted, unfinished} & {run.info.run_id for run in current(workspace).values()}


def test_after_a_kill_the_next_call_ends_as_a_quiet_one(tracked, workspace, tmp_path, monkeypatch):
    """Killed before its first, its last and some other changes of files in the store."""
    monkeypatch.setattr(training_logs, "added", lambda *given: given[2].model_copy(update={"logs": LOGS}))
    quiet = {key: (run.data.metrics, run.data.params) for key, run in current(workspace).items()}
    killed = []

    def call(name: str, at: int = 0) -> kills.Ended:
        place = Workspace(tmp_path / name)
        if not place.root.exists():
            shutil.copytree(tracked, place.root, ignore=shutil.ignore_patterns("mlruns", "mlflow.db*"))
        return kills.run(lambda: mlflow_runs.track(place, PARAMS), place.mlflow, tmp_path / "notes", at)

    count = len(call("whole").changes)
    for at in sorted({round(1 + (count - 1) * k / (KILLS - 1)) for k in range(KILLS)}):
        place = Workspace(tmp_path / f"killed{at}")
        assert call(place.root.name, at).code == -signal.SIGKILL
        again = call(place.root.name)
        assert again.code == 0, again.said
        assert {key: (run.data.metrics, run.data.params) for key, run in current(place).items()} == quiet, at
        killed += [run for run in all_runs(place).values() if run.info.status == "KILLED"]
    assert killed  # what was under way is called so


def test_an_experiment_that_was_deleted_or_copied_is_one_sentence(workspace, tracked, tmp_path):
    number = client(workspace).get_experiment_by_name("touch").experiment_id
    client(workspace).delete_experiment(number)
    with pytest.raises(InputError, match=f"experiment touch was deleted there.*restore -x {number}"):
        mlflow_runs.track(workspace, PARAMS)
    client(workspace).restore_experiment(number)
    shutil.copytree(tracked, tmp_path / "copy")
    with pytest.raises(InputError, match=r"^mlflow.db: .* moved or copied; delete mlflow.db and mlruns"):
        mlflow_runs.track(Workspace(tmp_path / "copy"), PARAMS)


def test_conditions_of_any_name_are_logged_apart(workspace, tracked):
    former = change(workspace.scores("touch"), "condition", "two fingers (90°)::größer")
    (new,) = new_runs(workspace)
    assert new.data.metrics["main/two fingers _90____größer.rmse"] == 8.5
    table = pd.read_csv(workspace.scores("touch"))
    alike = table[:1].assign(condition="two fingers [90°]::größer")
    pd.concat([table, alike]).to_csv(workspace.scores("touch"), index=False)
    with pytest.raises(InputError, match="scores.csv: two rows for the same condition and metric"):
        mlflow_runs.track(workspace, PARAMS)
    workspace.scores("touch").write_text(former)
    mlflow_runs.track(workspace, PARAMS)


def test_a_run_of_an_unknown_id_is_one_sentence(workspace, tracked, tmp_path):
    with pytest.raises(InputError, match="^0{32}: no such run in MLflow"):
        packages.locate(workspace, "0" * 32, PARAMS, tmp_path / "draft")
    own = client(workspace).create_run(client(workspace).get_experiment_by_name("touch").experiment_id).info.run_id
    with pytest.raises(InputError, match=f"^{own}: this MLflow run holds no model"):
        packages.locate(workspace, own, PARAMS, tmp_path / "draft")
    client(workspace).delete_run(own)


@pytest.mark.parametrize(
    ("file", "named"),
    [
        ("ingest.json", "data/touch/ingest.json"),
        ("scores.csv", "data/touch/scores.csv"),
        ("speed/latency.csv", "data/touch/speed/latency.csv"),
        ("latency/lomp.train.csv", "data/touch/latency/lomp.train.csv"),
        ("models/lomp/press-1/history.csv", "data/touch/models/lomp/press-1/history.csv"),
        ("models/lomp/press-1/fit.json", "data/touch/models/lomp/press-1/fit.json"),
        ("models/lomp/press-1/estimator.skops", "data/touch/models/lomp/press-1: no network.safetensors or"),
    ],
)
def test_a_missing_file_is_named_and_nothing_is_logged(workspace, tracked, file, named):
    path, before = tracked / "data" / "touch" / file, all_runs(workspace).keys()
    away = path.rename(path.with_suffix(".away"))
    with pytest.raises(InputError, match=named):
        mlflow_runs.track(workspace, PARAMS)
    away.rename(path)
    assert all_runs(workspace).keys() == before


def test_missing_rows_and_other_settings_are_named(workspace, tracked):
    former = change(workspace.scores("touch"), "seed", 7)
    with pytest.raises(InputError, match=r"scores.csv: no row for protocol press, model linear, seed 0"):
        mlflow_runs.track(workspace, PARAMS)
    workspace.scores("touch").write_text(former)
    other = copy.deepcopy(PARAMS)
    other["touch"]["models"]["lomp"]["hidden"] = 16
    with pytest.raises(InputError, match=r"press-0/fit.json: was made with other settings than touch.models.lomp"):
        mlflow_runs.track(workspace, other)


@pytest.mark.parametrize(
    "uri",
    ["http://me:s3cret@127.0.0.1:9", "postgresql://me:s3cret@127.0.0.1:9/runs"],
)
def test_an_unreachable_store_is_one_sentence_without_secrets(workspace, tracked, uri, monkeypatch, capfd, caplog):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
    with pytest.raises(SystemExit) as ended:
        run_stage(lambda: mlflow_runs.track(workspace, PARAMS), workspace.params)
    message = str(ended.value)
    assert message.startswith("error: MLFLOW_TRACKING_URI: the MLflow store cannot be used") and "\n" not in message
    assert "s3cret" not in message + "".join(capfd.readouterr()) + caplog.text
    assert "s3cret" not in mlflow_store.link("1", "press", "single.rmse", ascending=True)


def test_a_locked_or_damaged_store_is_one_sentence(workspace, tracked, monkeypatch, tmp_path):
    with sqlite3.connect(tracked / "mlflow.db") as other:
        other.execute("begin exclusive")
        with pytest.raises(InputError, match="^mlflow.db: .* cannot be used .*locked.*close what else uses it"):
            mlflow_runs.track(workspace, PARAMS)
    (tmp_path / "damaged.db").write_text("not a database" * 100)
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tmp_path / 'damaged.db'}")
    with pytest.raises(InputError, match="cannot be used .*not a database.*move a damaged file away"):
        mlflow_runs.track(workspace, PARAMS)


def runs_of_evidence(workspace) -> dict:
    """(model, protocol, variant, budget) -> run of touch in the store of a workspace."""
    return {
        tuple(run.data.tags[key] for key in ("model", "protocol", "variant", "budget")): run
        for run in all_runs(workspace).values()
    }


@pytest.fixture(scope="module")
def committed(tmp_path_factory):
    """A clone in which nothing was computed, whose evidence on touch is in its store."""
    workspace = Workspace(tmp_path_factory.mktemp("clone"))
    (workspace.root / "evidence").symlink_to(ROOT / "evidence")
    values = params.load(ROOT / "params.yaml") | {"experiments": ["touch"]}
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        mlflow_runs.track(workspace, values)
        yield workspace, values


def test_a_clone_has_the_means_over_seeds_of_the_evidence(committed):
    workspace, _ = committed
    runs = runs_of_evidence(workspace)
    rows = shards.read(workspace)
    rows = rows[(rows.experiment == "touch") & (rows.protocol == "random_window") & (rows.condition == "double")]
    rows = rows[(rows.model == "lomp") & (rows.metric == "rmse") & (rows.budget == "full") & rows.variant.isna()]
    run = runs["lomp", "random_window", "none", "full"]
    assert run.info.run_name == f"LoMP, random_window, full budget, {len(rows)} seeds"
    assert run.data.metrics["main/double.rmse"] == pytest.approx(gmean(rows.value.astype(float)))
    assert run.data.metrics["published/double.rmse"] == 7.49 and run.data.tags["unit.rmse"] == "kPa"
    seeds = client(workspace).get_metric_history(run.info.run_id, "seeds/double.rmse")
    assert {point.step: point.value for point in seeds} == dict(zip(rows.seed, rows.value, strict=True))
    times = pd.read_csv(ROOT / "evidence" / "times.csv")
    times = times[times.shard.str.fullmatch(r"touch_random_window(_lomp)?-\d+-full") & (times.model == "lomp")]
    index = pd.read_csv(ROOT / "evidence" / "index.csv")
    times = times.merge(index[["shard", "machine", "commit"]], on="shard")
    tags, machine = run.data.tags, times.machine.mode()[0]
    seconds = times[times.machine == machine].train_s.mean()  # a card's are no part of a mean of a core's
    assert run.info.end_time - run.info.start_time == pytest.approx(1000 * seconds, abs=1)
    assert run.data.metrics["more/train_s"] == pytest.approx(seconds) and tags["timed_on"] == machine
    assert [*map(tags.get, ("shards", "git_commit", "machine"))] == [
        "; ".join(sorted(set(times[name]))) for name in ("shard", "commit", "machine")
    ]
    assert "git_changed" not in tags, "of no checkout, but of the shards"
    kept = [pd.read_csv(ROOT / "evidence" / "curves" / f"{name}.csv") for name in times.shard]
    curve = pd.concat([each[each.model == "lomp"] for each in kept]).groupby("epoch").validation_loss.mean()
    said = client(workspace).get_metric_history(run.info.run_id, "validation_loss")
    assert {point.step: point.value for point in said} == pytest.approx(curve.to_dict()) and len(curve) > 1
    assert runs["linear", "random_window", "none", "none"].data.tags["shown"] == "true"
    assert runs["lomp", "press", "none", "half"].data.tags["shown"] == "false", "where there is the full budget"
    alone = runs["lomp", "press", "lomp_alpha_0", "none"]
    assert alone.data.params["alpha"] == "0.0" and alone.data.params["hidden"] == "64"
    assert alone.info.run_name == "LoMP, press, lomp_alpha_0, 3 seeds"
    marked = {name: alone.data.tags[name] for name in ("shown", "compared", "readme")}
    assert marked == {"shown": "true", "compared": "false", "readme": "false"}
    assert not any("data" in key for key in runs), "rows that are of no model"


def test_every_number_of_readme_is_a_metric_of_one_run(tmp_path, monkeypatch):
    """In a store that the committed evidence alone has filled."""
    workspace = Workspace(tmp_path)
    (tmp_path / "evidence").symlink_to(ROOT / "evidence")
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    mlflow_runs.track(workspace, params.load(ROOT / "params.yaml") | {"experiments": ["touch", "strain", "glove"]})
    source = client(workspace)
    runs = list(source.search_runs([each.experiment_id for each in source.search_experiments()], max_results=2000))
    numbers = readme_tables.numbers((ROOT / "README.md").read_text(encoding="utf-8"))
    assert len(numbers) == 18 + 4 + 21 and not readme_tables.without_run(numbers, runs)
    (best,) = (number for number in numbers if (number.model, number.title) == ("SP-ResNet", "Pressure and bending"))
    of_best = {"protocol": "session_combined", "model": "sp_resnet", "variant": "none"}
    others = [run for run in runs if not of_best.items() <= run.data.tags.items()]
    assert len(others) < len(runs) and readme_tables.without_run(numbers, others) == [best]
    other = best._replace(text="93.93")  # after 4 epochs: of a run, and not of one that README shows
    assert readme_tables.without_run([other], runs) == [other]
    listed = (ROOT / "reports" / "shards.md").read_text(encoding="utf-8")
    for run in runs:
        if run.data.tags["readme"] == "true":
            assert all(f"evidence/results/{name}.csv)" in listed for name in run.data.tags["shards"].split("; "))


def test_the_link_opens_the_models_compared_by_their_main_score(committed, tab, capsys):
    """In a browser, with MLflow's server on the store, as `tactile track --serve` starts it."""
    workspace, values = committed
    capsys.readouterr()
    mlflow_runs.track(workspace, values)
    said = capsys.readouterr().out.strip()
    assert said.startswith("touch: 0 of ")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{free.getsockname()[1]}"
    host, _, port = address.partition(":")
    call = f"track.serve(track.Workspace(pathlib.Path({str(workspace.root)!r})), {host!r}, {port}, [])"
    server = subprocess.Popen(
        [sys.executable, "-c", f"import pathlib; from pipeline.commands import track; {call}"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    try:
        assert server.stdout.readline() == f"http://{address} shows the runs; Ctrl-C ends it\n"
        tab.width(1600)
        tab.open(said.split()[-1].replace("127.0.0.1:5055", address))
        slowly = "new Promise(done => setTimeout(() => done(document.body.innerText), 500))"
        until(lambda: "main/double.rmse" in tab.run(slowly).partition("matching runs")[2], 120)
        listed, _, charts = tab.run(slowly).partition(" matching runs")
        # To the command alone, which ends MLflow's own processes; not SIGINT, which tests in the background ignore.
        server.send_signal(signal.SIGTERM)
        server.wait(30)
        until(lambda: socket.socket().connect_ex((host, int(port))), 10)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(server.pid, signal.SIGKILL)
    there = [run for run in runs_of_evidence(workspace).values() if run.data.tags["compared"] == "true"]
    there = [run for run in there if run.data.tags["protocol"] == "random_window"]
    assert listed.endswith(str(len(there)))
    best = sorted(there, key=lambda run: run.data.metrics["main/double.rmse"])
    places = [listed.index(run.info.run_name) for run in best]
    assert places == sorted(places), "the lowest error first"
    first, *others = (charts.index(name) for name in ("main/double.rmse", "main/single.rmse", best[0].info.run_name))
    assert first < min(others), "the chart of the main score is the first"
