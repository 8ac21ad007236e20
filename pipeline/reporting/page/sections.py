"""Build the reviewer's pages: answers, claims and provenance on the first, every table and figure on the second.

All of it comes from the tables in reports/; only what was measured by hand is shown as its Markdown says it. The pages
refer to figures in reports/, so that folder is what is passed on; nothing is loaded from a network. No date and no
commit: the pages are the same wherever the numbers are.
"""

import re
from collections.abc import Container, Mapping
from pathlib import Path

import pandas as pd
import yaml
from markupsafe import Markup

from pipeline.claims import entries, stability
from pipeline.claims.rules import BAND
from pipeline.reporting.figures import ratios
from pipeline.reporting.figures.answers import FILE as FIRST_PICTURE
from pipeline.reporting.page import answers, charts, claims, origins
from pipeline.reporting.page.hypertext import FOLDER, check_references, figure, fill, markdown
from pipeline.reporting.stability import FINDINGS, by_test, intervals, stability_table
from pipeline.reporting.tables import Table
from pipeline.results import one_table, shards
from tactile.base import files, paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.base.provenance import version as installed
from tactile.drawing.labels import condition_name, experiment_name, plain, task_name
from tactile.experiments import facts
from tactile.scoring.estimates import read_csv

HEADING = "Soft tactile sensing, reproduced"
CONTENTS = {"#answers": "Answers", "#findings": "Findings", "#compared": "Our errors over the published ones"}
CONTENTS |= {"#speed": "Speed against accuracy", "#stability": "Stability", "#verdicts": "Every claim"}
CONTENTS |= {"#provenance": "Provenance", "appendix.html": "Appendix"}
NUMBERS = ("scores", "latency", "counts", "stress", "rightsize", "physics", "twins", "claims")
PACKAGES = ("torch", "numpy", "scipy", "scikit-learn", "pandas", "pyarrow", "matplotlib")  # of those that make numbers
# Folders of reports/ that the appendix shows, after those of experiments.
CHAPTERS = {"stability": "Stability", "rightsize": "Model size", "physics": "Physics", "twins": "Scenes and recordings"}
CHAPTERS |= {"material": "Recorded material", "benchmarks": "Benchmarks"}
OF_OWN_LOGS = "its logs are your own, of which there is no evidence; their report is in reports/look"
NOT_COMPUTED = "none of its shards is in the evidence; `tactile evidence` computes them"
# A line of a list, `- [its file](its file): words`, or a picture with the words behind it in its paragraph.
CAPTIONED = re.compile(
    r"^(?:- \[[^\]]*|!\[(?P<title>[^\]]*))\]\((?P<stem>[^)\s]+)\.png\):? *(?P<words>.*(?:\n(?![\n!-]).+)*)\n",
    re.MULTILINE,
)
OF_PAPER = re.compile(r"figure(\d+[a-z]?)(?:_.*)?")  # the file of a figure that a paper has, too


