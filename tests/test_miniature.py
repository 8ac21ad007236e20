"""What one run of the miniature reads and finds: every setting, and the numbers of tests/miniature.csv.

The file has the scores, and some numbers of stress, that this code gives at miniature scale, each with the tolerance
that other processors need: they add in another order and call other routines for tanh. Between AVX-512 and plain SSE
(ATEN_CPU_CAPABILITY=default, OPENBLAS_CORETYPE=PRESCOTT) networks differed by 1e-7 of the value and models in closed
form by 1e-13; 1e-4 and 1e-6 are allowed, and one in each count of a network's right answers.
Where a number has changed for a reason, make the file anew, from the root, and say why in the commit:

    python tests/test_miniature.py
"""

import re
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from builders.project import leaves, run_miniature

from tactile.base import params

PINNED = Path(__file__).with_name("miniature.csv")
KEY = ["table", "experiment", "protocol", "condition", "model", "seed", "metric"]
CLOSED = ("constant", "linear", "tree", "ridge", "naive_bayes")
CLOSED_SHARE, TRAINED_SHARE = 1e-6, 1e-4  # of the value
COUNTED = ("accuracy", "touches_found")  # shares of `n` answers


def found(folder: Path) -> pd.DataFrame:
    """KEY, value and tolerance of every number that is pinned; folder: a project that has run."""
    reports = folder / "reports" / "look"
    scores = pd.read_csv(reports / "scores.csv").assign(table="scores")
    # Of a network that has hardly been trained, one image changes the precision of a class, and the last digits which
    # of many cells of the same height is the highest.
    scores = scores[~scores["metric"].isin(["macro_precision", "location_error"]) | scores["model"].isin(CLOSED)]
    stress = pd.read_csv(folder / "reports" / "stress.csv").assign(table="stress")  # of the shards, at all severities
    stress = stress[stress["model"].isin(CLOSED) & (stress["seed"] == 0) & (stress["severity"] != 0)]
    stress["metric"] = stress["perturbation"] + " " + stress["severity"].map("{:g}".format) + " " + stress["metric"]
    rows = pd.concat([scores, stress]).reindex(columns=[*KEY, "value", "n"]).reset_index(drop=True)
    share = np.where(rows["model"].isin(CLOSED), CLOSED_SHARE, TRAINED_SHARE)
    # A share of explained variance is a difference from 1: near 0 it has the tolerance of 1.
    size = np.where(rows["metric"].str.contains("r2"), np.maximum(rows["value"].abs(), 1.0), rows["value"].abs())
    counted = rows["metric"].isin(COUNTED) & ~rows["model"].isin(CLOSED)
    rows["tolerance"] = np.where(counted, 1 / rows["n"], share * size)
    return rows.drop(columns="n")


def test_numbers_of_the_miniature_are_the_pinned_ones(miniature):
    both = pd.read_csv(PINNED, keep_default_na=False, na_values=["nan"]).merge(
        found(miniature.folder).fillna({"protocol": "", "condition": ""}),
        on=KEY,
        how="outer",
        suffixes=("", "_here"),
        indicator=True,
    )
    lost = both[both["_merge"] != "both"]
    assert lost.empty, f"pinned or found alone:\n{lost[KEY].head(20)}"
    same = (both["value"] - both["value_here"]).abs() <= both["tolerance"]
    off = both[~(same | (both["value"].isna() & both["value_here"].isna()))]
    assert off.empty, f"{len(off)} of {len(both)}:\n{off[[*KEY, 'value', 'value_here', 'tolerance']].head(20)}"
    assert len(both) > 500


def test_every_setting_is_read_by_something(miniature):
    """Of experiments with recordings, which do not run here: tests/stages/test_recorded.py.

    The yardstick of touch is a model that the miniature has not (tests/tools/test_calibrate.py).
    """
    values = params.read(miniature.folder / "params.yaml")
    read = set((miniature.folder.parent / "settings.txt").read_text().split())
    unread = [name for name in leaves(values) if name not in read and "_recorded." not in name]
    unread = [name for name in unread if not name.startswith("touch.yardstick.")]
    assert not unread, f"nobody reads {', '.join(unread)}"


PLACEHOLDERS = r"\bnan\b|\bNone\b(?! of the)|- points|not counted|\b1 seeds|\ball 2 models|\{\{|\{%|<built-in"


def test_no_report_has_a_placeholder_or_broken_grammar(miniature):
    texts = {path: path.read_text(encoding="utf-8") for path in (miniature.folder / "reports").rglob("*.md")}
    page = miniature.folder / "reports" / "index.html"
    texts[page] = re.sub(r"<(script|style).*?</\1>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    found = [f"{path}: {match[0]}" for path, text in texts.items() for match in re.finditer(PLACEHOLDERS, text)]
    assert len(texts) > 15 and not found, found


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        rows = found(run_miniature(Path(folder)).folder)
    rows.to_csv(PINNED, index=False, lineterminator="\n", na_rep="nan", float_format="%.9g")
    print(f"{PINNED}: {len(rows)} numbers")
