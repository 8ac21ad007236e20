"""The reports of `touch` and `velostat_recorded`, written into a new folder."""

from pathlib import Path

from pipeline import figures_touch, figures_velostat, pages, report_touch, report_velostat
from pipeline.scoring import results
from pipeline.datasets import schemas
from pipeline.base import files, paths


def write_touch(settings: dict, target: Path) -> None:
    """Write the report of `touch` into the new folder `target`; settings: its block of params.yaml."""
    accuracy = target / "accuracy"
    scores, latency, table, protocol, seed = pages.read("touch", settings)
    windows = figures_touch.windows_of(table, settings, protocol, seed)
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

    files.write_table(accuracy / "table1.csv", report_touch.score_table(scores, settings, conditions))
    files.write_text(accuracy / "table1.md", report_touch.table_one(scores, settings, conditions))
    files.write_text(accuracy / "training.md", report_touch.training(fits, settings))
    trained = [fit for runs in fits.values() for fit in runs if fit.stop_reason != "closed_form"]
    differences = pages.own_differences("touch", settings)
    unseen = report_touch.unseen_products(
        schemas.matrix(table["x"])[:, -settings["sensor"]["rows"] * settings["sensor"]["cols"] :].astype(float),
        schemas.names(table[schemas.split_column(protocol, seed)]),
        schemas.names(table["condition"]),
        settings["sensor"],
    )
    files.write_text(
        accuracy / "README.md", report_touch.findings(scores, settings, conditions, trained, differences, unseen)
    )

    figures_touch.learning_curves(
        accuracy / "learning_curves.png",
        {model: fits[model, protocol] for model in settings["models"]},
        protocol,
    )
    figures_touch.characteristic_curve(accuracy / "figure2b.png", settings)
    figures_touch.peak_pressure(accuracy / "figure4.png", windows, maps, settings)
    figures_touch.press_location(accuracy / "figure5.png", frames, settings)
    if "double" in conditions:
        figures_touch.double_touch(accuracy / "figure6.png", windows, maps, settings)
    figures_touch.error_distribution(accuracy / "figure7.png", windows, maps, settings)
    if present & set(figures_touch.SEVERAL_TOUCHES):
        figures_touch.pressure_maps(accuracy / "figure8.png", windows, maps, settings)

    panels = {f"{name} touch": (protocol, name) for name in report_touch.TABLE_CONDITIONS if name in conditions}
    published = report_touch.published_times(latency, settings)
    pages.write_speed(target, settings, scores, latency, panels, ("rmse", "RMSE (kPa)"), end=published)


def write_velostat_recorded(settings: dict, target: Path) -> None:
    """Write the report of `velostat_recorded` into the new folder `target`; settings: its block of params."""
    accuracy = target / "accuracy"
    scores, latency, table, protocol, seed = pages.read("velostat_recorded", settings)
    test = schemas.names(table[schemas.split_column(protocol, seed)]) == "test"
    recordings = sorted(set(schemas.names(table["recording"])[test]))
    groups = ["all", *sorted({name.split("/")[0] for name in recordings}, key=_by_force)]
    best = report_velostat.best_model(scores, settings)
    drawn = [model for model in settings["models"] if model in ("linear", best)]
    predicted = {
        model: results.read_predictions("velostat_recorded", model, protocol, seed, table)
        for model in settings["models"]
    }

    files.write_table(accuracy / "table.csv", report_velostat.score_table(scores, settings, groups))
    files.write_text(accuracy / "table.md", report_velostat.score_text(scores, settings, groups))
    files.write_text(accuracy / "README.md", report_velostat.findings(scores, settings, groups, best))
    # The recordings that the best model (or, if all failed, the first) reads best, in the middle and worst.
    judge = best or next(iter(settings["models"]))
    order = sorted(
        recordings,
        key=lambda name: scores.estimate(protocol, name.split("/")[0], judge, "r2").mean,
        reverse=True,
    )
    chosen = [order[k] for k in sorted({0, len(order) // 2, len(order) - 1})]
    figures_velostat.force_over_time(
        accuracy / "figure.png", table, test, {model: predicted[model] for model in drawn}, chosen
    )

    pages.write_speed(target, settings, scores, latency, {"all recordings": (protocol, "all")}, ("rmse", "RMSE (N)"))


def _by_force(name: str) -> tuple:
    """pike1_force_5 before pike1_force_10."""
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in name.split("_"))
