"""The comparison of recordings with scenes: ranges over recordings, and what lies out of range is said."""

import numpy as np
import pandas as pd
import pytest

from pipeline import experiments
from pipeline.base import files
from pipeline.base.errors import InputError
from pipeline.reporting import studies, tables
from pipeline.stages import twins as twins_stage


def made(values: dict[tuple[str, str], list[float]], note: str = "") -> pd.DataFrame:
    """Return twins.csv; values: (statistic, source) -> one value per recording."""
    rows = [
        (statistic, "1", source, f"{source}{k}", value, f"What {statistic} is.", note)
        for (statistic, source), numbers in values.items()
        for k, value in enumerate(numbers)
    ]
    return pd.DataFrame(rows, columns=studies.TWINS)


def summarised(table: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of reports/twins.csv, of which there are none yet."""
    return studies.summarised("touch", table, pd.DataFrame(columns=["experiment"]))


LIKE = {("noise", "recorded"): [1.0, 2.0, 4.0], ("noise", "simulated"): [0.5, 3.0, 9.0]}
UNLIKE = {("loop", "recorded"): [1.0, 2.0], ("loop", "simulated"): [2.5, 2.6]}


def test_a_median_within_the_recorded_range_is_inside():
    table = summarised(made(LIKE | UNLIKE)).set_index("statistic")
    assert table.loc["noise", ["recorded", "recorded_low", "recorded_high"]].tolist() == [2.0, 1.0, 4.0]
    assert table.loc["noise", ["simulated", "simulated_low", "simulated_high"]].tolist() == [3.0, 0.5, 9.0]
    assert table["inside"].tolist() == [True, False]
    on_the_end = made({("loop", "recorded"): [1.0, 2.0], ("loop", "simulated"): [2.0]})
    assert summarised(on_the_end)["inside"].tolist() == [True]


def test_what_is_out_of_range_is_said_with_its_reason():
    rows = tables.twins(summarised(made(LIKE | UNLIKE, note="The film is thinner."))).rows
    assert {row[0]: (row[3], row[4], row[6]) for row in rows} == {
        "Noise": ("3 (0.5 to 9)", "yes", "-"),
        "Loop": ("2.55 (2.5 to 2.6)", "no", "The film is thinner."),
    }


def test_files_are_written_and_one_side_alone_is_no_comparison(workspace, undrawn, tmp_path):
    sides = {"touch": ("recorded", "simulated"), "strain": ("recorded",), "glove": ("simulated",)}
    for experiment in experiments.having("twin"):
        workspace.twins(experiment).parent.mkdir(parents=True)
        table = made({key: numbers for key, numbers in (LIKE | UNLIKE).items() if key[1] in sides[experiment]})
        table.to_csv(workspace.twins(experiment), index=False)
    target = tmp_path / "new"
    target.mkdir()
    summary = studies.twins(workspace, target, {})
    assert summary["experiment"].tolist() == [name for name in experiments.having("twin") for _ in range(2)]
    assert summary["inside"].notna().tolist() == [True, True, False, False, False, False]
    assert {path.name for path in target.iterdir()} == {"README.md", "touch.png"}
    text = (target / "README.md").read_text()
    assert (
        "The recordings were not fetched: there" in text and "The data are your own logs, not simulated: there" in text
    )
    workspace.twins("glove").unlink()
    with pytest.raises(InputError, match="python -m pipeline.stages.twins glove"):
        studies.twins(workspace, target, {})


def test_a_scene_that_needs_the_absent_recordings_stays_as_it_was(workspace, undrawn, tmp_path):
    for experiment in experiments.having("twin"):
        workspace.twins(experiment).parent.mkdir(parents=True)
        made(LIKE | UNLIKE, note="The film is thinner.").to_csv(workspace.twins(experiment), index=False)
    former = workspace.reports / "twins"
    former.mkdir(parents=True)
    files.write_table(former.with_suffix(".csv"), studies.twins(workspace, former, {}))
    made({}).to_csv(workspace.twins("touch"), index=False)
    target = tmp_path / "new"
    target.mkdir()
    files.write_table(target / "twins.csv", studies.twins(workspace, target, {}))
    assert (target / "twins.csv").read_bytes() == former.with_suffix(".csv").read_bytes()
    assert {path.name: path.read_bytes() for path in former.iterdir()} == {
        path.name: path.read_bytes() for path in target.iterdir() if path.name != "twins.csv"
    }


@pytest.mark.parametrize("absent", [True, False])
def test_recordings_that_are_absent_leave_the_scene(workspace, absent, monkeypatch):
    monkeypatch.setattr(twins_stage, "why_not_run", lambda *given: "not fetched" if absent else None)
    module = twins_stage.MODULES["strain"]
    rows = pd.DataFrame([("day", "noise", 1.0)], columns=["recording", "statistic", "value"])
    monkeypatch.setattr(module, "recorded", lambda *given: rows)
    monkeypatch.setattr(module, "simulated", lambda *given: rows.assign(value=2.0))
    monkeypatch.setattr(module, "STATISTICS", {"noise": ("mV", "Noise.")})
    table = twins_stage.statistics(workspace, {"strain": {"source": "simulated"}}, "strain")
    assert table["source"].tolist() == (["simulated"] if absent else ["recorded", "simulated"])
    assert np.isclose(table["value"].iloc[-1], 2.0) and table["unit"].eq("mV").all()
    assert twins_stage.statistics(workspace, {"strain": {"source": "logs/mine"}}, "strain").empty == absent
