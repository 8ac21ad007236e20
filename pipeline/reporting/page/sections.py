"""Build the reviewer's page: answers, every paper with its experiments, stability, sizes, physics, claims, provenance.

All of it comes from the other reports. It refers to their figures and tables, so the folder reports/ is what is passed
on; nothing is loaded from a network. No date and no commit: the page is the same wherever the numbers are.
"""

from collections.abc import Mapping, Sequence

from markupsafe import Markup

from pipeline.base import paths
from pipeline.base.availability import why_not_shown
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.claims import entries
from pipeline.reporting.page import answers, charts, leaderboards, provenance, verdicts
from pipeline.reporting.page.hypertext import FIGURE, Pages, anchor, check_references, read, sections, title
from pipeline.reporting.page.templates import fill, part, script
from pipeline.reporting.speed import chart_caption
from pipeline.reporting.words.labels import FRONTS, capitalised, experiment_name
from pipeline.scoring.results import read_csv

HEADING = "Soft tactile sensing, reproduced"
DRAWN = {"tradeoff.png", "training.png"}  # of the folder speed: charts of the page show the same
CHAPTERS = {
    "rightsize": "How small a model each scene needs",
    "physics": "How much physics each scene needs",
    "twins": "How like the recordings the scenes are",
    "material": "How the recorded material behaves",
    "longer": "Which trainings had ended",
    "benchmarks": "How fast it is",
}
OPENING = {  # what the page begins with
    "answers": "Answers",
    "compared": "Our errors over the published ones",
    "speed": "Speed against accuracy",
}
# The figure that an experiment opens with; the others are folded.
FIRST_FIGURES = {
    "touch": "figure6.png",
    "velostat_recorded": "figure.png",
    "strain": "samples.png",
    "strain_recorded": "figure.png",
    "glove": "figure15.png",
    "glove_recorded": "confusion_combined.png",
}
FINDINGS = 3  # of an experiment that are open
LIBRARIES = ("vendor/d3.min.js", "vendor/plot.umd.min.js")
SCRIPTS = ("page.js", "charts.js")


def has_published(text: str) -> bool:
    """Tell whether a table of a Markdown text has a column of published numbers."""
    lines = text.splitlines()
    return any(
        "published" in line.lower() and below.startswith("| -") for line, below in zip(lines, lines[1:], strict=False)
    )


def document(workspace: Workspace, pages: Pages, name: str, level: int, fold: bool = True) -> Markup:
    """Return a Markdown report as HTML. fold: close sections after the first that only have tables of our numbers."""
    folder, _, _ = name.rpartition("/")
    text = read(workspace, name)
    parts = []
    for place, (heading, body) in enumerate(sections(text)):
        html = pages.render(body, folder, level, f"{title(text)}: {heading}" if heading else title(text))
        tables_only = heading.startswith("Where the code") or "| -" in body and not has_published(body)
        if heading and fold and place > 1 and tables_only:
            html = part("folded", heading, html)
        elif heading:
            html = Markup("<h{0}>{1}</h{0}>{2}").format(level + 2, heading.replace("`", ""), html)
        parts.append(html)
    return Markup('<div id="{}">{}</div>').format(anchor(name), Markup().join(parts))


def files(workspace: Workspace, folder: str, suffix: str) -> list[str]:
    """Return the names of the files of a folder below reports/, in order."""
    entries = paths.require(workspace.reports / folder, "dvc repro").iterdir()
    return sorted(path.name for path in entries if path.suffix == suffix)


def owner(name: str, experiments: Sequence[str]) -> str:
    """Return the experiment of a stability figure or heading: the longest experiment's name that it starts with."""
    fitting = (key for key in experiments if name == key or name.startswith((f"{key}_", f"{experiment_name(key)}:")))
    return max(fitting, key=len, default="")


def first_findings(workspace: Workspace, pages: Pages, folder: str) -> Markup:
    """Return the first findings of an experiment as a list."""
    lines = dict(sections(read(workspace, f"{folder}/README.md"))).get("Findings", "").splitlines()
    opened = [line for line in lines if line.startswith("- ")][:FINDINGS]
    return pages.render("\n".join(opened), folder, 2, "Findings")


