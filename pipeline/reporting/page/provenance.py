"""Build the section of the page that says where its numbers come from: scale, data, seeds and versions."""

from collections.abc import Mapping
from html import escape

from pipeline.base import params, paths
from pipeline.base.availability import why_not_run
from pipeline.base.errors import InputError
from pipeline.logs.sources import SOURCES
from pipeline.reporting.page.hypertext import cell, folded, table
from pipeline.reporting.page.verdicts import SIGNS, badge
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import size
from pipeline.scoring.results import read_csv

NUMBERS = ("scores", "latency", "counts", "stress", "rightsize", "physics", "twins", "claims")
PACKAGES = ("torch", "numpy", "scipy", "scikit-learn", "pandas", "pyarrow", "matplotlib")  # of those that make numbers
SCALE_WORDS = {
    "laptop": "<strong>laptop</strong>",
    "paper": "<strong>that of the papers</strong>",
    "both": "the same on a laptop and at the papers'",
    "other": "own settings, none of <code>scales/</code>",
}


def data_of(experiment: str, values: Mapping) -> str:
    """Say where an experiment's numbers come from, at which scale, and how often they were drawn; HTML."""
    settings = values[experiment]
    source = settings.get("source")
    if source is None:
        where = SOURCES[experiment]
        data = (
            f"recorded data, <code>{where.repository}</code> at commit <code>{where.commit[:12]}</code>, "
            f"licence: {escape(where.licence)}"
        )
    elif source == "simulated":
        data = f"simulated by <code>pipeline/scenes/{experiment}.py</code>"
    else:
        data = f"your own logs, <code>{escape(str(source))}</code>"
    scale = SCALE_WORDS[params.scale_of(experiment, settings)]
    return f"Data: {data}. Scale: {scale}. Models: {len(settings['models'])}. Seeds: {seeds_of(settings)}."


def seeds_of(settings: Mapping) -> str:
    """Say how many seeds each split has, splits with equally many together; HTML."""
    groups: dict[int, list[str]] = {}
    for protocol, block in settings["protocols"].items():
        groups.setdefault(len(block["seeds"]), []).append(f"<code>{escape(protocol)}</code>")
    return "; ".join(f"{count} for {', '.join(names)}" for count, names in groups.items())


def versions() -> dict[str, str]:
    """Return package -> version that constraints.txt pins. Raises InputError where one is not pinned."""
    lines = paths.require(paths.ROOT / "constraints.txt", "git checkout constraints.txt").read_text(encoding="utf-8")
    pinned = dict(line.split("==", 1) for line in lines.splitlines() if "==" in line)
    for package in PACKAGES:
        if package not in pinned:
            raise InputError(f"constraints.txt: no version of {package}; add a line '{package}==...'")
    return {package: pinned[package] for package in PACKAGES}


def section(values: Mapping) -> str:
    """Return the section: scale, data, seeds, versions, and the files behind the page; values: params.yaml."""
    scores = read_csv(paths.REPORTS / "scores.csv", ["experiment", "protocol", "condition", "n"], "dvc repro")
    lines = []
    for experiment in values["experiments"]:
        tested = scores[scores["experiment"] == experiment].groupby("condition", sort=False)["n"].max()
        items = ", ".join(f"{condition}: {n:,}" for condition, n in tested.items()) or "-"
        run = "no: " + reason if (reason := why_not_run(experiment)) else "yes"
        where = cell(data_of(experiment, values), html=True)
        lines.append(({}, [cell(experiment), where, cell(run), cell(items)]))
    data = table("Data of each experiment", ["Experiment", "Data and seeds", "Run", "Most items tested"], lines)
    pinned = table(
        "Versions in constraints.txt of the packages that make numbers",
        ["Package", "Version"],
        [({}, list(map(cell, pair))) for pair in versions().items()],
    )
    counts = read_csv(paths.REPORTS / "counts.csv", ["experiment", "model", "macs", "params"], "dvc repro")
    header = [column.replace("_", " ") for column in counts.columns]
    lines = [({}, [count_cell(column, value) for column, value in row.items()]) for row in counts.to_dict("records")]
    links = ", ".join(f'<a href="{name}.csv">{name}.csv</a>' for name in NUMBERS)
    return (
        '<section id="provenance"><h2>Scale and provenance</h2>'
        '<p>All settings and seeds are in <a href="../params.yaml">params.yaml</a>. This page has no date '
        "and no commit, so that equal numbers give an equal page: <code>git log -1 -- reports</code> names the commit, "
        f"<code>dvc.lock</code> the hash of every input and output, MLflow the runs.</p>{data}{pinned}"
        f"{folded('Operations and parameters beside the printed ones', table('Counts', header, lines))}"
        f"<p>All numbers, in full precision: {links}.</p></section>"
    )


def count_cell(column: str, value) -> str:
    """Return a cell of counts.csv as HTML."""
    if value != value:
        return cell("-")
    if column == "model":
        return cell(model_name(value))
    if column == "verdict" and value in SIGNS:
        return cell(badge(value), html=True)
    return cell(size(value), value) if isinstance(value, (int, float)) else cell(str(value))
