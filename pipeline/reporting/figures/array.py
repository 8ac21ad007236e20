"""Draw frames of an array under several fingers: readings, contact, and what models say of it."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from pipeline.reporting.figures import style
from pipeline.reporting.words.labels import model_name

SIDE_IN = 1.55  # of a map, inches


def frames(
    path: Path,
    caption: str,
    names: Sequence[str],
    readings: np.ndarray,
    truth: np.ndarray,
    predicted: Mapping[str, np.ndarray],
    sensor: Mapping,
) -> None:
    """Draw one frame a row: its reading, its contact, and the maps that models predict, with their RMSE.

    names: of the n frames; readings: (n, elements) in counts; truth and each of `predicted`, by model: (n, map_rows,
    map_cols) in percent of contact. All maps have one scale of colours, and so have all readings. caption: what the
    predictions are of.
    """
    extent = (0, sensor["cols"] * sensor["pitch_mm"], 0, sensor["rows"] * sensor["pitch_mm"])
    columns = {"Reading": readings.reshape(-1, sensor["rows"], sensor["cols"]), "Contact": truth}
    columns |= {model_name(model): maps for model, maps in predicted.items()}
    size = {"figsize": (SIDE_IN * len(columns) + 1.2, (SIDE_IN + 0.2) * len(names) + 1.6)}
    figure, axes = plt.subplots(len(names), len(columns), squeeze=False, sharex=True, sharey=True, **size)
    drawn = {}
    for (heading, values), column in zip(columns.items(), axes.T, strict=True):
        counts = heading == "Reading"
        scale = {"vmin": 0, "vmax": readings.max()} if counts else {"vmin": 0, "vmax": 100}
        for row, ax in enumerate(column):
            look = {"origin": "lower", "extent": extent, "cmap": "Greys" if counts else "Blues"}
            drawn[counts] = ax.imshow(values[row], **look, **scale)
            if heading not in ("Reading", "Contact"):
                error = np.sqrt(np.square(values[row] - truth[row]).mean())
                ax.set_xlabel(f"RMSE {error:.1f} %" if np.isfinite(error) else "failed", labelpad=2)
            ax.set(xticks=[], yticks=[])
            ax.grid(False)
            ax.spines[:].set(visible=True, color=style.GREY, linewidth=0.6)
        column[0].set_title(heading, fontweight="bold")
    for name, ax in zip(names, axes[:, 0], strict=True):
        ax.set_ylabel(name, rotation=0, ha="right", va="center", labelpad=6)
    look = {"location": "bottom", "shrink": 0.9, "aspect": 30, "pad": 0.01}
    figure.colorbar(drawn[True], ax=axes[:, :1], label="Counts", extend="min", **(look | {"aspect": 10}))
    figure.colorbar(drawn[False], ax=axes[:, 1:], label="Share of a cell in contact (%)", extend="both", **look)
    side = f"{extent[1] / 10:g} cm x {extent[3] / 10:g} cm"
    title = f"Frames spread evenly over the test part, chosen before any model was fitted; each is {side}"
    figure.suptitle(style.literal(f"{title}\n{caption}"))
    style.save(figure, path)
