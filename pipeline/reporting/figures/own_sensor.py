"""Draw what models say of a pressure array of your own: forces, and maps of windows pressed hard."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from pipeline.reporting.figures import style
from pipeline.reporting.words.labels import model_name

MAPS = 4  # windows drawn
MOST_POINTS = 2000  # of a cloud of forces


def forces(path: Path, title: str, truth: np.ndarray, predicted: Mapping[str, np.ndarray]) -> dict[str, float]:
    """Draw predicted force against that on the load cell, one panel per model; both (n,) in N. Returns model -> R2."""
    figure, axes = style.panels(len(predicted), len(predicted), 3.3 * len(predicted) + 0.3, 3.2, 0.6, sharey=True)
    top = 1.05 * max(truth.max(initial=0), *(guess.max(initial=0) for guess in predicted.values()), 1e-9)
    spread, few = np.square(truth - truth.mean()).sum(), slice(None, None, -(-len(truth) // MOST_POINTS) or 1)
    r2 = {}
    for ax, (model, guess) in zip(axes.flat, predicted.items(), strict=True):
        r2[model] = float(1 - np.square(guess - truth).sum() / spread) if spread > 0 else np.nan
        ax.plot([0, top], [0, top], **style.MEASURED)
        ax.plot(truth[few], guess[few], ".", color=style.model_style(model).color, markersize=3, alpha=0.6)
        ax.set(
            xlim=(0, top),
            ylim=(0, top),
            xlabel="Force on the load cell (N)",
            title=f"{model_name(model)}, R2 {r2[model]:.3f}",
        )
    axes[0, 0].set_ylabel("Predicted force (N)")
    figure.suptitle(style.literal(title))
    style.save(figure, path)
    return r2


def maps(
    path: Path,
    title: str,
    counts: np.ndarray,
    truth: np.ndarray,
    predicted: Mapping[str, np.ndarray],
    settings: Mapping,
) -> dict[str, float]:
    """Draw reading, label and predicted maps of the windows between half and most of the pressure, MAPS of them.

    counts: (n, elements); truth, predicted: (n, cells) in kPa; settings: the block `touch` of params.yaml. Returns
    model -> RMSE (kPa) over the maps drawn.
    """
    sensor, label = settings["sensor"], settings["label"]
    order = np.argsort(truth.max(axis=1), kind="stable")
    chosen = order[np.linspace(len(order) // 2, len(order) - 1, min(MAPS, len(order))).astype(int)]
    extent = (0, sensor["cols"] * sensor["pitch_mm"], 0, sensor["rows"] * sensor["pitch_mm"])
    shape = label["map_rows"], label["map_cols"]
    lines = {"Reading": counts.reshape(-1, sensor["rows"], sensor["cols"]), "Label": truth.reshape(-1, *shape)}
    lines |= {model_name(model): guess.reshape(-1, *shape) for model, guess in predicted.items()}
    size = {"figsize": (2.3 * len(chosen) + 1.4, 2.3 * len(lines) + 0.6)}
    figure, axes = plt.subplots(len(lines), len(chosen), squeeze=False, sharex=True, sharey=True, **size)
    for row, (name, values) in zip(axes, lines.items(), strict=True):
        for ax, window in zip(row, chosen, strict=True):
            top = values[window].max() if name == "Reading" else truth[window].max()
            picture = ax.imshow(values[window] / max(top, 1e-9), origin="lower", extent=extent, vmin=0, vmax=1)
            unit = "counts" if name == "Reading" else "kPa"
            ax.set_title(f"peak {values[window].max():.0f} {unit}")
            ax.grid(False)
        row[0].set_ylabel(f"{name}\ny (mm)")
    for ax in axes[-1]:
        ax.set_xlabel("x (mm)")
    words = "Share of the label's peak (reading: of its own)"
    figure.colorbar(picture, ax=axes, label=words, extend="max", shrink=0.6)
    figure.suptitle(style.literal(title))
    style.save(figure, path)
    return {
        model: float(np.sqrt(np.square(guess[chosen] - truth[chosen]).mean())) for model, guess in predicted.items()
    }
