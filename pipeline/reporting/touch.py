"""Write reports/touch: Table I and Table II of the LoMP paper beside the published numbers, and its figures."""

import textwrap
from collections.abc import Mapping
from itertools import product
from pathlib import Path

import numpy as np

from pipeline.reporting import experiment, texts
from pipeline.reporting.figures import answers
from pipeline.reporting.figures import touch as figures
from pipeline.reporting.report import Report
from pipeline.reporting.speed import timed
from pipeline.results import kept, studies, times
from tactile.base import files
from tactile.base.paths import Workspace
from tactile.drawing import common
from tactile.drawing.labels import TIMES, model_name, plain, task_name
from tactile.scoring import metrics

UNITS = {  # of table1.csv
    "rmse": "kPa",
    "peak_error": "kPa",
    "location_error": "mm",
    "touches_found": "1",
    "force_error": "N",
    "force_rmse": "N",
    "force_r2": "1",
    "r2": "1",
}
CONDITIONS = ("single", "double", "three", "slide", "tape")
MAP_MODELS = ("rnn", "cnn", "lomp")  # of figure 8
SEVERAL_TOUCHES = {"double", "three", "slide", "tape"}  # conditions of figure 8


def write(workspace: Workspace, target: Path, settings: Mapping, look: bool) -> None:
    """Write the report of `touch`; see `experiment`."""
    accuracy, report = target / "accuracy", Report(workspace, "touch", settings, look)
    main = next(iter(settings["protocols"]))
    present = report.conditions(main)
    conditions = [name for name in CONDITIONS if name in present] + sorted(set(present) - set(CONDITIONS))
    runs = product(settings["protocols"], conditions, settings["models"], UNITS)
    files.write_table(accuracy / "table1.csv", report.scores(runs, UNITS, with_published=True))
    draw(report, accuracy, settings, main)
    experiment.learning_curves(report, accuracy / "learning_curves.png", {plain(main): main}, "kPa²")
    report.write(
        accuracy / "README.md",
        "touch",
        main=main,
        conditions=conditions,
        touch_kpa=metrics.touch_threshold_kpa(settings),
        ablation=ablation(report, main, settings["window"]["frames"]),
        yardstick=settings["yardstick"],
    )
    panels = {task_name(name): (main, name) for name in ("single", "double") if name in conditions}
    machine = times.one_machine([row[times.MACHINE] for row in timed(report, settings).values()], TIMES["p50_ms"])
    end = "\n" + texts.render("touch_times", r=report, machine=machine)
    experiment.write_speed(report, target, settings, panels, ("rmse", "RMSE (kPa)"), end=end)


def ablation(report: Report, protocol: str, frames: int) -> list[dict]:
    """Return what is changed in each variant that is no size of a ladder, and its errors over what it is compared with.

    Variants that were not computed are left out. frames: of a window in Table I, which a variant is compared with where
    it is like no other.
    """
    found, ladders = [], tuple(f"{family.name}_" for family in studies.FAMILIES.values())
    for name, variant in report.variants.items():
        (model, *_), beside = variant.models, variant.like
        if name.startswith(ladders) or report.results.rows(experiment="touch", variant=name).empty:
            continue
        ratios = {
            condition: report.ratio(
                (protocol, condition, model, "rmse", name), (protocol, condition, model, "rmse", beside)
            )
            for condition in ("single", "double")
        }
        known = report.variants[beside].set if beside else {}
        of_model = {key.rpartition(".")[2]: value for key, value in variant.set.items() if known.get(key) != value}
        seen = variant.set.get("touch.window.frames", frames)
        changed = ", ".join(f"{key} {value}" for key, value in of_model.items() if key != "frames")
        compared = beside or f"{model_name(model)}, Table I"
        found.append({"name": name, "of": model, "changed": changed, "frames": seen, "beside": compared})
        found[-1]["ratios"] = ratios
    return found


def draw(report: Report, folder: Path, settings: Mapping, protocol: str) -> None:
    """Draw the paper's figures, those of predictions where the first run of a protocol is kept."""
    figures.characteristic_curve(folder / "figure2b.png", settings["simulate"]["material"]["resistance_scale_ohm"])
    rows, caption, sensor = report.drawn(protocol), report.caption(protocol), settings["sensor"]
    if rows.empty:
        return
    windows, maps = figures.windows_of(rows, settings)
    figures.peak_pressure(folder / "figure4.png", windows, maps, caption)
    figures.press_location(folder / "figure5.png", rows[rows["model"] == kept.READING], settings)
    if windows.touched.any():
        figures.double_touch(folder / "figure6.png", windows, maps, sensor, caption)
    figures.error_distribution(folder / "figure7.png", windows, maps, caption)
    if set(windows.condition) & SEVERAL_TOUCHES:
        title = "Figure 8: from readings to pressure maps"
        label = settings["label"]
        names = [name for name in CONDITIONS if (windows.mapped & (windows.condition == name)).any()]
        at = [int(np.flatnonzero(windows.mapped & (windows.condition == name))[0]) for name in names]
        drawn = {
            model: np.stack(maps[model]["map"].iloc[at]).reshape(-1, label["map_rows"], label["map_cols"])
            for model in (kept.LABEL, *MAP_MODELS)
            if model in maps
        }
        truth = drawn.pop(kept.LABEL).astype(float)
        named, of = [textwrap.fill(task_name(name), 12) for name in names], common.pressures(truth)
        common.maps(folder / "figure8.png", title, caption, named, windows.counts[at], truth, drawn, sensor, of)
        if "double" in names and {"lomp", "cnn"} <= drawn.keys():
            k = names.index("double")
            shown = {"truth": truth[k]} | {model_name(model): drawn[model][k] for model in ("lomp", "cnn")}
            answers.pressed(folder / answers.FILE, f"Two touches, {caption}", shown, sensor)
