"""Answer the question of each paper: its printed numbers beside ours, and findings in words, each with its verdict.

The answers stand in README.md, in short and at length, each between two markers, and on the first screen of the page.
What is compared and the words of the findings are in content.yaml; a number that the evidence does not have yet is said
to be missing.
"""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd
from jinja2 import Environment, StrictUndefined

from pipeline.claims import entries, rules
from pipeline.claims.rules import VERDICTS
from pipeline.reporting import claims as claim_text
from pipeline.reporting import texts
from pipeline.reporting.figures.ratios import Point
from pipeline.reporting.page import origins
from pipeline.reporting.tables import Table
from pipeline.results import published, shards, shown
from pipeline.results.claim_inputs import FULL, LOOK
from pipeline.results.one_table import Results
from tactile.base import files
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.drawing.labels import capitalised, model_name
from tactile.drawing.markdown import interval, number
from tactile.experiments import facts
from tactile.scoring.estimates import LOG, SHARE, Estimate, estimate, scale_of

CHART = "answers.png"  # in reports/
BLOCKS = {
    name: (f"<!-- {name}: written by `python -m pipeline.stages.page` -->", f"<!-- end of {name} -->")
    for name in ("summary", "answers")
}
HOLDS = {rules.REPRODUCED: "Yes", rules.CONTRADICTED: "No", rules.UNDECIDED: "Open"}  # as of what a paper asserts
BEYOND = "beyond the paper"  # in place of a verdict, where a finding is about no claim of the paper
NOT_COMPUTED = "not computed yet"
TOOLS = (
    "estimate",
    "printed",
    "ranked",
    "pooled",
    "failures",
    "side",
    "paired",
)  # of _Scores, for the findings


class Finding(NamedTuple):
    """A sentence about our numbers, the verdict on the claim that it is about, or BEYOND, and the id of that claim."""

    text: str
    verdict: str
    claim: str


class Answer(NamedTuple):
    """What is said of one paper.

    origins: for each cell of `table` where its shards are listed, from reports/, empty for what is no number of ours;
    asked, short: its question and answer in a line; heading, points: of its panel of the chart; counts: data -> verdict
    -> claims.
    """

    paper: str
    title: str
    question: str
    asked: str
    short: str
    basis: str
    table: Table
    origins: list[list[str]]
    findings: list[Finding]
    heading: str
    points: dict[str, list[Point]]
    counts: list[tuple[str, list[tuple[str, int]]]]
    claims: int

    def linked(self, link: Callable[[str, str], str]) -> Table:
        """Return the table, our numbers in it as links to their shards; link: of text and an address in reports/."""
        rows = [
            [_first_linked(cell, at, link) if at else cell for cell, at in zip(row, places, strict=True)]
            for row, places in zip(self.table.rows, self.origins, strict=True)
        ]
        return Table(self.table.header, rows)


def _first_linked(cell: str, place: str, link: Callable[[str, str], str]) -> str:
    """Return a cell in which the number is a link, and its interval is not."""
    text, space, more = cell.partition(" ")
    return link(text, place) + space + more


class Absent(Exception):
    """The evidence has no run of what a sentence asks for."""


def answers(
    workspace: Workspace, claims: pd.DataFrame, results: Results, content: Mapping, values: Mapping
) -> list[Answer]:
    """Return the answer of each paper whose simulated experiment is reported.

    claims: as of page.claims.read; values: all settings.
    """
    papers = entries.papers(workspace)
    return [
        _answer(papers[key], asked, claims, results, values)
        for key, asked in content["answers"].items()
        if (claims["paper"] == key).any() and (workspace.reports / papers[key].simulated).exists()
    ]


