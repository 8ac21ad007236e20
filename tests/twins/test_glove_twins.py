"""The statistics of grasps, of made-up grasps whose answer is known."""

import numpy as np
import pyarrow as pa
import pytest
from builders.project import ROOT

from pipeline.scenes import glove as scene
from pipeline.twins import glove
from tactile.base import params
from tactile.datasets import schemas
from tactile.experiments import glove as experiment

OBJECTS = [f"object{k:02d}" for k in range(glove.OBJECTS_PER_SET)]
GRASPS = 4


def made(pressure, joints=None):
    """Grasps of OBJECTS; pressure: (object, grasp, frame) -> (cells,)."""
    pairs = [(k, g) for k in range(len(OBJECTS)) for g in range(GRASPS)]
    values = np.array([[pressure(k, g, f) for f in range(glove.FRAMES)] for k, g in pairs], dtype=float)
    names = np.repeat(OBJECTS, GRASPS)
    joints = np.random.default_rng(0).normal(0, 5, (len(names), 2)) if joints is None else joints
    return glove.Grasps(names, values, joints, np.tile(np.arange(GRASPS) / 10, len(OBJECTS)))


def medians(data):
    return glove.statistics(data).groupby("statistic")["value"].median()


def cell(k, height=1.0):
    pattern = np.zeros(len(OBJECTS))
    pattern[k] = height
    return pattern


def test_objects_on_cells_of_their_own_are_all_alike_within_and_told_apart():
    found = medians(made(lambda k, g, f: cell(k)))
    assert found["active_cells"] == pytest.approx(1 / len(OBJECTS))
    assert found["alike_within"] == pytest.approx(1) and found["alike_others"] == pytest.approx(0)
    assert found["pressure_between"] == pytest.approx(1)
    assert found["tree_grasps"] == found["tree_frames"] == 1
    assert found["rank"] == pytest.approx((len(OBJECTS) - 1) / len(OBJECTS))
    assert found["load_spread"] == found["load_wander"] == 0
    assert found["shift"] == pytest.approx(np.std(np.arange(GRASPS) / 10, ddof=1))


def test_a_load_that_differs_between_grasps_is_no_change_of_pattern():
    found = medians(made(lambda k, g, f: cell(k, 1 + g)))
    assert found["load_spread"] == pytest.approx(np.std([1, 2, 3, 4], ddof=1) / 2.5)
    assert found["load_wander"] == 0 and found["alike_within"] == pytest.approx(1)


def test_a_load_that_wanders_is_judged_over_the_last_half_second():
    found = medians(made(lambda k, g, f: cell(k, 1 + 0.1 * (f % 2) if f >= glove.FRAMES - glove.HELD else 9)))
    end = 1 + 0.1 * (np.arange(glove.FRAMES - glove.HELD, glove.FRAMES) % 2)
    assert found["load_wander"] == pytest.approx(end.std(ddof=1) / end.mean())


def test_objects_that_do_not_differ_cannot_be_told_apart_on_new_grasps():
    rng = np.random.default_rng(0)
    patterns = rng.random((len(OBJECTS), GRASPS, 30))
    found = medians(made(lambda k, g, f: patterns[k, g]))
    assert found["alike_others"] == pytest.approx(1, abs=0.02)
    assert found["pressure_between"] == pytest.approx(0.25, abs=0.05)  # means of 4 grasps each: chance
    assert found["tree_grasps"] < 0.3 and found["tree_frames"] > 0.9  # a frame's neighbours give its grasp away
    assert found["held_share"] == pytest.approx(0)


def test_joint_angles_are_judged_within_and_between_objects():
    names = np.repeat(np.arange(len(OBJECTS)), GRASPS)
    within = np.tile([-1.5, -0.5, 0.5, 1.5], len(OBJECTS))
    found = medians(made(lambda k, g, f: cell(k), np.column_stack([10.0 * names + within, 0 * names])))
    assert set(found.index) == set(glove.STATISTICS)
    assert found["joint_spread"] == pytest.approx(np.std([-1.5, -0.5, 0.5, 1.5], ddof=1))  # the still joint is left out
    between = np.var(10.0 * np.arange(len(OBJECTS)))
    assert found["joint_between"] == pytest.approx(between / (between + within.var()), rel=1e-3)


def test_the_scene_gives_back_its_own_misfit(workspace, monkeypatch):
    """With nothing but the misfit of the glove on, the spread of a joint between grasps is that misfit."""
    values = params.load(ROOT / "params.yaml")
    block = values["glove"]["simulate"] | {"sessions": 40, "frames_per_object": 400}
    effects = dict.fromkeys(block["effects"], False) | {"session": True}
    block |= {"effects": effects, "session": block["session"] | {"wander": 0.0}}
    settings = values["glove"] | {"simulate": block}
    rows = []
    full = scene.scene_of(settings)
    for name in ("can", "book"):
        for number in range(40):
            hold = scene.held(10, full, np.random.default_rng(number))
            counts = scene.scanned(scene.conductances(scene.OBJECTS[name], hold, full), full, None)
            rows += [(name, f"session{number:02d}", 0.1 * k, line) for k, line in enumerate(counts)]
    cells = np.array([line for *_, line in rows])
    columns = {
        "condition": [row[0] for row in rows],
        "recording": [row[1] for row in rows],
        "segment": np.zeros(len(rows), np.int16),
        "t_s": [row[2] for row in rows],
        "gap_before": np.zeros(len(rows), bool),
        "pressure": schemas.lists(cells[:, : experiment.PRESSURE_CELLS], pa.int16()),
        "strain": schemas.lists(cells[:, experiment.PRESSURE_CELLS :], pa.int16()),
    }
    table = pa.table(columns).cast(experiment.frames_schema({"sensor": {}}))
    monkeypatch.setattr(glove.paths, "require", lambda path, made_by: path)
    monkeypatch.setattr(glove.schemas, "read", lambda path: table)
    monkeypatch.setattr(glove, "of_set", lambda data, seed: iter(()))
    found = glove.simulated(workspace, values | {"glove": settings})
    spread = found[found["statistic"] == "joint_spread"].set_index("recording")["value"]
    assert spread["can"] == pytest.approx(block["session"]["fit_deg"], rel=0.15)
