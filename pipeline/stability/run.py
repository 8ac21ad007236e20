"""One trained model under stress: what windows.py, series.py and images.py share."""

from collections.abc import Iterable, Mapping

from pipeline import experiments, tasks
from pipeline.base.paths import Workspace
from pipeline.base.stress_tests import StressTest
from pipeline.scoring.metrics import Row

Scored = Iterable[tuple[str, list[Row]]]  # condition, rows of scores


class Run:
    """A trained model, its test part, and what readings were in training; each kind of input has one of its own.

    clean: condition -> scores of all of the test part. `changed(test, severity)` is the test part after a test, and
    `scores(changed)` are those of the model, NaN for a failed run.
    """

    clean: dict[str, list[Row]]
    rounding: float  # how far clean scores may be from those of `evaluate`

    def __init__(self, workspace: Workspace, values: Mapping, experiment: str, model: str, protocol: str, seed: int):
        self.workspace, self.experiment, self.protocol, self.seed = workspace, experiment, protocol, seed
        self.settings, self.asked = values[experiment], values["stress"][experiment]
        self.module = experiments.module(experiment)
        self.read()
        self.model, self.failed = tasks.load(workspace, values, experiment, model, protocol, seed, self.spec())
        self.predict_clean()

    @staticmethod
    def group(protocol: str) -> str:
        """Return what protocols with the same test part have in common: here each has its own."""
        return protocol

    def unchanged(self, test: StressTest) -> Scored:
        """Return the scores of severity 0, which all others are compared with."""
        return self.clean.items()
