"""Draw what a model predicted for a recording: a picture for every kind, and an animation of maps."""

from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw

from tactile.drawing import style
from tactile.inference import touches
from tactile.inference.card import Card
from tactile.inference.recordings import Recording, Tips, parts

plt = style.plt
MOMENTS = 4  # maps in the picture
MOST_LINES = 6  # objects drawn by name
FRAMES_PER_S = 10
LONGEST_S = 12  # of an animation
CELL = 12  # pixels of a map's cell in the animation
SHADES = 128  # of readings, from white to black, and of maps
RING = 11  # radius in pixels, in the animation


def draw(path: Path, recording: Recording, predicted: np.ndarray, card: Card, tips: Tips | None = None) -> None:
    """Draw the predictions of one recording, (n, *output_shape), over time; of maps also the hardest moments.

    tips: the truth, where it is known; it is drawn into pictures of maps.
    """
    time = recording.t_s - recording.t_s[0]
    if card.kind == "windows" and card.outputs.touch_kpa is not None:
        _draw_maps(path, recording, time, predicted, card, tips)
        return
    figure, ax = plt.subplots(figsize=(8, 3))
    flat = predicted.reshape(len(predicted), -1)
    if card.kind == "images":
        mean = np.nanmean(flat, axis=0)
        chosen = np.argsort(-mean)[:MOST_LINES]
        names, label = [card.outputs.names[k] for k in chosen], "Probability"
        flat = flat[:, chosen]
    else:
        names = [name.removesuffix("_mm") for name in card.outputs.names or ["force"]]
        label = {"mm": "Position (mm)", "N": "Force (N)"}[card.outputs.unit]
    colours = (style.BLUE, style.VERMILION, style.GREEN, style.PURPLE, style.SKY, style.ORANGE)
    for values, name, colour in zip(flat.T, names, colours, strict=False):
        ax.plot(time, values, color=colour, linewidth=1, label=style.literal(name))
    ax.set(xlabel="Time (s)", ylabel=label)
    if len(names) > 1:
        ax.legend(loc="upper left", bbox_to_anchor=(1, 1))
    ax.set_title(style.literal(f"{recording.name}, predicted by {style.model_name(card.model)}"))
    style.save(figure, path)


