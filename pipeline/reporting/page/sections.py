"""Build the reviewer's pages: answers, claims and provenance on the first, every table and figure on the second.

All of it comes from the tables in reports/; only what was measured by hand is shown as its Markdown says it. The pages
refer to figures in reports/, so that folder is what is passed on; nothing is loaded from a network. No date and no
commit: the pages are the same wherever the numbers are.
"""

from collections.abc import Container, Mapping

import numpy as np
import pandas as pd
import yaml
from markupsafe import Markup

from pipeline.base import paths
from pipeline.base.availability import has_report, why_not_run, why_not_shown
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.claims import entries
from pipeline.claims.rules import BAND
from pipeline.logs.sources import SOURCES
from pipeline.reporting import tables
from pipeline.reporting.figures import ratios
from pipeline.reporting.page import answers, charts, claims
from pipeline.reporting.page.hypertext import FOLDER, Figure, check_references, figure, fill, markdown, script
from pipeline.reporting.speed import ESTIMATE, seconds
from pipeline.reporting.studies import JOINED, SUMMARY, TWIN_TITLES, sizes_title, stability_file
from pipeline.reporting.tables import Table
from pipeline.reporting.verdicts import stability
from pipeline.reporting.verdicts.sizes import JUDGED
from pipeline.reporting.words.labels import condition_name, experiment_name, model_name, perturbation, plain
from pipeline.reporting.words.markdown import interval, number, size
from pipeline.scoring import one_table
from pipeline.scoring.results import Estimate, read_csv

HEADING = "Soft tactile sensing, reproduced"
CONTENTS = {
    "#answers": "Answers",
    "#compared": "Our errors over the published ones",
    "#speed": "Speed against accuracy",
}
CONTENTS |= {"#stability": "Stability", "#verdicts": "Every claim", "#provenance": "Provenance"}
CONTENTS |= {"appendix.html": "Appendix"}
NUMBERS = ("scores", "latency", "counts", "stress", "rightsize", "physics", "twins", "claims")
PACKAGES = ("torch", "numpy", "scipy", "scikit-learn", "pandas", "pyarrow", "matplotlib")  # of those that make numbers
PHYSICS = ["experiment", "effect", "condition", "model", "before", "relative", "low", "high", "verdict", "consequence"]


def build(workspace: Workspace, values: Mapping) -> dict[str, str]:
    """Return the pages, file name -> HTML, and write their chart and the answers in README.md; values: all settings.

    index.html has answers, speed, stability, claims and provenance, appendix.html all further tables and figures.
    """
    content = yaml.safe_load((FOLDER / "content.yaml").read_text(encoding="utf-8"))
    judged = claims.read(workspace)
    shown = {name: why_not_shown(workspace, name) for name in values["experiments"]}
    data = {name: data_of(name, block) for name, block in values.items() if name in shown}
    speeds = {name: speed_table(workspace, name) for name, reason in shown.items() if not reason}
    failures = read_csv(workspace.reports / "stability" / "failures.csv", stability.FAILURES, "dvc repro")
    found = answers.answers(workspace, judged, one_table.results(workspace, one_table.of_own_logs(values)), content)
    ratios.chart(workspace.reports / answers.CHART, {one.heading: one.points for one in found}, BAND)
    answers.write_readme(workspace, found)
    papers = entries.papers(workspace)
    simulated = {key: (paper.simulated, paper.title) for key, paper in papers.items() if paper.simulated in speeds}
    titled = [
        last_panel(speeds[name], title, content["answers"][paper]["conditions"])
        for paper, (name, title) in simulated.items()
    ]
    opening = fill(
        "answers",
        claims=int(judged["kind"].isin(claims.claim_text.COUNTED).sum()),
        answers=found,
        chart=figure(workspace, answers.CHART, "Our errors over the published ones, one panel per paper"),
        verdicts=claims.VERDICTS,
        speed=charts.data(pd.concat(titled), "Speed against accuracy", list(charts.AXES)) if titled else {},
    )
    first = [opening, stability_summary(workspace, failures), claims.section(workspace, judged)]
    contents = [(key, name, []) for key, name in CONTENTS.items()]
    index = page(HEADING, contents, [*first, provenance(workspace, data)])
    body, contents = [], [("index.html", "Answers", [])]
    for key, paper in papers.items():
        inner = [name for name in (paper.simulated, paper.recorded) if name in shown]
        sections = []
        for name in inner:
            common = {"experiment": name, "name": experiment_name(name), "data": data[name], "reason": shown[name]}
            sections.append(
                fill("experiment", **common, **experiment(workspace, name, speeds[name], failures, content["figures"]))
                if not shown[name]
                else fill("experiment", **common)
            )
        if inner:
            body.append(fill("paper", key=key, title=paper.title, sections=sections))
            contents.append((f"#{key}", paper.title, [(f"#{name}", experiment_name(name)) for name in inner]))
    parts = {
        "stability": stability_parts(workspace, failures),
        "rightsize": rightsize_parts(workspace),
        "physics": physics_parts(workspace),
        "twins": twins_parts(workspace),
        **{name: document_parts(workspace, name, content["figures"]) for name in ("material", "benchmarks")},
        "counts": counts_parts(workspace),
    }
    for key, chapter in content["chapters"].items():
        if parts[key]:
            body.append(fill("chapter", key=key, **chapter, parts=parts[key]))
            contents.append((f"#{key}", chapter["title"], []))
    pages = {"index.html": index, "appendix.html": page(f"{HEADING}: appendix", contents, body)}
    for name in pages:
        check_references(workspace, name, pages)
    return pages