def build(workspace: Workspace, values: Mapping) -> dict[str, str]:
    """Return the pages, file name -> HTML; write their chart, shards.md and the answers in README.md.

    values: all settings.

    index.html has answers, speed, stability, claims and provenance, appendix.html all further tables and figures.
    """
    content = yaml.safe_load((FOLDER / "content.yaml").read_text(encoding="utf-8"))
    judged = claims.read(workspace)
    own = one_table.of_own_logs(values)
    index = shards.table(shards.folder(workspace) / "index.csv", shards.INDEX)
    computed = set(index[index["protocol"] != shards.STUDY]["experiment"])
    there = {name for name in values["experiments"] if name in computed or speed_file(workspace, name).exists()}
    reasons = {name: "" if name in there else NOT_COMPUTED for name in values["experiments"]}
    shown = reasons | dict.fromkeys(own, OF_OWN_LOGS)
    data = {name: data_of(name, block) for name, block in values.items() if name in shown}
    speeds = {name: speed_table(workspace, name) for name, reason in shown.items() if not reason}
    failures = read_csv(workspace.reports / "stability" / "failures.csv", stability.FAILURES, "dvc repro")
    said = read_csv(workspace.reports / "stability" / "findings.csv", FINDINGS, "dvc repro")
    results = one_table.results(workspace, own)
    found = answers.answers(workspace, judged, results, content, values)
    ratios.chart(workspace.reports / answers.CHART, {one.heading: one.points for one in found}, BAND)
    answers.write_readme(workspace, found, judged)
    files.write_text(workspace.reports / origins.FILE, origins.document(workspace, results))
    papers = entries.papers(workspace)
    simulated = {key: (paper.simulated, paper.title) for key, paper in papers.items() if paper.simulated in speeds}
    titled = [last_panel(speeds[name], title, facts(name).paper.conditions) for name, title in simulated.values()]
    opening = fill(
        "answers",
        **answers.totals(judged),
        answers=found,
        pictures={one.paper: first_picture(workspace, papers[one.paper].simulated, one.asked) for one in found},
        link=Markup('<a href="{1}">{0}</a>').format,
        chart=figure(workspace, answers.CHART, "Our errors over the published ones, one panel per paper"),
        verdicts=claims.VERDICTS,
        speed=charts.data(pd.concat(titled), "Speed against accuracy") if titled else {},
    )
    first = [opening, stability_summary(failures, said), claims.section(workspace, judged)]
    contents = [(key, name, []) for key, name in CONTENTS.items()]
    index = fill("page", heading=HEADING, contents=contents, body=[*first, provenance(workspace, data)])
    body, contents = [], [("index.html", "Answers", [])]
    for key, paper in papers.items():
        inner = [name for name in (paper.simulated, *paper.recorded) if name in shown]
        parts = [experiment(workspace, name, shown[name], data[name], speeds.get(name)) for name in inner]
        if inner:
            body.append(fill("paper", key=key, title=paper.title, sections=parts))
            contents.append((f"#{key}", paper.title, [(f"#{name}", experiment_name(name)) for name in inner]))
    for name in CHAPTERS:
        if (chapter := documents(workspace, name, 2))["html"]:
            body.append(fill("chapter", key=name, title=CHAPTERS[name], **chapter))
            contents.append((f"#{name}", CHAPTERS[name], []))
    appendix = fill("page", heading=f"{HEADING}: appendix", contents=contents, body=body)
    pages = {"index.html": str(index), "appendix.html": str(appendix)}
    for name in pages:
        check_references(workspace, name, pages)
    return pages


def first_picture(workspace: Workspace, experiment: str, caption: str) -> dict | None:
    """Return the small picture of an experiment for the first screen, None where it has none."""
    name = f"{experiment}/accuracy/{FIRST_PICTURE}"
    return figure(workspace, name, caption) if (workspace.reports / name).exists() else None


def speed_file(workspace: Workspace, experiment: str) -> Path:
    """Return the file of the speed table of an experiment."""
    return workspace.reports / experiment / "speed" / "table2.csv"


def speed_table(workspace: Workspace, experiment: str) -> pd.DataFrame:
    """Read the speed table of an experiment."""
    path = speed_file(workspace, experiment)
    return read_csv(path, charts.COLUMNS, f"python -m pipeline.stages.render {experiment}")


def last_panel(speeds: pd.DataFrame, title: str, printed: Container[str]) -> pd.DataFrame:
    """Return the rows of the last panel, of a condition that a paper prints, with a title before its name."""
    of_paper = speeds[speeds["condition"].isin(printed)]
    panel = (of_paper if len(of_paper) else speeds)["panel"].iloc[-1]
    return speeds[speeds["panel"] == panel].assign(panel=f"{title}: {panel}")


def experiment(workspace: Workspace, name: str, reason: str, data: str, speeds: pd.DataFrame | None) -> Markup:
    """Return the section of an experiment: its chart and its reports; reason: why it was not run, if it was not."""
    common = {"experiment": name, "name": experiment_name(name), "data": data, "reason": reason}
    if speeds is None:
        return fill("experiment", **common)
    parts = {part.capitalize(): documents(workspace, f"{name}/{part}", 3) for part in ("accuracy", "speed")}
    return fill("experiment", **common, parts=parts, charts=charts.data(speeds, common["name"]))


