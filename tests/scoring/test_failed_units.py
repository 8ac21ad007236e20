"""A failed run has no score by unit: its predictions are no prediction without an error."""

import pytest
from builders import made_reports

from tactile.base.paths import Workspace
from tactile.scoring import units


@pytest.mark.parametrize("experiment", [name for name in made_reports.DATA if name.endswith("_recorded")])
def test_a_failed_run_has_no_row_by_unit(tmp_path, experiment):
    workspace, settings = Workspace(tmp_path), made_reports.settings_of(experiment)
    workspace.experiment_folder(experiment).mkdir(parents=True)
    failed, sound = list(settings["models"])[:2]
    made_reports.write(workspace, experiment, settings, failed)
    protocol = next(iter(settings["protocols"]))
    rows = list(units.rows(workspace, experiment, settings, [protocol]))
    seeds = {model: {row["seed"] for row in rows if row["model"] == model} for model in (failed, sound)}
    assert seeds == {failed: {1, 2}, sound: {0, 1, 2}}
