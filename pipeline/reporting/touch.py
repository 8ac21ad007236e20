"""Write reports/touch: Table I and Table II of the LoMP paper beside the published numbers, and its figures."""

from collections.abc import Mapping
from itertools import product
from pathlib import Path

from pipeline.base import files, paths
from pipeline.base.paths import Workspace
from pipeline.datasets import schemas
from pipeline.reporting import experiment
from pipeline.reporting.figures import common
from pipeline.reporting.figures import touch as figures
from pipeline.reporting.report import Report
from pipeline.reporting.words import templates
from pipeline.reporting.words.labels import model_name
from pipeline.scoring import metrics, studies
from pipeline.scoring.results import read_predictions, read_windows

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


def write(workspace: Workspace, target: Path, settings: Mapping) -> None:
    """Write the report of `touch`; see `experiment`."""
    accuracy, report = target / "accuracy", Report(workspace, "touch", settings)
    main = next(iter(settings["protocols"]))
    present = report.conditions(main)
    conditions = [name for name in CONDITIONS if name in present] + sorted(set(present) - set(CONDITIONS))
    runs = product(settings["protocols"], conditions, settings["models"], UNITS)
    files.write_table(accuracy / "table1.csv", report.scores(runs, UNITS, with_published=True))
    draw(workspace, accuracy, settings, main)
    experiment.learning_curves(workspace, accuracy / "learning_curves.png", "touch", settings, {main: main}, "kPa²")
    report.write(
        accuracy / "README.md",
        "touch",
        main=main,
        conditions=conditions,
        touch_kpa=metrics.touch_threshold_kpa(settings),
        ablation=ablation(report, main, settings["window"]["frames"]),
        yardstick=settings["yardstick"],
    )
    panels = {f"{name} touch": (main, name) for name in ("single", "double") if name in conditions}
    end = "\n" + templates.render("touch_times", r=report)
    experiment.write_speed(workspace, report, target, settings, panels, ("rmse", "RMSE (kPa)"), end=end)


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


def draw(workspace: Workspace, folder: Path, settings: Mapping, protocol: str) -> None:
    """Draw the paper's figures, those of predictions of the first run of a protocol."""
    seed, table = settings["protocols"][protocol]["seeds"][0], read_windows(workspace, "touch")
    windows = figures.windows_of(table, settings, protocol, seed)
    maps = {}
    for model in settings["models"]:
        predicted = read_predictions(workspace, "touch", model, protocol, seed, table)
        maps[model] = predicted[windows.rows].reshape(windows.truth.shape)
    figures.characteristic_curve(folder / "figure2b.png", settings["simulate"]["material"]["resistance_scale_ohm"])
    figures.peak_pressure(folder / "figure4.png", windows, maps)
    path = paths.require(workspace.frames("touch"), "python -m pipeline.stages.ingest touch")
    frames = schemas.read(path, columns=["condition", "v", "force_n", "x_mm", "y_mm"])
    figures.press_location(folder / "figure5.png", frames, settings)
    present, sensor = set(windows.condition), settings["sensor"]
    if "double" in present:
        figures.double_touch(folder / "figure6.png", windows, maps, sensor)
    figures.error_distribution(folder / "figure7.png", windows, maps)
    if present & SEVERAL_TOUCHES:
        title = "Figure 8: from readings to a pressure map; grid lines are the borders of the elements"
        shown = {model: maps[model] for model in MAP_MODELS if model in maps}
        chosen = figures.shown_maps(windows)
        common.maps(folder / "figure8.png", title, chosen, windows.counts, windows.truth, shown, sensor)