def documents(workspace: Workspace, name: str, level: int) -> dict:
    """Return what a folder of reports/ holds: its documents as HTML, and its figures, with the captions they give.

    level: of the headings below which the documents stand. A line of a figure and its caption becomes that figure.
    """
    folder, captions, html = workspace.reports / name, {}, []
    for place, path in enumerate(sorted(folder.glob("*.md")), 1):
        text = path.read_text(encoding="utf-8")
        captions |= {found["stem"]: caption(**found.groupdict()) for found in CAPTIONED.finditer(text)}
        html.append(markdown(CAPTIONED.sub("", text), f"{name} {place}", name, level))
    others = (path for path in sorted(folder.glob("*.png")) if path.name != FIRST_PICTURE)  # which the first page has
    captions |= {path.stem: plain(path.stem) for path in others if path.stem not in captions}
    figures = [figure(workspace, f"{name}/{stem}.png", words) for stem, words in captions.items()]
    return {"html": Markup("\n").join(html), "figures": figures}


def caption(title: str | None, stem: str, words: str) -> str:
    """Return the caption of a figure from what its document says of it, after its number in the paper, if any."""
    if found := OF_PAPER.fullmatch(stem):
        title = f"Figure {found[1]}"
    return ". ".join(filter(None, [title, " ".join(words.replace("`", "").split())]))


def data_of(experiment: str, settings: Mapping) -> str:
    """Say where an experiment's numbers come from."""
    source = settings.get("source")
    if source is None:
        where = facts(experiment).source
        data = f"recorded, {where.repository} at commit {where.commit[:12]}, licence: {where.licence}"
    else:
        data = f"simulated by pipeline/scenes/{experiment}.py" if source == "simulated" else f"your own logs, {source}"
    return f"Data: {data}. Models: {len(settings['models'])}."


def stability_summary(failures: pd.DataFrame, said: pd.DataFrame) -> Markup:
    """Return the section: of each experiment the sentences on its first tested condition, and its table.

    failures, said: failures.csv and findings.csv of reports/stability.
    """
    shown = []
    for name in said["experiment"].unique():
        place = protocol, condition = facts(name).first_tested
        here, rows = ((each["experiment"] == name) & _at(each, *place) for each in (said, failures))
        if not here.any():
            continue
        sentences = [each for each in said[here].iloc[0][FINDINGS[3:]] if isinstance(each, str) and each]
        title = f"{experiment_name(name)}: {condition_name(name, protocol, condition)}"
        known = failures[rows]["largest"].notna().any()
        table = by_test(stability_table(failures[rows])) if known else None
        over = intervals(failures[rows]) if known else ""
        shown.append({"title": title, "sentences": sentences, "table": table, "intervals": over})
    return fill("stability", parts=shown)


def _at(table: pd.DataFrame, protocol: str, condition: str) -> pd.Series:
    """Return which rows are of this protocol and condition, (n,) bool."""
    return (table["protocol"] == protocol) & (table["condition"] == condition)


def versions(workspace: Workspace) -> Table:
    """Return this project's version and those that constraints.txt pins; InputError where one of PACKAGES is not."""
    file = paths.require(workspace.root / "constraints.txt", "git checkout constraints.txt")
    pinned = dict(line.split("==", 1) for line in file.read_text(encoding="utf-8").splitlines() if "==" in line)
    for package in PACKAGES:
        if package not in pinned:
            raise InputError(f"constraints.txt: no version of {package}; add a line '{package}==...'")
    rows = [["this project", installed()], *([package, pinned[package]] for package in PACKAGES)]
    return Table(["Package", "Version"], rows)


def provenance(workspace: Workspace, data: Mapping[str, str]) -> Markup:
    """Return the section: scale, data, seeds, versions, counts, and the files behind the page; data: by experiment."""
    columns = ["experiment", "condition", "metric", "n"]
    scores = read_csv(workspace.reports / "scores.csv", columns, "python -m pipeline.stages.collect")
    rows = []
    for experiment, said in data.items():
        own = scores[(scores["experiment"] == experiment) & (scores["metric"] == facts(experiment).metric)]
        tested = own.groupby("condition", sort=False)["n"].max()
        items = ", ".join(f"{task_name(condition)}: {n:,.0f}" for condition, n in tested.items()) or "-"
        rows.append([experiment_name(experiment), said, items])
    return fill(
        "provenance",
        data=Table(["Experiment", "Data", "Most items tested"], rows),
        versions=versions(workspace),
        files=NUMBERS,
    )