def write_readme(workspace: Workspace, found: list[Answer], claims: pd.DataFrame) -> None:
    """Write these answers between the markers of README.md, if there is one. Raises InputError where it lacks them.

    claims: as of `answers`. DVC is not told of README.md: it deletes what it is told of.
    """
    if not (path := workspace.root / "README.md").exists():
        return
    tables = [one.linked(lambda text, place: f"[{text}](reports/{place})") for one in found]
    index = shards.table(shards.folder(workspace) / "index.csv", shards.INDEX)
    rendered = {
        "summary": texts.render(
            "summary", answers=found, **totals(claims), shards=len(index), core_s=index["core_s"].astype(float).sum()
        ),
        "answers": texts.render("answers", answers=zip(found, tables, strict=True), chart=f"reports/{CHART}"),
    }
    now = text = path.read_text(encoding="utf-8")
    for name, (start, end) in BLOCKS.items():
        before, at, rest = now.partition(start)
        _, ended, after = rest.partition(end)
        if not ended:
            raise InputError(f"README.md: the line '{end if at else start}' is missing; put it back")
        now = f"{before}{at}\n\n{rendered[name]}\n{ended}{after}"
    if now != text:
        files.write_text(path, now)


def totals(claims: pd.DataFrame) -> dict:
    """Return how many claims count, and verdict -> how many of them have it."""
    counted = claim_text.counted(claims)
    return {
        "total": len(counted),
        "counts": {verdict: int((counted["verdict"] == verdict).sum()) for verdict in VERDICTS},
    }


def _answer(paper: entries.Paper, asked: Mapping, claims: pd.DataFrame, results: Results, values: Mapping) -> Answer:
    own = claims[claims["paper"] == paper.key].set_index("id")
    scores = _Scores(results, paper, values[paper.simulated])
    counted = claim_text.counted(own)
    table, places, heading, points, basis = _beside(scores, asked, own)
    return Answer(
        paper=paper.key,
        title=paper.title,
        question=asked["question"],
        asked=asked["asked"],
        short=_written(scores, asked["short"], own) or f"{NOT_COMPUTED.capitalize()}.",
        basis=basis,
        table=table,
        origins=places,
        findings=[_finding(scores, one, own) for one in asked["findings"]],
        heading=f"{paper.title}\n{heading}",
        points=points,
        counts=[
            (data, [(verdict, int((rows["verdict"] == verdict).sum())) for verdict in VERDICTS])
            for data, rows in counted.groupby("data")
        ],
        claims=len(own),
    )


