"""Build the section of the page that says where its numbers come from: scale, data, seeds and versions."""

from collections.abc import Mapping

from markupsafe import Markup

from pipeline.base import params, paths
from pipeline.base.availability import has_report, why_not_run
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.logs.sources import SOURCES
from pipeline.reporting.page.templates import SIGNS, Cell, Row, fill, part
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import size
from pipeline.scoring.results import read_csv

NUMBERS = ("scores", "latency", "counts", "stress", "rightsize", "physics", "twins", "claims")
PACKAGES = ("torch", "numpy", "scipy", "scikit-learn", "pandas", "pyarrow", "matplotlib")  # of those that make numbers
SCALE_WORDS = {
    "laptop": Markup("<strong>laptop</strong>"),
    "paper": Markup("<strong>that of the papers</strong>"),
    "both": "the same on a laptop and at the papers'",
    "other": Markup("own settings, none of <code>scales/</code>"),
}


def data_of(workspace: Workspace, experiment: str, values: Mapping) -> Markup:
    """Say where an experiment's numbers come from, at which scale, and how often they were drawn."""
    settings = values[experiment]
    source = settings.get("source")
    if source is None:
        where = SOURCES[experiment]
        data = Markup("recorded data, <code>{}</code> at commit <code>{}</code>, licence: {}").format(
            where.repository, where.commit[:12], where.licence
        )
    elif source == "simulated":
        data = Markup("simulated by <code>pipeline/scenes/{}.py</code>").format(experiment)
    else:
        data = Markup("your own logs, <code>{}</code>").format(source)
    scale = SCALE_WORDS[params.scale_of(workspace.scales, experiment, settings)]
    models = len(settings["models"])
    return Markup("Data: {}. Scale: {}. Models: {}. Seeds: {}.").format(data, scale, models, seeds_of(settings))


def seeds_of(settings: Mapping) -> Markup:
    """Say how many seeds each split has, splits with equally many together."""
    groups: dict[int, list[Markup]] = {}
    for protocol, block in settings["protocols"].items():
        groups.setdefault(len(block["seeds"]), []).append(Markup("<code>{}</code>").format(protocol))
    return Markup("; ").join(
        Markup("{} for {}").format(count, Markup(", ").join(names)) for count, names in groups.items()
    )


def versions(workspace: Workspace) -> dict[str, str]:
    """Return package -> version that constraints.txt pins. Raises InputError where one is not pinned."""
    lines = paths.require(workspace.root / "constraints.txt", "git checkout constraints.txt").read_text(
        encoding="utf-8"
    )
    pinned = dict(line.split("==", 1) for line in lines.splitlines() if "==" in line)
    for package in PACKAGES:
        if package not in pinned:
            raise InputError(f"constraints.txt: no version of {package}; add a line '{package}==...'")
    return {package: pinned[package] for package in PACKAGES}


def section(workspace: Workspace, values: Mapping) -> Markup:
    """Return the section: scale, data, seeds, versions, and the files behind the page; values: params.yaml."""
    scores = read_csv(workspace.reports / "scores.csv", ["experiment", "protocol", "condition", "n"], "dvc repro")
    data = []
    for experiment in values["experiments"]:
        tested = scores[scores["experiment"] == experiment].groupby("condition", sort=False)["n"].max()
        items = ", ".join(f"{condition}: {n:,}" for condition, n in tested.items()) or "-"
        run = "no: " + reason if (reason := why_not_run(workspace, experiment)) else "yes"
        run += "; its results are the committed ones" if reason and has_report(workspace, experiment) else ""
        data.append(Row([Cell(experiment), Cell(data_of(workspace, experiment, values)), Cell(run), Cell(items)]))
    counts = read_csv(workspace.reports / "counts.csv", ["experiment", "model", "macs", "params"], "dvc repro")
    return fill(
        "provenance",
        data=data,
        versions=[Row([Cell(package), Cell(version)]) for package, version in versions(workspace).items()],
        count_header=[column.replace("_", " ") for column in counts.columns],
        counts=[Row([count_cell(column, value) for column, value in row.items()]) for row in counts.to_dict("records")],
        files=NUMBERS,
    )


def count_cell(column: str, value) -> Cell:
    """Return a cell of counts.csv."""
    if value != value:
        return Cell("-")
    if column == "model":
        return Cell(model_name(value))
    if column == "verdict" and value in SIGNS:
        return Cell(part("badge", value))
    return Cell(size(value), value) if isinstance(value, (int, float)) else Cell(str(value))
