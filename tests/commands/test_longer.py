"""Whether a training had ended: the same recipe for longer, beside the run that the reports are about."""

import argparse

import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.base import params
from pipeline.base.errors import InputError
from pipeline.commands import longer
from pipeline.stages import train


def given(**changes) -> argparse.Namespace:
    return argparse.Namespace(**{"experiment": "touch", "protocols": None, "times": 3, "seeds": 2} | changes)


def test_only_lengths_grow():
    block = {"units": 4, "training": {"epochs": 5, "drop_epoch": 2, "drop": 0.2}}
    assert longer.lengthened(block, 3) == {"units": 4, "training": {"epochs": 15, "drop_epoch": 6, "drop": 0.2}}
    assert block["training"]["epochs"] == 5


def test_a_longer_training_stands_beside_the_one_there_is(workspace, values, write_dataset, capsys):
    write_dataset("test")
    values["touch"]["models"] = {"constant": {}, "cnn": values["touch"]["models"]["cnn"]}
    del values["touch"]["protocols"]["random_window"]
    with pytest.raises(InputError, match="fit.json"):
        longer.main(workspace, given())
    workspace.ingest_report("touch").write_text('{"run": true}')
    train.train(workspace, values, "touch")
    longer.main(workspace, given())
    rows = pd.read_csv(workspace.reports / "longer" / "touch.csv")
    assert list(rows["seed"]) == [4, 5] and set(rows["longer_epochs"]) == {9} and set(rows["epochs"]) == {3}
    assert (rows["longer_error"] < rows["error"]).all()
    assert values["touch"]["models"]["cnn"]["training"]["epochs"] == 3
    assert " no |" in (workspace.reports / "longer" / "touch.md").read_text()


def test_a_protocol_that_is_not_there_is_named(values):
    with pytest.raises(InputError, match="no 'pres'; take of press, random_window"):
        longer.chosen(params.load(ROOT / "params.yaml"), "touch", ["pres"], 1)


@pytest.mark.parametrize(("longer_error", "ended"), [(0.995, "yes"), (0.98, "no"), (1.02, "no")])
def test_a_training_has_ended_where_a_longer_one_changes_less_than_a_hundredth(longer_error, ended):
    rows = pd.DataFrame([("press", "cnn", 0, 3, 1.0, 6, longer_error, 1.0)], columns=longer.COLUMNS)
    (line,) = [line for line in longer.text("touch", rows).splitlines() if line.startswith("| press")]
    assert line.split("|")[-3].strip() == ended


def test_rows_of_other_protocols_stay(workspace):
    for protocol, errors in (("press", (1.0,)), ("random_window", (2.0,)), ("press", (3.0,))):
        rows = [(protocol, "cnn", seed, 3, error, 6, error, 1.0) for seed, error in enumerate(errors)]
        longer.write(workspace, "touch", pd.DataFrame(rows, columns=longer.COLUMNS))
    rows = pd.read_csv(workspace.reports / "longer" / "touch.csv")
    assert dict(zip(rows["protocol"], rows["error"], strict=True)) == {"random_window": 2.0, "press": 3.0}
