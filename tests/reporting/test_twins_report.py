"""The comparison of recordings with scenes: ranges over recordings, and what lies out of range is said."""

import numpy as np
import pandas as pd
import pytest

from pipeline.reporting import studies, tables
from pipeline.stages import twins as twins_stage
from tactile import experiments
from tactile.base import files
from tactile.base.errors import InputError


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
    sides = {"touch": ("recorded", "simulated"), "array_recorded": ("recorded",), "strain": ("recorded",)}
    sides["glove"] = ("simulated",)
    for experiment in experiments.having("twin"):
        workspace.twins(experiment).parent.mkdir(parents=True)
        table = made({key: numbers for key, numbers in (LIKE | UNLIKE).items() if key[1] in sides[experiment]})
        table.to_csv(workspace.twins(experiment), index=False)
    target = tmp_path / "new"
    target.mkdir()
    summary = studies.twins(workspace, target, {})
    assert summary["experiment"].tolist() == [name for name in experiments.having("twin") for _ in range(2)]
    assert summary["inside"].notna().tolist() == [True] * 2 + [False] * 6
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


@pytest.mark.parametrize("source", ["simulated", "logs/mine"])
def test_recordings_beside_the_scene_of_another_experiment_ask_for_that_scene(workspace, source, monkeypatch):
    monkeypatch.setattr(twins_stage, "why_not_run", lambda *given: None)
    module = twins_stage.MODULES["array_recorded"]
    rows = pd.DataFrame([("P01", "noise", 1.0)], columns=["recording", "statistic", "value"])
    monkeypatch.setattr(module, "recorded", lambda *given: rows)
    monkeypatch.setattr(module, "simulated", lambda *given: rows)
    table = twins_stage.statistics(workspace, {"touch": {"source": source}}, "array_recorded")
    assert table["source"].tolist() == ["recorded", "simulated"][: 2 if source == "simulated" else 1]


def test_words_on_a_comparison_have_its_numbers():
    said = "Loops read {loop[simulated]:.2f} (recorded {loop[recorded_low]:.0f} to {loop[recorded_high]:.0f})."
    assert studies.told(said, summarised(made(LIKE | UNLIKE))) == "Loops read 2.55 (recorded 1 to 2)."
    assert studies.told("Alike.", summarised(made(LIKE))) == "Alike."


@pytest.mark.parametrize("known", [LIKE, LIKE | {("loop", "recorded"): [1.0]}, LIKE | {("loop", "simulated"): [1.0]}])
def test_words_with_a_number_that_is_not_known_are_not_said(known):
    assert studies.told("{noise[simulated]:.1f} and {loop[recorded]:.1f}", summarised(made(known))) == ""


def test_the_words_stand_below_the_table_of_their_comparison(workspace, undrawn, tmp_path):
    names = ["in_column", "along_line", "crossing", "beside", "gain_spread", "two_over_one", "in_row"]
    for experiment in experiments.having("twin"):
        workspace.twins(experiment).parent.mkdir(parents=True)
        values = {(name, "recorded"): [0.25, 0.75] for name in names} | {(name, "simulated"): [-0.5] for name in names}
        made(values).to_csv(workspace.twins(experiment), index=False)
    studies.twins(workspace, tmp_path, {})
    parts = (tmp_path / "README.md").read_text().split("\n## ")
    (part,) = (part for part in parts if part.startswith("Touch: the recorded capacitive array"))
    assert "one of two tips of a column differs by -0.50 in log" in part and "by 0.25 to 0.75 in log" in part
    assert part.rindex("| ---") < part.index("**What it lacks.**") and part.endswith(".\n")
    assert sum("**What it lacks.**" in other for other in parts) == 1
