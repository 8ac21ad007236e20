"""What severity 0 is held against: the rows of scores.csv, each of which is there once."""

import pytest

from pipeline.stability import clean_scores
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

HEADER = "protocol,condition,model,seed,metric,unit,value,n"
ROWS = ("press,001,linear,0,rmse,kPa,2.0,9", "press,001,linear,0,r2,1,,9")
RUN = ("press", "001", "linear", 0)


def checker(folder, *rows):
    workspace = Workspace(folder)
    workspace.scores("touch").parent.mkdir(parents=True)
    workspace.scores("touch").write_text("\n".join([HEADER, *rows, ""]))
    return clean_scores.checker(workspace, "touch", 1e-4)


def test_a_row_that_is_missing_doubled_or_another_is_named(tmp_path):
    check = checker(tmp_path / "whole", *ROWS)
    check(RUN, [("rmse", "kPa", 2.0001, 9), ("r2", "1", float("nan"), 9)])
    again = "run `python -m tactile.stages.evaluate touch` again"
    with pytest.raises(InputError, match=f"scores.csv: linear, press, seed 0 has rmse 2, but .* gives 2.1 .*; {again}"):
        check(RUN, [("rmse", "kPa", 2.1, 9)])
    with pytest.raises(InputError, match=f"no row for protocol press, .*, seed 1, metric rmse; {again}"):
        check((*RUN[:3], 1), [("rmse", "kPa", 2.0, 9)])
    with pytest.raises(InputError, match=f"scores.csv: two rows for press, 001, linear, 0, rmse; {again}"):
        checker(tmp_path / "doubled", *ROWS, ROWS[0])
