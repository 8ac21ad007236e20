"""Write reports/glove: Tables 1 and 2 of the SP-ResNet paper beside the published numbers, and its figures."""

from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.reporting import experiment
from pipeline.reporting.figures import answers, curves
from pipeline.reporting.figures import glove as figures
from pipeline.reporting.report import Report
from pipeline.results import glove_results, kept
from pipeline.results.glove_results import COMPARED, MOST_CONFUSED
from pipeline.results.published import METHODS, precision, precision_gain
from pipeline.scenes import glove as glove_scene
from tactile.base import files
from tactile.base.paths import Workspace
from tactile.datasets import images
from tactile.datasets.images import MODALITIES, modality
from tactile.datasets.seeding import generator
from tactile.drawing import common, style
from tactile.drawing.labels import capitalised, form_name, model_name, plain, task_name
from tactile.experiments import glove as glove_experiment
from tactile.scoring.estimates import PLAIN, SHARE, estimate

METRICS = ("macro_precision", "accuracy")
FRAMES_OF = ("combined", "pressure")  # datasets of figure 15
SHOWN_N = 0.6  # of figure 7
SHOWN_OBJECTS = 4  # of figure 13
HELD_DEG, HELD_S = (0.0, 30.0, 45.0, 60.0, 90.0), 160.0  # of figure 9a: one after the other
BENDS = (300, 500 / 300)  # of figure 9b: how many, s
WRONG = ("accuracy", "Images classified incorrectly (%)")


def write(workspace: Workspace, target: Path, settings: Mapping, look: bool) -> None:
    """Write the report of `glove`; see `experiment`.

    Differs from paper: left open there and chosen here: batches of 32 images, and how the learning rate rises and falls
    (see `training.Schedule`); which frames are one input of figure 15, and how many sets of them an epoch has. STAG's
    code, whose figure it is, takes every frame as the first of one set, and the others from other clusters of its
    recording; here the images of a session are divided into sets, anew in every epoch, and an epoch sees as many images
    as one of one frame.
    Differs from paper: figure 15 is of the STAG data set; on the glove, a session is one grasp.
    """
    accuracy, report = target / "accuracy", Report(workspace, "glove", settings, look)
    protocols = glove_results.main_protocols(settings)
    counts = glove_results.read_counts(workspace)
    files.write_table(accuracy / "table1.csv", score_table(report, with_published=True))
    gains = augmentation_table(report)
    if augmented := bool(gains["gain"].notna().any()):
        files.write_table(accuracy / "table2.csv", gains)
    by_number = draw_frames(workspace, accuracy, settings)
    draw_laws(accuracy, settings)
    draw_readings(report, accuracy, next(iter(protocols.values())))
    asked = dict.fromkeys(protocols if "sp_resnet" in report.models else (), "sp_resnet")
    draw_confusions(report, accuracy, "figure14", asked)
    if "combined" in asked:
        draw_mistaken(report, accuracy / answers.FILE, protocols["combined"])
    groups = {task_name(dataset): protocol for dataset, protocol in protocols.items()}
    experiment.learning_curves(report, accuracy / "learning_curves.png", groups, "nats")
    report.write(
        accuracy / "README.md",
        "glove",
        splits=glove_results.splits(settings),
        methods={printed: ("sp_resnet", augmented_by(method)) for method, printed in METHODS.items()},
        absent={"augmentation": not augmented, "input_frames": not by_number},
        alike=glove_results.like_with_like(counts),
        counts=counts[counts["published_macs"].notna()].fillna({"note": ""}),
        confused={dataset: list(most_confused(report, dataset, protocols[dataset])) for dataset in asked},
        yardstick=settings["yardstick"],
    )
    panels = {task_name(dataset): (protocol, dataset) for dataset, protocol in protocols.items()}
    experiment.write_speed(report, target, settings, panels, WRONG)


def score_table(report: Report, with_published: bool = False) -> pd.DataFrame:
    """Return one row per protocol, model and metric, fractions in full precision."""
    runs = product(report.protocols, report.models, METRICS)
    places = ((protocol, modality(protocol), model, metric) for protocol, model, metric in runs)
    return report.scores(places, dict.fromkeys(METRICS, "1"), with_published)


def augmented_by(method: str) -> str:
    """Return the variant of SP-ResNet that a method of METHODS alone augments; the model of Table 1 has all."""
    return "" if method == "all" else f"augmentation_{method}"


