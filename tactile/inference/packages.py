"""Find a trained model by what the user calls it, and make it a package: a folder of weights, card and nothing else."""

import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from tactile.base import cards as base_cards
from tactile.base import params, paths, provenance
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.inference import card as cards
from tactile.inference import channels, training_logs
from tactile.inference.describer import Describer

RUN_ID = re.compile("[0-9a-f]{32}")  # of MLflow


def make(
    workspace: Workspace,
    values: Mapping,
    experiment: str,
    model: str,
    protocol: str,
    seed: int,
    target: Path,
    refit: bool = False,
) -> cards.Card:
    """Write the package of one run of params.yaml (`values`) to the new folder `target`, and return its card.

    Its intervals are calibrated on the run's validation part, which is predicted for it; refit: as of
    `calibration.calibrated`, which may take as long as the training.

    Raises InputError where the run has not been trained and evaluated, or was trained with other settings.
    """
    from tactile.inference import calibration  # here, because the import of torch takes a second

    folder = paths.require(workspace.run_folder(experiment, model, protocol, seed), params.training_command(experiment))
    weights = cards.weights_file(folder)
    target.mkdir(parents=True)
    shutil.copy(weights, target / weights.name)
    described = of_run(workspace, values, experiment, model, protocol, seed)
    card = calibration.calibrated(workspace, values, described, refit)
    digests = training_logs.digests(workspace, values[experiment], experiment)
    card = training_logs.added(workspace, values[experiment], card, digests)
    cards.write(target, card)
    return card


def of_run(workspace: Workspace, values: Mapping, experiment: str, model: str, protocol: str, seed: int) -> cards.Card:
    """Return the card of one run of params.yaml; errors as `make`."""
    card = Describer(workspace, values, experiment).card(model, protocol, seed, provenance.code()[0])
    provenance.check_settings(workspace, [experiment], values)
    return card.model_copy(update={"correlation": channels.trained(workspace, values[experiment], card)})


def locate(workspace: Workspace, name: str, values: Mapping, draft: Path, refit: bool = False) -> tuple[Path, str]:
    """Return (folder of the package, where it comes from) for what the user calls a model.

    name: a folder with a card, or EXPERIMENT/MODEL, or EXPERIMENT/MODEL/PROTOCOL/SEED, or the id of an MLflow run. The
    model that this checkout trained is taken, of its first protocol and seed where none is named; where it trained
    none, the one of `pretrained/`. values: params.yaml; draft: a folder, not there yet, for the package of a run;
    refit: as of `make`. Raises InputError where there is no such model.
    """
    if Path(name, cards.NAME).is_file():
        return Path(name), "folder"
    if Path(name, base_cards.TARGET).is_file():
        raise InputError(
            f"{name}: only `tactile predict MODEL LOGS` and `tactile live MODEL --port PORT` take the model of a "
            "target of one's own"
        )
    if RUN_ID.fullmatch(name):
        from tactile.inference import mlflow_store  # here, because the import of MLflow takes a second

        return mlflow_store.downloaded(workspace, name, draft), "from MLflow"
    words = name.strip("/").split("/")
    if len(words) not in (2, 4) or words[0] not in values["experiments"]:
        near = (
            params.hint(words[0], values["experiments"]) if len(words) in (2, 4) else "experiments: touch, strain, ..."
        )
        raise InputError(
            f"{name}: no such model; name a folder with {cards.NAME}, or EXPERIMENT/MODEL such as touch/lomp ({near})"
        )
    experiment, model = words[:2]
    models = {
        *values[experiment]["models"],
        *(path.name for path in (workspace.brought("pretrained") / experiment).glob("*")),
    }
    if model not in models | {paths.MODEL_ZERO}:
        raise InputError(f"{name}: no such model; {params.hint(model, sorted(models))}")
    protocol, seed = params.runs(values, experiment)[0] if len(words) == 2 else (words[2], _number(words[3], name))
    if workspace.run_folder(experiment, model, protocol, seed).is_dir():
        make(workspace, values, experiment, model, protocol, seed, draft, refit)
        return draft, f"trained here, {protocol}, seed {seed}"
    pretrained = workspace.brought("pretrained")  # packages that come with the code, <experiment>/<model>
    shipped = pretrained / experiment / model
    if len(words) == 2 and shipped.is_dir():
        return shipped, "pretrained"
    have = sorted(path.parent.relative_to(pretrained).as_posix() for path in pretrained.glob(f"*/*/{cards.NAME}"))
    raise InputError(
        f"{name}: not trained in this folder; take one of the pretrained ({', '.join(have) or 'none'}), or run "
        "`dvc repro` in a checkout"
    )


def _number(word: str, name: str) -> int:
    if not word.isdecimal():
        raise InputError(f"{name}: '{word}' is no seed; write EXPERIMENT/MODEL/PROTOCOL/SEED")
    return int(word)
