"""Answer the question of each paper: its printed numbers beside ours, and findings in words, each with its verdict.

The answers stand in README.md, between two markers, and on the first screen of the page. What is compared and the words
of the findings are in content.yaml; a number that the evidence does not have yet is said to be missing.
"""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
from jinja2 import Environment, StrictUndefined

from pipeline.base import files
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.claims import entries
from pipeline.claims.rules import VERDICTS
from pipeline.reporting import claims as claim_text
from pipeline.reporting.figures.ratios import Point
from pipeline.reporting.tables import Table
from pipeline.reporting.words import templates
from pipeline.reporting.words.labels import model_name
from pipeline.reporting.words.markdown import interval, number
from pipeline.scoring import published
from pipeline.scoring.claim_inputs import LOOK
from pipeline.scoring.one_table import Results
from pipeline.scoring.results import Estimate, estimate

CHART = "answers.png"  # in reports/
MARKS = ("<!-- answers: written by `python -m pipeline.stages.page` -->", "<!-- end of answers -->")
BEYOND = "beyond the paper"  # in place of a verdict, where a finding is about no claim
NOT_COMPUTED = "not computed yet"


class Finding(NamedTuple):
    """A sentence about our numbers, the verdict on the claim that it is about, or BEYOND, and the id of that claim."""

    text: str
    verdict: str
    claim: str


class Answer(NamedTuple):
    """What is said of one paper; `heading`, `points`: of its panel of the chart; `counts` data -> verdict -> claims."""

    paper: str
    title: str
    question: str
    basis: str
    table: Table
    findings: list[Finding]
    heading: str
    points: dict[str, list[Point]]
    counts: list[tuple[str, list[tuple[str, int]]]]
    claims: int


class Absent(Exception):
    """The evidence has no run of what a sentence asks for."""


def answers(workspace: Workspace, claims: pd.DataFrame, results: Results, content: Mapping) -> list[Answer]:
    """Return the answer of each paper whose simulated experiment is reported; claims: as of page.claims.read."""
    papers = entries.papers(workspace)
    return [
        _answer(papers[key], asked, claims, results)
        for key, asked in content["answers"].items()
        if (claims["paper"] == key).any() and (workspace.reports / papers[key].simulated).exists()
    ]


def readme(workspace: Workspace, found: list[Answer]) -> str:
    """Return README.md with these answers between its markers. Raises InputError where it lacks them."""
    text = (workspace.root / "README.md").read_text(encoding="utf-8")
    before, start, rest = text.partition(MARKS[0])
    _, end, after = rest.partition(MARKS[1])
    if not end:
        raise InputError(f"README.md: the line '{MARKS[1] if start else MARKS[0]}' is missing; put it back")
    block = templates.render("answers", answers=found, chart=f"{workspace.reports.name}/{CHART}")
    return f"{before}{start}\n\n{block}\n{end}{after}"


def write_readme(workspace: Workspace, found: list[Answer]) -> None:
    """Bring README.md up to date; a workspace may have none. DVC is not told of it: it deletes what it is told of."""
    path: Path = workspace.root / "README.md"
    if path.exists() and (text := readme(workspace, found)) != path.read_text(encoding="utf-8"):
        files.write_text(path, text)


