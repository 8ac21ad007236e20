"""Build the reviewer's page: verdicts first, then every experiment's report, stability, sizes, physics, provenance.

All of it comes from the other reports. It refers to their figures and tables, so the folder reports/ is what is passed
on; nothing is loaded from a network. No date and no commit: the page is the same wherever the numbers are.
"""

from collections.abc import Mapping
from html import escape

from pipeline.base import paths
from pipeline.base.availability import why_not_run
from pipeline.base.errors import InputError
from pipeline.reporting.page import charts, provenance, verdicts
from pipeline.reporting.page.hypertext import Pages, anchor, check_references, folded, read, sections, title
from pipeline.reporting.verdicts.rules import EXPERIMENTS
from pipeline.scoring.results import read_csv

TABLES = ("table1.md", "table.md")  # an experiment's main table: open, the others folded
DRAWN = {"tradeoff.png", "training.png"}  # of the folder speed: charts of the page show the same
CHAPTERS = {
    "rightsize": "How small a model each scene needs",
    "twins": "How like the recordings the scenes are",
    "physics": "How much physics each scene needs",
    "benchmarks": "How fast it is",
}
STABILITY = ("README.md", "failures.md", "training.md")


def has_published(text: str) -> bool:
    """Tell whether a table of a Markdown text has a column of published numbers."""
    lines = text.splitlines()
    return any(
        "published" in line.lower() and below.startswith("| -") for line, below in zip(lines, lines[1:], strict=False)
    )


def document(pages: Pages, name: str, level: int, fold: bool = True) -> str:
    """Return a Markdown report as HTML. fold: close sections after the first that only have tables of our numbers."""
    folder, _, _ = name.rpartition("/")
    text = read(name)
    parts = []
    for place, (heading, body) in enumerate(sections(text)):
        html = pages.render(body, folder, level, heading or title(text))
        if not heading:
            parts.append(html)
        elif fold and place > 1 and (heading.startswith("Where the code") or "| -" in body and not has_published(body)):
            parts.append(folded(heading, html))
        else:
            parts.append(f"<h{level + 2}>{escape(heading.replace('`', ''))}</h{level + 2}>{html}")
    return f'<div id="{anchor(name)}">{"".join(parts)}</div>'


def files(folder: str, suffix: str) -> list[str]:
    """Return the names of the files of a folder below reports/, in order."""
    entries = paths.require(paths.REPORTS / folder, "dvc repro").iterdir()
    return sorted(path.name for path in entries if path.suffix == suffix)


def owner(name: str, experiments: list[str]) -> str:
    """Return the experiment of a stability figure or heading: the longest experiment's name that it starts with."""
    fitting = (key for key in experiments if name == key or name.startswith((f"{key}_", f"{key}:")))
    return max(fitting, key=len, default="")


def stability(pages: Pages, experiment: str, experiments: list[str]) -> str:
    """Return one experiment's part of the stability report. Raises InputError where there is none."""
    parts = []
    for name in STABILITY[:2]:
        chosen = [part for part in sections(read(f"stability/{name}")) if owner(part[0], experiments) == experiment]
        if not chosen:
            raise InputError(f"reports/stability/{name}: nothing about {experiment}; run `dvc repro` again")
        for heading, body in chosen:
            kept = "\n".join(line for line in body.splitlines() if not line.startswith("Figures:"))
            html = pages.render(kept, "stability", 3, heading)
            words = heading.partition(": ")[2] or heading
            if name == "failures.md":
                parts.append(folded(f"Where the models fail, {words}", html))
            else:
                parts.append(f"<h4>{escape(words)}</h4>{html}")
    figures = [
        (f"stability/{name}", name.removesuffix(".png").removeprefix(f"{experiment}_").replace("_", " "))
        for name in files("stability", ".png")
        if owner(name.removesuffix(".png"), experiments) == experiment
    ]
    gallery = pages.gallery(figures) if figures else ""
    return f"<h3>Stability</h3>{gallery}{''.join(parts)}"


def speed(pages: Pages, experiment: str, name: str) -> str:
    """Return the charts of speed against accuracy, and the tables behind them."""
    folder = f"{experiment}/speed"
    made_by = f"python -m pipeline.stages.render {experiment}"
    parts = [charts.charts(read_csv(paths.REPORTS / folder / "table2.csv", charts.COLUMNS, made_by), name)]
    for file in files(folder, ".md"):
        heading = title(read(f"{folder}/{file}")) or file
        parts.append(folded(f"In numbers: {heading}", document(pages, f"{folder}/{file}", 2, fold=False)))
    others = set(files(folder, ".png")) - DRAWN
    return f"<h3>Speed against accuracy</h3>{''.join(parts)}{pages.rest(folder, '', others)}"


