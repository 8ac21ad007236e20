"""Put trained models under stress: one loop over runs, stress tests and severities, for every kind of input.

A kind is a class in windows.py, series.py or images.py that knows how to apply a test and how to score it:

* `Kind(workspace, values, experiment)`; `rounding`: how far clean scores may be from those of `evaluate`.
* `group(protocol)`: protocols with the same name share their readings.
* `levels(protocol, seed)` -> the test readings of a run, and what readings were in training.
* `run(model, protocol, seed, levels)` -> a trained model; its `clean`: condition -> scores of all of its test part.
* `unchanged(run, levels, test, seed)` -> (condition, scores) of severity 0, what all others are compared with.
* `apply(levels, test, severity, seed)` -> changed inputs; `scores(run, changed)` -> (condition, scores) of each.

A draw depends on the seed and the name of the test alone, so that all models see the same.
"""

from collections.abc import Callable, Iterator, Mapping

from pipeline import tasks
from pipeline.base.paths import Workspace
from pipeline.base.stress_tests import SCENE, planned
from pipeline.stability import clean_scores, perturbations  # noqa: F401 - they register themselves
from pipeline.stability.images import Images
from pipeline.stability.series import Series
from pipeline.stability.windows import Windows, simulate_scenes

KINDS = {"windows": Windows, "series": Series, "images": Images}


def prepare(workspace: Workspace, values: Mapping, experiment: str) -> None:
    """Check the tests that params.yaml asks for, and simulate the scenes that all models of windows share."""
    plan = planned(values, experiment, tasks.kind(experiment))
    if tasks.kind(experiment) == "windows":
        simulate_scenes(workspace, values, experiment, plan)


def runs(values: Mapping, experiment: str) -> Iterator[tuple[str, int]]:
    """Yield protocol and seed of every run that is tested."""
    block = values["stress"][experiment]
    for protocol in block["protocols"]:
        for seed in block.get("seeds", values[experiment]["protocols"][protocol]["seeds"]):
            yield protocol, seed


def rows(workspace: Workspace, values: Mapping, experiment: str, model: str, report: Callable[[], None]) -> list[tuple]:
    """Return one model's rows: (protocol, condition, seed, perturbation, severity, metric, unit, value, n).

    A run that failed in training has NaN for values. `prepare` ran before. Raises InputError for an unknown test in
    params.yaml, and where the clean scores are not those of scores.csv.
    """
    import torch

    torch.set_num_threads(1)
    plan = planned(values, experiment, tasks.kind(experiment))
    kind = KINDS[tasks.kind(experiment)](workspace, values, experiment)
    check = clean_scores.checker(workspace, experiment, kind.rounding)
    found: dict[tuple[str, int], list[tuple]] = {run: [] for run in runs(values, experiment)}
    groups: dict[tuple[str, int], list[str]] = {}
    for protocol, seed in found:
        groups.setdefault((kind.group(protocol), seed), []).append(protocol)
    for (_, seed), protocols in groups.items():
        levels = kind.levels(protocols[0], seed)
        trained = {protocol: kind.run(model, protocol, seed, levels) for protocol in protocols}
        for protocol, run in trained.items():
            for condition, scores in run.clean.items():
                check((protocol, condition, model, seed), scores)
        for test, severities in plan.items():
            scored = {
                protocol: [(0, *each) for each in kind.unchanged(run, levels, test, seed)]
                for protocol, run in trained.items()
            }
            for severity in severities:
                changed = kind.apply(levels, test, severity, seed)
                for protocol, run in trained.items():
                    scored[protocol] += [(severity, *each) for each in kind.scores(run, changed)]
            for protocol, own in scored.items():
                ordered = by_condition(own) if test.acts_on == SCENE else own
                found[protocol, seed] += [
                    (condition, seed, test.name, severity, *row)
                    for severity, condition, scores in ordered
                    for row in scores
                ]
        for _ in protocols:
            report()
    return [(protocol, *row) for (protocol, _), own in found.items() for row in own]


def by_condition(scored: list[tuple]) -> list[tuple]:
    """Return (severity, condition, scores) of a scene's test, those of severity 0 first, then by condition."""
    order = list(dict.fromkeys(condition for _, condition, _ in scored))
    return sorted(scored, key=lambda one: (one[0] != 0, one[0] != 0 and order.index(one[1])))
