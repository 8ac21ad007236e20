"""What results were made with: the commit, and the settings in dvc.lock."""

import copy
import os
import subprocess

import pytest
import yaml

from tactile.base import provenance
from tactile.base.errors import InputError
from tactile.base.paths import Workspace


def test_git_state_reports_commit_and_changes(workspace, tmp_path, monkeypatch):
    for name in [name for name in os.environ if name.startswith("GIT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    assert provenance.git_state(workspace)[0] == "unknown (not a git checkout)"
    identity = ["-c", "user.name=test", "-c", "user.email=test@example.org"]
    (tmp_path / "params.yaml").write_text("a: 1\n")
    for command in (["init", "-q"], ["add", "."], [*identity, "commit", "-q", "-m", "first"]):
        subprocess.run(["git", "-C", str(tmp_path), *command], check=True)
    (tmp_path / "dvc.lock").write_text("written by the pipeline\n")
    commit, changed = provenance.git_state(workspace)
    assert len(commit) == 40 and changed == "false"
    (tmp_path / "params.yaml").write_text("a: 2\n")
    assert provenance.git_state(workspace) == (commit, "true")
    inside = tmp_path / "copy"
    inside.mkdir()
    assert provenance.git_state(Workspace(inside))[0] == "unknown (not a git checkout)"


def test_results_of_other_settings_are_refused(workspace, tmp_path):
    values = {"device": "auto", "touch": {"label": {"map_rows": 20}}}
    provenance.check_settings(workspace, ["touch"], values)  # no dvc.lock, so nothing to check
    stage = {"outs": [{"path": "data/touch/scores.csv"}], "params": {"params.yaml": copy.deepcopy(values)}}
    (tmp_path / "dvc.lock").write_text(yaml.safe_dump({"stages": {"evaluate@touch": stage}}))
    provenance.check_settings(workspace, ["touch"], values)
    with pytest.raises(InputError, match=r"^params.yaml, device: data/touch/scores.csv was made with another value"):
        provenance.check_settings(workspace, ["touch"], {**values, "device": "cpu"})
    values["touch"]["label"]["map_rows"] = 10
    with pytest.raises(
        InputError, match=r"^params/touch.yaml, touch.label.map_rows: data/touch/scores.csv was made with"
    ):
        provenance.check_settings(workspace, ["touch"], values)
    (tmp_path / "dvc.lock").write_text("stages: {evaluate@touch: {outs: [{pa")
    with pytest.raises(InputError, match="^dvc.lock: not whole"):
        provenance.check_settings(workspace, ["touch"], values)
