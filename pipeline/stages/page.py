"""Stage: the reviewer's page: reports/index.html, verdicts first, then every experiment's report, size, physics, scale.

All of it comes from the other reports. It refers to their figures and tables, so the folder reports/ is what is passed
on; nothing is loaded from a network. No date and no commit: the page is the same wherever the numbers are.
Usage: python -m pipeline.stages.page
"""

import os
from collections.abc import Mapping
from html import escape

import pandas as pd

from pipeline.base import params, paths
from pipeline.base.availability import why_not_run
from pipeline.base.errors import InputError, run_stage
from pipeline.logs.sources import SOURCES
from pipeline.reporting.labels import model_name
from pipeline.reporting.markdown import number, size
from pipeline.reporting.page import charts, hypertext
from pipeline.reporting.page.hypertext import Pages, anchor, cell, read, sections, table, title
from pipeline.reporting.verdicts.rules import EXPERIMENTS, NOT_REPRODUCED, NOT_TESTABLE, PAPERS, REPRODUCED
from pipeline.scoring.results import read_csv

VERDICTS = {REPRODUCED: ("yes", "✓"), NOT_REPRODUCED: ("no", "✗"), NOT_TESTABLE: ("open", "–")}
CLAIMS = ["claim", "paper", "section", "data", "published", "ours", "low", "high", "verdict", "reason", "unit"]
CLAIMS += ["printed", "measured"]
SPEED = ["panel", "model", "measure", "error", "low", "high", "runs", "failed", "batch", "p50_ms", "p95_ms"]
SPEED += ["large_batch", "predictions_per_s", "train_s", "params", "macs", "size_bytes"]
SPEED += list(charts.FRONTS.values())
TABLES = ("table1.md", "table.md")  # an experiment's main table: open, the others folded
DRAWN = {"tradeoff.png", "training.png"}  # of the folder speed: charts of the page show the same
CHAPTERS = {
    "rightsize": "How small a model each scene needs",
    "physics": "How much physics each scene needs",
    "benchmarks": "How fast it is",
}
NUMBERS = ("scores", "latency", "counts", "stress", "rightsize", "physics", "claims")
PACKAGES = ("torch", "numpy", "scipy", "scikit-learn", "pandas", "pyarrow", "matplotlib")  # of those that make numbers


def value_text(value: float, unit: str) -> str:
    """A claim's number, rounded."""
    if unit == "count":
        return size(value) if value == value else "-"
    return number(value, 3 if abs(value) < 1 else 2)


def undecided(verdict: str, reason: str) -> bool:
    """Whether a claim is not reproduced for want of runs alone."""
    return verdict == NOT_REPRODUCED and "undecided" in reason and "contradicted" not in reason


def badge(verdict: str, reason: str = "") -> str:
    """A verdict in a colour and, for those who do not see it, a sign and the word."""
    kind, sign = VERDICTS[verdict]
    more = " unclear" if undecided(verdict, reason) else ""
    word = verdict + (": undecided" if more else "")
    return f'<span class="badge {kind}{more}"><span aria-hidden="true">{sign}\u00a0</span>{escape(word)}</span>'


def read_claims() -> pd.DataFrame:
    """claims.csv. Raises InputError for a paper or a verdict that nobody knows."""
    path, made_by = paths.REPORTS / "claims.csv", "python -m pipeline.stages.judge"
    claims = read_csv(path, CLAIMS, made_by)
    claims["reason"] = claims["reason"].astype(object).where(claims["reason"].notna(), "")
    for column, known in (("paper", PAPERS), ("verdict", VERDICTS)):
        unknown = sorted(set(claims[column].astype(str)) - set(known))
        if unknown:
            raise InputError(f"reports/claims.csv: {column} '{unknown[0]}' is unknown; run `{made_by}` again")
    return claims


