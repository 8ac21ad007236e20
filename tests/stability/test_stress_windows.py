"""Stress of trained models: perturbed scenes are the known ones with one thing changed, clean scores come back."""

import json
import sys

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT, run_stage

from pipeline.scenes import touch, touch_stress
from pipeline.stability import windows as stress_windows
from pipeline.stages import simulate, stress
from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.base.stress_tests import REGISTERED, planned
from tactile.datasets import schemas
from tactile.datasets.seeding import generator
from tactile.stages import dataset, evaluate, ingest, train, window
from tactile.tasks import windows

PERTURBATIONS = {"noise": [0.01, 0.03], "dead": [2], "specimen": [1], "press_speed": [-1], "touches": [1, 2]}


def small() -> dict:
    """params.yaml with two models on a few presses."""
    values = params.load(ROOT / "params.yaml")
    block = values["touch"]
    block["simulate"]["single"] = {"points_per_side": 5, "depths": 2, "repetitions": 1, "presses_per_recording": 50}
    block["simulate"]["double"] = {"recordings": 2, "presses_per_recording": 10}
    block["simulate"]["specimens"] = 2
    block["protocols"] = {"press": {"seeds": [0, 1]}}
    block["models"] = {"constant": {}, "linear": {}}
    values["stress"]["touch"] = {"protocols": ["press"], "perturbations": PERTURBATIONS}
    return values


@pytest.fixture(scope="module")
def workspace(tmp_path_factory) -> Workspace:
    return Workspace(tmp_path_factory.mktemp("touch"))


@pytest.fixture(scope="module")
def trained(workspace):
    """A workspace in which `touch` was simulated, trained and evaluated."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(params, "load", small_loader(small()))
        patch.setenv("WORKERS", "1")
        for stage in (simulate, ingest, window, dataset, train, evaluate):
            run_stage(patch, workspace, stage, "touch")
    return workspace


def small_loader(values: dict):
    text = json.dumps(values)
    return lambda _: json.loads(text)


@pytest.fixture
def project(trained, monkeypatch):
    """`project(values)` makes these the settings of the trained workspace."""

    def use(values: dict) -> None:
        monkeypatch.setattr(params, "load", small_loader(values))
        monkeypatch.setenv("WORKERS", "1")
        monkeypatch.setattr(sys, "argv", ["stress", "touch"])

    return use


@pytest.fixture(scope="module")
def stressed(trained) -> pd.DataFrame:
    """stress.csv of the trained workspace."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(params, "load", small_loader(small()))
        patch.setenv("WORKERS", "1")
        run_stage(patch, trained, stress, "touch")
    assert not trained.stress_scenes("touch").exists()
    return pd.read_csv(trained.stress("touch"))


@pytest.mark.slow
def test_clean_scores_are_those_of_evaluate_and_every_severity_has_its_rows(workspace, stressed):
    found, scores = stressed, pd.read_csv(workspace.scores("touch"))
    assert tuple(found.columns) == stress.COLUMNS
    key = ["protocol", "condition", "model", "seed", "metric"]
    clean = found[(found.severity == 0) & found.condition.isin(["single", "double"])]
    both = clean.merge(scores, on=key, suffixes=("", "_before"))
    assert len(both) == len(clean) > 0 and (both.value.fillna(-1) == both.value_before.fillna(-1)).all()
    rmse = found[found.metric == "rmse"]
    levels = {
        (name, condition): tuple(own.severity.unique())
        for (name, condition), own in rmse.groupby(["perturbation", "condition"])
    }
    assert levels == {
        ("noise", "single"): (0, 0.01, 0.03),
        ("noise", "double"): (0, 0.01, 0.03),
        ("dead", "single"): (0, 2),
        ("dead", "double"): (0, 2),
        ("specimen", "double"): (0, 1),
        ("specimen", "single_anew"): (0, 1),
        ("press_speed", "double"): (0, -1),
        ("press_speed", "single_anew"): (0, -1),
        ("touches", "several"): (1, 2),
    }
    assert (rmse.groupby(["perturbation", "condition", "severity"]).size() == 4).all()  # 2 models, 2 seeds
    linear = rmse[(rmse.model == "linear") & (rmse.condition == "single") & (rmse.perturbation == "noise")]
    assert (np.diff(linear.pivot(index="severity", columns="seed", values="value"), axis=0) > 0).all()


