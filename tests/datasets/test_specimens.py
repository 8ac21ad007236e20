"""Specimens are told by the names of recordings; recorded ones are all of one."""

import numpy as np

from pipeline.datasets import specimens


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
