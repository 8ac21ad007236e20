"""Draw where the statistics of a simulated scene lie in the range of the recorded ones."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from tactile.drawing import style
from tactile.drawing.labels import statistic_name

FARTHEST = 1.5  # widths of the recorded range beyond its ends; what lies farther is an arrow there


def positions(path: Path, title: str, summary: pd.DataFrame) -> None:
    """Draw one line per statistic: the recorded median and the simulated ones, as places in the recorded range.

    summary: rows of reports/twins.csv, whose order is that of the lines.
    """
    figure, ax = plt.subplots(figsize=(8, 1.6 + 0.3 * len(summary)))
    ax.axvspan(0, 1, color="#E8F1F8", zorder=0)
    least, most, handles = -FARTHEST, 1 + FARTHEST, {}
    for line, row in enumerate(summary.itertuples()):
        low, width = row.recorded_low, row.recorded_high - row.recorded_low or abs(row.recorded_high) or 1.0
        names = ("recorded", "simulated", "simulated_low", "simulated_high")
        recorded, middle, *ends = ((getattr(row, name) - low) / width for name in names)
        (handles["recorded median"],) = ax.plot(recorded, line, "|", color=style.BLACK, markersize=12, mew=1.5)
        colour = style.BLUE if row.inside else style.VERMILION
        ax.plot(np.clip(ends, least, most), (line, line), color=colour, linewidth=1.3)
        marker = "<" if middle < least else ">" if middle > most else "D"
        (drawn,) = ax.plot(np.clip(middle, least, most), line, marker, color=colour, markersize=6)
        if marker == "D":
            handles[f"simulated median, {'in the recorded range' if row.inside else 'out of it'}"] = drawn
    ax.set_yticks(range(len(summary)), map(statistic_name, summary["statistic"]))
    ax.set(ylim=(len(summary) - 0.4, -0.6), xlim=(least - 0.1, most + 0.1))
    ax.set_xticks([0, 1], ["lowest recorded", "highest recorded"])
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=3)
    figure.suptitle(f"{title}\nlines: from the lowest simulated to the highest; arrows: farther away")
    style.save(figure, path)
