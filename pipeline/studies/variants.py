"""Train and score models with something changed: the variants that evidence/shards.yaml names of an experiment.

Everything else is as in the tables. Transfer starts from the network in the tables of the task that it starts from; a
variant of what that network sees, or of how it is trained, trains its own. The rows are those of the one table.
Usage: python -m pipeline.studies.variants EXPERIMENT SEED
"""

import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

from pipeline.results import shards
from pipeline.results.claim_inputs import COLUMNS
from pipeline.results.published import ANY
from tactile import models, tasks
from tactile.base import arguments, files, params, workers
from tactile.base.errors import InputError
from tactile.base.params_file import copied, set_values
from tactile.base.paths import Workspace
from tactile.learning.trained import Trained
from tactile.settings.shards import Variant

# What training reads and a dataset is not made of, or what it may see less of. Any other setting would change nothing.
CHANGES = r"models\..+|window\.frames|sensor\.channels|protocols\.\w+\.(base|passes|samples)"


def varied(workspace: Workspace, experiment: str, variant: Variant) -> dict:
    """Return all settings with those of a variant.

    Raises InputError for a key that there is not, that a variant cannot change, or with a wrong value.
    """
    for name in variant.set:
        if not re.fullmatch(rf"{experiment}\.({CHANGES})", name):
            raise InputError(
                f"{shards.SETS}: a variant of {experiment} cannot change '{name}', for its data are those of the set; "
                "make another set of it"
            )
    with tempfile.TemporaryDirectory() as folder:
        copy = copied(workspace.params, Path(folder))
        set_values(variant.set, copy, shards.SETS)
        values = params.read(copy)
    params.check(values, dict.fromkeys(variant.set, shards.SETS))
    return values


class Setting(NamedTuple):
    """What all runs of a variant have in common; values: all settings, with those of the variant."""

    workspace: Workspace
    values: Mapping
    experiment: str
    seed: int

    @property
    def block(self) -> Mapping:
        """Return the settings of the experiment."""
        return self.values[self.experiment]

    @property
    def data(self) -> tuple:
        """Return the first arguments of the functions of tasks."""
        return self.workspace.dataset(self.experiment), self.experiment, self.block

    def fit(self, model: str, protocol: str, base: Path | None):
        """Return a trained model; base: the folder of the network that transfer starts from, if it does."""
        settings = params.run_settings(self.values, self.experiment, model, protocol)

        def build(spec):
            return models.build(model, spec, settings, f"{self.experiment}.models.{model}")

        device = self.values["device"]
        return tasks.of(self.experiment).fit(*self.data, protocol, self.seed, build, device=device, base=base).model

    def of_base(self, base: str) -> list:
        """Return the settings that decide what the network becomes that transfer starts from; base: its protocol."""
        made = params.run_settings(self.values, self.experiment, self.block["model_zero"], base)
        return [made, *(self.block[key] for key in ("sensor", "window")), self.block["protocols"][base]]

    def rows(self, model, protocol: str) -> Iterator[Mapping]:
        """Yield condition, metric, unit, value and n of the scores of a model, of its parameters and operations."""
        run = Trained(model, failed=model.summary.best_epoch == 0)
        for *_, tests in tasks.of(self.experiment).tested(*self.data, [(protocol, self.seed)], lambda *_: run):
            for *_, scores in tests:
                for row in scores:
                    yield dict(zip(("condition", "metric", "unit", "value", "n"), row, strict=True))
        for metric, value in (("params", model.parameters()), ("macs", model.macs())):
            yield {"condition": ANY, "metric": metric, "unit": "1", "value": value, "n": 1}


def run(
    workspace: Workspace, known: Mapping, experiment: str, name: str, variant: Variant, seed: int, report: Callable
) -> list[Mapping]:
    """Train and score one variant with one seed; return its rows. known: all settings, without those of the variant."""
    import torch

    torch.set_num_threads(1)
    own, tables = (
        Setting(workspace, values, experiment, seed) for values in (varied(workspace, experiment, variant), known)
    )
    first, rows = own.block.get("model_zero", ""), []
    with tempfile.TemporaryDirectory() as folder:
        for protocol in variant.protocols:
            base = tasks.of(experiment).base(experiment, own.block, protocol)
            for model in variant.models:
                zero = workspace.run_folder(experiment, first, base, seed) if base and params.transfers(model) else None
                if zero and own.of_base(base) != tables.of_base(base):
                    zero = Path(folder) / base
                    if not zero.exists():
                        network = own.fit(first, base, None)
                        zero.mkdir()
                        network.save(zero)
                place = {"experiment": experiment, "protocol": protocol, "model": model, "variant": name, "seed": seed}
                rows += [place | {"budget": ""} | row for row in own.rows(own.fit(model, protocol, zero), protocol)]
                report()
    return rows


def main(workspace: Workspace) -> None:
    """Train and score all variants of the experiment and seed named on the command line."""
    known = params.load(workspace.params)
    experiment, seed = arguments.of_study(__doc__, known["experiments"])
    sets = [each for each in shards.read_sets(workspace).values() if each.experiment == experiment]
    variants = {
        name: one.model_copy(update={"protocols": one.protocols or each.protocols})
        for each in sets
        for name, one in each.variants.items()
        if set(one.models) <= set(known[experiment]["models"])  # else these settings lack one
    }
    steps = {name: len(one.protocols) * len(one.models) for name, one in variants.items()}
    calls = {name: (workspace, known, experiment, name, one, seed) for name, one in variants.items()}
    with tqdm(total=sum(steps.values()), desc=f"variants {experiment}", unit="run") as bar:
        rows = dict(workers.run(run, calls, bar, steps=steps))
    lines = ([row[column] for column in COLUMNS] for name in variants for row in rows[name])
    files.write_csv(workspace.study_result(experiment, "variants"), COLUMNS, lines)


if __name__ == "__main__":
    arguments.run(main)
