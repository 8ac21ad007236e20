"""Say what people are shown: the rows of the one table behind each number of a table or a run, and their shards.

README.md, the page and MLflow ask this module, so that none of them shows what another contradicts. Whatever they show
is of the evidence, and of the budget that `Results.shown` names.
"""

from collections.abc import Collection, Iterable, Mapping
from typing import NamedTuple

import pandas as pd

from pipeline.results import published, shards
from pipeline.results.claim_inputs import LOOK
from pipeline.results.one_table import WHOLE, Results
from tactile.base.facts import Paper
from tactile.base.paths import Workspace
from tactile.experiments import facts
from tactile.scoring.estimates import read_csv

OF = ["experiment", "protocol", "model", "variant", "budget"]  # of a training; models without epochs have no budget
COMPARED = ("rmse", "error", "macro_precision", "accuracy")  # metrics of models; of others a variant may be two objects
CURVES = ["train_loss", "validation_loss"]


class Cell(NamedTuple):
    """A number of a table, the estimate over the seeds of these rows; in the order of the arguments of Results.runs."""

    experiment: str
    protocol: str
    condition: str
    model: str
    metric: str
    variant: str
    budget: str

    @property
    def training(self) -> tuple[str, ...]:
        """Return what its trainings are of, as the columns OF."""
        return tuple(getattr(self, name) for name in OF)


class Column(NamedTuple):
    """Our numbers beside those that a paper prints for one condition."""

    condition: str
    split: str  # of the paper's `splits`; empty where the evidence has no number
    cells: dict[str, Cell]  # model -> its number, where it is computed
    own: list[str]  # models that are computed on the split of the verdicts


class Origin(NamedTuple):
    """Where numbers come from; names, commits and machines are sorted, and each is there once."""

    shards: list[str]
    commits: list[str]
    machines: list[str]


def evidence(workspace: Workspace, own: Collection[str] = ()) -> Results:
    """Return the results of the committed shards alone; own: experiments left out, as their logs are the user's."""
    rows = shards.read(workspace)
    return Results(rows[~rows["experiment"].isin(own)].assign(**{WHOLE: False}))


def is_shown(results: Results, experiment: str, protocol: str, variant: str, budget: str) -> bool:
    """Return whether the tables show trainings at this budget; without one, of models without epochs, they do."""
    shown = results.shown(experiment, protocol, variant)
    return budget == shown or not budget and shown != LOOK


def variant_of(experiment: str, protocol: str, model: str) -> str:
    """Return the variant that stands for a model beside the others, where a table has a model once; often none, ""."""
    paper = facts(experiment).paper
    return paper.variants.get((protocol, model), "") if paper else ""


def paper_table(results: Results, experiment: str) -> list[Column]:
    """Return what stands beside the numbers of the paper of a simulated experiment, a column for each condition.

    Ours are of the split of the verdicts, the first of `splits`, or of one on which more models are computed.
    """
    paper = facts(experiment).paper
    columns: list[Column] = []
    if paper is None:
        return columns
    own = next(iter(paper.splits))
    for condition in paper.conditions:
        found = {
            at: _cells(results, experiment, paper, at.format(condition=condition), condition) for at in paper.splits
        }
        split = max(found, key=lambda at: len(found[at])) if any(found.values()) else ""
        columns.append(Column(condition, split, found.get(split, {}), list(found[own])))
    return columns


def _cells(results: Results, experiment: str, paper: Paper, protocol: str, condition: str) -> dict[str, Cell]:
    """Return model -> its number on a protocol, of the models that the paper prints and the evidence has."""
    cells: dict[str, Cell] = {}
    if results.shown(experiment, protocol) == LOOK:
        return cells
    for model in published.PRINTED[paper.key]:
        place = experiment, protocol, condition, model, paper.metric, variant_of(experiment, protocol, model)
        runs, budget = results.found(*place, results.shown(experiment, protocol, place[-1]))
        if len(runs):
            cells[model] = Cell(*place, budget)
    return cells


def readme(results: Results, experiment: str) -> set[tuple[str, ...]]:
    """Return the trainings (columns OF) of which README.md shows a number beside a paper's."""
    columns = paper_table(results, experiment)
    return {cell.training for column in columns for cell in column.cells.values()}


def origin(index: pd.DataFrame, names: Iterable[str]) -> Origin:
    """Return the origin of numbers of these shards; index: of `shards.table`, as text."""
    rows = index[index["shard"].isin(set(names))]
    return Origin(*(sorted(filter(None, set(rows[name]))) for name in ("shard", "commit", "machine")))


def curves(workspace: Workspace, names: Iterable[str]) -> pd.DataFrame:
    """Return the learning curves of these shards: shard, model, protocol, seed, epoch and CURVES.

    A shard of variants, or of a study, keeps none.
    """
    columns = ["model", "protocol", "seed", "epoch", *CURVES]
    paths = {name: shards.folder(workspace) / "curves" / f"{name}.csv" for name in names}
    kept = [read_csv(path, columns, shards.MADE_BY).assign(shard=name) for name, path in paths.items() if path.exists()]
    return pd.concat(kept) if kept else pd.DataFrame(columns=[*columns, "shard"])


def changed(sets: Mapping[str, shards.ShardSet], names: Iterable[str], model: str, variant: str) -> dict[str, set]:
    """Return what the settings of shards (names) differ in from params/ for a model: setting -> its values.

    A setting has its name as in params/<experiment>.yaml, one of the model its name in the model's block. Those of
    other models are left out, but of the models that a variant names.
    """
    found: dict[str, set] = {}
    for each in {name.rsplit("-", 2)[0]: sets.get(name.rsplit("-", 2)[0]) for name in names}.values():
        if each is None:
            continue
        entry = each.variants.get(variant)
        for key, value in {**each.set, **(entry.set if entry else {})}.items():
            setting = key.removeprefix(f"{each.experiment}.")
            of_model = setting.split(".")[1] if setting.startswith("models.") else model
            if of_model == model or entry and key in entry.set:
                found.setdefault(setting.removeprefix(f"models.{model}."), set()).add(str(value))
    return found
