"""Draw the figures of the strain experiments, those of the latent-space paper first.

A function returns the numbers of what it draws that the figure's caption states (strain_captions.py).
"""

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from pipeline.reporting.figures import style
from pipeline.reporting.figures.style import MEASURED, model_style
from pipeline.reporting.words.labels import model_name
from pipeline.scoring.results import Estimate, estimate

SHOWN_S = 120.0  # of the test part in figures 5, 6 and 8; the drift is drawn over all of it
DRIFT_S = 150.0
AXES = "xyz"
MOST_PRESSES = 300


def performance(
    path: Path,
    title: str,
    time_s: np.ndarray,
    volts: np.ndarray,
    truth: np.ndarray,
    predicted: Mapping[str, np.ndarray],
    outputs: Sequence[int],
) -> dict[str, float]:
    """Draw figures 5, 6 and 8: sensor readings (if given) and true and predicted position over time.

    time_s: (T,) from the start of the test part; volts: (T, channels) or (T, 0); truth, predicted: (T, 3) in mm.
    Returns model -> mean distance (mm) from the true position over what is drawn.
    """
    chosen = time_s - time_s[0] <= SHOWN_S
    at = time_s[chosen] - time_s[0]
    rows = len(outputs) + (volts.shape[1] > 0)
    figure, axes = plt.subplots(rows, 1, figsize=(9, 2.2 * rows + 0.8), sharex=True, squeeze=False)
    axes = list(axes[:, 0])
    if volts.shape[1]:
        change = volts[chosen] - volts[chosen].mean(axis=0)
        for channel, colour in zip(change.T, plt.get_cmap("viridis")(np.linspace(0, 0.9, volts.shape[1])), strict=True):
            axes[0].plot(at, channel, color=colour, linewidth=0.9)
        axes[0].set(ylabel="Voltage, mean\nremoved (V)", title=f"{volts.shape[1]} strands")
        axes = axes[1:]
    handles = {}
    for ax, column in zip(axes, outputs, strict=True):
        handles["true"] = ax.plot(at, truth[chosen, column], **(MEASURED | {"linewidth": 1.1}))[0]
        for model, values in predicted.items():
            look = model_style(model)
            (handles[look.label],) = ax.plot(
                at, values[chosen, column], color=look.color, linestyle=look.linestyle, linewidth=1.2
            )
        ax.set_ylabel(f"{AXES[column]} (mm)")
    axes[-1].set_xlabel("Time since the start of the test part (s)")
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=len(handles))
    figure.suptitle(title)
    style.save(figure, path)
    return {
        model: float(np.linalg.norm((values - truth)[chosen][:, outputs], axis=1).mean())
        for model, values in predicted.items()
    }