def count_table(claims: pd.DataFrame) -> str:
    """Verdicts by paper and data."""
    header = ["Paper", "Data", *VERDICTS, "of not reproduced: undecided", "Claims"]
    rows = []
    groups = [((PAPERS[paper], data), own) for (paper, data), own in claims.groupby(["paper", "data"], sort=False)]
    for names, own in [*groups, (("All", ""), claims)]:
        counts = [int((own["verdict"] == verdict).sum()) for verdict in VERDICTS]
        counts += [sum(map(undecided, own["verdict"], own["reason"])), len(own)]
        attributes = {"class": "total"} if names[0] == "All" else {}
        rows.append((attributes, [*map(cell, names), *(cell(str(count)) for count in counts)]))
    return table("Verdicts by paper and data", header, rows)


def claim_table(claims: pd.DataFrame) -> str:
    """Every claim with its verdict; rows carry what the filter asks for."""
    header = ["Verdict", "Claim", "Paper", "Section", "Data", "Published", "Ours [95 % interval]", "Unit", "Reason"]
    rows = []
    for row in claims.itertuples():
        ours = value_text(row.ours, row.unit)
        if row.low == row.low:
            ours += f" [{value_text(row.low, row.unit)}, {value_text(row.high, row.unit)}]"
        kind = "number of a table" if row.printed else "sentence"
        attributes = {"data-paper": row.paper, "data-verdict": row.verdict, "data-data": row.data, "data-kind": kind}
        rows.append(
            (
                attributes,
                [
                    cell(badge(row.verdict, row.reason), html=True),
                    cell(row.claim + (" *" if row.measured else "")),
                    *map(cell, (PAPERS[row.paper], str(row.section), row.data)),
                    cell(value_text(row.published, row.unit), row.published),
                    cell(ours, row.ours),
                    *map(cell, (row.unit, row.reason)),
                ],
            )
        )
    return table("Every claim", header, rows)


def filters(claims: pd.DataFrame) -> str:
    """Controls of the table of claims; of use only where scripts run."""
    kinds = {"sentence": "sentence", "number of a table": "number of a table"}
    choices = {
        "paper": {key: PAPERS[key] for key in claims["paper"].unique()},
        "verdict": {key: key for key in VERDICTS},
        "data": {key: key for key in claims["data"].unique()},
        "kind": kinds,
    }
    parts = []
    for name, known in choices.items():
        options = "".join(f'<option value="{escape(key)}">{escape(word)}</option>' for key, word in known.items())
        parts.append(
            f'<label>{name.capitalize()} <select name="{name}"><option value="">all</option>{options}</select></label>'
        )
    return (
        f'<form class="filters" hidden>{"".join(parts)}<label>Words <input type="search" name="words"></label>'
        f'<output aria-live="polite">{len(claims)} of {len(claims)} claims</output></form>'
    )


def folded(heading: str, html: str, open_: bool = False) -> str:
    """A part of the page that opens and closes."""
    return f"<details{' open' if open_ else ''}><summary>{escape(heading)}</summary>{html}</details>"


def verdicts(pages: Pages, claims: pd.DataFrame) -> str:
    """The first section: how many claims came out, every claim, the rules, and what was tried."""
    unclear = sum(map(undecided, claims["verdict"], claims["reason"]))
    more = {NOT_REPRODUCED: f" {unclear} of them undecided: so few runs cannot tell"} if unclear else {}
    tiles = "".join(
        f'<li class="{kind}"><strong>{int((claims["verdict"] == verdict).sum())}</strong> {badge(verdict)}'
        f"{more.get(verdict, '')}</li>"
        for verdict, (kind, _) in VERDICTS.items()
    )
    text = read("claims.md")
    rules = pages.render(sections(text)[0][1], "", 2, "Rules")
    tried = "".join(
        folded(heading, pages.render(body, "", 3, heading))
        for heading, body in sections(text, "### ")
        if heading
        for body in [sections(body)[0][1]]
    )
    return (
        f'<section id="verdicts"><h2>A verdict on every claim</h2><ul class="tiles">{tiles}</ul>{count_table(claims)}'
        f'{folded("The rules", rules)}<h3 id="claims">Every claim</h3>{filters(claims)}{claim_table(claims)}'
        f"<h3>Where a claim is not reproduced</h3>{tried}</section>"
    )


