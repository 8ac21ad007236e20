"""Training of the models of an experiment: what is trained again, and what a stopped or wrong one leaves."""

import os
import shutil

import pytest
from builders.project import ROOT

from tactile.base import files, params, paths
from tactile.base.errors import InputError
from tactile.stages import train as stage

RUNS = [("press", 0), ("press", 1), ("random_window", 0)]
MODELS = ["constant", "tree", "cnn"]
ALL = [(model, *run) for model in reversed(MODELS) for run in RUNS]  # the longest first


class Stopped(Exception):
    """In place of what ends a process."""


@pytest.fixture
def values(workspace, tmp_path, monkeypatch):
    """params.yaml with three runs of MODELS for touch, in a copy of the code, without any data but a stand-in."""
    monkeypatch.setattr(paths, "CODE", tmp_path / "tactile")
    monkeypatch.setenv("WORKERS", "1")
    code = ROOT / "tactile", tmp_path / "tactile"
    shutil.copytree(*code, ignore=shutil.ignore_patterns("__pycache__"), copy_function=os.symlink)
    for experiment in ("touch", "strain"):
        files.write_text(workspace.dataset(experiment), "data")
        files.write_text(workspace.ingest_report(experiment), '{"run": true}')
    values = params.load(ROOT / "params.yaml")
    values["touch"]["protocols"] = {"press": {"seeds": [0, 1]}, "random_window": {"seeds": [0]}}
    values["touch"]["budget"] = 1.0
    values["touch"]["models"] = {model: values["touch"]["models"][model] for model in MODELS}
    return values


@pytest.fixture
def train(workspace, values, monkeypatch):
    """`train(experiment, stop_at)`: train up to a run; return the runs (model, protocol, seed) trained in this call."""

    def trained(experiment="touch", stop_at=None) -> list[tuple[str, str, int]]:
        done = []

        def train_run(workspace, values, experiment, model, protocol, seed, target, report):
            target.mkdir(parents=True)
            if (model, protocol, seed) == stop_at:
                raise Stopped
            block = params.model_settings(values, experiment, model)
            (target / "network.safetensors").write_text(f"{model} {protocol} {seed} {block}")
            done.append((model, protocol, seed))
            for _ in range(params.epochs(block)):
                report(1, 1, 0.5)
            return 10.0 + seed

        monkeypatch.setattr(stage, "train_run", train_run)
        try:
            stage.train(workspace, values, experiment)
        except Stopped:
            assert stop_at
        return done

    return trained


def written(workspace, experiment="touch") -> dict[str, bytes]:
    """Path -> content of all that DVC takes for the outputs of the stage."""
    outs = (workspace.models(experiment), workspace.training_times(experiment, "any").parent)
    found = [path for out in outs for path in sorted(out.rglob("*")) if path.is_file()]
    return {path.relative_to(workspace.root).as_posix(): path.read_bytes() for path in found}


def append(workspace, file: str) -> None:
    """Put a changed copy of a file of code into its place."""
    code = workspace.root / file
    text = code.read_text()
    code.unlink()
    code.write_text(text + "# changed\n")


def test_all_models_are_trained_in_one_go_the_longest_first(workspace, values, train, capsys):
    assert train() == ALL
    folder = workspace.models("touch")
    assert sorted(path.name for path in folder.iterdir()) == sorted(MODELS)
    assert sorted(path.name for path in (folder / "cnn").glob("*/")) == ["press-0", "press-1", "random_window-0"]
    times = workspace.training_times("touch", "tree").read_text().splitlines()
    assert times == ["protocol,seed,train_s", "press,0,10.0", "press,1,11.0", "random_window,0,10.0"]
    assert not any(workspace.model_draft("touch", model).exists() for model in MODELS)
    epochs = 3 * (1 + 1 + values["touch"]["models"]["cnn"]["training"]["epochs"])
    assert f"train touch: 100%|██████████| {epochs}/{epochs}" in capsys.readouterr().err


def test_nothing_is_trained_again_where_nothing_changed(workspace, train):
    train()
    before = written(workspace)
    assert train() == [] and written(workspace) == before


