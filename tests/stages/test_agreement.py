"""Agreement with the committed look: every verdict can be had, by the spread of the evidence, which hangs on no git."""

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.results import shards
from pipeline.results.claim_inputs import COLUMNS
from pipeline.stages import agreement
from tactile.base import files, params
from tactile.base.paths import Workspace


def scores(values=(), models=("linear", "cnn"), experiment="touch", metric="rmse", protocol="press") -> pd.DataFrame:
    """Two models, three seeds; `values`: (model, seed) -> value where it is not 10 + seed."""
    values = dict(values)
    rows = [
        (experiment, protocol, "single", model, metric, seed, "kPa", values.get((model, seed), 10.0 + seed), 9)
        for model in models
        for seed in range(3)
    ]
    return pd.DataFrame(rows, columns=agreement.ROWS)


def evidence(of: dict, **place) -> pd.DataFrame:
    """Rows of shards of the CNN: budget -> values of its seeds."""
    row = {"experiment": "touch", "protocol": "press", "condition": "single", "model": "cnn", "metric": "rmse"} | place
    rows = [
        row | {"budget": budget, "seed": seed, "value": value, "variant": place.get("variant")}
        for budget, values in of.items()
        for seed, value in enumerate(values)
    ]
    return pd.DataFrame(rows).reindex(columns=COLUMNS)


SHARDS = {"full": (4.0, 5.0, 6.0), "half": (1.0, 5.0, 9.0)}  # of standard deviation 1, a fifth of the mean


def made(table: pd.DataFrame, make: str = "AMD") -> pd.DataFrame:
    return table.assign(make=make)


def verdict(value: float, committed=(), kept=None, others=(), make="AMD", **place) -> str:
    """others: make -> values of its look as of `scores`; make: of this machine."""
    spread = agreement.spreads(evidence(SHARDS) if kept is None else kept)
    there = [
        made(scores(committed, **place)),
        *(made(scores(one, **place), name) for name, one in dict(others).items()),
    ]
    found = agreement.compare(pd.concat(there), scores({("cnn", 1): value}, **place), spread, make)
    return found.set_index(["model", "seed"])["verdict"]["cnn", 1]


def test_every_verdict_can_be_had():
    assert verdict(11.0) == "to the bit"
    assert verdict(11.0 + 1e-7) == "to six digits"
    assert verdict(13.1) == verdict(8.9) == "within tolerance", "a fifth of the value, as the evidence's seeds differ"
    assert verdict(13.3) == verdict(8.7) == verdict(np.nan) == "beyond"
    assert verdict(np.nan, {("cnn", 1): np.nan}) == "to the bit"
    spread = agreement.spreads(evidence(SHARDS))
    others = agreement.compare(made(scores()), scores(models=("cnn", "rnn")), spread, "AMD")
    assert others["verdict"].value_counts().to_dict() == {"to the bit": 3, "only here": 3, "only committed": 3}


def test_the_tolerance_is_the_spread_of_the_evidence():
    nothing = evidence({"full": ()})
    assert verdict(11.21, kept=nothing) == "within tolerance" and verdict(11.23, kept=nothing) == "beyond", "2 %"
    half = evidence({"half": (4.0, 5.0, 6.0)})
    assert verdict(13.1, kept=half) == "within tolerance", "half, where no more was run"
    one = evidence({"full": (5.0,), "half": (4.0, 5.0, 6.0)})
    assert verdict(13.1, kept=one) == "within tolerance" and verdict(13.3, kept=one) == "beyond", "one seed has none"
    varied = evidence({"full": (1.0, 5.0, 9.0)}, variant="wider")
    assert verdict(11.3, kept=varied) == "beyond", "a variant is another model"
    shares = evidence({"full": (0.4, 0.5, 0.6)}, metric="accuracy")  # 0.1 is a tenth of no value, but of a share
    place = {"metric": "accuracy", "committed": {("cnn", 1): 0.2}}
    assert verdict(0.29, kept=shares, **place) == "within tolerance" and verdict(0.31, kept=shares, **place) == "beyond"
    two = pd.concat([evidence(SHARDS), evidence({"full": (4.9, 5.0, 5.1)}, protocol="random_window")])
    assert verdict(13.1, kept=two, protocol="other") == "within tolerance", "the largest of the other protocols"
    assert verdict(11.3, kept=two, protocol="random_window") == "beyond", "but its own, where it has one"


def test_a_machine_is_compared_with_its_own_make():
    others = {"Intel": {("cnn", 1): 11.5}}
    nothing = evidence({"full": ()})
    assert verdict(11.5, kept=nothing, others=others, make="Intel") == "to the bit"
    assert verdict(11.5, kept=nothing, make="Intel") == "beyond", "without its own with the first"
    assert verdict(11.0, kept=nothing, others=others, make="Apple") == "to the bit"