class _Scores:
    """The evidence on one simulated experiment, beside what its paper prints; shares are in %."""

    def __init__(self, results: Results, asked: entries.Paper, settings: Mapping):
        self.results, self.experiment, self.settings = results, asked.simulated, settings
        self.sources, self.paper = asked.sources, facts(asked.simulated).paper
        self.metric, self.units = self.paper.metric, self.paper.times
        self.models = list(published.PRINTED[self.paper.key])

    def printed(self, condition: str, model: str) -> float:
        """Return the number that the paper prints, NaN where there is none."""
        return published.number(self.paper.key, model, condition, self.paper.printed)

    def runs(self, protocol: str, condition: str, model: str, metric: str = "", variant: str = "") -> pd.Series:
        """Return seed -> value. Raises Absent where the evidence has none."""
        runs = self.results.runs(self.experiment, protocol, condition, model, metric or self.metric, variant)
        if self.results.shown(self.experiment, protocol) == LOOK or not len(runs):
            raise Absent
        return runs * (100 if scale_of(metric or self.metric) == SHARE else 1)

    def estimate(self, protocol: str, condition: str, model: str, metric: str = "", variant: str = "") -> Estimate:
        """Return mean and interval over the seeds. Raises Absent where the evidence has none."""
        runs, scale = self.runs(protocol, condition, model, metric, variant), scale_of(metric or self.metric)
        return estimate(runs / 100, scale).percent() if scale == SHARE else estimate(runs, scale)

    def ranked(self, protocol: str, condition: str) -> list[tuple[str, float]]:
        """Return (name, mean) of the paper's models, the best first."""
        means = [(model_name(at), self.estimate(protocol, condition, at).mean) for at in self.models]
        return sorted(means, key=lambda pair: pair[1], reverse=self.units == 100)

    def pooled(self, data: str, condition: str, metric: str = "") -> dict[str, Estimate]:
        """Return model -> a score over all splits of recordings together, with its interval, the lowest first.

        data: as claims name it; a model that lacks a split is left out. Raises Absent where all do.
        """
        source = self.sources[data]
        metric, models = metric or source.metric, self.results.rows(experiment=source.experiment)["model"].unique()
        places = {model: (source.experiment, source.protocol, condition, model, metric, "", FULL) for model in models}
        draws = {model: self.results.draws(*place) for model, place in places.items()}
        found = {model: rules.interval(values) for model, values in draws.items() if len(values)}
        if not found:
            raise Absent
        found = {model: each.percent() if scale_of(metric) == SHARE else each for model, each in found.items()}
        return dict(sorted(found.items(), key=lambda pair: pair[1].mean))

    def failures(self, conditions: Mapping[str, str], model: str) -> tuple[int, int]:
        """Return how many trainings failed, and of how many; conditions: protocol -> the condition that shows it.

        A training failed where its error is not finite, or above that of the constant model of the same seed.
        """
        pairs = [(self.runs(*at, model), self.runs(*at, "constant")) for at in conditions.items()]
        failed = [~(runs <= floor.reindex(runs.index)) for runs, floor in pairs]
        return sum(int(each.sum()) for each in failed), sum(map(len, failed))

    def side(self, protocol: str, condition: str, one: str, other: str, metric: str = "") -> int:
        """Return -1, 0 or 1: one model's values less another's, paired by seed, are below, around or above 0."""
        places = ((protocol, condition, model, metric) for model in (one, other))
        spread = estimate(np.subtract(*(self.runs(*place) for place in places)).dropna())
        return int(spread.low > 0) - int(spread.high < 0)

    def paired(self, protocol: str, condition: str, model: str, variant: str) -> Estimate:
        """Return a variant's error over that of the model itself, paired by seed. Raises Absent where there is none."""
        own, other = (self.runs(protocol, condition, model, variant=name) for name in ("", variant))
        return estimate((other / own).dropna(), LOG)


def _beside(scores: _Scores, asked: Mapping, own: pd.DataFrame) -> tuple[Table, list, str, dict[str, list[Point]], str]:
    """Return a paper's table with ours beside it, the origins of its cells, heading and points of its chart, its basis.

    What stands there `shown.paper_table` says.
    """
    paper, columns = scores.paper, shown.paper_table(scores.results, scores.experiment)
    header, cells = ["Model"], {model: [model_name(model)] for model in scores.models}
    places = {model: [""] for model in scores.models}
    points: dict[str, list[Point]] = {title: [] for title in paper.conditions.values()}
    own_split, first = next(iter(paper.splits.items()))
    seeds, said, judged = set(), {}, True
    for condition, split, computed, _ in columns:
        title, judged = paper.conditions[condition], split == own_split
        header += [f"{title}: paper ({asked['unit']})", *["ours"][: bool(split)], *["verdict"][:judged]]
        if split:
            budgets = {cell.budget for cell in computed.values() if cell.budget}
            said.setdefault(paper.splits[split], set()).update(budgets)
        for model, row in cells.items():
            printed, place = scores.printed(condition, model), asked["claims"].format(condition=condition, model=model)
            row.append(number(printed))
            places[model].append("")
            if cell := computed.get(model):
                run = (cell.protocol, condition, model, cell.metric, cell.variant)
                seeds.add(len(scores.runs(*run)))
                row.append(interval(scores.estimate(*run)))
                places[model].append(origins.place(scores.experiment, cell.protocol, cell.variant))
            elif split:
                row.append(NOT_COMPUTED)
                places[model].append("")
            if judged:
                claim = asked.get("same", {}).get(place, place)
                row.append(_verdict(own, claim))
                places[model].append("")
                points[title] += _points(own, claim, model, scores.units == 100)
    mean = "geometric mean" if scale_of(scores.metric) == LOG else "mean"
    words = [f"{capitalised(paper.printed)} in {asked['unit']}."]
    words += [
        f"Ours: {split}{_part(at)}; {mean}s of {_span(seeds).replace('seed', 'training')} [95 % intervals]."
        for split, at in said.items()
    ]
    alone = columns[-1].own
    early = f"computed for {' and '.join(map(model_name, alone))} alone" if alone else NOT_COMPUTED
    words += [] if judged else [f"{capitalised(first)}: {early}, so no number here has a verdict."]
    heading = f"{', '.join(said)}, {_span(seeds)}\n{asked['drawn']}" if said else NOT_COMPUTED
    basis = " ".join([*words, asked.get("note", "")]).strip()
    return Table(header, list(cells.values())), list(places.values()), heading, points, basis


