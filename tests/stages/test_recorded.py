"""Recorded data from their files to scores, times and stress: on files made up here, and on the real ones."""

import argparse
import json
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from builders import contact_frames, grasps, strain_workspaces
from builders.project import ROOT, leaves, run_stage
from opened.noted import Noted, ignore_bookkeeping

from pipeline.stages import agreement, latency, stress
from tactile import experiments
from tactile.base import params
from tactile.base.errors import InputError
from tactile.commands import predict
from tactile.inference import recordings as logs
from tactile.logs import sources
from tactile.sheet import sources as sheets
from tactile.stages import dataset, evaluate, ingest, train, window

# A model in closed form of each, which every processor fits to the same digits but the last (RBF-Net is none: of six
# k-means fits on another processor one ends 0.25 % off), and its protocols.
MODEL = {"velostat_recorded": "constant", "strain_recorded": "ridge", "glove_recorded": "naive_bayes"}
PROTOCOLS = {
    "velostat_recorded": ("repetition", "pike1_force_20"),
    "strain_recorded": ("within_day_xy", "across_days_xy", "new_places_xy"),
    "glove_recorded": ("grasp_pressure", "grasp_combined", "grasp_strain"),
    "array_recorded": ("fold_0", "two_too_1"),
}


def made_velostat(folder):
    """Two repetitions of ten presses of 1 s with each of two tips, on a taxel that reads 900 to 903 counts at rest."""
    devices = (("velostat_data", 143.0), ("futek_data", 250.0))
    runs = enumerate(product(("pike1_force_20", "pike5_force_20"), ("exp1", "exp2")))
    for (number, (tip, repetition)), (device, rate_hz) in product(runs, devices):
        t = np.arange(0, 20, 1 / rate_hz)
        force = 20 * np.maximum(0, np.sin(np.pi * t)) ** 2
        values = force if device == "futek_data" else 900 + number - 20 * force
        path = folder / device / tip / f"exp_{tip}_sensor1_{repetition}.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("".join(f"{v:.4f} {1.6e9 + s:.6f}\n" for v, s in zip(values, t, strict=True)))


def made_strain(folder):
    """60 presses on one day and 30 on the next, which has a channel more."""
    for name, channels, cycles in (("new_test/para5_long.mat", 6, 60), ("para5_long_n.mat", 7, 30)):
        strain_workspaces.save(folder, strain_workspaces.workspace(channels, cycles), name)


def made_glove(folder):
    """Six grasps of each of two objects."""
    for first in range(0, 1200, 100):
        content = grasps.xml(grasps.grasp(seed=first))
        condition = "ball" if first < 600 else "mug"
        grasps.save(folder, content, f"{condition}_{first:06d}-{first + 90:06d}.dsa", condition)


MADE = {"velostat_recorded": made_velostat, "strain_recorded": made_strain, "glove_recorded": made_glove}
MADE_ALL = MADE | {"array_recorded": contact_frames.sessions}  # of which no log is predicted


@pytest.fixture
def stages(workspace, monkeypatch):
    """`stages(experiment, folder, values, more)`: all up to the scores, and `more`, of one model in this process."""
    monkeypatch.setenv("WORKERS", "1")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")  # put back after `latency`

    def run(experiment, folder, values, more=()):
        monkeypatch.setattr(sources, "is_complete", lambda workspace, name: True)
        monkeypatch.setattr(sources, "folder", lambda workspace, name: folder)
        monkeypatch.setattr(params, "load", lambda _: values)
        windows = [window] if experiments.module(experiment).KIND == "windows" else []
        for module in [ingest, *windows, dataset, train, evaluate, *more]:
            run_stage(monkeypatch, workspace, module, experiment)

    return run