def test_two_makes_tell_how_far_a_third_may_be_off():
    """They differ by 1/11 at one of three seeds: the usual difference is 5.2 %, twice that 10.5 % of 11."""
    others = {"Intel": {("cnn", 1): 12.0}}
    nothing = evidence({"full": ()})
    assert verdict(12.1, kept=nothing, others=others, make="Apple") == "within tolerance"
    assert verdict(12.2, kept=nothing, others=others, make="Apple") == "beyond"
    assert verdict(11.3, kept=nothing, others=others, make="AMD") == "beyond", "a machine owes its own make no less"
    linear = {"Intel": {("linear", 1): 22.0}}
    assert verdict(11.3, kept=nothing, others=linear, make="Apple") == "beyond", "of another model"


@pytest.fixture
def project(workspace, monkeypatch):
    """A workspace with scores of two experiments, of which one did not run."""
    monkeypatch.setattr(params, "load", lambda _: {"experiments": ["touch", "glove"]})
    monkeypatch.setattr(agreement.processes, "make", lambda: "AMD")
    here = scores({("cnn", 0): 1 / 3, ("cnn", 1): np.nan})
    for name, table in {"touch": here, "glove": here[:0]}.items():
        files.write_table(workspace.scores(name), table, missing="nan")
    return workspace


def run(monkeypatch, capsys, workspace, *given) -> str:
    monkeypatch.setattr("sys.argv", ["agreement", *given])
    agreement.main(workspace)
    return capsys.readouterr().out


def test_the_committed_look_is_written_by_a_call_of_its_own_alone(project, monkeypatch, capsys):
    committed = project.root / agreement.COMMITTED
    said = "there is no number in evidence/look.csv; `python -m pipeline.stages.agr"
    assert said in run(monkeypatch, capsys, project) and not committed.exists()
    committed.parent.mkdir(exist_ok=True)
    committed.write_text(",".join(agreement.MADE) + "\n")
    assert said in run(monkeypatch, capsys, project), "nor has a table without a row one"
    assert (project.look / "agreement.md").read_text().count("Not compared") == 1
    run(monkeypatch, capsys, project, "accept")
    assert run(monkeypatch, capsys, project) == "6 of 6 numbers agree: 6 to the bit.\n"
    before = committed.read_text()
    files.write_table(project.scores("touch"), scores({("cnn", 0): 1 / 3, ("cnn", 1): 5.0}), missing="nan")
    assert run(monkeypatch, capsys, project) == "5 of 6 numbers agree: 5 to the bit, 1 beyond.\n"
    assert committed.read_text() == before
    line = next(line for line in (project.look / "agreement.md").read_text().splitlines() if "cnn" in line)
    assert "nan" in line and "5" in line


def test_scores_of_what_did_not_run_here_stay_committed(project, monkeypatch, capsys):
    run(monkeypatch, capsys, project, "accept")
    files.write_table(project.scores("touch"), scores()[:0])
    files.write_table(project.scores("glove"), scores(experiment="glove"))
    said = run(monkeypatch, capsys, project, "accept")
    assert said == "evidence/look.csv: 6 numbers of this machine, 6 as they were\n"
    said = run(monkeypatch, capsys, project)
    assert said.startswith("6 of 6 numbers agree: 6 to the bit. No scores here: touch (6) of 12 committed numbers")


def test_the_look_of_another_make_stands_behind_that_of_the_first(project, monkeypatch, capsys):
    run(monkeypatch, capsys, project, "accept")
    monkeypatch.setattr(agreement.processes, "make", lambda: "Intel")
    files.write_table(project.scores("touch"), scores({("cnn", 0): 1 / 3, ("cnn", 1): 4.0}))
    assert "1 beyond" in run(monkeypatch, capsys, project)
    assert "touch with the look of a processor of AMD" in (project.look / "agreement.md").read_text()
    run(monkeypatch, capsys, project, "accept")
    assert run(monkeypatch, capsys, project) == "6 of 6 numbers agree: 6 to the bit.\n"
    assert list(pd.read_csv(project.root / agreement.COMMITTED)["make"]) == ["AMD"] * 6 + ["Intel"] * 6


def test_the_committed_look_is_of_every_experiment_and_agrees_with_itself():
    committed = pd.read_csv(ROOT / agreement.COMMITTED, dtype={"condition": str})
    assert set(committed["experiment"]) == set(params.load(ROOT / "params.yaml")["experiments"])
    spread = agreement.spreads(shards.read(Workspace(ROOT)))
    for make, of_make in committed.groupby("make", sort=False):
        found = agreement.compare(committed, of_make, spread, make)
        found = found[found["experiment"].isin(of_make["experiment"])]
        assert set(found["verdict"]) == {"to the bit"} and (found["tolerance"] > 0).mean() > 0.9