def speed(workspace: Workspace, pages: Pages, experiment: str, name: str) -> list[tuple[str, Markup]]:
    """Return (heading, HTML) of the charts of speed against accuracy, and of the tables behind them."""
    folder = f"{experiment}/speed"
    table = read_csv(
        workspace.reports / folder / "table2.csv", charts.COLUMNS, f"python -m pipeline.stages.render {experiment}"
    )
    others = set(files(workspace, folder, ".png")) - DRAWN
    said = Markup().join(Markup("<p>{}</p>").format(chart_caption(table, time)) for time in FRONTS)
    drawn = said + charts.charts(table, name) + pages.rest(folder, "", others)
    tables = [
        (
            f"In numbers: {title(read(workspace, f'{folder}/{file}')) or file}",
            document(workspace, pages, f"{folder}/{file}", 2, fold=False),
        )
        for file in files(workspace, folder, ".md")
    ]
    return [("Speed against accuracy, every split", drawn), *tables]


def experiment_section(workspace: Workspace, pages: Pages, experiment: str, values: Mapping) -> tuple[str, Markup]:
    """Return one experiment's name and section: findings, figure, leaderboards, more; or why it was not run."""
    folder = f"{experiment}/accuracy"
    name = title(read(workspace, f"{folder}/README.md")).removesuffix(": results")
    if values[experiment].get("source") == "simulated":
        name = f"{name}: simulated"
    common = {"experiment": experiment, "name": name, "data": provenance.data_of(workspace, experiment, values)}
    if reason := why_not_shown(workspace, experiment):
        return name, fill("experiment", **common, reason=reason)
    reports = [file for file in files(workspace, folder, ".md") if file != "README.md"]
    everything = "\n".join(read(workspace, f"{folder}/{file}") for file in ("README.md", *reports))
    first = [file for file in files(workspace, folder, ".png") if file == FIRST_FIGURES.get(experiment)]
    findings, figure = first_findings(workspace, pages, folder), pages.rest(folder, everything, first)
    boards = leaderboards.leaderboards(workspace, experiment, name)
    details = [
        (title(read(workspace, f"{folder}/{file}")) or file, document(workspace, pages, f"{folder}/{file}", 2))
        for file in reports
    ]
    details.append(
        ("All findings, figures and differences from the paper", document(workspace, pages, f"{folder}/README.md", 2))
    )
    if further := pages.rest(folder, everything, files(workspace, folder, ".png")):
        details.append(("Further figures", further))
    details += speed(workspace, pages, experiment, name)
    opened = {"findings": findings, "figure": figure, "leaderboards": boards}
    return name, fill("experiment", **common, reason="", **opened, details=details)


def paper_sections(
    workspace: Workspace, pages: Pages, values: Mapping
) -> list[tuple[str, str, list[tuple[str, str]], Markup]]:
    """Return (id, title, its experiments' ids and names, HTML) of every paper of which an experiment is there."""
    built = []
    for paper, said in entries.papers(workspace).items():
        experiments = [key for key in (said.simulated, said.recorded) if key in values["experiments"]]
        inner = [(key, *experiment_section(workspace, pages, key, values)) for key in experiments]
        if inner:
            html = Markup().join(section for *_, section in inner)
            html = Markup('<section id="{}"><h2>{}</h2>{}</section>').format(paper, said.title, html)
            built.append((paper, said.title, [(key, words) for key, words, _ in inner], html))
    return built


