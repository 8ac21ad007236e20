"""The run at the papers' scale: its settings, and what stays in reports/paper_scale when a part of it is run again."""

import argparse

import pandas as pd
import pytest
import yaml
from builders.project import ROOT
from dvc.repo import Repo

from pipeline.base import params
from pipeline.base.errors import InputError
from pipeline.base.params_file import copied
from pipeline.base.paths import Workspace
from pipeline.commands import paper_scale

SCORES = ("experiment", "protocol", "model", "value")
CLAIMS = ("id", "verdict", "ours")


def table(columns, *rows) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=columns)


def rows_of(frame: pd.DataFrame) -> set[tuple]:
    return set(frame.itertuples(index=False, name=None))


def test_a_part_replaces_its_own_protocol_and_no_other():
    before = table(
        SCORES, ("touch", "press", "cnn", "1"), ("touch", "random", "cnn", "2"), ("glove", "press", "cnn", "3")
    )
    ours = table(SCORES, ("touch", "press", "cnn", "4"), ("touch", "press", "rnn", "5"))
    assert rows_of(paper_scale.merged("scores.csv", ours, before)) == {
        ("touch", "press", "cnn", "4"),
        ("touch", "press", "rnn", "5"),
        ("touch", "random", "cnn", "2"),
        ("glove", "press", "cnn", "3"),
    }


def test_a_verdict_stays_where_a_part_could_not_test_the_claim():
    before = table(
        CLAIMS, ("a", "reproduced", "1"), ("b", "not testable", ""), ("c", "undecided", "3"), ("d", "undecided", "9")
    )
    ours = table(CLAIMS, ("a", "not testable", ""), ("b", "contradicted", "2"), ("c", "reproduced", "4"))
    assert rows_of(paper_scale.merged("claims.csv", ours, before)) == {
        ("a", "reproduced", "1"),
        ("b", "contradicted", "2"),
        ("c", "reproduced", "4"),
        ("d", "undecided", "9"),
    }


@pytest.fixture
def commit(tmp_path, monkeypatch):
    """A checkout in place of the clone: DVC and git are not run, params.yaml is there."""
    calls = []
    monkeypatch.setattr(paper_scale, "run", lambda folder, *command: calls.append(command))
    folder = tmp_path / "paper_scale"
    (folder / ".git").mkdir(parents=True)
    copied(ROOT / "params.yaml", folder)
    return folder


def test_the_settings_are_the_papers_and_the_protocols_those_asked_for(commit):
    paper_scale.prepare(Workspace(ROOT), "touch", ["random_window"], commit)
    values = params.load(commit / "params.yaml")
    assert list(values["touch"]["protocols"]) == ["random_window"]
    assert values["touch"]["protocols"]["random_window"]["seeds"] == [0, 1, 2, 3, 4]
    assert [params.scale_of(ROOT / "scales", name, values[name]) for name in ("touch", "glove")] == ["paper", "paper"]


def test_an_unknown_protocol_is_named_with_those_that_there_are(commit):
    with pytest.raises(InputError, match="touch has no 'random'; take of press, random_window"):
        paper_scale.prepare(Workspace(ROOT), "touch", ["random"], commit)


def test_scores_settings_and_hashes_are_kept(tmp_path):
    folder, target = tmp_path / "run", tmp_path / "reports"
    files = {
        "data/touch/scores.csv": "experiment,protocol,value\ntouch,press,0.1\n",
        "data/touch/speed/latency.csv": "experiment,p50_ms\ntouch,0.5\n",
        "reports/longer/touch.csv": "protocol,model\npress,cnn\nrandom_window,cnn\n",
        "reports/claims.csv": "id,verdict\nlomp/a,reproduced\n",
        "reports/claims.md": "# Claims\n",
        "params.yaml": "device: cpu\n",
        "params/touch.yaml": "touch: {sensor: {rows: 5}, protocols: {press: {}}}\n",
        "params/glove.yaml": "glove: {}\n",
        "dvc.lock": "schema: '2.0'\nstages: {train@touch: {cmd: a}, evaluate@touch: {cmd: b}, train@glove: {cmd: c}}\n",
    }
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content)
    paper_scale.keep_numbers("touch", folder, target)
    assert not (target / "touch").exists() and not (target / "claims.csv").exists(), "verdicts come after numbers"
    paper_scale.keep_verdicts("touch", ["press"], folder, target)
    assert (target / "scores.csv").read_text() == "experiment,protocol,value,scale\ntouch,press,0.1,paper\n"
    part = target / "touch" / "press"
    assert set(yaml.safe_load((part / "dvc.lock").read_text())["stages"]) == {"train@touch", "evaluate@touch"}
    assert yaml.safe_load((part / "params.yaml").read_text()) == {
        "touch": {"sensor": {"rows": 5}, "protocols": {"press": {}}}
    }
    assert (target / "longer.csv").read_text() == "protocol,model,scale,experiment\npress,cnn,paper,touch\n"
    assert (part / "claims.md").exists()


def test_every_experiment_names_stages_that_there_are():
    parser = argparse.ArgumentParser()
    paper_scale.add_arguments(parser)
    with Repo(str(ROOT)) as repo:
        known = {stage.name for stage in repo.index.stages}
    for experiment, stages in paper_scale.STAGES.items():
        assert parser.parse_args([experiment]).protocols == []
        assert set(stages) <= known