def drifting(path: Path, title: str, time_s: np.ndarray, volts: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Draw the strands' readings in the whole test part, and their means over DRIFT_S; time_s (T,), volts (T, n).

    Returns by strand, (n,) in mV, how far its means move and the standard deviation of its readings around them, and
    how long the test part is (min).
    """
    minutes = (time_s - time_s[0]) / 60
    block = ((time_s - time_s[0]) // DRIFT_S).astype(int)
    centre = np.bincount(block, minutes) / np.bincount(block)
    moved, scatter = [], []
    figure, axes = plt.subplots(volts.shape[1], 1, figsize=(9, 1.1 * volts.shape[1] + 1.2), sharex=True, squeeze=False)
    for k, (ax, reading) in enumerate(zip(axes[:, 0], 1e3 * (volts - volts.mean(axis=0)).T, strict=True)):
        (line,) = ax.plot(minutes, reading, color=style.GREY, linewidth=0.4)
        means = np.bincount(block, reading) / np.bincount(block)
        (slow,) = ax.plot(centre, means, color=style.VERMILION, linewidth=1.6)
        moved.append(np.ptp(means))
        scatter.append((reading - means[block]).std())
        ax.set_ylabel(f"{k}")
    axes[-1, 0].set_xlabel("Time since the start of the test part (min)")
    figure.supylabel("Voltage of each strand, mean removed (mV)")
    names = ["reading", f"mean over {DRIFT_S:g} s: the drift"]
    figure.legend([line, slow], names, loc="outside lower center", ncols=2)
    figure.suptitle(title)
    style.save(figure, path)
    return np.array(moved), np.array(scatter), float(minutes[-1])


def latent_space(path: Path, latents: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Draw figure 7: the states of model-0 on task 2; latents: t_s and one column per unit.

    Returns by state, (units,), the size of the change of its mean from the first to the last tenth, and its standard
    deviation.
    """
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
    tenth = -(-len(states) // 10)
    return np.abs(states[-tenth:].mean(axis=0) - states[:tenth].mean(axis=0)), states.std(axis=0)


def curves(
    path: Path, table: pd.DataFrame, x: str, by: str | None, labels: Mapping[str, str], floor: Mapping[str, float]
) -> None:
    """Draw error (mm) against `x` on a logarithmic axis, one panel per task, one line per value of `by`.

    table: protocol, x, seed, value and `by`; labels: title, xlabel; floor: error of the constant model by task.
    """
    tasks = list(dict.fromkeys(table["protocol"]))
    figure, axes = style.panels(len(tasks), len(tasks), 4.6 * len(tasks), 3.9, 0)
    handles = {}
    for ax, task in zip(axes[0], tasks, strict=True):
        runs = table[table["protocol"] == task]
        for name, group in runs.groupby(by, sort=False) if by else [("lstm_direct", runs)]:
            look = model_style(name)
            estimates = {size: estimate(part["value"]) for size, part in group.groupby(x)}
            mean, spread = style.spread(estimates.values())
            spread = np.nan_to_num(np.minimum(spread, 0.98 * mean))
            handles[look.label] = ax.errorbar(
                list(estimates), mean, spread, color=look.color, marker=look.marker, linestyle=look.linestyle,
                capsize=2.5, markersize=6,
            )  # fmt: skip
        if task in floor:
            handles["Constant (mean)"] = ax.axhline(floor[task], color=style.GREY, linestyle=":")
        ax.set(xscale="log", yscale="log", xlabel=labels["xlabel"], title=task.replace("_", " "))
        style.plain_log(ax.xaxis, sorted(runs[x].unique()))
        style.plain_log(ax.yaxis)
    axes[0][0].set_ylabel("Test error (mm), mean and 95 % interval")
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=min(4, len(handles)))
    figure.suptitle(labels["title"])
    style.save(figure, path)


def decoding(path: Path, scores: Mapping[tuple[str, str, str], Estimate]) -> None:
    """Draw how well elapsed time and true drift can be read, by input; scores: (task, target, input) -> R2."""
    tasks, targets, inputs = (list(dict.fromkeys(names)) for names in zip(*scores, strict=True))
    inputs = sorted(inputs, key=lambda name: (not name.startswith("raw"), "model-0" not in name))
    colours = dict(zip(inputs, (style.GREY, style.BLUE, style.VERMILION), strict=False))
    figure, axes = style.panels(len(tasks), len(tasks), 4.6 * len(tasks), 3.7, 0, sharey=True)
    width = 0.8 / len(inputs)
    for ax, task in zip(axes[0], tasks, strict=True):
        for k, name in enumerate(inputs):
            mean, spread = style.spread(scores[task, target, name] for target in targets)
            place = np.arange(len(targets)) + (k - (len(inputs) - 1) / 2) * width
            look = {"yerr": np.nan_to_num(spread), "capsize": 3, "color": colours[name], "label": name}
            ax.bar(place, np.maximum(mean, -0.2), width, **look)
        ax.axhline(0, color=style.BLACK, linewidth=0.8)
        ax.set_xticks(np.arange(len(targets)), targets)
        ax.set(title=task.replace("_", " "), ylim=(-0.25, 1.05))
    axes[0][0].set_ylabel("R2 of a linear decoder,\nheld-out blocks")
    handles, names = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names))
    figure.suptitle("Is the latent space free of drift? (0: nothing can be read, 1: everything; bars end at -0.2)")
    style.save(figure, path)


