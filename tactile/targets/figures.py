"""Draw what models of a target say of groups that they have not seen."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tactile.drawing import style

COLUMNS = 5  # panels beside each other


def agreement(path: Path, title: str, unit: str, tests: Mapping[str, tuple[np.ndarray, np.ndarray]]) -> None:
    """Draw predicted over true numbers, a panel a test; tests: name -> (true, predicted), each (n,), in `unit`."""
    known = np.concatenate([np.concatenate(pair) for pair in tests.values()])
    low, high = known.min(), known.max()
    ends = low - 0.05 * (high - low), high + 0.05 * (high - low)
    columns = min(COLUMNS, len(tests))
    figure, axes = style.panels(len(tests), columns, 2.2 * columns + 0.7, 2.3, 0.7, sharex=True, sharey=True)
    for ax, (name, (truth, predicted)) in zip(axes.flat, tests.items(), strict=False):
        ax.plot(ends, ends, color=style.GREY, linewidth=0.8)
        ax.plot(truth, predicted, ".", color=style.BLUE, markersize=2.5, alpha=0.5)
        ax.set(xlim=ends, ylim=ends, title=style.literal(name))
    figure.supxlabel(style.literal(f"true ({unit})"))
    figure.supylabel(style.literal(f"predicted ({unit})"))
    figure.suptitle(style.literal(title))
    style.save(figure, path)
