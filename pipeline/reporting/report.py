"""What a template may say of an experiment: tables and numbers of the one table of results, verdicts, differences."""

import re
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipeline.reporting import differences, texts
from pipeline.reporting.claims import tables_of
from pipeline.results import kept, one_table, published, shards, shown
from pipeline.results.claim_inputs import FULL, HALF, LOOK
from pipeline.results.published import ANY
from tactile.base import files, paths
from tactile.base.facts import FOLDS
from tactile.base.paths import Workspace
from tactile.drawing import markdown
from tactile.drawing.labels import model_name, split_name
from tactile.drawing.markdown import COUNTS, number, size, table
from tactile.experiments import facts
from tactile.scoring import estimates
from tactile.scoring.estimates import LOG, SHARE, Estimate, estimate, scale_of

BUDGETS = {LOOK: "the look of this machine", HALF: "half of the budget", FULL: "the full budget"}
CURVE = ["model", "protocol", "seed", "epoch", "train_loss", "validation_loss"]
FIGURE = re.compile(r"^- \[.*?\]\((\S+\.png)\)")
Place = tuple[str, ...]  # protocol, condition, metric and, of what is not the model itself, variant


class Report:
    """The results of one experiment beside what its paper prints, as the templates ask for them."""

    def __init__(self, workspace: Workspace, experiment: str, settings: Mapping, look: bool = False):
        """Read the one table and judge the claims; settings: the experiment's block of settings.

        The results are those of the evidence, with `look` what the stages computed here.
        """
        self.workspace, self.experiment, self.models = workspace, experiment, list(settings["models"])
        self.of_look = look
        self.protocols, self.settings = list(settings["protocols"]), settings
        if self.of_look:
            paths.require(workspace.scores(experiment), f"python -m tactile.stages.evaluate {experiment}")
            self.results = one_table.of_look(workspace, experiment)
        else:
            self.results = one_table.results(workspace, [], experiment)
        sets = shards.read_sets(workspace) if (shards.folder(workspace) / "shards.yaml").exists() else {}
        self.varied = {each.variant: each for each in sets.values() if each.variant and each.experiment == experiment}
        of_experiment = [each.variants for each in sets.values() if each.experiment == experiment]
        self.variants = {name: one for each in of_experiment for name, one in each.items()}
        self.of_tables = {
            name: each
            for name, each in sets.items()
            if each.experiment == experiment and not (each.variant or shards.study(each))
        }
        self._sets = {protocol: each for each in self.of_tables.values() for protocol in each.protocols}
        paper = facts(experiment).paper
        rows = published.table(paper.key if paper else "").itertuples()
        self._printed = {(row.condition, row.model, row.variant, row.metric): (row.value, row.step) for row in rows}
        self._claims: Callable[..., str] = tables_of(workspace, experiment, self.results)
        self._differences = differences.of_experiment(experiment, settings)

    def estimate(self, protocol: str, condition: str, model: str, metric: str, variant: str = "") -> Estimate:
        """Return mean and interval over the seeds of one protocol."""
        return self.results.estimate(self.experiment, protocol, condition, model, metric, variant=variant)

    def scored(self) -> dict[tuple[str, str], list[str]]:
        """Return (protocol, condition) -> the metrics that the models were scored by, in the order of scores.csv."""
        rows = self.results.rows(experiment=self.experiment, whole=True)
        groups = rows.groupby(["protocol", "condition"], sort=False)["metric"]
        return {place: list(dict.fromkeys(metrics)) for place, metrics in groups}

    def conditions(self, protocol: str) -> list[str]:
        """Return the conditions of a protocol that the models were scored on."""
        return [condition for name, condition in self.scored() if name == protocol]

    def basis(self, protocol: str) -> str:
        """Return how many runs the numbers of a protocol are of, and at which budget, with the epochs of its set."""
        budget = self.results.shown(self.experiment, protocol)
        if budget == LOOK and not self.of_look:
            return "not computed"
        runs = self._runs(protocol, budget)
        what = "fold" if facts(self.experiment).seeds == FOLDS else "run"
        said = f"{runs} {what}{'' if runs == 1 else 's'}"
        if protocol not in self._sets:
            return said
        changed = self._sets[protocol].set.items()
        epochs = [value for key, value in changed if key.endswith(".training.epochs")] if budget != LOOK else []
        numbers = " to ".join(map(str, sorted({min(epochs), max(epochs)}))) if epochs else ""
        return f"{said}, {BUDGETS[budget]}" + (f" of {numbers} epochs" if numbers else "")

    def origins(self) -> str:
        """Return a table of what the numbers of each protocol are of; empty where they are of own logs."""
        rows = [
            [split_name(protocol), self.basis(protocol), each.data if shown != LOOK else "what the settings name"]
            for protocol, each in self._sets.items()
            for shown in [self.results.shown(self.experiment, protocol)]
            if protocol in self.protocols
        ]
        return table(["Split", "Numbers of", "Data"], rows) if rows else ""

    @cached_property
    def kept(self) -> pd.DataFrame:
        """Return what figures draw, see `scoring.kept`: of the shards at the budgets that are shown, or of the look."""
        if self.of_look:
            return kept.of_look(self.workspace, self.experiment)
        budgets = {protocol: self.results.shown(self.experiment, protocol) for protocol in self.protocols}
        return kept.of_evidence(self.workspace, self.experiment, budgets)

    def drawn(self, protocol: str) -> pd.DataFrame:
        """Return the rows of `kept` of one protocol."""
        return self.kept[self.kept["protocol"] == protocol]

    def undrawn(self) -> str:
        """Say which command computes the predictions that figures show, where shards have not kept them; or nothing."""
        index, lost = shards.table(shards.folder(self.workspace) / "index.csv", shards.INDEX), []
        for name, each in self.of_tables.items():
            for protocol in set(each.protocols) & set(facts(self.experiment).drawn):
                shard = shards.Shard(name, kept.FIRST, self.results.shown(self.experiment, protocol)).name
                if shard in set(index["shard"]) and not shards.kept_file(self.workspace, shard).exists():
                    lost.append(name)
        if self.of_look or not lost:
            return ""
        names = " ".join(dict.fromkeys(lost))
        return f"Some shards have kept no predictions: `{shards.MADE_BY} {names}` computes those that figures show."

    def _runs(self, protocol: str, budget: str) -> int:
        """Return how many seeds the numbers of a protocol are of; those of variants count where there are no others."""
        rows = self.results.rows(experiment=self.experiment, protocol=protocol)
        rows = rows[(rows["seed"] >= 0) & (rows["budget"] == budget)]
        plain = rows[rows["variant"] == ""]
        return (rows if plain.empty else plain)["seed"].nunique()

    def caption(self, protocol: str, together: int = 0) -> str:
        """Return what a figure's predictions are of: budget, seeds, split; together: so many seeds, not the first."""
        budget, things = self.results.shown(self.experiment, protocol), facts(self.experiment).seeds
        runs = self._runs(protocol, budget)
        number = f"{runs} {things if runs != 1 else things.removesuffix('s')}"
        if together == runs > 1:
            number += " together"
        elif runs > 1:
            number = f"{f'{together} together' if together > 1 else 'first'} of {number}"
        return f"{BUDGETS[budget].removeprefix('the ')}, {number}, test part of {split_name(protocol)}"

    def curves(self, protocols: Iterable[str]) -> pd.DataFrame:
        """Return the losses of all trainings of more than one epoch: CURVE and `budget`, of the shards or of the look.

        Those of shards are thinned. protocols: those that are asked for.
        """
        if self.of_look:
            runs = [
                estimates.read_fit(self.workspace, self.experiment, model, protocol, seed).history.assign(
                    model=model, protocol=protocol, seed=seed, budget=LOOK
                )
                for protocol in protocols
                for seed in self.settings["protocols"][protocol]["seeds"]
                for model in self.models
            ]
            none = pd.DataFrame(columns=[*CURVE, "budget"], dtype=float)
            return pd.concat([run[[*CURVE, "budget"]] for run in runs if len(run) > 1] or [none])
        index = shards.table(shards.folder(self.workspace) / "index.csv", shards.INDEX)
        index = index[index["shard"].str.rsplit("-", n=2).str[0].isin(self.of_tables)]
        rows = shown.curves(self.workspace, index["shard"]).merge(index[["shard", "budget"]], on="shard")
        rows = rows[rows["protocol"].isin(list(protocols)) & rows["model"].isin(self.models)]
        return rows[[*CURVE, "budget"]]

    text = staticmethod(markdown.score)

    def score(self, protocol: str, condition: str, model: str, metric: str, variant: str = "", **how: Any) -> str:
        """Return `mean [low, high]` of a model; how: see `markdown.score`."""
        return self.text(self.estimate(protocol, condition, model, metric, variant), metric, **how)

    def printed(self, condition: str, model: str, metric: str, variant: str = "", percent: bool = False) -> str:
        """Return the number that the paper prints, with its digits; a dash where it prints none."""
        places = [(where, model, variant, metric) for where in (condition, ANY)]
        value, step = next((self._printed[place] for place in places if place in self._printed), (np.nan, 1.0))
        if metric in COUNTS:
            return "-" if np.isnan(value) else size(value)
        factor = 100 if percent else 1
        return number(factor * value, max(0, -round(np.log10(factor * step))))

    def table(
        self,
        columns: Mapping[str, Place],
        rows: Mapping[str, tuple[str, str]] | None = None,
        corner: str = "Model",
        across: bool = False,
        **how: Any,
    ) -> str:
        """Return a Markdown table of results, every one beside what the paper prints where it prints any in its column.

        columns: heading -> see Place; rows: heading -> (model, variant), by default the models; across: models run
        along the top, places down; how: digits, percent.
        """
        named = {model_name(model): (model, "") for model in self.models} if rows is None else rows
        lines = [[corner, *named]]
        for heading, (protocol, condition, metric, *further) in columns.items():
            found = [(model, variant or "".join(further)) for model, variant in named.values()]
            values = [self.estimate(protocol, condition, model, metric, variant) for model, variant in found]
            paper = [
                self.printed(condition, model, metric, variant, how.get("percent", False)) for model, variant in found
            ]
            if set(paper) != {"-"}:
                lines.append([f"{heading}: published", *paper])
            runs = max(value.runs + value.failed for value in values)
            name = heading if set(paper) == {"-"} else f"{heading}: ours"
            lines.append([name, *(self.text(value, metric, runs=runs, **how) for value in values)])
        header, *body = lines if across else [list(line) for line in zip(*lines, strict=True)]
        return table(header, body)

    def by_budget(self, condition: str, metric: str) -> str:
        """Return a table of a metric over the protocols and budgets that were run; empty where only the look was."""
        lines = [["Model", *map(model_name, self.models)]]
        for protocol in self.protocols:
            for budget in (HALF, FULL):
                place = self.experiment, protocol, condition
                found = [self.results.found(*place, model, metric, "", budget) for model in self.models]
                if any(at == budget for _, at in found):
                    values = [estimate(runs, scale_of(metric)) for runs, _ in found]
                    said = [self.text(value, metric) for value in values]
                    lines.append([f"{split_name(protocol)}, {budget}", *said])
        header, *rows = zip(*lines, strict=True)
        return table(header, rows) if len(lines) > 1 else ""

    def verdicts(self, *names: str) -> str:
        """Return a table of claims, by the last parts of their ids: the published number, ours, the verdict, why."""
        return self._claims(*names)

    def ratio(self, one: Place, other: Place) -> Estimate:
        """Return the ratio of two errors, paired by seed, each of (protocol, condition, model, metric[, variant]).

        Of a share, such as accuracy, the error is what is missing to 1. None of a run where either was not run.
        """
        first, second = (
            1 - runs if scale_of(place[3]) == SHARE else runs
            for place in (one, other)
            for runs in [self.results.runs(self.experiment, *place)]
        )
        both = first.index.intersection(second.index)
        return estimate(first[both] / second[both], LOG)

    def differences(self) -> str:
        """Return where the code differs from the paper, one line each."""
        return "\n".join(f"- `{file}`: {text}" for file, text in self._differences) or "- Nowhere."

    def scores(
        self,
        runs: Iterable[tuple[str, str, str, str]],
        units: Mapping[str, str] | None = None,
        with_published: bool = False,
    ) -> pd.DataFrame:
        """Return a row per (protocol, condition, model, metric) of `runs`, mean and interval in full precision.

        units: metric -> unit. Without them, or without published numbers, there is no such column.
        """
        rows = []
        for protocol, condition, model, metric in runs:
            row = {"protocol": protocol, "condition": condition, "model": model, "metric": metric}
            row |= {"unit": units[metric]} if units else {}
            if with_published:
                row["published"] = published.score(self.experiment, model, condition, metric)
            rows.append(row | self.estimate(protocol, condition, model, metric)._asdict())
        return pd.DataFrame(rows)

    def write(self, path: Path, template: str, **values: Any) -> None:
        """Write a filled template; a line of a figure that was not drawn beside it is left out."""
        lines = texts.render(template, r=self, **values).splitlines(keepends=True)
        drawn = (line for line in lines if not (of := FIGURE.match(line)) or (path.parent / of[1]).exists())
        files.write_text(path, "".join(drawn))
