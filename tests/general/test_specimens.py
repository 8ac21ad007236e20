"""Specimens: told by the names of recordings, one for each seed, and never one trained on where another is meant."""

import numpy as np
import pytest
from builders.project import ROOT

from pipeline import scenes
from pipeline.results import shards
from pipeline.scenes import glove, glove_stress, strain, strain_stress, touch, touch_stress
from tactile.base import params
from tactile.base.params_file import set_values
from tactile.base.paths import Workspace
from tactile.datasets import specimens


def test_a_simulated_recording_says_which_specimen_it_is_of():
    assert specimens.number(specimens.named(12, "run003")) == 12
    assert [specimens.number(name) for name in ("run003", "specimen-1", "specimen4", "my-specimen2-a")] == [0] * 4


def test_a_seed_has_one_specimen_and_seeds_take_turns():
    names = np.array(["specimen0-a", "specimen1-a", "specimen1-b", "specimen2-a"])
    chosen = [np.flatnonzero(specimens.of_seed(names, seed)).tolist() for seed in range(4)]
    assert chosen == [[0], [1, 2], [3], [0]]


def test_recordings_without_a_specimen_are_every_seeds():
    assert specimens.of_seed(np.array(["run000", "monday"]), 5).all()
    assert specimens.of_seed(np.array([], dtype=str), 5).shape == (0,)


def test_a_specimen_has_chances_of_its_own():
    scene = {"seed": 7, "specimen": 3, "specimens": 4}
    assert specimens.drawn(scene, 2) == {"seed": 9, "specimen": 5, "specimens": 4}


SETS = {  # of the evidence, one of each simulated experiment -> its settings
    name: each.set | {f"{each.experiment}.protocols.{one}.seeds": list(range(each.seeds)) for one in each.protocols}
    for name, each in shards.read_sets(Workspace(ROOT)).items()
    if name in ("strain", "touch_random_window", "glove_frames_combined")
}
AMOUNTS = {"look": {}, **SETS}
SMALL = {
    "touch": {"single": {"points_per_side": 1, "depths": 1}, "double": {"recordings": 1, "presses_per_recording": 2}},
    "strain": {"samples": 50},
    "glove": {"sessions": 1, "frames_per_object": 2},
}


class Drawn(Exception):
    """The number of the specimen whose film or finger a scene was about to draw."""


def raising(number):
    def stop(*given, **named):
        raise Drawn(number(*given, **named))

    return stop


def specimen_of(call, *given) -> int:
    """The number of the specimen that a call which makes logs draws."""
    with pytest.raises(Drawn) as caught:
        call(*given)
    return caught.value.args[0]


@pytest.fixture(params=AMOUNTS)
def values(request, workspace, monkeypatch):
    """The settings with one of the amounts, the specimens of whose scenes are told and not simulated."""
    set_values(AMOUNTS[request.param], workspace.params)
    monkeypatch.setattr(touch, "logs_of", raising(lambda recording, scene, *others, **named: scene["specimen"]))
    monkeypatch.setattr(strain, "logs_of", raising(lambda recording, *others, **named: recording.specimen))
    monkeypatch.setattr(glove, "conductances", raising(lambda thing, hold, scene: scene["specimen"]))
    values = params.load(workspace.params)
    for name, sizes in SMALL.items():
        scene = values[name]["simulate"]
        merged = {key: scene[key] | own if isinstance(own, dict) else own for key, own in sizes.items()}
        values[name]["simulate"] = scene | merged
    return values


def number_of(experiment: str, recording) -> int:
    """The seed that a planned recording is of, by the rule that the splits follow."""
    if experiment == "strain":
        return int(recording.name.removeprefix("run"))
    return specimens.number(recording.name)


def seeds_of(values, experiment: str) -> list[int]:
    return sorted({seed for block in values[experiment]["protocols"].values() for seed in block["seeds"]})


@pytest.mark.parametrize("experiment", ["touch", "strain", "glove"])
def test_every_seed_has_a_specimen_of_its_own_for_training_and_for_demonstrations(values, experiment):
    recordings, logs_of = scenes.plan(experiment, values[experiment])
    drawn = {}
    for one in recordings:
        drawn.setdefault(number_of(experiment, one), {}).setdefault(one.condition, set()).add(specimen_of(logs_of, one))
    assert set(drawn) >= set(seeds_of(values, experiment)), "no two seeds take turns with one specimen"
    assert all(len(set.union(*by_condition.values())) == 1 for by_condition in drawn.values())
    numbers = [number for by_condition in drawn.values() for number in set.union(*by_condition.values())]
    assert len(set(numbers)) == len(numbers)
    assert len({frozenset(by_condition) for by_condition in drawn.values()}) == 1, "every seed has all conditions"


@pytest.mark.parametrize("experiment", ["touch", "strain", "glove"])
def test_a_stress_test_of_other_specimens_takes_none_that_was_trained_on(values, experiment):
    """Touch, glove: of any seed. Strain: not the own finger of the model, though that of another seed may know it."""
    settings, severities = values[experiment], values["stress"][experiment]["perturbations"]["specimen"]
    recordings, logs_of = scenes.plan(experiment, settings)
    trained = {number_of(experiment, one): specimen_of(logs_of, one) for one in recordings}
    stressed = {(seed, severity): other(settings, experiment, seed, severity) for seed in trained
                for severity in (0, *severities)}  # fmt: skip
    assert all(stressed[seed, 0] == trained[seed] for seed in trained), "severity 0 changes nothing"
    for (seed, severity), number in stressed.items():
        known = {trained[seed]} if experiment == "strain" else set(trained.values())
        assert severity == 0 or number not in known, (seed, severity, number)
        assert severity == 0 or number not in {stressed[seed, less] for less in severities if less < severity}


def other(settings, experiment: str, seed: int, severity: float) -> int:
    """The specimen that the stress test of other specimens draws for the model of a seed."""
    if experiment == "touch":
        recordings, logs_of = touch_stress.plan(settings, "double", "specimen", severity, seed)
        return specimen_of(logs_of, recordings[0])
    if experiment == "glove":
        session = specimens.named(seed, "session00")
        return specimen_of(glove_stress.session, settings, "can", session, "specimen", severity)
    return specimen_of(strain_stress.logs_of, strain_stress.changed(settings, "specimen", severity), "task_1", seed)