def stability_of(workspace: Workspace, pages: Pages, experiment: str, experiments: Sequence[str]) -> Markup:
    """Return one experiment's part of the stability report. Raises InputError where there is none."""
    text = read(workspace, "stability/README.md")
    chosen = [section for section in sections(text) if owner(section[0], experiments) == experiment]
    if not chosen:
        raise InputError(f"reports/stability/README.md: nothing about {experiment}; run `dvc repro` again")
    opened = []
    for heading, body in chosen:
        kept = "\n".join(line for line in body.splitlines() if not FIGURE.match(line))
        words = capitalised(heading.partition(": ")[2] or heading)
        opened.append(Markup("<h4>{}</h4>{}").format(words, pages.render(kept, "stability", 3, heading)))
    figures = [
        name
        for name in files(workspace, "stability", ".png")
        if owner(name.removesuffix(".png"), experiments) == experiment
    ]
    maps = [name for name in figures if name.endswith("heat_map.png")]
    curves = [name for name in figures if name not in maps]
    if maps:
        opened.insert(0, pages.rest("stability", text, maps))
    if curves:
        gallery = pages.rest("stability", text, curves)
        opened.append(part("folded", "Error by severity, every perturbation", gallery))
    heading = Markup('<h3 id="stability-{}">{}</h3>').format(experiment, experiment_name(experiment))
    return heading + Markup().join(opened)


def stability_section(workspace: Workspace, pages: Pages, experiments: Sequence[str]) -> Markup:
    """Return the section on stability: what holds for all experiments, then each that was run."""
    text, general = read(workspace, "stability/README.md"), []
    for place, (heading, body) in enumerate(sections(text)):
        if owner(heading, experiments) or not body:
            continue
        html = pages.render(body, "stability", 3, heading or title(text))
        if place == 0:
            general.append(Markup('<div id="{}">{}</div>').format(anchor("stability/README.md"), html))
        else:
            general.append(part("folded", heading, html))
    each = [
        stability_of(workspace, pages, key, experiments) for key in experiments if not why_not_shown(workspace, key)
    ]
    return Markup('<section id="stability"><h2>Where trained models fail</h2>{}</section>').format(
        Markup().join([general[0], *each, *general[1:]])
    )


def embedded(workspace: Workspace, values: Mapping) -> list[str]:
    """Return the names of the reports that are on the page, each under an id of its own."""
    ran = [experiment for experiment in values["experiments"] if not why_not_shown(workspace, experiment)]
    folders = [f"{experiment}/{folder}" for experiment in ran for folder in ("accuracy", "speed")]
    names = [f"{folder}/{file}" for folder in folders for file in files(workspace, folder, ".md")]
    return [*names, "stability/README.md", *(report for reports in chapters(workspace).values() for report in reports)]


def chapters(workspace: Workspace) -> dict[str, list[str]]:
    """Return chapter -> its reports, of the CHAPTERS that there are: some are measured by hand."""
    reports = {chapter: sorted((workspace.reports / chapter).glob("*.md")) for chapter in CHAPTERS}
    return {chapter: [f"{chapter}/{file.name}" for file in there] for chapter, there in reports.items() if there}


def build(workspace: Workspace, values: Mapping) -> str:
    """Return the whole page; values: params.yaml."""
    pages = Pages(workspace, embedded(workspace, values))
    body, contents = [answers.section(workspace, pages, values)], [(key, name, []) for key, name in OPENING.items()]
    for paper, name, inner, html in paper_sections(workspace, pages, values):
        contents.append((paper, name, inner))
        body.append(html)
    contents.append(("stability", "Stability", []))
    body.append(stability_section(workspace, pages, values["experiments"]))
    for chapter, reports in chapters(workspace).items():
        text = Markup().join(document(workspace, pages, report, 1, fold=False) for report in reports)
        gallery = pages.rest(
            chapter, "\n".join(read(workspace, name) for name in reports), files(workspace, chapter, ".png")
        )
        heading = Markup('<section id="{}"><h2>{}</h2>').format(chapter, CHAPTERS[chapter])
        body.append(heading + text + gallery + Markup("</section>"))
        contents.append((chapter, CHAPTERS[chapter], []))
    contents.append(("verdicts", "Every claim", []))
    body.append(verdicts.section(workspace, pages))
    contents.append(("provenance", "Scale and provenance", []))
    body.append(provenance.section(workspace, values))
    html = fill(
        "page",
        heading=HEADING,
        style=script("page.css"),
        contents=contents,
        body=Markup("\n").join(body),
        libraries=Markup("\n").join(map(script, LIBRARIES)),
        scripts=Markup("\n").join(map(script, SCRIPTS)),
    )
    check_references(workspace, str(html))
    return str(html)