def _verdict(own: pd.DataFrame, claim: str) -> str:
    """Return the verdict on a number, `-` where there is none; of one that is off also the side; own: claims by id."""
    if claim not in own.index:
        return "-"
    row = own.loc[claim]
    sides = {-1: ", lower", 1: ", higher"} if row["verdict"] == rules.OFF else {}
    return row["verdict"] + sides.get(int(np.sign(np.nan_to_num(row["ours"] - row["published"]))), "")


def _points(own: pd.DataFrame, claim: str, model: str, share: bool) -> list[Point]:
    """Return the point of what a claim judges, if it is judged; share: the point is what the number lacks to 100 %."""
    if claim not in own.index or not np.isfinite((row := own.loc[claim])["ours"]):
        return []
    values = [abs(100 * share - row[name]) for name in ("published", "ours", "low", "high")]
    return [Point(model, *values[:2], *sorted(values[2:]))]


def _part(budgets: set[str]) -> str:
    """Return how much of the trainings the table's numbers are of, where it is not all of them."""
    return "" if budgets <= {FULL} else f", budget {' and '.join(sorted(budgets))}"


def _span(counts: set[int]) -> str:
    least, most = min(counts, default=0), max(counts, default=0)
    return ("1 seed" if most == 1 else f"{most} seeds") if least == most else f"{least} to {most} seeds"


def _finding(scores: _Scores, asked: Mapping[str, str], own: pd.DataFrame) -> Finding:
    """Return a finding of content.yaml with its numbers, or that they are not computed yet."""
    name = asked.get("claim", "")
    if name and name not in own.index:
        return Finding(asked.get("absent", f"{NOT_COMPUTED.capitalize()}."), BEYOND, "")

    text = _written(scores, asked["text"], own)
    text = text or asked.get("absent") or f"{NOT_COMPUTED.capitalize()}: {own.loc[name, 'claim']}"
    verdict = own.loc[name, "verdict"] if name else rules.BEYOND
    return Finding(text, BEYOND if verdict == rules.BEYOND else verdict, name)


def _written(scores: _Scores, text: str, own: pd.DataFrame) -> str:
    """Return a text of content.yaml with its numbers, empty where the evidence lacks one; own: claims by id."""

    def claim(key: str) -> pd.Series:
        if key not in own.index or np.isnan(own.loc[key, "ours"]):
            raise Absent
        return own.loc[key]

    environment = Environment(undefined=StrictUndefined)  # it is escaped where it becomes HTML
    environment.filters |= {"number": number, "interval": interval, "model_name": model_name}
    environment.globals |= {key: getattr(scores, key) for key in TOOLS} | {"claim": claim}
    environment.globals["holds"] = lambda key: HOLDS[claim(key)["verdict"]]
    try:
        return " ".join(environment.from_string(text).render().split())
    except Absent:
        return ""
