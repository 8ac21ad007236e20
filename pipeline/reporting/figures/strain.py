"""Draw the figures that the latent-space paper has of its sensors: drifting readings and the states of model-0."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from pipeline.reporting.figures import style

DRIFT_S = 150.0


def drifting(path: Path, title: str, time_s: np.ndarray, volts: np.ndarray) -> None:
    """Draw the strands' readings in the whole test part, and their means over DRIFT_S; time_s (T,), volts (T, n)."""
    minutes = (time_s - time_s[0]) / 60
    _, block = np.unique((time_s - time_s[0]) // DRIFT_S, return_inverse=True)  # none is empty, whatever the gaps
    centre = np.bincount(block, minutes) / np.bincount(block)
    figure, axes = plt.subplots(volts.shape[1], 1, figsize=(9, 1.1 * volts.shape[1] + 1.2), sharex=True, squeeze=False)
    for k, (ax, reading) in enumerate(zip(axes[:, 0], 1e3 * (volts - volts.mean(axis=0)).T, strict=True)):
        (line,) = ax.plot(minutes, reading, color=style.GREY, linewidth=0.4)
        means = np.bincount(block, reading) / np.bincount(block)
        (slow,) = ax.plot(centre, means, color=style.VERMILION, linewidth=1.6)
        ax.set_ylabel(f"{k}")
    axes[-1, 0].set_xlabel("Time since the start of the test part (min)")
    figure.supylabel("Voltage of each strand, mean removed (mV)")
    names = ["reading", f"mean over {DRIFT_S:g} s: the drift"]
    figure.legend([line, slow], names, loc="outside lower center", ncols=2)
    figure.suptitle(title)
    style.save(figure, path)


def latent_space(path: Path, latents: pd.DataFrame) -> None:
    """Draw figure 7: the states of model-0 on task 2; latents: t_s and one column per unit."""
    at = latents["t_s"] - latents["t_s"].iloc[0]
    states = latents.drop(columns="t_s").to_numpy()
    figure, ax = plt.subplots(figsize=(9, 3.2))
    for state, colour in zip(states.T, plt.get_cmap("viridis")(np.linspace(0, 0.95, states.shape[1])), strict=True):
        ax.plot(at, state, color=colour, linewidth=0.7)
    ax.set(
        xlabel="Time since the start of the test part (s)",
        ylabel="State",
        ylim=(-1.02, 1.02),
        title=f"Figure 7: the {states.shape[1]} states of model-0 while it sees task 2 (one line per state)",
    )
    style.save(figure, path)


def beyond_training(path: Path, errors: pd.DataFrame) -> None:
    """Draw a point per finger and model; errors: `beyond` as a share, and a column in mm for each model."""
    figure, ax = plt.subplots(figsize=(6.5, 4.4))
    for model in errors.columns.drop(["beyond", "constant"], errors="ignore"):
        label, colour, marker, _ = style.model_style(model)
        ax.plot(
            100 * errors["beyond"], errors[model], linestyle="", color=colour, marker=marker, alpha=0.7, label=label
        )
    ax.set(
        xlabel="Mean distance of the test part's drift from its range before (% of that range)",
        ylabel="Test error (mm)",
        ylim=(0, None),
        title="Task 1: error of each finger where drift leaves the range of training",
    )
    figure.legend(loc="outside lower center", ncols=3)
    style.save(figure, path)