@pytest.mark.slow
def test_of_many_recordings_the_first_are_perturbed(workspace, stressed, project):
    """One of two recordings of double touches: half the windows, and severity 0 is the score of that half."""
    values, whole = small(), stressed
    values["stress"]["touch"]["recordings"] = {"double": 1}
    project(values)
    stress.main(workspace)
    part = pd.read_csv(workspace.stress("touch"))
    key = [column for column in part.columns if column not in ("value", "n")]
    both = whole.merge(part, on=key, suffixes=("", "_of_part"))
    assert len(both) == len(whole) == len(part)
    single = both[both.condition == "single"]
    assert (single.n == single.n_of_part).all() and len(single)
    clean = single[single.severity == 0]  # where windows are fewer, noise is another
    np.testing.assert_allclose(clean.value, clean.value_of_part)
    rmse = both[(both.condition == "double") & (both.metric == "rmse")]
    assert (rmse.n_of_part / rmse.n).between(0.4, 0.6).all()
    assert (rmse.value != rmse.value_of_part).all()
    clean = part[(part.condition == "double") & (part.severity == 0)]
    assert (clean.groupby(["model", "seed", "metric"]).value.nunique(dropna=False) == 1).all()


@pytest.mark.slow
def test_other_clean_scores_than_those_of_evaluate_are_refused(workspace, project):
    project(small())
    file = workspace.scores("touch")
    before = file.read_text()
    scores = pd.read_csv(file)
    scores.loc[(scores.model == "linear") & (scores.metric == "rmse"), "value"] *= 1.01
    scores.to_csv(file, index=False)
    try:
        with pytest.raises(
            InputError, match="linear, press, seed 0 has rmse .* run `python -m tactile.stages.evaluate"
        ):
            stress.main(workspace)
    finally:
        file.write_text(before)


@pytest.mark.slow
def test_a_run_that_failed_in_training_has_no_value(workspace, project):
    project(small())
    fit = workspace.run_folder("touch", "constant", "press", 1) / "fit.json"
    files = {file: file.read_text() for file in (fit, workspace.scores("touch"))}
    fit.write_text(json.dumps(json.loads(files[fit]) | {"best_epoch": 0}))
    scores = pd.read_csv(workspace.scores("touch"))
    scores.loc[(scores.model == "constant") & (scores.seed == 1), "value"] = np.nan
    scores.to_csv(workspace.scores("touch"), index=False)
    try:
        stress.main(workspace)
    finally:
        for file, text in files.items():
            file.write_text(text)
    rmse = pd.read_csv(workspace.stress("touch")).query("metric == 'rmse' and model == 'constant'")
    assert rmse[rmse.seed == 1].value.isna().all() and rmse[rmse.seed == 0].value.notna().all()


@pytest.mark.slow
def test_recordings_that_are_absent_leave_a_header(workspace, project, monkeypatch):
    project(small())
    monkeypatch.setattr(sys, "argv", ["stress", "velostat_recorded"])
    workspace.ingest_report("velostat_recorded").parent.mkdir(exist_ok=True)
    workspace.ingest_report("velostat_recorded").write_text('{"run": false, "reason": "no recordings"}')
    stress.main(workspace)
    assert workspace.stress("velostat_recorded").read_text() == ",".join(stress.COLUMNS) + "\n"


def test_own_logs_have_no_scene_to_perturb():
    values = small()

    def cases():
        return stress_windows.scene_cases(values, "touch", planned(values, "touch", "windows"))

    assert len(cases()) == 14  # of each of two arrays 2 x 2 variations, 2 layouts, the single touches
    assert sorted(case.specimen for case in cases()) == [0] * 7 + [1] * 7
    values["touch"]["source"] = "data/own"
    assert cases() == []


@pytest.mark.slow
def test_perturbed_counts_stay_what_the_adc_can_print(workspace, project):
    project(small())
    values = small()
    data = windows.read(workspace.dataset("touch"), values["touch"])
    train_part = data.part("press", 0) == "train"
    levels = stress_windows.Levels.seen(values["touch"], data, train_part)

    def change(x, name, severity, rng):
        return levels.changed(x, REGISTERED["windows"][name], severity, rng)

    for name, severity in (("noise", 0.5), ("gain_drift", 2.0), ("offset_drift", 0.5), ("jitter", 1.0)):
        x = change(data.x[:50], name, severity, generator(0, name))
        assert x.min() >= 0 and x.max() <= 1023 and np.array_equal(x, np.rint(x)), name
    untouched = np.nansum(schemas.matrix(data.rows["force_n"]), axis=1) < 0.5
    rest = np.median(data.x[train_part & untouched], axis=(0, 1))
    still = np.broadcast_to(rest, (3, 8, 25)).astype(np.float32)
    assert np.array_equal(change(still, "gain_drift", 1.0, generator(0, "g")), np.rint(still))  # no response, no change


