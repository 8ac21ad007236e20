"""Find the scale and the offset of a load cell from a log of known weights that lay on it one after another.

LOG is what the load cell printed, as `tactile record PORT LOG` writes it; WEIGHT are the weights in the order in which
they lay there, 0 where none did, each for a few seconds. Steady stretches of the log are matched with them, and the
line of least squares gives scale and offset, with 95 % intervals from three weights on: force in N = scale * reading +
offset. Masses become forces by standard gravity (9.80665 m/s2). The lines for settings.yaml are printed.

Examples:

    tactile weigh weights.log 0 200g 500g 1kg 0
    tactile weigh weights.log 0 9.8N --name load_cell_2.log
"""

import argparse
from pathlib import Path

import numpy as np

from tactile.base import arguments, params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.own import logs as own_logs
from tactile.own import weights

READING = "reading"  # the column of a load cell, in any unit
DIGITS = 7  # of scale and offset: a converter has up to 24 bits


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the log, the weights and the name of the log in the settings to the parser of this command."""
    parser.add_argument("log", type=Path, metavar="LOG", help="of a load cell on which known weights lay")
    parser.add_argument("weights", nargs="+", metavar="WEIGHT", help="in the order of the log, such as 0 200g 1kg 0")
    parser.add_argument("--name", default="load_cell.log", help="the log in recordings (load_cell.log)")
    arguments.add_output(parser)


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Print the line through the weights, how far each is off, and the lines for settings.yaml."""
    forces = [weights.force_n(text) for text in given.weights]
    if len(forces) < 2:
        raise InputError("one weight tells no scale; give two or more, such as 0 and 1kg")
    settings = params.load(workspace.params)["touch"]
    log, proposal = own_logs.read_in_any_unit("touch", given.log, [READING], settings)
    time, reading = log.rows["time_s"].to_numpy(), log.rows[READING].to_numpy()
    found, unit = weights.held(time, reading), "lines" if "rate_hz" in proposal.layout else "s"
    if len(found) != len(forces):
        spans = "; ".join(f"{_span(one, time[0])} {unit} at {one.reading:.7g}" for one in found) or "none"
        raise InputError(
            f"{given.log}: {len(found)} steady stretches, but {len(forces)} weights ({spans}); name the weight of each "
            "stretch, or record again, each weight for a few seconds"
        )
    line = weights.line([one.reading for one in found], forces)
    print(f"{'weight':>10}  {f'held ({unit})':>15}  {'reading':>12}  {'off by (N)':>10}")
    for text, one, off in zip(given.weights, found, line.off_n, strict=True):
        print(f"{text:>10}  {_span(one, time[0]):>15}  {one.reading:>12.7g}  {off:>+10.3g}")
    full = max(map(abs, forces))
    print(
        f"\nforce in N = reading * scale + offset, scale {line.scale:.6g}{_half(line.scale_half)}, offset "
        f"{line.offset:.6g}{_half(line.offset_half)}; off by up to {100 * np.abs(line.off_n).max() / full:.2g} % of "
        f"{full:.3g} N"
    )
    laid_out = proposal.layout | {name: float(f"{getattr(line, name):.{DIGITS}g}") for name in ("scale", "offset")}
    block = own_logs.format_block("touch", {given.name: [proposal._replace(layout=laid_out)]}, settings)
    print("\nfor settings.yaml of your sensor:", *block, sep="\n")
    result = {name: getattr(line, name) for name in ("scale", "scale_half", "offset", "offset_half")}
    arguments.answer(given, result | {"off_n": line.off_n.tolist(), "forces_n": forces})


def _span(one: weights.Held, start_s: float) -> str:
    return f"{one.start_s - start_s:.4g} to {one.end_s - start_s:.4g}"


def _half(width: float) -> str:
    return "" if np.isnan(width) else f" +- {width:.2g}"