OF_TREE = [run for run in ALL if run[0] == "tree"]


@pytest.mark.parametrize(
    ("file", "again"),
    [
        ("tactile/models/tree.py", OF_TREE),
        ("tactile/learning/estimators.py", [run for run in ALL if run[0] != "cnn"]),
        ("tactile/datasets/windows.py", ALL),
        ("tactile/stages/train.py", ALL),
        ("tactile/models/vgg.py", []),
        ("tactile/learning/lomp_network.py", []),
        ("tactile/scoring/metrics.py", []),
        ("tactile/experiments/touch.py", []),
        ("tactile/base/workers.py", []),
    ],
)
def test_a_change_of_code_trains_what_imports_it(workspace, train, file, again):
    train()
    append(workspace, file)
    assert train() == again


def test_a_change_of_one_models_settings_trains_that_model_alone(workspace, values, train):
    train()
    before = written(workspace)
    values["touch"]["models"]["tree"] = {"each": "element", "min_samples_leaf": 7, "max_features": 1.0}
    assert train() == OF_TREE
    changed = {path for path, content in written(workspace).items() if before[path] != content}
    assert changed == {f"data/touch/models/tree/{p}-{s}/network.safetensors" for p, s in RUNS} | {
        "data/touch/models/tree/origin.txt"
    }


@pytest.mark.parametrize("key", ["label", "sensor", "window", "device", "budget"])
def test_a_change_of_a_setting_that_all_read_trains_all(values, train, key):
    train()
    if key == "device":
        values["device"] = "cpu"
    elif key == "budget":
        values["touch"]["budget"] = 0.5
    else:
        values["touch"][key] = values["touch"][key] | {"changed": 1}
    assert train() == ALL


@pytest.mark.parametrize("key", ["simulate", "latency", "yardstick"])
def test_a_change_of_another_setting_trains_nothing(values, train, key):
    train()
    values["touch"][key] = values["touch"][key] | {"changed": 1}
    assert train() == []


def test_other_data_train_all(workspace, train):
    train()
    files.write_text(workspace.dataset("touch"), "other data")
    assert train() == ALL


@pytest.mark.parametrize("damage", ["changed", "lost", "added", "no times"])
def test_a_folder_that_is_not_as_it_was_written_is_trained_again(workspace, train, damage):
    train()
    before = written(workspace)
    file = workspace.run_folder("touch", "tree", "press", 1) / "network.safetensors"
    if damage == "no times":
        file = workspace.training_times("touch", "tree")
    elif damage == "added":
        file = file.with_name("other.txt")
    if damage in ("changed", "added"):
        file.write_text("by hand")
    else:
        file.unlink()
    assert train() == OF_TREE and written(workspace) == before


def test_a_model_that_is_no_longer_listed_is_removed(workspace, values, train):
    train()
    cnn = values["touch"]["models"].pop("cnn")
    files.write_text(workspace.training_times("touch", "other"), "of an earlier version")
    assert train() == []
    assert {path.split("/")[3].split(".")[0] for path in written(workspace)} == {"constant", "tree"}
    values["touch"]["models"]["cnn"] = cnn
    assert train() == ALL[:3]


def test_a_stopped_training_goes_on_from_its_finished_runs(workspace, values, train):
    train()
    before = written(workspace)
    values["touch"]["models"]["tree"] = {"each": "element", "min_samples_leaf": 7, "max_features": 1.0}
    values["touch"]["models"]["cnn"] = values["touch"]["models"]["cnn"] | {"hidden": [8]}
    assert train(stop_at=("tree", "press", 1)) == ALL[:4]
    assert written(workspace) == before  # the earlier training stays until this one is whole
    assert train() == ALL[4:6]
    assert not workspace.model_draft("touch", "tree").exists()
    assert written(workspace).keys() == before.keys()
    assert train() == []