def has_published(text: str) -> bool:
    """Whether a table of a Markdown text has a column of published numbers."""
    lines = text.splitlines()
    return any(
        "published" in line.lower() and below.startswith("| -") for line, below in zip(lines, lines[1:], strict=False)
    )


def document(pages: Pages, name: str, level: int, fold: bool = True) -> str:
    """A Markdown report. fold: close the sections after the first which only have tables of our own numbers."""
    folder, _, _ = name.rpartition("/")
    text = read(name)
    parts = []
    for place, (heading, body) in enumerate(sections(text)):
        own = pages.render(body, folder, level, heading or title(text))
        if not heading:
            parts.append(own)
        elif fold and place > 1 and (heading.startswith("Where the code") or "| -" in body and not has_published(body)):
            parts.append(folded(heading, own))
        else:
            parts.append(f"<h{level + 2}>{escape(heading.replace('`', ''))}</h{level + 2}>{own}")
    return f'<div id="{anchor(name)}">{"".join(parts)}</div>'


def files(folder: str, suffix: str) -> list[str]:
    """Names of the files of a folder below reports/, in order."""
    found = paths.require(paths.REPORTS / folder, "dvc repro")
    return sorted(path.name for path in found.iterdir() if path.suffix == suffix)


def owner(name: str, experiments: list[str]) -> str:
    """Whose a figure or heading of the stability report is: the longest name of an experiment that it starts with."""
    found = [one for one in experiments if name == one or name.startswith((f"{one}_", f"{one}:"))]
    return max(found, key=len, default="")


def stability(pages: Pages, experiment: str, experiments: list[str]) -> str:
    """One experiment's part of the stability report. Raises InputError where there is none."""
    parts = []
    for name, folds in (("README.md", False), ("failures.md", True)):
        text = read(f"stability/{name}")
        own = [(h, body) for h, body in sections(text) if owner(h, experiments) == experiment]
        if not own:
            raise InputError(f"reports/stability/{name}: nothing about {experiment}; run `dvc repro` again")
        for heading, body in own:
            kept = "\n".join(line for line in body.splitlines() if not line.startswith("Figures:"))
            html = pages.render(kept, "stability", 3, heading)
            words = heading.partition(": ")[2] or heading
            if folds:
                words = f"Where the models fail, {words}"
            parts.append(folded(words, html, open_=False) if folds else f"<h4>{escape(words)}</h4>{html}")
    figures = [
        (f"stability/{name}", name.removesuffix(".png").removeprefix(f"{experiment}_").replace("_", " "))
        for name in files("stability", ".png")
        if owner(name.removesuffix(".png"), experiments) == experiment
    ]
    gallery = pages.gallery(figures) if figures else ""
    return f"<h3>Stability</h3>{gallery}{''.join(parts)}"


def speed(pages: Pages, experiment: str, name: str) -> str:
    """The charts of speed against accuracy, and the tables behind them."""
    folder = f"{experiment}/speed"
    rows = read_csv(paths.REPORTS / folder / "table2.csv", SPEED, f"python -m pipeline.stages.render {experiment}")
    parts = [charts.charts(rows, name)]
    for file in files(folder, ".md"):
        text = read(f"{folder}/{file}")
        parts.append(folded(f"In numbers: {title(text) or file}", document(pages, f"{folder}/{file}", 2, fold=False)))
    others = set(files(folder, ".png")) - DRAWN
    return f"<h3>Speed against accuracy</h3>{''.join(parts)}{pages.rest(folder, '', others)}"


