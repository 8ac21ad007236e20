"""Say what a LoMP consists of, without torch: which elements send messages to which, and the shapes of its weights."""

import numpy as np

from tactile.base.errors import InputError
from tactile.learning.spec import Spec

NEIGHBOURS = (4, 8)  # of an inner element: sharing an edge, or a corner, too
LARGEST_STATE = 10.0  # of a stream; states of trained networks reach 7 to 9 on validation windows


def check(spec: Spec, neighbours: int) -> None:
    """Raise InputError for another number of neighbours, and for a map that has no equal block for every element."""
    if neighbours not in NEIGHBOURS:
        raise InputError(f"lomp: neighbours must be 4 or 8, not {neighbours!r}")
    if spec.map_rows % spec.rows or spec.map_cols % spec.cols:
        raise InputError(
            f"lomp: a map of {spec.map_rows}x{spec.map_cols} does not divide into equal blocks over "
            f"{spec.rows}x{spec.cols} elements; make the map a multiple of the array"
        )


def neighbour_matrix(rows: int, cols: int, neighbours: int) -> np.ndarray:
    """Return eq. 3's sum as a matrix A (elements, elements): A[i, j] is 1 where j is one of the neighbours of i."""
    index = np.arange(rows * cols)
    down = np.abs(index[:, None] // cols - index // cols)
    across = np.abs(index[:, None] % cols - index % cols)
    distance = down + across if neighbours == 4 else np.maximum(down, across)
    return (distance == 1).astype(np.float32)


def shapes(spec: Spec, hidden: int, readout: list[int], one_readout: bool) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the weights of `Lomp` by name; settings as of `lomp_network.Lomp`."""
    cells, block = spec.elements, spec.map_rows // spec.rows * (spec.map_cols // spec.cols)
    found = {
        "gate_input": (cells, 1, 2 * hidden),
        "gate_input_bias": (cells, 1, 2 * hidden),
        "gate_state": (cells, hidden, 2 * hidden),
        "gate_state_bias": (cells, 1, 2 * hidden),
        "candidate_input": (cells, 1, hidden),
        "candidate_input_bias": (cells, 1, hidden),
        "candidate_state": (cells, hidden, hidden),
        "candidate_state_bias": (cells, 1, hidden),
        "message": (hidden, hidden),  # U, shared by all elements
        "message_bias": (hidden,),
        "update": (cells, hidden, hidden),  # P
        "update_bias": (cells, 1, hidden),
    }
    widths, of = [2 * hidden, *readout, block], 1 if one_readout else cells
    found |= {f"readout.{k}": (of, widths[k], widths[k + 1]) for k in range(len(widths) - 1)}
    return found | {f"readout_bias.{k}": (of, 1, widths[k + 1]) for k in range(len(widths) - 1)}