def check_blocks(experiment, table):
    """Blocks of a score under stress have, weighted by their counts, the score itself; other metrics have none."""
    facts = experiments.facts(experiment)
    main = table["metric"] == facts.metric
    assert main.any() and table[~main]["blocks"].isna().all()
    for row in table[main].itertuples():
        persons = [[pair.split(":") for pair in part.split()] for part in row.blocks.split("/")]
        loss, count = np.array([pair for part in persons for pair in part], float).T
        mean = np.sum(loss * count) / np.sum(count)
        assert (np.sqrt(mean) if facts.metric == "rmse" else mean) == pytest.approx(row.value, rel=5e-4), row
        assert count.sum() == row.n and 1 < len(count) <= 10, row
        assert (len(persons) == 2) == (facts.subject != ""), "a fold is tested on two persons"


def settings(experiment, model):
    """params.yaml with one model and the protocols of PROTOCOLS for one experiment."""
    values = params.load(ROOT / "params.yaml")
    block = values[experiment]
    block["models"] = {model: block["models"][model]}
    asked = {name: block["protocols"][name] for name in PROTOCOLS[experiment]}
    block["protocols"] = {name: each | {"seeds": each["seeds"] or [0]} for name, each in asked.items()}
    return values


@pytest.mark.parametrize("experiment", MADE_ALL)
def test_every_setting_of_recorded_data_is_read(workspace, experiment, stages, tmp_path, monkeypatch):
    """All stages on recordings that are made up here, with settings that note what is read of them."""
    values, read = settings(experiment, "constant"), set()
    values[experiment]["latency"] |= {"warm_up": 1, "calls": 2}
    values["stress"][experiment]["protocols"] = list(PROTOCOLS[experiment][:1])
    if experiment == "strain_recorded":
        values["stress"][experiment]["perturbations"]["time"] = [0.3, 0.6]  # minutes: these days are short
    MADE_ALL[experiment](tmp_path / "made")
    ignore_bookkeeping(monkeypatch.setattr)
    stages(experiment, tmp_path / "made", Noted(values, read), [latency, stress])
    check_blocks(experiment, pd.read_csv(workspace.stress(experiment), dtype={"condition": str}))
    run_stage(monkeypatch, workspace, stress, experiment, "look")
    scores = pd.read_csv(workspace.scores(experiment))
    assert set(scores["protocol"]) == set(PROTOCOLS[experiment]) and np.isfinite(scores["value"]).any()
    own = {name for name in leaves(values) if name.startswith((f"{experiment}.", f"stress.{experiment}."))}
    own -= {name for name in own if ".usable." in name}  # the report on stability reads these
    assert own and sorted(own - read) == []


RUN = {"velostat_recorded": "repetition", "strain_recorded": "across_days_xy", "glove_recorded": "grasp_pressure"}


def predicted(workspace, experiment, values, place, out) -> dict[str, dict]:
    """Predict recordings with the model of MODEL, and return their summaries by the name of the file."""
    protocol = RUN[experiment]
    name = f"{experiment}/{MODEL[experiment]}/{protocol}/{values[experiment]['protocols'][protocol]['seeds'][0]}"
    predict.main(workspace, argparse.Namespace(model=name, logs=place, out=out, no_pictures=True))
    found = json.loads((out / "summary.json").read_text())["recordings"]
    return {each["log"].rpartition("/")[2]: each for each in found}


def check_scores(workspace, experiment, values, found: dict[str, dict]):
    """Assert that recordings of the test part alone are scored, as the dataset says; return how many are, and not."""
    seed = values[experiment]["protocols"][RUN[experiment]]["seeds"][0]
    split = f"split_{RUN[experiment]}_{seed}"
    table = pd.read_parquet(workspace.dataset(experiment), columns=["recording", split])
    parts = {name: set(rows) - {"unused"} for name, rows in table.groupby("recording")[split]}
    for file, each in found.items():
        own = parts[Path(file).stem]
        reason = "trained on this recording" if "train" in own else "this recording is of the validation part"
        assert (each["scores"] is None) == (own != {"test"}) and each.get("not_scored", reason).startswith(reason)
        assert f"test part of `{RUN[experiment]}`, seed {seed}" == each["held_out_of"]
    return sum(each["scores"] is not None for each in found.values()), len(found)