def experiment_section(pages: Pages, experiment: str, values: Mapping) -> str:
    """One experiment: findings, tables, charts, stability; or why it was not run."""
    text = read(f"{experiment}/accuracy/README.md")
    name = title(text).removesuffix(": results")
    start = f'<section id="{experiment}"><h2>{escape(name)}</h2><p class="note">{data_of(experiment, values)}</p>'
    if reason := why_not_run(experiment):
        return f'{start}<p class="absent"><strong>Not run:</strong> {escape(reason)}.</p></section>'
    folder = f"{experiment}/accuracy"
    reports = [file for file in files(folder, ".md") if file != "README.md"]
    opened, closed = [], []
    for file in reports:
        heading, html = title(read(f"{folder}/{file}")) or file, document(pages, f"{folder}/{file}", 2)
        if file in TABLES:
            opened.append(f"<h3>{escape(heading)}</h3>{html}")
        else:
            closed.append(folded(heading, html))
    parts = [*opened, *closed, document(pages, f"{folder}/README.md", 1)]
    everything = "\n".join(read(f"{folder}/{file}") for file in ("README.md", *reports))
    parts.append(pages.rest(folder, everything, files(folder, ".png")))
    parts += [speed(pages, experiment, name), stability(pages, experiment, values["experiments"])]
    return f"{start}{''.join(parts)}</section>"


def data_of(experiment: str, values: Mapping) -> str:
    """Where an experiment's numbers come from, and how often they were drawn; HTML."""
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
    return f"Data: {data}. Models: {len(settings['models'])}. Seeds: {seeds_of(settings)}."


def seeds_of(settings: Mapping) -> str:
    """How many seeds each split has, those with as many together; HTML."""
    groups: dict[int, list[str]] = {}
    for protocol, block in settings["protocols"].items():
        groups.setdefault(len(block["seeds"]), []).append(f"<code>{escape(protocol)}</code>")
    return "; ".join(f"{count} for {', '.join(names)}" for count, names in groups.items())


def general_stability(pages: Pages, experiments: list[str]) -> str:
    """What the stability report says of all experiments together."""
    parts = []
    for name in ("README.md", "failures.md", "training.md"):
        text = read(f"stability/{name}")
        for place, (heading, body) in enumerate(sections(text)):
            if owner(heading, experiments) or not body:
                continue
            html = pages.render(body, "stability", 3, heading or title(text))
            if place == 0:
                html = f'<div id="{anchor(f"stability/{name}")}">{html}</div>'
            if place == 0 and name == "README.md":
                parts.append(html)
            else:
                parts.append(folded(heading or title(text), html, open_=name == "README.md"))
    return f'<section id="stability"><h2>Where trained models fail</h2>{"".join(parts)}</section>'


def scale_of(values: Mapping) -> str:
    """The committed scale that params.yaml is at, or that it is at none of them."""
    for path in sorted((paths.ROOT / "scales").glob("*.yaml")):
        wanted = params.parsed(path)
        if all(_at(values, dotted) == value for dotted, value in wanted.items()):
            return path.stem
    return "none of scales/: own settings"


def _at(values: Mapping, dotted: str):
    for key in dotted.split("."):
        values = values.get(key) if isinstance(values, Mapping) else None
    return values


def versions() -> dict[str, str]:
    """Package -> version that constraints.txt pins. Raises InputError where one is not pinned."""
    lines = paths.require(paths.ROOT / "constraints.txt", "git checkout constraints.txt").read_text(encoding="utf-8")
    pinned = dict(line.split("==", 1) for line in lines.splitlines() if "==" in line)
    for package in PACKAGES:
        if package not in pinned:
            raise InputError(f"constraints.txt: no version of {package}; add a line '{package}==...'")
    return {package: pinned[package] for package in PACKAGES}


