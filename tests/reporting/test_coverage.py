"""The table of coverage shows one model a test, the reason of what lies outside, and what cannot be told."""

import numpy as np
import pandas as pd

from tactile.base import files
from tactile.drawing import coverage

ROWS = [  # protocol, condition, model, output, case, bound, calibrated, width, share, reason
    ("press", "single", "constant", "force_n", "touch", 9.0, 20, 1.0, 0.90, ""),
    ("press", "single", "linear", "force_n", "touch", 2.0, 20, 4.0, 0.80, "chance"),
    ("press", "single", "rbf", "force_n", "touch", 3.0, 20, 6.0, 0.92, ""),
    ("press", "single", "linear", "force_n", "no touch", 2.0, 19, 3.0, 0.94, ""),
    ("press", "single", "rbf", "force_n", "no touch", 1.0, 20, 2.0, 0.97, "chance"),
    ("alone", "", "linear", "force_n", "touch", np.nan, 1, np.nan, np.nan, "90% need 9 groups"),
]


def table(workspace) -> pd.DataFrame:
    """Return ROWS as `tactile coverage` writes and `read` reads them."""
    written = [
        ("touch", *row[:3], 0, *row[3:5], "N", row[5], 1.0, "press", *row[6:9], row[8], row[8], 30, 300, row[9])
        for row in ROWS
    ]
    files.write_csv(workspace.coverage("touch"), coverage.COLUMNS, written)
    return coverage.read(workspace, "touch")


def test_a_row_is_of_the_model_with_the_narrowest_intervals_of_the_first_output(workspace):
    first, second = coverage.rows(table(workspace))
    assert first == [
        *(
            "Press, one touch",
            "force_n, touch",
            "Linear",
            "20 presses",
            "4.00 N",
            "80 [80, 80]",
            "30",
            "chance",
            "1 of 2",
        ),
        "Linear 80 (chance)",
    ]
    assert second == [
        *("Press, one touch", "force_n, no touch", "Linear", "19 presses", "3.00 N", "94 [94, 94]", "30", "", "1 of 2"),
        "RBF-Net 97 (chance)",
    ]


def test_what_no_model_can_tell_is_named_with_the_number_of_its_groups(workspace):
    assert coverage.untold(table(workspace)) == ["Alone (1 press)"]
