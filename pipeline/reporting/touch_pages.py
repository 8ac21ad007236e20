"""The reports of `touch` and `velostat_recorded`, written into a new folder."""

from pathlib import Path

from pipeline.base import files, paths
from pipeline.datasets import schemas
from pipeline.reporting import (
    experiment as experiment_report,
)
from pipeline.reporting import (
    touch as touch_report,
)
from pipeline.reporting import (
    velostat_recorded as velostat_recorded_report,
)
from pipeline.reporting.figures import touch as touch_figures
from pipeline.reporting.figures import velostat as velostat_figures
from pipeline.scoring import results


def write_touch(settings: dict, target: Path) -> None:
    """Write the report of `touch` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, protocol, seed = experiment_report.read("touch", settings)
    windows = touch_figures.windows_of(table, settings, protocol, seed)
    present = set(windows.condition)
    known = ("single", "double", "three", "slide", "tape")
    conditions = [name for name in known if name in present] + sorted(present - set(known))
    fits = {
        (model, name): [results.read_fit("touch", model, name, number) for number in block["seeds"]]
        for model in settings["models"]
        for name, block in settings["protocols"].items()
    }
    maps = {
        model: results.read_predictions("touch", model, protocol, seed, table).reshape(windows.truth.shape)
        for model in settings["models"]
    }
    frames_path = paths.require(paths.frames("touch"), "python -m pipeline.stages.ingest touch")
    frames = schemas.read(frames_path, columns=["condition", "v", "force_n", "x_mm", "y_mm"])

    files.write_table(accuracy / "table1.csv", touch_report.score_table(scores, settings, conditions))
    files.write_text(accuracy / "table1.md", touch_report.table_one(scores, settings, conditions))
    files.write_text(accuracy / "training.md", touch_report.training(fits, settings))
    trained = [fit for runs in fits.values() for fit in runs if fit.stop_reason != "closed_form"]
    differences = experiment_report.own_differences("touch", settings)
    unseen = touch_report.unseen_products(
        schemas.matrix(table["x"])[:, -settings["sensor"]["rows"] * settings["sensor"]["cols"] :].astype(float),
        schemas.names(table[schemas.split_column(protocol, seed)]),
        schemas.names(table["condition"]),
        settings["sensor"],
    )
    files.write_text(
        accuracy / "README.md", touch_report.findings(scores, settings, conditions, trained, differences, unseen)
    )

    touch_figures.learning_curves(
        accuracy / "learning_curves.png",
        {model: fits[model, protocol] for model in settings["models"]},
        protocol,
    )
    touch_figures.characteristic_curve(accuracy / "figure2b.png", settings)
    touch_figures.peak_pressure(accuracy / "figure4.png", windows, maps, settings)
    touch_figures.press_location(accuracy / "figure5.png", frames, settings)
    if "double" in conditions:
        touch_figures.double_touch(accuracy / "figure6.png", windows, maps, settings)
    touch_figures.error_distribution(accuracy / "figure7.png", windows, maps, settings)
    if present & set(touch_figures.SEVERAL_TOUCHES):
        touch_figures.pressure_maps(accuracy / "figure8.png", windows, maps, settings)

    panels = {f"{name} touch": (protocol, name) for name in touch_report.TABLE_CONDITIONS if name in conditions}
    published = touch_report.published_times(latency, settings)
    experiment_report.write_speed(target, settings, scores, latency, panels, ("rmse", "RMSE (kPa)"), end=published)


def write_velostat_recorded(settings: dict, target: Path) -> None:
    """Write the report of `velostat_recorded` into the new folder `target`; settings: its block of params."""
    accuracy = target / "accuracy"
    scores, latency, table, protocol, seed = experiment_report.read("velostat_recorded", settings)
    test = schemas.names(table[schemas.split_column(protocol, seed)]) == "test"
    recordings = sorted(set(schemas.names(table["recording"])[test]))
    groups = ["all", *sorted({name.split("/")[0] for name in recordings}, key=_by_force)]
    best = velostat_recorded_report.best_model(scores, settings)
    drawn = [model for model in settings["models"] if model in ("linear", best)]
    predicted = {
        model: results.read_predictions("velostat_recorded", model, protocol, seed, table)
        for model in settings["models"]
    }

    files.write_table(accuracy / "table.csv", velostat_recorded_report.score_table(scores, settings, groups))
    files.write_text(accuracy / "table.md", velostat_recorded_report.score_text(scores, settings, groups))
    files.write_text(accuracy / "README.md", velostat_recorded_report.findings(scores, settings, groups, best))
    # The recordings that the best model (or, if all failed, the first) reads best, in the middle and worst.
    judge = best or next(iter(settings["models"]))
    order = sorted(
        recordings,
        key=lambda name: scores.estimate(protocol, name.split("/")[0], judge, "r2").mean,
        reverse=True,
    )
    chosen = [order[k] for k in sorted({0, len(order) // 2, len(order) - 1})]
    velostat_figures.force_over_time(
        accuracy / "figure.png", table, test, {model: predicted[model] for model in drawn}, chosen
    )

    experiment_report.write_speed(
        target, settings, scores, latency, {"all recordings": (protocol, "all")}, ("rmse", "RMSE (N)")
    )


def _by_force(name: str) -> tuple:
    """pike1_force_5 before pike1_force_10."""
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in name.split("_"))