def page(heading: str, contents: list[tuple], body: list[Markup]) -> str:
    """Return a whole page; contents: (address, name, the same of what is in it)."""
    html = fill(
        "page",
        heading=heading,
        style=script("page.css"),
        contents=contents,
        body=Markup("\n").join(body),
        libraries=Markup("\n").join(map(script, ("vendor/d3.min.js", "vendor/plot.umd.min.js"))),
        scripts=Markup("\n").join(map(script, ("page.js", "charts.js"))),
    )
    return str(html)


def speed_table(workspace: Workspace, experiment: str) -> pd.DataFrame:
    """Read the speed table of an experiment."""
    path = workspace.reports / experiment / "speed" / "table2.csv"
    return read_csv(path, charts.COLUMNS, f"python -m pipeline.stages.render {experiment}")


def last_panel(speeds: pd.DataFrame, title: str, printed: Container[str]) -> pd.DataFrame:
    """Return the rows of the last panel, of a condition that a paper prints, with a title before its name."""
    of_paper = speeds[speeds["condition"].isin(printed)]
    panel = (of_paper if len(of_paper) else speeds)["panel"].iloc[-1]
    return speeds[speeds["panel"] == panel].assign(panel=f"{title}: {panel}")


def experiment(
    workspace: Workspace, name: str, speeds: pd.DataFrame, failures: pd.DataFrame, captions: Mapping[str, str]
) -> dict:
    """Return what the section of an experiment shows: its leaderboards, charts, figures and further tables."""
    boards = []
    for panel, rows in speeds.groupby("panel", sort=False):
        place = failures[["experiment", "protocol", "condition"]].eq([name, *rows[["protocol", "condition"]].iloc[0]])
        boards.append(
            (f"{experiment_name(name)}, {panel}", leaderboard(rows, stability.ranking(failures[place.all(axis=1)])))
        )
    folder = f"{name}/accuracy"
    drawn = {path.name for path in (workspace.reports / folder).glob("*.png")}
    known = [source.rpartition("/")[2] for source in captions if source.startswith(f"{folder}/")]
    order = [*(file for file in known if file in drawn), *sorted(drawn - set(known))]
    texts = sorted((workspace.reports / name).glob("*/*.md")), sorted((workspace.reports / name).glob("*/*.csv"))
    return {
        "boards": boards,
        "figures": [described(workspace, f"{folder}/{file}", captions) for file in order],
        "charts": charts.data(speeds, experiment_name(name), list(charts.AXES)),
        "files": [path.relative_to(workspace.reports).as_posix() for group in texts for path in group],
    }


def described(workspace: Workspace, source: str, captions: Mapping[str, str]) -> Figure:
    """Return a figure with its caption, or with the words of its name where it has none."""
    return figure(workspace, source, captions.get(source, plain(source.rpartition("/")[2].removesuffix(".png"))))