def _draw_maps(
    path: Path, recording: Recording, time: np.ndarray, maps: np.ndarray, card: Card, tips: Tips | None
) -> None:
    """Draw force over time, and readings and maps of the hardest moments, which lie apart."""
    force = _forces(maps, card)
    moments = hardest(force, max(1, len(maps) // (3 * MOMENTS)))
    figure = plt.figure(figsize=(9, 6.2))
    grid = figure.add_gridspec(3, MOMENTS, height_ratios=(1.1, 1, 1.25))
    ax = figure.add_subplot(grid[0, :])
    ax.plot(time, force, color=style.BLUE, linewidth=1, label="map")
    if tips:
        pressed = np.where(tips.known, np.nansum(tips.force_n, axis=1), np.nan)
        ax.plot(time, pressed, color=style.BLACK, linewidth=1, linestyle="--", label="load cells")
        ax.legend(loc="upper right")
    for number, k in enumerate(moments):
        ax.axvline(time[k], color=style.GREY, linewidth=0.8, linestyle=":")
        ax.annotate(f" {number + 1}", (time[k], 1), xycoords=("data", "axes fraction"), va="top")
    ax.set(xlabel="Time (s)", ylabel="Force (N)")
    legend = "; rings: tips, crosses: touches that are found" if tips else ""
    ax.set_title(style.literal(f"{recording.name}, predicted by {style.model_name(card.model)}{legend}"))
    sensor = card.reading["sensor"]
    extent = (0, sensor["cols"] * sensor["pitch_mm"], 0, sensor["rows"] * sensor["pitch_mm"])
    of_moments = touches.touches(maps[moments], card)
    highest = max(float(np.nanmax(maps[moments])), np.finfo(float).tiny)
    axes = []
    for number, (k, of_map) in enumerate(zip(moments, of_moments, strict=True)):
        above, below = (figure.add_subplot(grid[row, number]) for row in (1, 2))
        reading = recording.x[k].reshape(sensor["rows"], sensor["cols"])
        above.imshow(
            reading, origin="lower", extent=extent, cmap="Greys", vmin=recording.x.min(), vmax=recording.x.max()
        )
        above.set_title(f"{number + 1}: {time[k]:.2f} s")
        image = below.imshow(maps[k], origin="lower", extent=extent, cmap="viridis", vmin=0, vmax=highest)
        for touch in of_map:
            below.plot(touch.x_mm, touch.y_mm, "+", color="white", markersize=9)
        pressed = places(tips, k)
        for x_mm, y_mm in pressed:
            below.plot(x_mm, y_mm, "o", markerfacecolor="none", markeredgecolor="white", markersize=15)
        hardest_kpa = f", {of_map[0].kpa:.0f} kPa" if of_map else ""
        shown = f"{len(of_map)} touch{'es' * (len(of_map) != 1)}" + (f" of {len(pressed)}" if tips else "")
        below.set_title(f"{shown}{hardest_kpa}")
        for ax_ in (above, below):
            ax_.grid(False)
        below.set_xlabel("x (mm)")
        if number == 0:
            above.set_ylabel("Reading\ny (mm)")
            below.set_ylabel("Map\ny (mm)")
        axes.append(below)
    figure.colorbar(image, ax=axes, label="Pressure (kPa)", shrink=0.8)
    style.save(figure, path)


def _forces(maps: np.ndarray, card: Card) -> np.ndarray:
    """Return the force of each map in N, (n,); NaN of a map that holds NaN."""
    return np.concatenate([touches.force_n(part, card) for part in parts(maps)])


def places(tips: Tips | None, k: int) -> list[tuple[float, float]]:
    """Return x and y (mm) of the tips that press at reading k; none where the truth is not known."""
    if tips is None:
        return []
    at = ~np.isnan(tips.force_n[k])
    return list(zip(tips.x_mm[k, at].tolist(), tips.y_mm[k, at].tolist(), strict=True))


def hardest(force: np.ndarray, apart: int) -> np.ndarray:
    """Return the places of up to MOMENTS largest values of force (n,), `apart` from each other at least, rising."""
    left, chosen = np.nan_to_num(force, nan=-np.inf).copy(), []
    while len(chosen) < MOMENTS and np.isfinite(left).any():
        k = int(left.argmax())
        chosen.append(k)
        left[max(0, k - apart) : k + apart + 1] = -np.inf
    return np.sort(np.array(chosen, int))


def animate(path: Path, recording: Recording, maps: np.ndarray, card: Card, tips: Tips | None = None) -> None:
    """Write a GIF of readings and maps side by side, around the hardest moment, at the speed of the recording.

    tips: the truth, where it is known: rings in the map.
    """
    force = _forces(maps, card)
    known = np.flatnonzero(~np.isnan(force))
    force = force[known]
    middle = recording.t_s[known[force.argmax()]]
    first = max(recording.t_s[known[0]], min(middle - LONGEST_S / 2, recording.t_s[known[-1]] - LONGEST_S))
    times = np.arange(first, min(first + LONGEST_S, recording.t_s[known[-1]]) + 1e-9, 1 / FRAMES_PER_S)
    rows = known[np.searchsorted(recording.t_s[known], times).clip(max=len(known) - 1)]
    lowest, most = float(recording.x.min()), float(recording.x.max())
    highest = max(float(maps[rows].max()), np.finfo(float).tiny)
    sensor, (_, map_rows, map_cols) = card.reading["sensor"], maps.shape
    height, width = map_rows * CELL, map_cols * CELL
    tones = np.linspace(0, 1, SHADES)
    palette = np.concatenate([matplotlib.colormaps[name](tones, bytes=True)[:, :3] for name in ("Greys", "viridis")])
    of_maps = touches.touches(maps[rows], card)
    images = []
    for k, of_map in zip(rows, of_maps, strict=True):
        shades = np.zeros((height + 22, 2 * width + 12), np.uint8)  # places in the palette, of which 0 is white
        reading = (recording.x[k].reshape(sensor["rows"], sensor["cols"]) - lowest) / max(most - lowest, 1)
        for left, first_shade, values in ((0, 0, reading), (width + 12, SHADES, maps[k] / highest)):
            cells = first_shade + np.rint(np.clip(values[::-1], 0, 1) * (SHADES - 1)).astype(np.uint8)
            cells = cells.repeat(height // cells.shape[0], axis=0).repeat(width // cells.shape[1], axis=1)
            shades[:height, left : left + width] = cells
        picture = Image.fromarray(shades)
        said = f"{recording.t_s[k] - recording.t_s[0]:6.1f} s   " + "   ".join(
            f"{touch.kpa:.0f} kPa" for touch in of_map
        )
        pen = ImageDraw.Draw(picture)
        pen.text((4, height + 5), said, fill=SHADES - 1)
        for x_mm, y_mm in places(tips, k):
            x = width + 12 + x_mm / (sensor["cols"] * sensor["pitch_mm"]) * width
            y = height - y_mm / (sensor["rows"] * sensor["pitch_mm"]) * height
            pen.ellipse((x - RING, y - RING, x + RING, y + RING), outline=0, width=2)
        picture.putpalette(palette.tobytes())
        images.append(picture)
    images[0].save(path, save_all=True, append_images=images[1:], duration=1000 // FRAMES_PER_S, loop=0, optimize=True)