def _answer(paper: entries.Paper, asked: Mapping, claims: pd.DataFrame, results: Results) -> Answer:
    own = claims[claims["paper"] == paper.key].set_index("id")
    scores = _Scores(results, paper.simulated)
    counted = claim_text.counted(own)
    table, heading, points, basis = _beside(scores, asked, own)
    return Answer(
        paper=paper.key,
        title=paper.title,
        question=asked["question"],
        basis=basis,
        table=table,
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
    """The evidence on one simulated experiment, beside what its paper prints."""

    def __init__(self, results: Results, experiment: str):
        self.results, self.experiment = results, experiment
        self.paper, self.metric, self.name, self.units = published.SCORES[experiment]

    def has(self, protocol: str) -> bool:
        """Say whether the evidence has runs of a protocol."""
        return self.results.shown(self.experiment, protocol) != LOOK

    def runs(self, protocol: str, condition: str, model: str, metric: str = "") -> pd.Series:
        """Return seed -> value, a share in %. Raises Absent where the evidence has none."""
        if not self.has(protocol):
            raise Absent
        runs = self.results.runs(self.experiment, protocol, condition, model, metric or self.metric)
        if not len(runs):
            raise Absent
        return runs * (100 if self.units == 100 or metric == "touches_found" else 1)

    def estimate(self, protocol: str, condition: str, model: str, metric: str = "") -> Estimate:
        """Return mean and interval over the seeds, a share in %. Raises Absent where the evidence has no run."""
        self.runs(protocol, condition, model, metric)
        found = self.results.estimate(self.experiment, protocol, condition, model, metric or self.metric)
        return found.percent() if self.units == 100 or metric == "touches_found" else found

    def printed(self, condition: str, model: str) -> float:
        """Return what the paper prints, NaN where it prints nothing."""
        return published.number(self.paper, model, condition, self.name)

    def models(self) -> list[str]:
        """Return the models of which the paper prints a number, in its order."""
        return list(published.PRINTED[self.paper])

    def ranked(self, protocol: str, condition: str) -> list[tuple[str, float]]:
        """Return (name, mean) of the paper's models, the best first."""
        means = [(model_name(at), self.estimate(protocol, condition, at).mean) for at in self.models()]
        return sorted(means, key=lambda pair: pair[1] * (-1 if self.units == 100 else 1))

    def failures(self, conditions: Mapping[str, str], model: str) -> tuple[int, int]:
        """Return how many trainings failed, and of how many; conditions: protocol -> the condition that shows it.

        A training failed where its error is not finite, or above that of the constant model of the same seed.
        """
        failed = total = 0
        for protocol, condition in conditions.items():
            runs = self.runs(protocol, condition, model)
            floor = self.runs(protocol, condition, "constant").reindex(runs.index)
            failed, total = failed + int((~(runs <= floor)).sum()), total + len(runs)
        return failed, total


def _beside(scores: _Scores, asked: Mapping, own: pd.DataFrame) -> tuple[Table, str, dict[str, list[Point]], str]:
    """Return a paper's table with ours beside it, heading and points of its chart, and what our numbers are of.

    Ours are of the paper's split; where the evidence does not have it, of the split that no recording crosses.
    """
    header, cells = ["Model"], {model: [model_name(model)] for model in scores.models()}
    points: dict[str, list[Point]] = {}
    seeds, missing, said = set(), [], {}
    for condition, title in asked["conditions"].items():
        split = next((at for at in asked["splits"] if scores.has(at.format(condition=condition))), "")
        protocol, judged = split.format(condition=condition), split == next(iter(asked["splits"]))
        header.append(f"{title}: paper ({asked['unit']})")
        if split:
            header.append("ours")
            said[asked["splits"][split]] = scores.results.shown(scores.experiment, protocol)
            header += ["verdict"] if judged else []
        if not judged:
            missing.append(title)
        points[title] = []
        for model, row in cells.items():
            printed = scores.printed(condition, model)
            row.append(number(printed))
            if not split:
                continue
            try:
                ours, runs = scores.estimate(protocol, condition, model), scores.runs(protocol, condition, model)
                seeds.add(len(runs))
                row.append(interval(ours))
                less = (lambda value: 100 - value) if scores.units == 100 else (lambda value: value)
                points[title].append(Point(model, less(printed), less(ours.mean), [*map(less, runs)]))
            except Absent:
                row.append(NOT_COMPUTED)
            if judged:
                place = asked["claims"].format(condition=condition, model=model)
                row.append(own["verdict"].get(asked.get("same", {}).get(place, place), "-"))
    first = next(iter(asked["splits"].values()))
    words = [f"{scores.name[:1].upper()}{scores.name[1:]} in {asked['unit']}."]
    heading = ", ".join([*said, _span(seeds)]) if said else NOT_COMPUTED
    for split, budget in said.items():
        words.append(f"Ours: {split}, {_span(seeds)}, budget {budget}, mean [95 % interval].")
    if missing:
        words.append(f"{first[:1].upper()}{first[1:]}: {NOT_COMPUTED}, so no number has a verdict.")
    return Table(header, list(cells.values())), heading, points, " ".join([*words, asked.get("note", "")]).strip()


def _span(counts: set[int]) -> str:
    least, most = min(counts, default=0), max(counts, default=0)
    return ("1 seed" if most == 1 else f"{most} seeds") if least == most else f"{least} to {most} seeds"


def _finding(scores: _Scores, asked: Mapping[str, str], own: pd.DataFrame) -> Finding:
    """Return a finding of content.yaml with its numbers, or that they are not computed yet."""
    name = asked.get("claim", "")
    if name and name not in own.index:
        return Finding(f"{NOT_COMPUTED.capitalize()}.", BEYOND, "")

    def claim(key: str) -> Any:
        row = own.loc[key] if key in own.index else None
        if row is None or row["ours"] != row["ours"]:
            raise Absent
        return row

    tools = {key: getattr(scores, key) for key in ("estimate", "printed", "ranked", "failures")}
    environment = Environment(undefined=StrictUndefined)  # it is escaped where it becomes HTML
    environment.filters["number"] = number
    environment.globals |= tools | {"claim": claim, "within": partial(_within, scores)}
    try:
        text = " ".join(environment.from_string(asked["text"]).render().split())
    except Absent:
        text = asked.get("absent") or f"{NOT_COMPUTED.capitalize()}: {own.loc[name, 'claim']}"
    return Finding(text, own.loc[name, "verdict"] if name else BEYOND, name)


def _within(scores: _Scores, protocol: str, condition: str, one: str, other: str, metric: str = "") -> int:
    """Return -1, 0 or 1: whether a model's values, less the other's of the same seed, are below, around or above 0."""
    difference = scores.runs(protocol, condition, one, metric) - scores.runs(protocol, condition, other, metric)
    spread = estimate(difference.dropna())
    return int(spread.low > 0) - int(spread.high < 0)