@pytest.fixture
def settings():
    return small()["touch"]


def first(settings, condition, perturbation, severity, specimen=0):
    recordings, logs_of = touch_stress.plan(settings, condition, perturbation, severity, specimen)
    return recordings[0], logs_of(recordings[0])


@pytest.mark.parametrize("specimen", [0, 1])
def test_unchanged_double_recordings_are_the_experiments_own(settings, specimen):
    recordings, logs_of = touch.plan(settings)
    of_double = [recording for recording in recordings if recording.condition == "double"]
    double = [recording for recording in of_double if recording.name.endswith("run000")]
    assert [recording.name for recording in double] == ["specimen0-run000", "specimen1-run000"]
    for perturbation in ("peak_pressure", "press_speed", "tip_radius", "specimen"):
        assert first(settings, "double", perturbation, 0, specimen)[1] == logs_of(double[specimen])
    assert logs_of(double[0])["array.log"] != logs_of(double[1])["array.log"]


@pytest.mark.parametrize("condition", ["double", "single_anew"])
def test_one_thing_changes_at_a_time(settings, condition):
    plain, logs = first(settings, condition, "unchanged", 0)
    assert len(plain.touches) == (2 if condition == "double" else 1)
    harder, _ = first(settings, condition, "peak_pressure", 0.5)
    np.testing.assert_allclose(harder.touches[0].force_n, 1.5 * plain.touches[0].force_n)
    assert np.array_equal(harder.touches[0].x_mm, plain.touches[0].x_mm)

    slower, _ = first(settings, condition, "press_speed", -1)
    pressed, before = ((one.touches[-1].force_n > 0).sum() for one in (slower, plain))
    assert pressed == pytest.approx(2 * before, rel=0.1)
    assert slower.touches[0].force_n.max() == pytest.approx(plain.touches[0].force_n.max())
    trembles = 0.06 if condition == "double" else 1e-6  # a hand that holds longer trembles otherwise
    assert slower.touches[-1].force_n.max() == pytest.approx(plain.touches[-1].force_n.max(), rel=trembles)

    blunter, _ = first(settings, condition, "tip_radius", 5)
    np.testing.assert_allclose(blunter.touches[0].force_n, 4 * plain.touches[0].force_n)  # same pressure
    assert touch_stress.changed(settings, "tip_radius", 5).settings["label"]["tip_radius_mm"] == 10

    other, other_logs = first(settings, condition, "specimen", 1)
    assert np.array_equal(other.touches[0].force_n, plain.touches[0].force_n)
    assert other_logs["array.log"][0] != logs["array.log"][0]


def test_more_touches_are_the_same_touches_and_others(settings):
    places, kpa = touch_stress.places(settings, 5)
    fewer, softer = touch_stress.places(settings, 2)
    assert np.array_equal(places[:, :2], fewer) and np.array_equal(kpa[:, :2], softer)
    elements = np.floor(places / settings["sensor"]["pitch_mm"])
    apart = np.abs(elements[:, :, None] - elements[:, None]).max(axis=-1)
    assert (apart[:, ~np.eye(5, dtype=bool)] >= 2).all() and places.min() > 0 and places.max() < 60
    recording, _ = first(settings, "several", "touches", 3)
    assert len(recording.touches) == 3


@pytest.mark.parametrize("distance", [12, 48])
def test_two_touches_are_as_far_apart_as_asked(settings, distance):
    places, _ = touch_stress.pairs(settings, distance)
    assert np.allclose(np.linalg.norm(places[:, 1] - places[:, 0], axis=1), distance)
    assert places.min() >= 6 and places.max() <= 54


@pytest.mark.parametrize(
    ("perturbation", "severity", "sentence"),
    [
        ("touches", 6, "whole number from 1 to 5"),
        ("touches", 1.5, "whole number"),
        ("distance", 60, "at most 48 mm"),
        ("tip_radius", -5, "leaves no tip"),
    ],
)
def test_impossible_scenes_are_refused(settings, perturbation, severity, sentence):
    with pytest.raises(InputError, match=sentence):
        touch_stress.plan(settings, "several", perturbation, severity, 0)
