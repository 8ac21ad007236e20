"""Draw where the statistics of a simulated scene lie in the range of the recorded ones."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from pipeline.reporting.figures import style

SIDES = (("recorded", -0.15, style.GREY, "|"), ("simulated", 0.15, style.BLUE, "o"))  # with place, colour, marker
FARTHEST = 1.5  # widths of the recorded range beyond its ends; what lies farther is drawn there, as an arrow


def positions(path: Path, title: str, table: pd.DataFrame, summary: pd.DataFrame) -> None:
    """Draw one line per statistic: every recording, and every simulated one, as a place in the recorded range.

    table: data/<experiment>/twins.csv; summary: the rows of reports/twins.csv, whose order is that of the lines.
    """
    figure, ax = plt.subplots(figsize=(8, 1.6 + 0.36 * len(summary)))
    ax.axvspan(0, 1, color="#E8F1F8", zorder=0)
    for line, row in enumerate(summary.itertuples()):
        width = row.recorded_high - row.recorded_low or abs(row.recorded_high) or 1.0
        for side, height, colour, marker in SIDES:
            values = table[(table["statistic"] == row.statistic) & (table["source"] == side)]["value"].to_numpy(float)
            place = (values - row.recorded_low) / width
            far = (place < -FARTHEST) | (place > 1 + FARTHEST)
            ax.plot(place[~far], np.full((~far).sum(), line + height), marker, color=colour, markersize=4, alpha=0.7)
            for side_of, arrow in ((-FARTHEST, "<"), (1 + FARTHEST, ">")):
                beyond = far & (np.sign(place - 0.5) == np.sign(side_of))
                ax.plot(np.full(beyond.sum(), side_of), np.full(beyond.sum(), line + height), arrow, color=colour)
        middle = np.clip((row.simulated - row.recorded_low) / width, -FARTHEST, 1 + FARTHEST)
        ax.plot(middle, line + 0.15, "D", color=style.BLUE if row.inside else style.VERMILION, markersize=7)
    names = [
        f"{row.statistic.replace('_', ' ')}: {row.recorded:.3g}, {row.simulated:.3g}" for row in summary.itertuples()
    ]
    ax.set_yticks(range(len(summary)), names)
    ax.set_ylim(len(summary) - 0.4, -0.6)
    ax.set_xlim(-FARTHEST - 0.1, 1 + FARTHEST + 0.1)
    ax.set_xticks([0, 1], ["lowest recorded", "highest recorded"])
    ax.set_ylabel("statistic: median recorded, simulated")
    ax.set_title(
        f"{title}\ngrey bars: recordings; dots: simulated;\n"
        "diamond: median of the simulated, blue within the recorded range"
    )
    style.save(figure, path)
