"""Training of all runs of a model: what a stopped or wrong one leaves, and what the next one takes from it."""

import pytest

from pipeline.base import files, params, paths, runs
from pipeline.base.errors import InputError

RUNS = [("press", 0), ("press", 1), ("random_window", 0)]


class Stopped(Exception):
    """In place of what ends a process."""


@pytest.fixture
def values(tmp_path, monkeypatch):
    """params.yaml with three runs of `linear`, in a folder of its own that has an earlier training of it."""
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    monkeypatch.setenv("WORKERS", "1")
    (tmp_path / "pipeline" / "stages").mkdir(parents=True)
    (tmp_path / "pipeline" / "stages" / "train.py").write_text("first")
    files.write_text(paths.dataset("touch"), "data")
    files.write_text(paths.ingest_report("touch"), '{"run": true}')
    files.write_text(paths.model_folder("touch", "linear") / "press-0" / "fit.json", "earlier")
    values = params.load()
    values["touch"] = values["touch"] | {"protocols": {"press": {"seeds": [0, 1]}, "random_window": {"seeds": [0]}}}
    return values


def train(values, stop_at=None) -> list[tuple[str, int]]:
    """Train `linear`, up to the run `stop_at`; return the runs that were trained in this call."""
    trained = []

    def train_run(values, experiment, model, protocol, seed, target, report):
        target.mkdir(parents=True)
        if (protocol, seed) == stop_at:
            raise Stopped
        (target / "fit.json").write_text(f"{protocol} {seed} of call {len(trained)}")
        trained.append((protocol, seed))
        return 10.0 + seed

    try:
        runs.train_all(train_run, values, "touch", "linear")
    except Stopped:
        pass
    return trained


def result() -> dict[str, str]:
    folder = paths.model_folder("touch", "linear")
    return {path.parent.name: path.read_text() for path in sorted(folder.rglob("fit.json"))}


def test_a_stopped_training_goes_on_from_its_finished_runs(values):
    assert train(values, stop_at=("random_window", 0)) == RUNS[:2]
    assert result() == {"press-0": "earlier"}  # the earlier training stays until this one is whole
    assert train(values) == RUNS[2:]
    assert list(result()) == ["press-0", "press-1", "random_window-0"]
    times = paths.training_times("touch", "linear").read_text().splitlines()
    assert times == ["protocol,seed,train_s", "press,0,10.0", "press,1,11.0", "random_window,0,10.0"]
    assert not paths.model_draft("touch", "linear").exists()
    assert train(values) == RUNS  # a whole one is done again, when asked for


@pytest.mark.parametrize("change", ["settings", "data", "code"])
def test_finished_runs_of_other_settings_data_or_code_are_not_taken(values, change):
    train(values, stop_at=("random_window", 0))
    if change == "settings":
        values["touch"] = values["touch"] | {"models": values["touch"]["models"] | {"tree": {"changed": 1}}}
    elif change == "data":
        files.write_text(paths.dataset("touch"), "other data")
    else:
        (paths.ROOT / "pipeline" / "stages" / "train.py").write_text("second")
    assert train(values) == RUNS


def test_a_run_without_its_time_is_trained_again(values):
    train(values, stop_at=("random_window", 0))
    times = paths.model_draft("touch", "linear") / "times.csv"
    times.write_text("\n".join(times.read_text().splitlines()[:2]) + "\n")
    assert train(values) == RUNS[1:]


def test_a_wrong_model_leaves_the_trained_one(values):
    with pytest.raises(InputError, match="no model 'cubic'"):
        runs.train_all(lambda *arguments: 0.0, values, "touch", "cubic")

    def refuses(*arguments):
        raise InputError("a setting that does not go with the data")

    with pytest.raises(InputError, match="does not go with"):
        runs.train_all(refuses, values, "touch", "linear")
    assert result() == {"press-0": "earlier"}


def test_a_draft_that_links_elsewhere_is_not_removed(values, tmp_path):
    (tmp_path / "canary" / "important").mkdir(parents=True)
    draft = paths.model_draft("touch", "linear")
    draft.parent.mkdir(parents=True, exist_ok=True)
    draft.symlink_to(tmp_path / "canary")
    with pytest.raises(InputError, match="so it is not removed"):
        train(values)
    assert (tmp_path / "canary" / "important").is_dir()