def experiment_section(pages: Pages, experiment: str, values: Mapping) -> tuple[str, str]:
    """Return one experiment's name and section: findings, tables, charts, stability; or why it was not run."""
    folder = f"{experiment}/accuracy"
    name = title(read(f"{folder}/README.md")).removesuffix(": results")
    data = provenance.data_of(experiment, values)
    start = f'<section id="{experiment}"><h2>{escape(name)}</h2><p class="note">{data}</p>'
    if reason := why_not_run(experiment):
        return name, f'{start}<p class="absent"><strong>Not run:</strong> {escape(reason)}.</p></section>'
    reports = [file for file in files(folder, ".md") if file != "README.md"]
    opened, closed = [], []
    for file in reports:
        heading, html = title(read(f"{folder}/{file}")) or file, document(pages, f"{folder}/{file}", 2)
        if file in TABLES:
            opened.append(f"<h3>{escape(heading)}</h3>{html}")
        else:
            closed.append(folded(heading, html))
    findings = document(pages, f"{folder}/README.md", 1)
    everything = "\n".join(read(f"{folder}/{file}") for file in ("README.md", *reports))
    parts = [*opened, *closed, findings, pages.rest(folder, everything, files(folder, ".png"))]
    parts += [speed(pages, experiment, name), stability(pages, experiment, values["experiments"])]
    return name, f"{start}{''.join(parts)}</section>"


def general_stability(pages: Pages, experiments: list[str]) -> str:
    """Return the part of the stability report that is of all experiments together."""
    parts = []
    for name in STABILITY:
        text = read(f"stability/{name}")
        for place, (heading, body) in enumerate(sections(text)):
            if owner(heading, experiments) or not body:
                continue
            html = pages.render(body, "stability", 3, heading or title(text))
            if place == 0:
                html = f'<div id="{anchor(f"stability/{name}")}">{html}</div>'
            first = place == 0 and name == "README.md"
            parts.append(html if first else folded(heading or title(text), html, open_=name == "README.md"))
    return f'<section id="stability"><h2>Where trained models fail</h2>{"".join(parts)}</section>'


def embedded(values: Mapping) -> list[str]:
    """Return the names of the reports that are on the page, each under an id of its own."""
    ran = [experiment for experiment in values["experiments"] if not why_not_run(experiment)]
    folders = [f"{experiment}/{part}" for experiment in ran for part in ("accuracy", "speed")]
    names = [f"{folder}/{file}" for folder in folders for file in files(folder, ".md")]
    names += [f"stability/{name}" for name in STABILITY]
    return [*names, *(f"{chapter}/README.md" for chapter in chapters())]


def chapters() -> list[str]:
    """Return the CHAPTERS that there are: the benchmarks are no stage, but measured by hand."""
    measured = (paths.REPORTS / "benchmarks" / "README.md").exists()
    return [chapter for chapter in CHAPTERS if measured or chapter != "benchmarks"]


def build(values: Mapping) -> str:
    """Return the whole page; values: params.yaml."""
    pages = Pages(embedded(values))
    body, names = [verdicts.section(pages)], {"verdicts": "Verdicts"}
    for experiment in values["experiments"]:
        names[experiment], section = experiment_section(pages, experiment, values)
        body.append(section)
    body.append(general_stability(pages, values["experiments"]))
    names["stability"] = "Stability"
    for chapter in chapters():
        text = document(pages, f"{chapter}/README.md", 1)
        gallery = pages.rest(chapter, "", files(chapter, ".png"))
        body.append(f'<section id="{chapter}"><h2>{escape(CHAPTERS[chapter])}</h2>{text}{gallery}</section>')
        names[chapter] = CHAPTERS[chapter]
    body.append(provenance.section(values))
    names["provenance"] = "Scale and provenance"
    links = "".join(f'<li><a href="#{key}">{escape(name)}</a></li>' for key, name in names.items())
    folder = paths.CODE / "reporting" / "page"
    css, js = ((folder / name).read_text(encoding="utf-8") for name in ("page.css", "page.js"))
    heading = "Soft tactile sensing, reproduced"
    html = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">'
        f"<title>{heading}</title>\n<style>\n{css}</style></head>\n<body><header><h1>{heading}</h1>"
        f"<p>Claims of {len(EXPERIMENTS)} papers on soft tactile sensors, re-run from raw logs. The "
        "numbers of all tables and charts are those of the other files of this folder.</p>"
        f'<nav aria-label="Contents"><ul>{links}</ul></nav></header>\n<main>{chr(10).join(body)}</main>\n'
        f"<script>\n{js}</script></body></html>\n"
    )
    check_references(html)
    return html
