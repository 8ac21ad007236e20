"""Test how often the 90 % intervals of trained models hold the truth, and say why where it is not about 90 %.

The models of the first seed of every protocol of the settings, trained before, are calibrated on their validation part,
as `tactile export` does it, and tested on their test part: reports/coverage/EXPERIMENT.csv, and README.md beside it for
people. Models of series that were fitted to their validation part, too, are fitted again without it, once.

Examples:

    tactile coverage touch
"""

import argparse
from collections.abc import Iterator, Mapping

import numpy as np
from tqdm import tqdm

from tactile import experiments
from tactile.base import files, params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.drawing import coverage, labels, templates

RECORDED = tuple(experiments.having("source"))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the experiments to the parser of this command."""
    parser.add_argument(
        "experiment", nargs="*", metavar="EXPERIMENT", default=RECORDED, help=f"without any: {', '.join(RECORDED)}"
    )


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """Write the coverage of the experiments named on the command line."""
    import torch

    torch.set_num_threads(1)
    values = params.load(workspace.params)
    for experiment in given.experiment:
        if experiment not in values["experiments"]:
            raise InputError(f"{experiment}: no such experiment; {params.hint(experiment, values['experiments'])}")
        files.write_csv(workspace.coverage(experiment), coverage.COLUMNS, list(rows(workspace, values, experiment)))
        print(workspace.coverage(experiment))
    write_page(workspace, values)


def write_page(workspace: Workspace, values: Mapping) -> None:
    """Write README.md of all tables of coverage that are there."""
    there = [name for name in values["experiments"] if workspace.coverage(name).exists()]
    read = {labels.experiment_name(name): coverage.read(workspace, name) for name in there}
    tables = {name: (list(coverage.rows(table)), coverage.untold(table)) for name, table in read.items()}
    target = workspace.coverage("").with_name("README.md")
    files.write_text(target, templates.render(templates.TEXTS, "coverage", header=coverage.HEADER, tables=tables))
    print(target)


def rows(workspace: Workspace, values: Mapping, experiment: str) -> Iterator[tuple]:
    """Yield the rows of an experiment's table, as coverage.COLUMNS; one without a share where there is no interval."""
    from tactile.inference import calibration, intervals
    from tactile.inference.describer import Describer
    from tactile.scoring import conformal

    describer, protocols = Describer(workspace, values, experiment), values[experiment]["protocols"]
    first = [(protocol, block["seeds"][0]) for protocol, block in protocols.items()]
    every = [(model, *run) for run in first for model in values[experiment]["models"]]
    for model, protocol, seed in tqdm(every, desc=f"coverage {experiment}", unit="run"):
        card = calibration.calibrated(workspace, values, describer.card(model, protocol, seed, ""), refit=True)
        if card.calibration is None:
            continue
        for bound in card.calibration.bounds:
            unit = intervals.unit(bound.output, card)
            of = bound.output, bound.case, unit, bound.value, bound.floor, card.calibration.group, bound.groups
            tested = [
                each for each in card.calibration.coverage if (each.output, each.case) == (bound.output, bound.case)
            ]
            for each in tested:
                measured = each.width, each.share, each.low, each.high, each.groups, each.rows, each.reason
                yield experiment, protocol, each.condition, model, seed, *of, *measured
            if not tested:
                nothing = *[np.nan] * 4, 0, 0, f"{conformal.LEVEL:.0%} need {conformal.least()} groups"
                yield experiment, protocol, "", model, seed, *of, *nothing
