"""One trained model under stress: what windows.py, series.py and images.py share."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pyarrow as pa

from tactile import experiments, tasks
from tactile.base.paths import Workspace
from tactile.base.stress_tests import StressTest
from tactile.scoring import metrics
from tactile.scoring.units import Units, losses

Row = tuple[str, str, float, int, str]  # of metrics.Row, and the blocks of the main metric, see `Units`
Scored = Iterable[tuple[str, list[Row]]]  # condition, rows of scores


class Run:
    """A trained model, its test part, and what readings were in training; each kind of input has one of its own.

    clean: condition -> scores of all of the test part. `changed(test, severity)` is the test part after a test, and
    `scores(changed)` are those of the model, NaN for a failed run.
    """

    clean: dict[str, list[Row]]
    rounding: float  # how far clean scores may be from those of `evaluate`
    units: Units | None = None  # of the test part, where it is of recordings

    def __init__(self, workspace: Workspace, values: Mapping, experiment: str, model: str, protocol: str, seed: int):
        self.workspace, self.experiment, self.protocol, self.seed = workspace, experiment, protocol, seed
        self.settings, self.asked = values[experiment], values["stress"][experiment]
        self.module = experiments.module(experiment)
        self.read()
        if (facts := self.module.FACTS).source:
            self.units = Units.of(*self.tested(), facts)
        self.model, self.failed = tasks.load(workspace, values, experiment, model, protocol, seed, self.spec())
        self.predict_clean()

    def with_blocks(
        self, scores: Sequence[metrics.Row], rows: np.ndarray | None, truth: np.ndarray, predicted: np.ndarray
    ) -> list[Row]:
        """Return scores, NaN for a failed run, with the blocks of the main metric where the test part is of recordings.

        rows: (n,) of the dataset, None of a changed scene; truth, predicted: see `losses`.
        """
        blocks, metric = "", self.module.FACTS.metric if self.units else ""
        if self.units and rows is not None and not self.failed and np.isfinite(predicted).all():
            blocks = self.units.written(rows, losses(metric, truth, predicted))
        return [(*row, blocks if row[0] == metric else "") for row in metrics.unless_failed(scores, self.failed)]

    def read(self) -> None:
        """Read the test part."""
        raise NotImplementedError

    def tested(self) -> tuple[np.ndarray, pa.Table]:
        """Return the rows of the dataset that are tested, (n,) rising, and its columns that say what they are of."""
        raise NotImplementedError

    @staticmethod
    def group(protocol: str) -> str:
        """Return what protocols with the same test part have in common: here each has its own."""
        return protocol

    def unchanged(self, test: StressTest) -> Scored:
        """Return the scores of severity 0, which all others are compared with."""
        return self.clean.items()