def leaderboard(rows: pd.DataFrame, relative: pd.Series) -> Table:
    """Return the table of one task. rows: of the speed table; relative: by model, see `stability.ranking`."""
    header = ["Model", rows["measure"].iloc[0], "Prediction (ms)", "Training (s)", "Parameters", "File (bytes)"]
    best = rows["error"].where(rows["failed"] == 0).min()
    cells = []
    for row in rows.to_dict("records"):
        error = interval(Estimate(*(row[key] for key in ESTIMATE)))
        first = Markup("<strong>{}</strong>").format(error) if row["error"] == best and not row["failed"] else error
        costs = [f"{row['p50_ms']:.3f}", seconds(row["train_s"]), size(row["params"]), size(row["size_bytes"])]
        cells.append([model_name(row["model"]), first, *costs, number(relative.get(row["model"], np.nan))])
    return Table([*header, "Error under stress"], cells)


def data_of(experiment: str, settings: Mapping) -> str:
    """Say where an experiment's numbers come from, and how often the look draws them."""
    source = settings.get("source")
    if source is None:
        where = SOURCES[experiment]
        data = f"recorded, {where.repository} at commit {where.commit[:12]}, licence: {where.licence}"
    else:
        data = f"simulated by pipeline/scenes/{experiment}.py" if source == "simulated" else f"your own logs, {source}"
    seeds = "; ".join(f"{plain(name)} {len(block['seeds'])}" for name, block in settings["protocols"].items())
    return f"Data: {data}. Models: {len(settings['models'])}. Seeds of each split in the look: {seeds}."


def study(workspace: Workspace, title: str, source: str, caption: str, listed: list[tuple[str, Table]]) -> dict:
    """Return a part of a chapter: a figure, if there is one, and tables with their names."""
    there = (workspace.reports / source).is_file()
    return {"title": title, "figures": [figure(workspace, source, caption)] if there else [], "tables": listed} | {
        "folded": [],
        "html": "",
    }


def stability_summary(workspace: Workspace, failures: pd.DataFrame) -> Markup:
    """Return the section: of each experiment one heat map, of its last condition, and what it shows."""
    shown = []
    for name, own in failures.groupby("experiment", sort=False):
        ranked = {place: stability.ranking(rows) for place, rows in own.groupby(["protocol", "condition"], sort=False)}
        places = [place for place, order in ranked.items() if len(order) and place[1] not in JOINED]
        if not places:
            continue
        protocol, condition = places[-1]
        rows = own[(own["protocol"] == protocol) & (own["condition"] == condition)]
        title = f"{experiment_name(name)}: {condition_name(name, protocol, condition)}"
        source = f"stability/{stability_file(name, protocol, condition)}_heat_map.png"
        order, means = ranked[protocol, condition], rows.groupby("perturbation", sort=False)["relative"].mean()
        words = {"best": model_name(order.index[0]), "least": order.iloc[0], "models": rows["model"].nunique()}
        words |= {
            "worst": model_name(order.index[-1]),
            "most": order.iloc[-1],
            "hardest": perturbation(means.idxmax())[0],
        }
        words |= {"holds": int((rows["verdict"] == stability.HOLDS).sum()), "tests": len(rows)}
        words |= {"useless": int((rows["verdict"] == stability.WORSE).sum())}
        shown.append(words | {"title": title, "figure": figure(workspace, source, f"{title}, relative error")})
    return fill("stability", parts=shown)


def stability_parts(workspace: Workspace, failures: pd.DataFrame) -> list[dict]:
    """Return the parts of the chapter on stability, one for each experiment and condition."""
    parts, seen = [], set()
    for (name, protocol, condition), rows in failures.groupby(["experiment", "protocol", "condition"], sort=False):
        title = f"{experiment_name(name)}: {condition_name(name, protocol, condition)}"
        file, caption = (
            f"stability/{stability_file(name, protocol, condition)}",
            f"{title}, relative error of each model",
        )
        listed = [(f"Stability, {title}", tables.stability(rows))]
        if name not in seen:
            seen.add(name)
            own = failures[failures["experiment"] == name]
            listed.insert(0, (f"Severities, {experiment_name(name)}", tables.severities(own)))
        part = study(workspace, title, f"{file}_heat_map.png", caption, listed)
        if (workspace.reports / f"{file}.png").is_file():
            part["folded"] = [figure(workspace, f"{file}.png", f"{title}, error by severity")]
        parts.append(part)
    return parts


