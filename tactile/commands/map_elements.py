"""Find which printed column each element of an array is, by pressing every element once.

LOG is what the array printed, as `tactile record PORT LOG` writes it, while each of its elements was pressed once by a
finger or a rod, row by row from the bottom and from left to right, with half a second of rest in between. The column
that answers most in a press is the element's; the line for settings.yaml is printed, and the array as seen from above.
A column that never answers most is named: a dead element, or a wire.

Examples:

    tactile map pressed.log 4 4
"""

import argparse
from pathlib import Path

import numpy as np

from tactile.base import arguments, params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.own import element_order
from tactile.own import logs as own_logs

USUAL_HZ = 50.0  # frames a second of a log without times, whose presses may last half or twice as long
BLURRED = 0.7  # response of the second column over that of the first, from which on a press is named


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the log, the numbers of rows and of columns to the parser of this command."""
    parser.add_argument("log", type=Path, metavar="LOG", help="of an array whose elements were pressed in turn")
    parser.add_argument("rows", type=int, metavar="ROWS")
    parser.add_argument("cols", type=int, metavar="COLS")
    arguments.add_output(parser)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Print the order of the columns, and the array as seen from above."""
    rows, cols = given.rows, given.cols
    if min(rows, cols) < 1 or rows * cols < 2:
        raise InputError(f"{rows} rows of {cols}: an array has two elements or more")
    names, settings = [f"v{k}" for k in range(rows * cols)], params.load(workspace.params)["touch"]
    log, _ = own_logs.read_in_any_unit("touch", given.log, names, settings, USUAL_HZ)
    reading = np.column_stack([log.rows[name].to_numpy() for name in names])
    try:
        found = element_order.pressed(log.rows["time_s"].to_numpy(), reading)
        order = element_order.order(found, rows * cols)
    except InputError as error:
        raise InputError(f"{given.log}: {error}") from error
    width = len(str(rows * cols - 1))
    print("columns, seen from above with the first row at the bottom:\n")
    for row in reversed(range(rows)):
        print("  " + "  ".join(f"{column:>{width}}" for column in order[row * cols : (row + 1) * cols]))
    for number, one in enumerate(found):
        if one.share > BLURRED:
            print(
                f"\npress {number + 1}: a second column has {100 * one.share:.0f} % of column {one.column}'s response"
            )
    as_printed = order == list(range(rows * cols))
    print("\nfor settings.yaml of your sensor" + (", where nothing needs to be changed:" if as_printed else ":"))
    print(f"touch.sensor.order: {[] if as_printed else order}")
    arguments.answer(given, {"order": order, "share_of_second": [one.share for one in found]})