def augmentation_table(report: Report) -> pd.DataFrame:
    """Return table2.csv: SP-ResNet's precision in unseen sessions by method, and its gain over none, paired by seed."""
    rows = []
    for metric, dataset, method in product(METRICS, MODALITIES, METHODS):
        runs = {
            name: report.results.runs("glove", f"session_{dataset}", dataset, "sp_resnet", metric, augmented_by(name))
            for name in (method, "none")
        }
        of_paper = metric == "macro_precision"
        printed = [function(method, dataset) / 100 for function in (precision, precision_gain)] if of_paper else []
        row = dict(zip(("published", "published_gain"), printed or (np.nan, np.nan), strict=True))
        row |= {
            "method": method,
            "condition": dataset,
            "metric": metric,
            "unit": "1",
            **estimate(runs[method], SHARE)._asdict(),
        }
        gain = estimate((runs[method] - runs["none"]).dropna())
        rows.append(row | {"gain": gain.mean, "gain_low": gain.low, "gain_high": gain.high})
    names = ["method", "condition", "metric", "unit", "published", "mean", "low", "high", "runs", "failed"]
    return pd.DataFrame(rows, columns=[*names, "published_gain", "gain", "gain_low", "gain_high"])


def most_confused(report: Report, dataset: str, protocol: str) -> Iterator[tuple[str, str]]:
    """Yield the most confused pairs of objects, and the share of their images that is given the other's name."""
    rows = report.results.rows(experiment="glove", protocol=protocol, condition=dataset, metric="confusion")
    pairs = [pair for pair in rows["variant"].unique() if pair != "mean_pair"]
    means = {
        pair: report.results.runs("glove", protocol, dataset, "sp_resnet", "confusion", pair).mean() for pair in pairs
    }
    for pair in sorted(pairs, key=lambda pair: -means[pair])[:MOST_CONFUSED]:
        yield pair, report.score(protocol, dataset, "sp_resnet", "confusion", pair, percent=True)


def draw_mistaken(report: Report, path: Path, protocol: str) -> None:
    """Draw which pairs of objects SP-ResNet, which sees both kinds of data, takes for each other most often."""
    place = ("glove", protocol, "combined", "sp_resnet", "confusion")
    pairs = [pair for pair, _ in most_confused(report, "combined", protocol)]
    rows = [(plain(pair.replace("_and_", ", ")), (100 * report.results.runs(*place, pair)).to_list()) for pair in pairs]
    if rows:
        answers.bars(path, "Objects that SP-ResNet takes for each other most often", "% of their images", rows, 50)


def draw_frames(workspace: Workspace, folder: Path, settings: Mapping) -> bool:
    """Draw figure 15 on the simulated glove and write its numbers; return whether there are any."""
    compared = [model for model in COMPARED if model in settings["models"]]
    frames = {dataset: glove_results.read_frames(workspace, dataset, compared) for dataset in FRAMES_OF}
    frames = {dataset: rows for dataset, rows in frames.items() if len(rows)}
    if frames:
        draw_by_frames(folder / "figure15.png", {task_name(dataset): rows for dataset, rows in frames.items()})
        together = pd.concat([rows.assign(condition=dataset) for dataset, rows in frames.items()])
        files.write_table(folder / "figure15.csv", together)
    return bool(frames)