def rightsize_parts(workspace: Workspace) -> list[dict]:
    """Return the parts of the chapter on sizes, one for each experiment."""
    judged = read_csv(workspace.reports / "rightsize.csv", JUDGED, "dvc repro")
    return [
        study(
            workspace,
            experiment_name(name),
            f"rightsize/{name}.png",
            "Error against size; a ring marks the smallest size that is enough, a diamond the published one",
            [
                (f"Sizes of {sizes_title(family)}", tables.rightsize(own))
                for family, own in rows.groupby("family", sort=False)
            ],
        )
        for name, rows in judged.groupby("experiment", sort=False)
    ]


def physics_parts(workspace: Workspace) -> list[dict]:
    """Return the parts of the chapter on physics, one for each experiment."""
    judged = read_csv(workspace.reports / "physics.csv", PHYSICS, "dvc repro")
    caption = "Change of each model's error without an effect, and half of its interval"
    return [
        study(
            workspace,
            experiment_name(name),
            f"physics/{name}.png",
            caption,
            [
                (f"Effects of the scene, {name}", tables.physics(own)),
                (f"Errors with all effects, {name}", tables.physics_errors(own)),
            ],
        )
        for name, own in judged.groupby("experiment", sort=False)
    ]


def twins_parts(workspace: Workspace) -> list[dict]:
    """Return the parts of the chapter on recordings and scenes, one for each experiment."""
    summary = read_csv(workspace.reports / "twins.csv", SUMMARY, "dvc repro")
    caption = "Where the simulated statistics lie in the recorded range"
    return [
        study(workspace, TWIN_TITLES[name], f"twins/{name}.png", caption, [(TWIN_TITLES[name], tables.twins(own))])
        for name, own in summary.groupby("experiment", sort=False)
    ]


def document_parts(workspace: Workspace, name: str, captions: Mapping[str, str]) -> list[dict]:
    """Return the documents of a folder that is filled by hand, and its figures; nothing where there is none."""
    folder = workspace.reports / name
    texts = [path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.md"))]
    html = Markup("\n").join(markdown(text, f"{name} {k}", name, 2) for k, text in enumerate(texts, 1))
    figures = [described(workspace, f"{name}/{path.name}", captions) for path in sorted(folder.glob("*.png"))]
    return [{"title": "", "figures": figures, "tables": [], "folded": [], "html": html}] if texts else []


def versions(workspace: Workspace) -> Table:
    """Return the versions that constraints.txt pins. Raises InputError where one of PACKAGES is not pinned."""
    file = paths.require(workspace.root / "constraints.txt", "git checkout constraints.txt")
    pinned = dict(line.split("==", 1) for line in file.read_text(encoding="utf-8").splitlines() if "==" in line)
    for package in PACKAGES:
        if package not in pinned:
            raise InputError(f"constraints.txt: no version of {package}; add a line '{package}==...'")
    return Table(["Package", "Version"], [[package, pinned[package]] for package in PACKAGES])


def provenance(workspace: Workspace, data: Mapping[str, str]) -> Markup:
    """Return the section: scale, data, seeds, versions, counts, and the files behind the page; data: by experiment."""
    scores = read_csv(workspace.reports / "scores.csv", ["experiment", "protocol", "condition", "n"], "dvc repro")
    rows = []
    for experiment, said in data.items():
        tested = scores[scores["experiment"] == experiment].groupby("condition", sort=False)["n"].max()
        items = ", ".join(f"{plain(condition)}: {n:,}" for condition, n in tested.items()) or "-"
        reason = why_not_run(workspace, experiment)
        run = f"no: {reason}" if reason else "yes"
        run += "; its results are the committed ones" if reason and has_report(workspace, experiment) else ""
        rows.append([experiment_name(experiment), said, run, items])
    return fill(
        "provenance",
        data=Table(["Experiment", "Data and seeds", "Run", "Most items tested"], rows),
        versions=versions(workspace),
        files=NUMBERS,
    )


def counts_parts(workspace: Workspace) -> list[dict]:
    """Return the part of the chapter on operations and parameters."""
    counts = read_csv(workspace.reports / "counts.csv", ["experiment", "model", "macs", "params"], "dvc repro")
    cells = [[count_cell(column, value) for column, value in row.items()] for row in counts.to_dict("records")]
    table = Table([plain(column) for column in counts.columns], cells)
    return [{"title": "", "figures": [], "tables": [("Counts", table)], "folded": [], "html": ""}]


def count_cell(column: str, value) -> str:
    """Return a cell of counts.csv."""
    if value != value:
        return "-"
    return model_name(value) if column == "model" else size(value) if isinstance(value, (int, float)) else str(value)
