"""List the trained models that are here, with what each takes, gives and scored: MODEL of the other commands.

Those of pretrained/ come with the repository, those of `dvc repro` are of the look, which trains little, and those of
`tactile own NAME` are in build/own/NAME/trained. A score is the main one of the model's test part, in the condition
that stands beside it.

Examples:

    tactile models
    tactile models --json
"""

import argparse
from collections.abc import Iterator, Mapping
from pathlib import Path

from tactile.base import arguments, params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.inference import card as cards

OWN = Path("build", "own")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the output to the parser of this command."""
    arguments.add_output(parser)


def packages(workspace: Workspace) -> Iterator[tuple[str, Path]]:
    """Yield name and folder of every package: of pretrained/, and of own sensors."""
    pretrained = workspace.brought("pretrained")
    for around, pattern in ((pretrained, "*/*"), (workspace.root, f"{OWN.as_posix()}/*/trained/*")):
        for card in sorted(around.glob(f"{pattern}/{cards.NAME}")):
            yield card.parent.relative_to(around).as_posix(), card.parent


def described(name: str, folder: Path) -> dict:
    """Return what a package is called, takes, gives and scored; in place of that `problem`, where it cannot be read."""
    from tactile.inference import consistent  # here, because the import of the experiments takes a second

    try:
        card = consistent.read(folder)
    except InputError as error:
        return {"model": name, "problem": str(error)}
    columns = f"{card.inputs.columns} {card.inputs.unit}"
    outputs = ", ".join(card.outputs.names or []) or card.outputs.unit
    said = {"model": name, "takes": columns, "gives": outputs if card.kind != "images" else "object", "scores": None}
    if score := next((each for each in card.scores if each.value is not None), None):
        unit = "" if score.unit == "1" else f" {score.unit}"
        said["scores"] = f"{score.metric} {score.value:.3g}{unit} ({score.condition}, {card.protocol})"
    return said


def trained_here(workspace: Workspace, values: Mapping) -> list[str]:
    """Return EXPERIMENT/MODEL of the runs of params.yaml (`values`) that `dvc repro` has trained in this folder."""
    found = []
    for experiment in values["experiments"]:
        protocol, seed = params.runs(values, experiment)[0]
        for model in values[experiment]["models"]:
            if workspace.run_folder(experiment, model, protocol, seed).is_dir():
                found.append(f"{experiment}/{model}")
    return found


def main(workspace: Workspace, given: argparse.Namespace) -> None:
    """List the models."""
    listed = [described(name, folder) for name, folder in packages(workspace)]
    here = trained_here(workspace, params.load(workspace.params))
    width = max([len(said["model"]) for said in listed], default=0)
    for said in listed:
        words = said.get("problem") or f"{said['takes']} -> {said['gives']}; {said['scores'] or 'not scored'}"
        print(f"{said['model']:<{width}}  {words}")
    if here:
        print("trained here by `dvc repro`:", ", ".join(here))
    if not listed and not here:
        print("none; `dvc repro` trains those of the papers, `tactile own FOLDER` those of your own sensor")
    arguments.answer(given, {"packages": listed, "trained_here": here})