def draw_by_frames(path: Path, tables: Mapping[str, pd.DataFrame]) -> None:
    """Draw macro precision against the number of input frames, one panel per table, rows as of `read_frames`."""
    panels, ticks, gloves = {}, set(), max(table["seed"].nunique() for table in tables.values())
    for name, table in tables.items():
        groups = table[table["metric"] == "macro_precision"].groupby(["model", "form"], sort=False)
        panels[name] = []
        for (model, form), runs in groups:
            values = {n: 100 * part["value"] for n, part in runs.groupby("frames")}
            dotted = {"linestyle": ":", "markerfacecolor": "white"} if form == "mean" else {}
            said = f"{model_name(model)}, {form_name(form)}"
            panels[name].append(curves.line(model, values, label=said, **dotted))
            ticks |= set(runs["frames"])
    number = "one simulated glove" if gloves == 1 else f"mean and dots of {gloves} simulated gloves"
    least = min(np.min(values) for lines in panels.values() for line in lines for values in line.values)
    limits = (10 * (least // 10), 100)  # points of difference are few, of one glove nothing: no axis of 3 points
    names = ("Number of input frames", "Macro precision (%)")
    title = f"Figure 15: several frames of a session ({number})"
    curves.curves(path, panels, title, names, PLAIN, limits=limits, ticks=sorted(ticks))


def draw_laws(folder: Path, settings: Mapping) -> None:
    """Draw figures 7 and 9 of one cell of the scene: its laws, as the glove's scanner reads them.

    Differs from paper: its figures 7 to 9 are measurements of the glove's own cells; here the scene's laws are drawn,
    without figure 8, the fatigue of a cell under 600 cycles, of which they have none.
    """
    scene = glove_scene.scene_of(settings)
    film, hz = scene["film"], scene["frame_hz"]
    rng = generator(scene["seed"], "calibration")

    def read(siemens: np.ndarray) -> np.ndarray:
        counts = glove_scene.scanned([siemens.reshape(len(siemens), -1, 1)], scene, rng)
        return glove_experiment.conductance(counts, scene["circuit"]["reference_ohm"]).mean(axis=1)

    force = np.linspace(0, SHOWN_N, 200)
    title = "Figure 7: a pressure cell of the scene"
    figures.pressed_cell(folder / "figure7.png", force, glove_scene.pressed_film(force, film), title)

    held_s = np.arange(round(HELD_S * hz)) / hz
    held = np.array(HELD_DEG)[(held_s * len(HELD_DEG) / HELD_S).astype(int)]
    bends, period_s = BENDS
    bent_s = np.arange(round(bends * period_s * hz)) / hz
    triangle = 1 - np.abs(2 * (bent_s / period_s % 1) - 1)  # from 0 up to 1 and back in every period
    cells = images.GLOVE["strain"].joint ** 2
    joint = [
        (time_s, read(np.repeat(glove_scene.bent_film(angle, film)[:, None], cells, axis=1)))
        for time_s, angle in ((held_s, held), (bent_s, HELD_DEG[-1] * triangle))
    ]
    title = f"Figure 9: a joint of the scene, held at angles and bent {bends} times; its law has no fatigue"
    figures.bent_joint(folder / "figure9.png", *joint, HELD_DEG, title)


def draw_readings(report: Report, folder: Path, protocol: str) -> None:
    """Draw figure 10, one grasp as images, and figure 13, the last frames of some objects' last sessions."""
    rows = report.drawn(protocol)
    rows = rows[rows["model"] == kept.READING]
    if rows.empty:
        return
    pictures, frames = rows[rows["named"].notna()], rows[rows["named"].isna()]
    values = zip(pictures["named"], pictures["values"], strict=True)
    shown = {dataset: cells.astype(float).reshape(images.SIDE, images.SIDE) for dataset, cells in values}
    title = f"Figure 10: one grasp ({plain(pictures['object'].iloc[0])}) as tactile images, each scaled by itself"
    areas = {name: area.place for name, area in images.GLOVE.items()}
    figures.tactile_images(folder / "figure10.png", shown, areas, style.literal(title))
    by_object = frames.groupby("object", observed=True, sort=False)["values"]
    sequences = {name: np.stack(own).astype(float).T for name, own in by_object}
    sequences = {name: sequences[name] for name in list(sequences)[:: -(-len(sequences) // SHOWN_OBJECTS)]}
    last = f"the last {kept.SEQUENCE_FRAMES} frames of an object's last session"
    title = f"Figure 13: {last}; below the line, joint means"
    figures.tactile_sequences(folder / "figure13.png", sequences, glove_experiment.PRESSURE_CELLS, title)


def draw_confusions(report: Report, folder: Path, name: str, models: Mapping[str, str]) -> None:
    """Draw <name>_<dataset>.png, the confusions of all seeds that are kept, together; models: dataset -> the model."""
    protocols = glove_results.main_protocols(report.settings)
    for dataset, model in models.items():
        rows = report.drawn(protocols[dataset])
        counts = rows[rows["model"] == model]
        if counts.empty:
            continue
        objects = sorted(set(rows["object"][rows["model"] == kept.LABEL]))
        matrix = counts.pivot_table("images", "object", "named", "sum", fill_value=0, observed=True)
        matrix = matrix.reindex(index=objects, columns=objects, fill_value=0).to_numpy()
        caption = report.caption(protocols[dataset], counts["seed"].nunique())
        title = f"{capitalised(task_name(dataset))}: {model_name(model)}\n{caption}"
        common.confusion_matrix(folder / f"{name}_{dataset}.png", matrix, objects, title)
