"""The comparison of recordings with scenes: ranges over recordings, and what lies out of range is said."""

import numpy as np
import pandas as pd
import pytest

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.reporting import twins
from pipeline.stages import twins as twins_stage


def made(values: dict[tuple[str, str], list[float]], note: str = "") -> pd.DataFrame:
    """Return twins.csv; values: (statistic, source) -> one value per recording."""
    rows = [
        (statistic, "1", source, f"{source}{k}", value, f"What {statistic} is.", note)
        for (statistic, source), numbers in values.items()
        for k, value in enumerate(numbers)
    ]
    return pd.DataFrame(rows, columns=twins.COLUMNS)


LIKE = {("noise", "recorded"): [1.0, 2.0, 4.0], ("noise", "simulated"): [0.5, 3.0, 9.0]}
UNLIKE = {("loop", "recorded"): [1.0, 2.0], ("loop", "simulated"): [2.5, 2.6]}


def test_a_median_within_the_recorded_range_is_inside():
    table = twins.summarised("touch", made(LIKE | UNLIKE)).set_index("statistic")
    assert table.loc["noise", ["recorded", "recorded_low", "recorded_high"]].tolist() == [2.0, 1.0, 4.0]
    assert table.loc["noise", ["simulated", "simulated_low", "simulated_high"]].tolist() == [3.0, 0.5, 9.0]
    assert table["inside"].tolist() == [True, False]
    on_the_end = made({("loop", "recorded"): [1.0, 2.0], ("loop", "simulated"): [2.0]})
    assert twins.summarised("touch", on_the_end)["inside"].tolist() == [True]


@pytest.mark.parametrize(
    ("source", "reason"), [("simulated", "The recordings were not fetched"), ("recorded", "The data are your own logs")]
)
def test_one_side_alone_is_no_comparison(source, reason):
    table = made({key: numbers for key, numbers in (LIKE | UNLIKE).items() if key[1] == source})
    summary = twins.summarised("touch", table)
    assert summary["inside"].isna().all() and reason in twins.readme({"touch": summary})


def test_no_statistic_at_all_is_said():
    summary = twins.summarised("touch", made({}))
    assert list(summary.columns) == twins.SUMMARY
    assert "The recordings were not fetched" in twins.readme({"touch": summary})


def test_files_are_written_and_read(tmp_path, monkeypatch):
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    for experiment in twins.TITLES:
        paths.twins(experiment).parent.mkdir(parents=True)
        made(LIKE | UNLIKE).to_csv(paths.twins(experiment), index=False)
    target = tmp_path / "twins"
    target.mkdir()
    summary = twins.write(target, tmp_path / "former")
    assert summary["experiment"].tolist() == [name for name in twins.TITLES for _ in range(2)]
    assert {path.name for path in target.iterdir()} == {"README.md", *(f"{name}.png" for name in twins.TITLES)}
    paths.twins("glove").unlink()
    with pytest.raises(InputError, match="python -m pipeline.stages.twins glove"):
        twins.write(target, tmp_path / "former")


@pytest.mark.parametrize("absent", [True, False])
def test_recordings_that_are_absent_leave_the_scene(absent, monkeypatch):
    monkeypatch.setattr(twins_stage, "why_not_run", lambda experiment: "not fetched" if absent else None)
    module = twins_stage.MODULES["strain"]
    rows = pd.DataFrame([("day", "noise", 1.0)], columns=["recording", "statistic", "value"])
    monkeypatch.setattr(module, "recorded", lambda values: rows)
    monkeypatch.setattr(module, "simulated", lambda values: rows.assign(value=2.0))
    monkeypatch.setattr(module, "STATISTICS", {"noise": ("mV", "Noise.")})
    table = twins_stage.statistics({"strain": {"source": "simulated"}}, "strain")
    assert table["source"].tolist() == (["simulated"] if absent else ["recorded", "simulated"])
    assert np.isclose(table["value"].iloc[-1], 2.0) and table["unit"].eq("mV").all()
    assert twins_stage.statistics({"strain": {"source": "logs/mine"}}, "strain").empty == absent
