"""Put trained models under stress: one loop over runs, stress tests and severities, for every kind of input.

How a test is applied and scored is each kind's own: the class `Run` of windows.py, series.py and images.py. A draw
depends on the seed and the name of the test alone, so that all models see the same.
"""

from collections.abc import Callable, Iterator, Mapping

from pipeline.stability import clean_scores, images, series, windows
from pipeline.stability import perturbations as perturbations  # the tests of readings register themselves
from tactile import tasks
from tactile.base.paths import Workspace
from tactile.base.stress_tests import SCENE, planned

KINDS = {"windows": windows, "series": series, "images": images}


def prepare(workspace: Workspace, values: Mapping, experiment: str) -> None:
    """Check the tests that params.yaml asks for, and simulate the scenes that all models of windows share."""
    plan = planned(values, experiment, tasks.kind(experiment))
    if tasks.kind(experiment) == "windows":
        windows.simulate_scenes(workspace, values, experiment, plan)


def runs(values: Mapping, experiment: str) -> Iterator[tuple[str, int]]:
    """Yield protocol and seed of every run that is tested."""
    for protocol in values["stress"][experiment]["protocols"]:
        for seed in values[experiment]["protocols"][protocol]["seeds"]:
            yield protocol, seed


def rows(workspace: Workspace, values: Mapping, experiment: str, model: str, report: Callable[[], None]) -> list[tuple]:
    """Return one model's rows: (protocol, condition, seed, perturbation, severity, metric, unit, value, n, blocks).

    A run that failed in training has NaN for values. `prepare` ran before. Raises InputError for an unknown test in
    params.yaml, and where the clean scores are not those of scores.csv.
    """
    import torch

    torch.set_num_threads(1)
    plan = planned(values, experiment, tasks.kind(experiment))
    of_kind = KINDS[tasks.kind(experiment)].Run
    check = clean_scores.checker(workspace, experiment, of_kind.rounding)
    found: dict[tuple[str, int], list[tuple]] = {run: [] for run in runs(values, experiment)}
    groups: dict[tuple[str, int], list[str]] = {}
    for protocol, seed in found:
        groups.setdefault((of_kind.group(protocol), seed), []).append(protocol)
    for (_, seed), protocols in groups.items():
        together = [of_kind(workspace, values, experiment, model, protocol, seed) for protocol in protocols]
        for run in together:
            for condition, scores in run.clean.items():
                check((run.protocol, condition, model, seed), scores)
        for test, severities in plan.items():
            scored = [[(0, *each) for each in run.unchanged(test)] for run in together]
            for severity in severities:
                changed = together[0].changed(test, severity)
                for run, own in zip(together, scored, strict=True):
                    own += [(severity, *each) for each in run.scores(changed)]
            for run, own in zip(together, scored, strict=True):
                for severity, condition, scores in by_condition(own) if test.acts_on == SCENE else own:
                    found[run.protocol, seed] += [(condition, seed, test.name, severity, *row) for row in scores]
        for _ in together:
            report()
    return [(protocol, *row) for (protocol, _), own in found.items() for row in own]


def by_condition(scored: list[tuple]) -> list[tuple]:
    """Return (severity, condition, scores) of a scene's test, those of severity 0 first, then by condition."""
    order = list(dict.fromkeys(condition for _, condition, _ in scored))
    return sorted(scored, key=lambda one: (one[0] != 0, one[0] != 0 and order.index(one[1])))
