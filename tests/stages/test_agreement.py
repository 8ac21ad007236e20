"""Agreement with the committed scores: every verdict can be had, and a failed run is no agreement."""

import subprocess

import numpy as np
import pandas as pd
import pytest

from pipeline.base import params
from pipeline.stages import agreement


def scores(values=(), models=("linear", "cnn"), experiment="touch") -> pd.DataFrame:
    """Two models, three seeds; `values`: (model, seed) -> value where it is not 10 + seed."""
    values = dict(values)
    rows = [
        (experiment, "press", "single", model, "rmse", seed, values.get((model, seed), 10.0 + seed))
        for model in models
        for seed in range(3)
    ]
    return pd.DataFrame(rows, columns=[*agreement.KEY, "value"])


def verdict(value: float, committed=()) -> str:
    found = agreement.compare(scores(committed), scores({("cnn", 1): value}))
    return found.set_index(["model", "seed"])["verdict"]["cnn", 1]


def test_every_verdict_can_be_had():
    assert verdict(11.0) == "to the bit"
    assert verdict(11.0 + 1e-7) == "to six digits"
    assert verdict(11.9) == verdict(10.1) == "within tolerance", "the standard deviation of the seeds"
    assert verdict(12.1) == verdict(np.nan) == "beyond"
    equal = {("cnn", k): 10.0 for k in range(3)}
    assert verdict(10.19, equal) == "within tolerance" and verdict(10.21, equal) == "beyond", "two percent"
    assert verdict(np.nan, {("cnn", 1): np.nan}) == "to the bit"
    others = agreement.compare(scores(), scores(models=("cnn", "rnn")))["verdict"].value_counts()
    assert others.to_dict() == {"to the bit": 3, "only here": 3, "only committed": 3}


@pytest.fixture
def project(workspace, tmp_path, monkeypatch):
    """A checkout with scores of one experiment, not yet a repository of git."""
    monkeypatch.setattr(params, "load", lambda _: {"experiments": ["touch"]})
    monkeypatch.setattr("sys.argv", ["agreement"])
    for path in (workspace.reports / "scores.csv", workspace.scores("touch")):
        path.parent.mkdir(parents=True)
        scores({("cnn", 0): 1 / 3, ("cnn", 1): np.nan}).to_csv(path, index=False, na_rep="nan")
    return tmp_path


def test_scores_are_compared_with_those_of_the_last_commit(workspace, project, monkeypatch, capsys):
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(project.parent))
    agreement.main(workspace)
    assert (
        "Not compared with the committed scores, HEAD:./reports/scores.csv of git: fatal: not a git repo"
        in (workspace.reports / "agreement.md").read_text()
    )
    author = ["-c", "user.name=test", "-c", "user.email=test@example.org"]
    for command in (["init", "-q"], ["add", "-f", "reports/scores.csv"], [*author, "commit", "-qm", "scores"]):
        subprocess.run(["git", *command], cwd=project, check=True)
    (workspace.reports / "scores.csv").unlink()
    agreement.main(workspace)
    assert capsys.readouterr().out.endswith("6 of 6 numbers agree: 6 to the bit.\n")
    workspace.scores("touch").write_text(",".join([*agreement.KEY, "value"]) + "\n")
    agreement.main(workspace)
    assert capsys.readouterr().out.startswith("0 of 0 numbers agree: 0 to the bit. No scores here: touch (6) of 6 ")
    monkeypatch.setenv("PATH", "")
    agreement.main(workspace)
    assert "there is no git" in capsys.readouterr().out
