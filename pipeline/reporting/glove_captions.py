"""Write the captions of the figures of the glove and of recorded grasps: what each shows, from what is drawn."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from pipeline.datasets.images import HIGHEST
from pipeline.reporting.sentences import best, caption
from pipeline.reporting.words.labels import form_name
from pipeline.reporting.words.markdown import code, interval, number
from pipeline.scoring.glove_results import FORMS, pair_shares, ranked_pairs
from pipeline.scoring.results import estimate

PRESSED = 0.1  # of the highest reading: what reads more counts as pressed, or bent


def pressed_cell(force_n: np.ndarray, siemens: np.ndarray) -> str:
    """Return the caption of figure 7; both (samples,), by rising force."""
    pressed, most = siemens[force_n > 0], force_n.max()
    return caption(
        f"the resistance of a pressure cell falls from {number(1e-3 / siemens[0], 1)} kΩ at rest to "
        f"{number(1e-3 / pressed[-1], 1)} kΩ at {most:g} N",
        f"its conductance rises from {number(1e3 * siemens[0])} to {number(1e3 * pressed[-1])} mS",
    )


def bent_joint(held: tuple, bends: tuple, angles: Sequence[float]) -> str:
    """Return the caption of figure 9; held, bends: see `figures.glove.bent_joint`."""
    by_angle = [1e3 * part.mean() for part in np.array_split(held[1], len(angles))]
    first, last = (1e3 * part.max() for part in np.array_split(bends[1], 10)[:: 10 - 1])
    return caption(
        f"the mean conductance of a joint's cells rises from {number(by_angle[0])} mS at {angles[0]:g}° to "
        f"{number(by_angle[-1])} mS at {angles[-1]:g}°",
        f"from the first to the last tenth of the bends, the highest changes by {100 * (last / first - 1):+.1f} %",
        "the law has no fatigue",
    )


def tactile_images(pictures: Mapping[str, np.ndarray], name: str) -> str:
    """Return the caption of figure 10. pictures: dataset -> image, 0 to HIGHEST; name: of the object."""
    palm, joints = (int((pictures[dataset] > PRESSED * HIGHEST).sum()) for dataset in ("pressure", "strain"))
    return caption(
        f"in a grasp of {code(name)}, {palm} cells of the palm and {joints} cells of the joints read more than "
        f"{100 * PRESSED:.0f} % of the highest value",
        "the three images are scaled on their own, so their colours do not compare",
    )


def tactile_sequences(sequences: Mapping[str, np.ndarray], cells: int) -> str:
    """Return the caption of figure 13; see `figures.glove.tactile_sequences`."""
    means = {name: float(values[:cells].mean()) for name, values in sequences.items()}
    most, least = max(means, key=means.get), min(means, key=means.get)
    text = f"{code(most)} presses the palm hardest, with a mean conductance of {number(means[most], 3)} mS"
    if most != least:
        text += f"; {code(least)} least, with {number(means[least], 3)} mS ({len(means)} objects)"
    return caption(text)


def confusion_matrix(counts: np.ndarray, objects: Sequence[str], dataset: str, model: str) -> str:
    """Return the caption of a confusion matrix. counts: (runs, classes, classes) images; model: its name."""
    if not len(counts):
        return caption(f"{dataset}: every run of {model} failed")
    total = counts.sum(axis=0)
    right = estimate([100 * np.trace(run) / run.sum() for run in counts])
    text = f"{dataset}: {model} classifies {interval(right, 1)} % of the images correctly"
    pair = ranked_pairs(total)[0]
    share = pair_shares(total)[pair]
    if not share > 0:
        return caption(f"{text}, and confuses no pair of objects")
    first, second = (code(objects[k]) for k in pair)
    return caption(
        text,
        f"most confused are {first} and {second}: {number(share, 1)} % of their images are given each other's name",
    )


def precision_by_frames(panels: Mapping[str, pd.DataFrame]) -> str:
    """Return the caption of figure 15. panels: see `figures.glove.precision_by_frames`."""
    parts = []
    for dataset, table in panels.items():
        rows = table[table["metric"] == "macro_precision"]
        for form in (form for form in FORMS if form in set(rows["form"])):
            of_form = rows[rows["form"] == form]
            most = of_form["frames"].max()
            values = {
                model: estimate(100 * runs["value"])
                for model, runs in of_form[of_form["frames"] == most].groupby("model", sort=False)
            }
            frames = f"{most} input {'frame' if most == 1 else 'frames'}"
            highest = best(values, "macro precision", "%", 1, more_is_better=True)
            parts.append(f"{dataset}, {frames}, {form_name(form)}: {highest}")
    return caption(*parts)