def provenance(values: Mapping) -> str:
    """Scale, data, seeds, versions, and the files behind the page."""
    scores = read_csv(paths.REPORTS / "scores.csv", ["experiment", "protocol", "condition", "n"], "dvc repro")
    rows = []
    for experiment in values["experiments"]:
        own = scores[scores["experiment"] == experiment]
        tested = own.groupby("condition", sort=False)["n"].max()
        words = ", ".join(f"{condition}: {n:,}" for condition, n in tested.items()) or "-"
        run = "no: " + reason if (reason := why_not_run(experiment)) else "yes"
        where = data_of(experiment, values)
        rows.append(({}, [cell(experiment), cell(where, html=True), cell(run), cell(words)]))
    data = table("Data of each experiment", ["Experiment", "Data and seeds", "Run", "Most items tested"], rows)
    pinned = table(
        "Versions in constraints.txt of the packages that make numbers",
        ["Package", "Version"],
        [({}, [cell(package), cell(version)]) for package, version in versions().items()],
    )
    counts = read_csv(paths.REPORTS / "counts.csv", ["experiment", "model", "macs", "params"], "dvc repro")
    header = [column.replace("_", " ") for column in counts.columns]
    lines = [({}, [count_cell(column, value) for column, value in row.items()]) for row in counts.to_dict("records")]
    links = ", ".join(f'<a href="{name}.csv">{name}.csv</a>' for name in NUMBERS)
    return (
        '<section id="provenance"><h2>Scale and provenance</h2>'
        f"<p>Scale: <strong>{escape(scale_of(values))}</strong>; all settings and seeds are in "
        '<a href="../params.yaml">params.yaml</a>. This page has no date and no commit, so that equal numbers give '
        "an equal page: <code>git log -1 -- reports</code> names the commit, <code>dvc.lock</code> the hash of every "
        f"input and output, MLflow the runs.</p>{data}{pinned}"
        f"{folded('Operations and parameters beside the printed ones', table('Counts', header, lines))}"
        f"<p>All numbers, in full precision: {links}.</p></section>"
    )


def count_cell(column: str, value) -> str:
    """A cell of counts.csv."""
    if value != value:
        return cell("-")
    if column == "model":
        return cell(model_name(value))
    if column == "verdict":
        return cell(badge(value), html=True) if value in VERDICTS else cell(str(value))
    return cell(size(value), value) if isinstance(value, (int, float)) else cell(str(value))


def embedded(values: Mapping) -> list[str]:
    """Names of the reports that are on the page, each under its own id."""
    ran = [experiment for experiment in values["experiments"] if not why_not_run(experiment)]
    folders = [f"{experiment}/{part}" for experiment in ran for part in ("accuracy", "speed")]
    names = [f"{folder}/{file}" for folder in folders for file in files(folder, ".md")]
    names += [f"stability/{name}.md" for name in ("README", "failures", "training")]
    return [*names, *(f"{chapter}/README.md" for chapter in chapters())]


def chapters() -> list[str]:
    """Those of CHAPTERS that there are: the benchmarks are no stage, but measured by hand."""
    measured = (paths.REPORTS / "benchmarks" / "README.md").exists()
    return [chapter for chapter in CHAPTERS if measured or chapter != "benchmarks"]


def build(values: Mapping) -> str:
    """Return the whole page; values: params.yaml."""
    pages, claims = Pages(embedded(values)), read_claims()
    body = [verdicts(pages, claims)]
    names = {"verdicts": "Verdicts"}
    for experiment in values["experiments"]:
        body.append(experiment_section(pages, experiment, values))
        names[experiment] = title(read(f"{experiment}/accuracy/README.md")).removesuffix(": results")
    body.append(general_stability(pages, values["experiments"]))
    names["stability"] = "Stability"
    for chapter in chapters():
        text = document(pages, f"{chapter}/README.md", 1)
        gallery = pages.rest(chapter, "", files(chapter, ".png"))
        body.append(f'<section id="{chapter}"><h2>{escape(CHAPTERS[chapter])}</h2>{text}{gallery}</section>')
        names[chapter] = CHAPTERS[chapter]
    body.append(provenance(values))
    names["provenance"] = "Scale and provenance"
    links = "".join(f'<li><a href="#{key}">{escape(name)}</a></li>' for key, name in names.items())
    css, js = (
        (paths.CODE / "reporting" / "page" / name).read_text(encoding="utf-8") for name in ("page.css", "page.js")
    )
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
    hypertext.check_references(html)
    return html


def main() -> None:
    """Write reports/index.html."""
    (paths.REPORTS / "benchmarks").mkdir(exist_ok=True)
    html = build(params.load())
    target = paths.REPORTS / "index.html"
    draft = target.with_name("index.html.unfinished")
    draft.write_text(html, encoding="utf-8", newline="\n")
    os.replace(draft, target)
    print(f"reports/index.html: {len(html.encode()) // 1024} KiB")


if __name__ == "__main__":
    run_stage(main)
