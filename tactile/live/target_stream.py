"""Put the model of a target to work on readings as they come, in the place of an `inference.predictor.Predictor`."""

from collections import deque
from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from tactile.base import ranges
from tactile.experiments import facts, module
from tactile.inference.card import Bound, Calibration, Inputs, Outputs, Shapes
from tactile.inference.card import Card as ModelCard
from tactile.inference.intervals import ALWAYS, OBJECT
from tactile.scoring import conformal
from tactile.targets import features, kept, models, read
from tactile.targets.kept import Kept

NO_CLOCK_S = 0.1  # from one reading to the next, of cards that do not say it


class _Outputs(Outputs):
    """A number in the target's unit, or the scores of its classes."""

    best: ClassVar[str] = "predicted"
    set_of_them: ClassVar[str] = "set"

    unit: str


class StreamCard(ModelCard):
    """The card of a target's model as `live` takes cards."""

    outputs: _Outputs
    sensor: str
    target: str

    @property
    def title(self) -> str:
        """The model's name for people."""
        return f"{self.sensor}: {self.target}"

    @property
    def says(self) -> Literal["numbers", "classes"]:
        """What one prediction is: two classes or more have scores, whatever the unit of a number is called."""
        return "classes" if len(self.outputs.names) > 1 else "numbers"

    @property
    def output_shape(self) -> tuple[int, ...]:
        """Shape of one prediction: (1,) in the target's unit, or (classes,)."""
        return (len(self.outputs.names),)

    @property
    def heading(self) -> str:
        """What its predictions are, for people."""
        return self.target if self.says == "classes" else f"{self.target} in {self.outputs.unit}"

    @property
    def lacks(self) -> str:
        """Why there is no prediction where there is none, for people."""
        return f"No prediction yet: the model first sees for {features.START_S:g} s what the sensor reads untouched."


class Stream:
    """A target's model, reading by reading; predictions are those that `kept.predict` makes of the whole log.

    A model that sees readings above what a recording began with says nothing in its first START_S.
    """

    as_trained = False  # nothing in torch could be made faster

    def __init__(self, model: Kept):
        self._model, self.card = model, card_of(model)
        self.interval_sentences = [kept.interval(model.card)]
        self.output_shape = self.card.output_shape
        self.reset()

    def order(self, reading: Mapping[str, Mapping]) -> list[int]:
        """Return the numbers of the printed values in the order of those of the training, as `Predictor.order`."""
        columns = np.arange(self.card.inputs.columns)[None]
        return read.as_trained(columns, reading, self._model.card.settings)[0].tolist()

    def reset(self, frame_step: int | None = None) -> None:
        """Begin a recording; frame_step: of no use here, as windows are seconds long."""
        self._window: deque[tuple[float, np.ndarray, bool]] = deque()  # time (s), reading, outside
        self._first: list[tuple[float, np.ndarray]] = []  # readings of the first START_S
        self._start: np.ndarray | None = None
        self.stepped_outside = False  # of the latest reading, as Predicted.outside

    def step(self, reading: np.ndarray, unmeasured: bool = False, t_s: float | None = None) -> np.ndarray:
        """Return the prediction for the next reading, (1,) in the target's unit or (classes,) scores.

        reading: (elements,); unmeasured: it is no measurement; t_s: its time, None: one usual step after the last. A
        time before the last one is that of a device that began anew, and so does the recording.
        """
        card, reading = self._model.card, np.asarray(reading, np.float32)
        if t_s is None:
            t_s = self._window[-1][0] + self.card.inputs.interval_s if self._window else 0.0
        if self._window and t_s <= self._window[-1][0]:
            self.reset()
        if self._window and t_s - self._window[-1][0] > features.SILENCE * card.window_s:
            self._window.clear()
        self._window.append((t_s, reading, unmeasured or bool(ranges.outside(reading[None], card.trained_on)[0])))
        while self._window[0][0] < t_s - card.window_s:
            self._window.popleft()
        time, seen, outside = map(np.array, zip(*self._window, strict=True))
        self.stepped_outside = bool(outside.any())
        self._begin(t_s, reading)
        if self._start is None:
            return np.full(self.output_shape, np.nan, np.float32)
        found = features.statistics(time, np.zeros(len(time), int), seen, np.array([len(time) - 1]), card.window_s)
        x = features.columns(found, self._start, card.view)
        return models.predicted(self._model.estimator, x, self.output_shape[0])[0].astype(np.float32)

    def _begin(self, t_s: float, reading: np.ndarray) -> None:
        """Take a reading for what the recording began with, if it is one of those."""
        if self._model.card.view != features.ABOVE_START:
            self._start = np.zeros_like(reading)  # which the other views do not see
            return
        if not self._first or t_s <= self._first[0][0] + features.START_S:
            self._first.append((t_s, reading))
        elif self._start is None:
            time, seen = map(np.array, zip(*self._first, strict=True))
            self._start = features.start(time, seen)


def card_of(model: Kept) -> StreamCard:
    """Return the card of a target's model as `live` takes cards."""
    card, of = model.card, facts(model.card.experiment)
    sensor, outputs = card.settings["sensor"], len(card.classes) or 1
    rows = sensor["rows"] if card.experiment == "touch" else 1
    name = OBJECT if card.classes else f"{card.target.name}_{card.target.unit}"
    bounds = [Bound(output=name, case=ALWAYS, value=card.bound, groups=card.units, rows=0)]
    return StreamCard(
        experiment=card.experiment,
        kind=module(card.experiment).KIND,
        model=card.model,
        protocol=card.by,
        seed=0,
        commit=card.commit,
        version=card.version,
        settings={},
        reading=card.settings,
        shapes=Shapes(frames=1, rows=rows, cols=card.elements // rows, map_rows=1, map_cols=outputs),
        inputs=Inputs(
            columns=card.elements,
            unit=sensor.get("unit", of.unit),
            order="as printed",
            interval_s=card.interval_s or NO_CLOCK_S,
            frame_step=1,
        ),
        outputs=_Outputs(
            unit="probability" if card.classes else card.target.unit,
            names=card.classes or [name],
        ),
        precision=None,
        best_epoch=0,
        scores=[],
        files={},
        calibration=Calibration(
            level=conformal.LEVEL, group="press", shared=False, refitted=False, bounds=bounds, coverage=[]
        ),
        trained_on=card.trained_on,
        sensor=card.sensor,
        target=card.target.name,
    )
