"""Draw the figures that the latent-space paper has of its sensors: drifting readings and the states of model-0."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from tactile.drawing import style

DRIFT_S = 150.0
COMPONENTS = 3  # of figure 7


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
        ax.set_ylabel(f"strand {k + 1}")
    axes[-1, 0].set_xlabel("Time since the start of the test part (min)")
    figure.supylabel("Voltage, mean removed (mV)")
    names = ["reading", f"mean over {DRIFT_S:g} s: the drift"]
    figure.legend([line, slow], names, loc="outside lower center", ncols=2)
    figure.suptitle(title)
    style.save(figure, path)


def latent_space(path: Path, latents: pd.DataFrame) -> None:
    """Draw figure 7: the states of model-0 on task 2, and their principal components; latents: t_s, a column per unit.

    States run from top to bottom by their share in the first component.
    """
    at = (latents["t_s"] - latents["t_s"].iloc[0]).to_numpy()
    states = latents.drop(columns="t_s").to_numpy()
    centred = states - states.mean(axis=0)
    _, sizes, ways = np.linalg.svd(centred, full_matrices=False)
    ways = ways[:COMPONENTS] * np.sign(ways[:COMPONENTS].sum(axis=1, keepdims=True))  # a component has no sign
    figure, (above, below) = plt.subplots(2, 1, figsize=(8, 5.6), sharex=True, height_ratios=[3, 2])
    look = {"cmap": "RdBu", "vmin": -1, "vmax": 1, "aspect": "auto", "interpolation": "nearest"}
    extent = (at[0], at[-1], states.shape[1] + 0.5, 0.5)
    picture = above.imshow(states[:, np.argsort(-ways[0])].T, extent=extent, **look)
    above.grid(False)
    above.set_ylabel("State, in the order of\nthe first component")
    figure.colorbar(picture, ax=above, label="Value", ticks=[-1, 0, 1], pad=0.01, aspect=12)
    shares = np.square(sizes) / np.square(sizes).sum()
    looks = zip((style.BLUE, style.VERMILION, style.BLACK), ("-", "--", ":"), strict=True)
    for k, (course, (colour, dashes)) in enumerate(zip((centred @ ways.T).T, looks, strict=False)):
        name = f"component {k + 1}: {100 * shares[k]:.0f} % of the variance"
        below.plot(at, course, color=colour, linestyle=dashes, label=name)
    below.set(xlabel="Time since the start of the test part (s)", ylabel="Principal component")
    figure.legend(loc="outside lower center", ncols=COMPONENTS)
    figure.suptitle(f"Figure 7: the {states.shape[1]} states of model-0 while it sees task 2")
    style.save(figure, path)
