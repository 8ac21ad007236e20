"""Score models on scenes that lack one of their effects each. Small scenes, short trainings.

Every variant (an effect and a seed) goes the whole way: simulated logs, ingest, windows, labels, training, scores of
the test part. Effect `none`: all effects on. The seed moves the scene's own seed and is that of split and training, so
that two seeds differ in all that is drawn by chance, and the variants of one seed are paired.
Writes the scores of one seed; `render_study physics` judges them.
Usage: python -m pipeline.studies.physics touch|strain|glove SEED
"""

from collections.abc import Callable, Mapping

from tqdm import tqdm

from pipeline.results.studies import PHYSICS, effects
from pipeline.stability import changed_scene
from tactile.base import arguments, files, params, workers
from tactile.base.paths import Workspace
from tactile.experiments import facts


def settings_of(values: Mapping, experiment: str, effect: str, seed: int) -> dict:
    """Return the experiment's block of settings at the scale of physics.<experiment>.scene, without `effect`.

    `none`: with all of them. Raises InputError where the result is not what tactile/settings allows.
    """
    changes = values["physics"][experiment]["scene"]
    settings = changed_scene.settings_of(values, experiment, changes, f"physics.{experiment}.scene")
    settings = changed_scene.drawn(settings, seed)
    effects = {name: name != effect for name in settings["simulate"]["effects"]}
    return settings | {"simulate": settings["simulate"] | {"effects": effects}}


def asked_of(values: Mapping, experiment: str) -> changed_scene.Asked:
    """Return what the block physics.<experiment> trains."""
    chosen = values["physics"][experiment]
    return changed_scene.Asked(
        chosen["protocols"], chosen["models"], f"physics.{experiment}.models", list(chosen["models"])
    )


def run_variant(values: Mapping, experiment: str, effect: str, seed: int, report: Callable) -> list[tuple]:
    """Return rows of physics.csv (studies.PHYSICS) of one effect left out and one seed."""
    import torch

    torch.set_num_threads(1)
    asked, settings = asked_of(values, experiment), settings_of(values, experiment, effect, seed)
    metric, rows = facts(experiment).metric, []
    for condition, model, scores in changed_scene.scores_anew(experiment, settings, asked, seed, values["device"]):
        unit, value = next((unit, value) for name, unit, value, _ in scores if name == metric)
        rows.append((experiment, effect, condition, model, seed, metric, unit, value))
    report()
    return rows


def main(workspace: Workspace) -> None:
    """Run every variant of the experiment and seed named on the command line."""
    values = params.load(workspace.params)
    experiment, seed = arguments.of_study(__doc__, values["physics"])
    wanted = [(effect, seed) for effect in effects(values, experiment)]
    with tqdm(total=len(wanted), desc=f"physics {experiment}", unit="variant") as bar:
        rows = dict(workers.run(run_variant, {key: (values, experiment, *key) for key in wanted}, bar))
    files.write_csv(
        workspace.study_result(experiment, "physics"), PHYSICS, (row for key in wanted for row in rows[key])
    )


if __name__ == "__main__":
    arguments.run(main)
