"""Write the captions of the figures of strain: what each shows, from the numbers that are drawn."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from pipeline.reporting.sentences import best, caption, one_run, overlap
from pipeline.reporting.words.labels import plain
from pipeline.reporting.words.markdown import number
from pipeline.scoring.results import R2, Estimate, estimate
from pipeline.scoring.strain_results import LATENT


def performance(errors: Mapping[str, float], task: str, seconds: float) -> str:
    """Return the caption of figure 5, 6 or 8. errors: model -> mean distance (mm) over the seconds that are drawn."""
    nearest = best(one_run(errors), "mean error", "mm")
    return caption(f"{plain(task)}, first {seconds:g} s of the test part: {nearest}")


def drifting(moved_mv: np.ndarray, scatter_mv: np.ndarray, minutes: float, block_s: float) -> str:
    """Return the caption of the drift of the readings; see `figures.strain.drifting`."""
    return caption(
        f"in the {number(minutes, 0)} min of the test part of task 1, the mean over {block_s:g} s moves by "
        f"{number(moved_mv.min(), 1)} to {number(moved_mv.max(), 1)} mV, by strand",
        f"readings scatter around it with a standard deviation of {number(np.median(scatter_mv), 1)} mV (median over "
        "strands)",
    )


def latent_space(changes: np.ndarray, spreads: np.ndarray) -> str:
    """Return the caption of figure 7; see `figures.strain.latent_space`."""
    return caption(
        f"from the first to the last tenth of the test part, the mean of a state of model-0 changes by "
        f"{number(np.median(changes), 3)} (median of {len(changes)} states; {number(changes.max(), 3)} at most)",
        f"the standard deviation of a state is {number(np.median(spreads), 3)} (median)",
    )


def samples(table: pd.DataFrame) -> str:
    """Return the caption of the error by the number of training samples. table: see `strain.samples_sentences`."""
    parts = []
    for task, rows in table.groupby("protocol", sort=True):
        errors = rows.groupby(["model", "samples"])["value"].apply(estimate)
        direct, transfer = errors["lstm_direct"], errors["lstm_transfer"]
        close = sum(overlap(direct[n], transfer[n]) for n in direct.index)
        parts.append(
            f"{plain(task)}: {ahead(direct, transfer)}; the two intervals overlap at {close} of {len(direct)} sizes"
        )
    return caption(*parts)


def ahead(direct: Mapping[int, Estimate], transfer: Mapping[int, Estimate]) -> str:
    """Say at which numbers of samples transfer or direct training has the lower mean error."""
    sizes = sorted(direct.index)
    won = [f"{n:,}" for n in sizes if transfer[n].mean < direct[n].mean]
    lost = [f"{n:,}" for n in sizes if f"{n:,}" not in won]
    if not won:
        return "direct training is ahead at every size"
    if not lost:
        return f"transfer is ahead at every size, so the curves do not cross up to {sizes[-1]:,} samples"
    return f"transfer is ahead at {' / '.join(won)} samples, direct training at {' / '.join(lost)}"


def decoding(drift: pd.DataFrame) -> str:
    """Return the caption of what can be decoded from voltages and latent space. drift: see `strain.drift_sentences`."""
    parts = []
    for (task, target), rows in drift.groupby(["protocol", "target"], sort=True):
        r2 = rows.groupby("input", sort=False)["value"].apply(estimate, scale=R2)
        raw = next(name for name in r2.index if name.startswith("raw"))
        parts.append(
            f"{plain(task)}, {target}: R2 {number(r2[LATENT].mean)} from the latent space of model-0, "
            f"{number(r2[raw].mean)} from the raw voltages"
            + (", and their intervals overlap" if overlap(r2[LATENT], r2[raw]) else "")
        )
    return caption(*parts)


def error_over_time(by_time: Mapping[str, Mapping[str, np.ndarray]]) -> str:
    """Return the caption of the error over time; by_time: task -> model -> (seeds, bins) errors in mm."""
    parts = []
    for task, models in by_time.items():
        grown = sum(runs[:, -1].mean() > runs[:, 0].mean() for runs in models.values())
        last = {model: estimate(runs[:, -1]) for model, runs in models.items()}
        parts.append(
            f"{plain(task)}: from the first to the last tenth of the test part, the mean error grows for {grown} of "
            f"{len(models)} models; at the end {best(last, 'error', 'mm')}"
        )
    return caption(*parts)


def capacity(table: pd.DataFrame) -> str:
    """Return the caption of the error by the size of the LSTM. table: see `strain.capacity_sentences`."""
    parts = []
    for task, rows in table.groupby("protocol", sort=True):
        lowest, fewest, mean = enough_units(rows)
        text = f"{plain(task)}: {lowest} units have the smallest mean error, {number(mean[lowest], 3)} mm"
        if fewest != lowest:
            text += f"; {fewest} are the fewest within one standard error of it, {number(mean[fewest], 3)} mm"
        parts.append(text)
    return caption(*parts)


def enough_units(rows: pd.DataFrame) -> tuple[int, int, pd.Series]:
    """Return the best number of units, the fewest within one standard error of it, and the mean error (mm) of each."""
    groups = rows.groupby("units")["value"]
    mean, error = groups.mean(), groups.std(ddof=1) / np.sqrt(groups.size())
    lowest = mean.idxmin()
    return (
        lowest,
        min(units for units in mean.index if mean[units] <= mean[lowest] + np.nan_to_num(error[lowest])),
        mean,
    )


def strands(table: pd.DataFrame) -> str:
    """Return the caption of the error by the number of strands. table: see `strain.strands_sentences`."""
    parts = []
    for task, rows in table.groupby("protocol", sort=True):
        ratios = strand_ratios(rows)
        by_count = ", ".join(f"{number(ratio.mean)} with {count}" for count, ratio in ratios.items())
        parts.append(f"{plain(task)}: the error of transfer over that of direct training is {by_count} strands")
    return caption(*parts)


def strand_ratios(rows: pd.DataFrame) -> dict[int, Estimate]:
    """Return number of strands -> error of transfer over that of direct training, paired by seed."""
    error = rows.set_index(["strands", "seed", "model"])["value"].unstack()
    ratios = (error["lstm_transfer"] / error["lstm_direct"]).groupby("strands")
    return {count: estimate(ratio) for count, ratio in ratios}


def presses(distances: Mapping[str, Mapping[str, float]]) -> str:
    """Return the caption of the places of recorded presses. distances: name of a split -> model -> mean error (mm)."""
    return caption(
        *(
            f"{split}: {best(one_run(errors), 'mean error of the presses drawn', 'mm')}"
            for split, errors in distances.items()
        )
    )