def test_frames_that_are_no_stream_are_not_predicted_as_a_log(workspace, stages, tmp_path):
    values, folder = settings("array_recorded", "linear"), tmp_path / "made"
    contact_frames.sessions(folder)
    stages("array_recorded", folder, values)
    name = f"array_recorded/linear/{PROTOCOLS['array_recorded'][0]}/0"
    asked = argparse.Namespace(model=name, logs=folder / "P01", out=tmp_path / "out", no_pictures=True)
    with pytest.raises(InputError, match="2 of 2 logs|frames of array_recorded do not follow one another"):
        predict.main(workspace, asked)
    with pytest.raises(InputError, match="array_recorded: its frames do not follow one another.*no data sheet"):
        sheets.sensors("array_recorded", "array_recorded", folder, values["array_recorded"])


@pytest.mark.parametrize("experiment", MADE)
def test_predict_finds_recordings_and_scores_those_that_did_not_train(workspace, experiment, stages, tmp_path):
    values, folder = settings(experiment, MODEL[experiment]), tmp_path / "made"
    MADE[experiment](folder)
    stages(experiment, folder, values)
    found = predicted(workspace, experiment, values, folder, tmp_path / "out")
    if experiment == "velostat_recorded":  # whose files have one name in each folder, and both folders one in it
        assert {name.partition("_sensor")[2] for name in found} == {"1_exp1.txt", "1_exp2.txt"} and len(found) == 4
        (folder / "futek_data" / "pike1_force_20" / "exp_pike1_force_20_sensor1_exp2.txt").write_text("1 2\n")
        with pytest.raises(InputError, match="1 of 2 logs cannot be read"):
            predicted(workspace, experiment, values, folder / "velostat_data" / "pike1_force_20", tmp_path / "out")
        assert {name: bool(each["scores"]) for name, each in found.items() if "pike5" in name} == {
            "exp_pike5_force_20_sensor1_exp1.txt": False, "exp_pike5_force_20_sensor1_exp2.txt": True
        }  # fmt: skip
        return
    scored, of = check_scores(workspace, experiment, values, found)
    assert 0 < scored < of == {"strain_recorded": 2, "glove_recorded": 12}[experiment]
    one = next(path for path in logs.logs(folder, experiment) if found[path.name]["scores"])
    assert [*predicted(workspace, experiment, values, one, tmp_path / "out")] == [one.name]
    within = {each.name for each in logs.logs(one.parent, experiment)}
    assert within == {path.name for path in folder.rglob("*") if path.is_file() and path.is_relative_to(one.parent)}
    with pytest.raises(InputError, match=f"nothing in it is called and placed as recordings of {experiment} are"):
        (tmp_path / "empty").mkdir()
        logs.logs(tmp_path / "empty", experiment)


@pytest.mark.slow
@pytest.mark.parametrize("experiment", MADE)
def test_predict_finds_the_real_recordings(experiment, recordings):
    folder = recordings(experiment)
    found = logs.logs(folder, experiment)
    assert len(found) == {"velostat_recorded": 16, "strain_recorded": 2, "glove_recorded": 856}[experiment]
    assert len(set(logs.names(folder, found, experiment))) == len(found)


@pytest.mark.slow
@pytest.mark.parametrize("experiment", MADE)
def test_real_recordings_have_the_committed_scores(workspace, experiment, stages, recordings, tmp_path):
    folder, values = recordings(experiment), settings(experiment, MODEL[experiment])
    stages(experiment, folder, values)
    committed = pd.read_csv(ROOT / "evidence" / "look.csv")
    chosen = (committed["experiment"] == experiment) & (committed["model"] == MODEL[experiment])
    committed = committed[chosen & committed["protocol"].isin(PROTOCOLS[experiment])]
    both = committed.merge(
        pd.read_csv(workspace.scores(experiment)), on=agreement.KEY, how="outer", suffixes=("", "_here")
    )
    assert len(both) == len(committed) > 0
    assert both["value_here"].to_numpy() == pytest.approx(both["value"].to_numpy(), rel=1e-4, nan_ok=True)
    found = predicted(workspace, experiment, values, folder, tmp_path / "out")
    if experiment != "velostat_recorded":
        scored, of = check_scores(workspace, experiment, values, found)
        assert 0 < scored < of == len(logs.logs(folder, experiment))