def error_over_time(path: Path, errors: Mapping[str, Mapping[str, np.ndarray]], minutes: np.ndarray) -> None:
    """Draw error against time since training ended; errors: task -> model -> (runs, bins) in mm; minutes: (bins,)."""
    figure, axes = style.panels(len(errors), len(errors), 4.6 * len(errors), 3.9, 0)
    handles = {}
    for ax, (task, models) in zip(axes[0], errors.items(), strict=True):
        for model, runs in models.items():
            look = model_style(model)
            mean, low, high = np.array([estimate(column)[:3] for column in runs.T]).T
            (handles[look.label],) = ax.plot(
                minutes, mean, color=look.color, marker=look.marker, linestyle=look.linestyle
            )
            if len(runs) > 1:
                ax.fill_between(minutes, low, high, color=look.color, alpha=0.15, linewidth=0)
        ax.set(xlabel="Time since training ended (min)", title=task.replace("_", " "))
        ax.set_ylim(bottom=0)
    axes[0][0].set_ylabel("Test error (mm), mean and 95 % interval")
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=min(4, len(handles)))
    figure.suptitle("Error against time since training ended")
    style.save(figure, path)


def presses(
    path: Path, views: Mapping[str, tuple[np.ndarray, np.ndarray, Mapping[str, np.ndarray]]]
) -> dict[str, dict[str, float]]:
    """Draw predicted against true place of test presses, one row per protocol, two columns (x, y) per model.

    Of many presses MOST_PRESSES are drawn, evenly over the test part.

    views: protocol -> (truth (n, 3), press (n,), model -> prediction (n, 3)), samples of presses only. Returns protocol
    -> model -> mean distance (mm) between true and predicted place of the presses drawn.
    """
    candidates = ("lstm_direct", "lstm_highpass", "press_difference")
    models = [model for model in candidates if all(model in view[2] for view in views.values())]
    columns = 2 * len(models)
    distances: dict[str, dict[str, float]] = {protocol: {} for protocol in views}
    figure, axes = style.panels(len(views) * columns, columns, 2.0 * columns, 2.2, 0.5, sharex=True, sharey=True)
    for row, (protocol, (truth, press, predicted)) in zip(axes, views.items(), strict=True):
        _, first, size = np.unique(press, return_index=True, return_counts=True)
        chosen = np.unique(np.linspace(0, len(first) - 1, min(MOST_PRESSES, len(first))).astype(int))
        halves = [slice(first[k] + size[k] // 2, first[k] + size[k]) for k in chosen]
        true = np.array([truth[half].mean(axis=0) for half in halves])
        for k, model in enumerate(models):
            guess = np.array([predicted[model][half].mean(axis=0) for half in halves])
            distances[protocol][model] = float(np.linalg.norm((guess - true)[:, :2], axis=1).mean())
            for column in range(2):
                ax = row[2 * k + column]
                ax.plot(true[:, column], guess[:, column], ".", color=model_style(model).color, markersize=2.5)
                ax.plot([-22.5, 22.5], [-22.5, 22.5], color=style.VERMILION, linewidth=0.8)
                ax.set(xlim=(-25, 25), ylim=(-40, 40))
                if ax.get_subplotspec().is_first_row():
                    ax.set_title(textwrap.fill(model_name(model), 20) + f"\n{AXES[column]}")
        row[0].set_ylabel(f"{protocol.replace('_', ' ')}\npredicted (mm)")
    for ax in axes[-1]:
        ax.set_xlabel("true (mm)")
    figure.suptitle(f"Place of test presses (up to {MOST_PRESSES}), mean over the second half of a press's samples")
    style.save(figure, path)
    return distances
