"""What claims need beside scores: derived from frames, labels and predictions, on made data of known answers."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from builders.project import ROOT

from pipeline.results import claim_inputs, glove_results
from tactile.base import params
from tactile.datasets import labels, schemas

TOUCH = params.load(ROOT / "params.yaml")["touch"]
ROWS, COLS = TOUCH["label"]["map_rows"], TOUCH["label"]["map_cols"]


def windows(condition: list[str], force: np.ndarray, truth: np.ndarray) -> pa.Table:
    """A dataset of windows; force: (n, 1) in N; truth: (n, cells) in kPa."""
    return pa.table(
        {
            "condition": pa.array(condition).dictionary_encode(),
            "force_n": schemas.lists(force.astype(np.float32), pa.float32()),
            "y": schemas.lists(truth.astype(np.float32), pa.float32()),
        }
    )


def test_pressure_is_high_above_200_kpa_on_single_touches_of_the_test_part():
    kpa = np.array([199.0, 201.0, 300.0, 300.0, 300.0])
    condition, tested = ["single"] * 4 + ["double"], np.array([True, True, True, False, True])
    force = (kpa / labels.pressure_kpa(np.ones(1), TOUCH["label"]["tip_radius_mm"]))[:, None]
    off = np.array([1000.0, 20.0, 40.0, 1000.0, 1000.0])  # of the rows that count 30 on average
    maps = np.zeros((len(kpa), ROWS * COLS), np.float32)
    maps[:, 7] = kpa - off * [1, 1, -1, 1, 1]
    table = windows(condition, force, maps)
    found = claim_inputs.high_pressure_error(TOUCH, table, maps, tested)
    assert found["n"] == 2 and found["value"] == pytest.approx(30.0, abs=1e-3)
    failed = claim_inputs.high_pressure_error(TOUCH, table, np.full_like(maps, np.nan), tested)
    assert failed["n"] == 2 and np.isnan(failed["value"])


def test_a_map_of_the_tape_is_tilted_to_the_side_with_more_pressure():
    maps = np.zeros((3, ROWS, COLS), np.float32)
    maps[:, 0, 0], maps[:, 0, -1] = [30.0, 10.0, 5.0], [10.0, 30.0, 0.0]
    maps[:, 1, 1] = -50.0  # what is below nothing does not count
    table = windows(["tape", "single", "tape"], np.ones((3, 1)), np.full((3, ROWS * COLS), 100.0))
    found = claim_inputs.left_right_tilt(TOUCH, table, maps.reshape(3, -1), np.array([True, True, False]))
    assert found["value"] == pytest.approx(0.5) and found["n"] == 1


@pytest.mark.parametrize("loss", [100, 0, -100])
def test_press_off_the_centre_shifts_the_curve(workspace, loss):
    rng, n = np.random.default_rng(0), 4000
    x, y = rng.uniform(0, 60, n), rng.uniform(0, 60, n)
    away = np.maximum(np.abs(x % 12 - 6), np.abs(y % 12 - 6))
    counts = np.zeros((n, 25), dtype=np.int16)
    counts[np.arange(n), (y // 12).astype(int) * 5 + (x // 12).astype(int)] = 500 - loss * (away > 3)
    columns = {"condition": pa.array(["single"] * n).dictionary_encode(), "v": schemas.lists(counts, pa.int16())}
    for name, values in (("force_n", rng.uniform(5, 25, n)), ("x_mm", x), ("y_mm", y)):
        columns[name] = schemas.lists(values[:, None].astype(np.float32), pa.float32())
    table = pa.table(columns)
    schemas.write(workspace.frames("touch"), table.schema, [table])
    found = claim_inputs.press_shift(workspace, TOUCH)
    assert len(found) == 25 and found.to_numpy() == pytest.approx(loss)


def test_strands_that_move_together_are_correlated():
    rng, n = np.random.default_rng(0), 2000
    together = np.repeat(rng.normal(0, 1, (n, 1)), 3, axis=1) * [1.0, -1.0, 2.0]
    names = pa.array(["task_1"] * n + ["task_2"] * n).dictionary_encode()
    fingers = pa.array([f"run00{k % 4}" for k in range(2 * n)]).dictionary_encode()
    voltage = np.concatenate([together, rng.normal(0, 1, (n, 3))]).astype(np.float32)
    table = pa.table({"condition": names, "recording": fingers, "v": schemas.lists(voltage, pa.float32())})
    assert list(claim_inputs.strand_correlations(table, "task_1").values()) == pytest.approx([1.0] * 4)
    assert max(claim_inputs.strand_correlations(table, "task_2").values()) < 0.1


def test_pairs_of_objects_have_a_share(workspace, monkeypatch):
    objects = ["bottle", "can", "toy"]
    counts = np.array([[[8, 2, 0], [0, 10, 0], [1, 0, 9]], [[7, 3, 0], [1, 9, 0], [0, 0, 10]]])
    monkeypatch.setattr(glove_results, "read_confusions", lambda *given: {"pressure": counts})
    monkeypatch.setattr(claim_inputs, "classes", lambda table: objects)
    settings = {"protocols": {"session_pressure": {"seeds": [0, 1]}}}
    rows = pd.DataFrame(claim_inputs.confusions(workspace, settings, None, {"pressure": "session_pressure"}))
    share = rows[rows["metric"] == "confusion"].pivot(index="variant", columns="seed", values="value")
    assert list(share.loc["bottle_and_can"]) == pytest.approx([0.1, 0.2])
    assert list(share.loc["mean_pair"]) == pytest.approx([0.15 / 3, 0.2 / 3])
    monkeypatch.setattr(glove_results, "read_confusions", lambda *given: {"pressure": counts[:1]})
    assert (
        list(claim_inputs.confusions(workspace, settings, None, {"pressure": "session_pressure"})) == []
    )  # a run failed


def test_of_several_input_frames_the_form_that_is_judged_has_rows():
    table = pd.DataFrame(
        [(form, "sp_resnet", 0, frames, "accuracy", 0.1 * frames) for form in ("trained", "mean") for frames in (1, 2)],
        columns=["form", "model", "seed", "frames", "metric", "value"],
    )
    rows = list(claim_inputs.by_frames(table))
    assert [row["variant"] for row in rows] == ["frames_1", "frames_2"] and rows[1]["value"] == pytest.approx(0.2)
    assert list(claim_inputs.by_frames(table.iloc[:0])) == []
