"""Calibrating a scene: the ratio of two models' errors on the validation part, and which value comes nearest."""

import argparse

import numpy as np
import pytest
from builders.project import miniature_settings

from pipeline.results import published
from pipeline.stability import changed_scene
from tactile.base import params, workers
from tactile.base.errors import InputError
from tactile.datasets import series
from tools import calibrate


@pytest.fixture
def values(workspace):
    """params.yaml at the scale of the miniature."""
    return miniature_settings(workspace)


def serial(function, tasks, bar):
    """Run what workers.run runs, in this process."""
    return [(key, function(*arguments, lambda: None)) for key, arguments in tasks.items()]


@pytest.fixture
def made_scores(monkeypatch):
    """Let the error of the yardstick's model be the knob, and the other one's error 2; return what was asked for."""
    asked_for = []

    def scores(workspace, experiment, settings, asked, seed, device):
        asked_for.append(asked)
        chosen = next(
            each for key, each in settings.items() if "yardstick" in key and each["protocol"] in asked.protocols
        )
        value = settings
        for key in chosen["knob"].split("."):
            value = value[key]
        for model, error in zip(asked.scored, (value, 2.0), strict=True):
            right = 1 - error if chosen["metric"] == "macro_precision" else error
            yield "another", model, [(chosen["metric"], "", 99.0, 1)]
            yield chosen["condition"], model, [(chosen["metric"], "", right, 1)]

    monkeypatch.setattr(changed_scene, "write_dataset", lambda *arguments: None)
    monkeypatch.setattr(changed_scene, "scores", scores)
    monkeypatch.setattr(workers, "run", serial)
    return asked_for


def asked(experiment: str, tried: list[float], seeds: list[int], yardstick: str = "yardstick") -> argparse.Namespace:
    """Return what the command was called with."""
    return argparse.Namespace(experiment=experiment, values=tried, seeds=seeds, set=None, yardstick=yardstick)


@pytest.mark.parametrize(
    ("experiment", "yardstick"),
    [("touch", "yardstick"), ("strain", "yardstick"), ("strain", "yardstick_task_2"), ("glove", "yardstick")],
)
def test_the_nearest_value_is_named_and_the_test_part_is_not_read(
    workspace, experiment, yardstick, values, made_scores, monkeypatch, capsys
):
    values[experiment][yardstick]["published"] = 0.15
    monkeypatch.setattr(params, "load", lambda _: values)
    calibrate.main(workspace, asked(experiment, [0.1, 0.32, 0.5], [0, 1], yardstick))
    lines = capsys.readouterr().out.splitlines()
    assert lines[-1].startswith(f"nearest: {values[experiment][yardstick]['knob']} = 0.32, ratio 0.160")
    assert len(lines) == 1 + 3 * 2 + 1
    assert {asked.part for asked in made_scores} == {"test" if experiment == "strain" else "validation"}


def test_the_validation_part_of_a_series_is_kept_from_training_and_the_test_part_is_left_out(values):
    settings = values["strain"]
    shorter = calibrate.held_out(settings)
    before, after = settings["simulate"]["samples"], shorter["simulate"]["samples"]
    parts = [
        series.chronological(n, *(block["split"][k] for k in ("train", "validation")))
        for n, block in ((before, settings), (after, shorter))
    ]
    assert after == np.flatnonzero(parts[0] == "test")[0], "the recording ends where the test part began"
    assert np.flatnonzero(parts[1] == "test")[0] == np.flatnonzero(parts[0] == "validation")[0]


def test_a_knob_that_is_not_there_is_named(workspace, values, monkeypatch):
    values["glove"]["yardstick"]["knob"] = "simulate.session.wonder"
    monkeypatch.setattr(params, "load", lambda _: values)
    with pytest.raises(InputError, match="glove.yardstick.knob: there is no key 'simulate.session.wonder'"):
        calibrate.main(workspace, asked("glove", [], [0]))


def test_a_yardstick_that_is_not_there_is_named(workspace, values, monkeypatch):
    monkeypatch.setattr(params, "load", lambda _: values)
    with pytest.raises(
        InputError, match="--yardstick task_2: strain in .*strain.yaml has yardstick and yardstick_task_2"
    ):
        calibrate.main(workspace, asked("strain", [], [0], "task_2"))


def test_the_ratios_of_strain_are_those_of_the_paper_over_a_place_that_is_uniform(values):
    motion = values["strain"]["simulate"]["motion"]
    across = [(np.arange(400) + 0.5) / 400 - 0.5]
    x, y, z = (np.outer(motion[f"{name}_mm"], across)[0] for name in ("width", "height", "depth"))
    for key, constant in (("yardstick", np.abs(z).mean()), ("yardstick_task_2", np.hypot(x[:, None], y).mean())):
        chosen = values["strain"][key]
        printed = published.score("strain", chosen["model"], chosen["protocol"], chosen["metric"])
        assert chosen["published"] == pytest.approx(printed / constant, abs=5e-4)


def test_recorded_data_cannot_be_calibrated(workspace, values, monkeypatch):
    values["touch"]["source"] = "logs/mine"
    monkeypatch.setattr(params, "load", lambda _: values)
    with pytest.raises(InputError, match="only a simulated scene"):
        calibrate.main(workspace, asked("touch", [], [0]))


@pytest.mark.slow
def test_a_scene_is_simulated_and_both_models_are_trained(values):
    chosen = values["glove"]["yardstick"]
    assert {chosen["model"], chosen["over"]} <= set(values["glove"]["models"])
    ours, others = calibrate.ratio(values, "glove", "yardstick", 0.5, 0, lambda: None)
    assert 0 <= ours <= 1 and 0 <= others <= 1