def test_a_stopped_training_of_settings_that_are_taken_back_is_forgotten(workspace, values, train):
    train()
    before, tree = written(workspace), values["touch"]["models"]["tree"]
    values["touch"]["models"]["tree"] = {"each": "element", "min_samples_leaf": 7, "max_features": 1.0}
    train(stop_at=("tree", "press", 1))
    values["touch"]["models"]["tree"] = tree
    assert train() == [] and written(workspace) == before and not workspace.model_draft("touch", "tree").exists()


@pytest.mark.parametrize("change", ["settings", "data", "code"])
def test_finished_runs_of_other_settings_data_or_code_are_not_taken(workspace, values, train, change):
    train(stop_at=("constant", "press", 0))
    if change == "settings":
        values["touch"]["models"]["tree"] = {"each": "element", "min_samples_leaf": 7, "max_features": 1.0}
    elif change == "data":
        files.write_text(workspace.dataset("touch"), "other data")
    else:
        append(workspace, "tactile/models/tree.py")
    assert train() == (ALL if change == "data" else ALL[3:])


def test_a_run_without_its_time_is_trained_again(workspace, train):
    train(stop_at=("tree", "press", 0))
    times = workspace.model_draft("touch", "cnn") / "times.csv"
    times.write_text("\n".join(times.read_text().splitlines()[:2]) + "\n")
    assert train() == ALL[1:]


def test_model_zero_comes_first_and_only_what_starts_from_it_follows_it(workspace, values, train):
    models = ["ridge", "lstm_direct", "lstm_transfer", "lstm_transfer_ridge"]
    values["strain"]["models"] = {model: values["strain"]["models"][model] for model in models}
    trained = train("strain")
    zeros = [(paths.MODEL_ZERO, "task_0", seed) for seed in values["strain"]["protocols"]["task_0"]["seeds"]]
    assert trained[: len(zeros)] == zeros and {model for model, *_ in trained[len(zeros) :]} == set(models)
    assert train("strain") == []
    values["strain"]["models"]["ridge"] = {"ridge": 2.0}
    assert {model for model, *_ in train("strain")} == {"ridge"}
    values["strain"]["models"]["lstm_direct"] = values["strain"]["models"]["lstm_direct"] | {"units": 7}
    assert {model for model, *_ in train("strain")} == {paths.MODEL_ZERO, *models} - {"ridge"}
    assert sorted(path.name for path in workspace.models("strain").iterdir()) == sorted([paths.MODEL_ZERO, *models])


def test_without_recordings_no_model_has_a_run(workspace, values, train):
    train()
    files.write_text(workspace.ingest_report("touch"), '{"run": false, "reason": "no recordings"}')
    assert train() == []
    assert not list(workspace.models("touch").rglob("*.safetensors"))
    assert workspace.training_times("touch", "tree").read_text() == "protocol,seed,train_s\n"
    files.write_text(workspace.ingest_report("touch"), '{"run": true}')
    assert train() == ALL


def test_a_wrong_model_leaves_the_trained_ones(workspace, values, train, monkeypatch):
    train()
    before = written(workspace)
    values["strain"]["model_zero"] = "cubic"
    with pytest.raises(InputError, match="no model 'cubic'"):
        train("strain")

    def refuses(*arguments):
        raise InputError("a setting that does not go with the data")

    values["touch"]["models"]["tree"] = {"each": "element", "min_samples_leaf": 7, "max_features": 1.0}
    monkeypatch.setattr(stage, "train_run", refuses)
    with pytest.raises(InputError, match="does not go with"):
        stage.train(workspace, values, "touch")
    assert written(workspace) == before


def test_a_missing_dataset_is_one_sentence(workspace, train):
    workspace.dataset("touch").unlink()
    with pytest.raises(InputError, match=r"dataset.parquet: not found; run `python -m tactile.stages.dataset touch`"):
        train()


def test_a_draft_that_links_elsewhere_is_not_removed(workspace, train, tmp_path):
    (tmp_path / "canary" / "important").mkdir(parents=True)
    draft = workspace.model_draft("touch", "tree")
    draft.parent.mkdir(parents=True, exist_ok=True)
    draft.symlink_to(tmp_path / "canary")
    with pytest.raises(InputError, match="so it is not removed"):
        train()
    assert (tmp_path / "canary" / "important").is_dir()
