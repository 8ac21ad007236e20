"""Predict while the sensor prints: one prediction per line, and what is to be known of lines and times.

A model's frames are as far apart in time as in training. A device that prints more often than the sensor of training
feeds several streams of frames, one after the other: of four times the rate, four times as many.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from tactile.inference import timing, touches
from tactile.inference.predictor import Predictor
from tactile.live.source import Lines, Reading
from tactile.logs import packets, unmeasured

MEASURED_S = 1.0  # of the device's clock, in which its rate is measured
LEAST_MEASURED = 4  # lines, of a slow device
MOST_LOAD = 0.8  # share of the time that predictions may take
TIMED = 20  # predictions that tell what one takes
KEPT = 1000  # latest lines and predictions that rate and times are taken from
LOOK_S = 2.0  # of the device's clock, after which the readings so far are looked at anew
LOOKED_AT = 200_000  # values, of the latest readings, that are looked at: 30 ms of the 405 cells of a glove


class Prediction(NamedTuple):
    """What a model says of one reading."""

    number: int  # from 1
    reading: Reading
    values: np.ndarray  # Predictor.output_shape, in the card's unit; NaN before the model has seen a whole window
    touches: list[touches.Touch]  # of a pressure map, the hardest first
    force_n: float | None  # of a map
    arrived_s: float  # time.monotonic() when the line was read
    predicted_s: float
    outside: bool  # the reading is, as of Predictor.outside


class Session:
    """A model at work on one source of lines. `notes`: sentences on how it differs from the sensor of training."""

    def __init__(self, model: Predictor, lines: Lines, say: Callable[[str], None]):
        """say: gets a sentence that the user must know, when it is known."""
        self.model, self.card, self.lines, self.say = model, model.card, lines, say
        self.notes: list[str] = []
        self.count = 0  # predictions
        self.to_prediction_s: deque[float] = deque(maxlen=KEPT)
        self._arrivals: deque[float] = deque(maxlen=KEPT)
        self._measured: list[tuple[Reading, float]] = []  # readings while the rate is not known, and their arrival
        self._rate: packets.Rate | None = None
        self._frame_step, self._every, self._turn = 1, 1, 0
        self._last: Reading | None = None
        self._step_s = self._time_of_a_step()
        self._latest: deque[Reading] = deque(maxlen=LOOKED_AT // self.card.inputs.columns)
        self._looked_s, self._constant, self._stuck = -np.inf, None, {}  # _stuck: channel -> value
        self._told: set[str] = set()

    def take(self, data: bytes | None, arrived_s: float) -> Iterator[Prediction]:
        """Yield the predictions for bytes that arrived (None: the device vanished); errors as Lines.take.

        Lines of the first MEASURED_S tell the rate: they are predicted together at its end.
        """
        count = self.lines.count
        for reading in self.lines.take(data):
            if self._rate is None:
                yield from self._measure(reading, arrived_s)
            elif (prediction := self._predict(reading, arrived_s)) is not None:
                self.to_prediction_s.append(prediction.predicted_s - arrived_s)
                yield prediction
        self._arrivals.extend([arrived_s] * (self.lines.count - count))

    def finish(self) -> Iterator[Prediction]:
        """Yield the predictions for lines that ended before their rate was known."""
        if self._rate is None and len(self._measured) >= LEAST_MEASURED:
            yield from self._start()

    def lines_per_s(self) -> float:
        """Return the rate at which the latest lines arrived, over about two seconds; 0 before there are two."""
        arrivals = list(self._arrivals)
        recent = [at for at in arrivals if at > arrivals[-1] - 2.0] if arrivals else []
        recent = recent if len(recent) > 2 else arrivals[-3:]
        later = sum(at > recent[0] for at in recent)  # without the lines that came with the first
        return later / (recent[-1] - recent[0]) if later else 0.0

    def _predict(self, reading: Reading, arrived_s: float) -> Prediction | None:
        """Return the prediction for the next reading, None for one that is left out.

        Few lost lines are filled by interpolation, as in `recordings.predict`; after more of them, a model of windows
        starts anew, since windows of training span no gap.
        """
        lost = packets.missing_before(self._rate, self._last.t_s, reading.t_s)
        if self.card.says == "map":
            if reading.restarted or lost > timing.most_filled(self._every * self._frame_step):
                self.model.reset(self._frame_step)
                self._turn = lost = 0
            for values in timing.between(self._last.values, reading.values, lost):
                if self._is_predicted():
                    self.model.step(values)
        self._last = reading
        if not self._is_predicted():
            return None
        values, of_map, force_n = self._evaluated(reading.values, self._is_unmeasured(reading), reading.t_s)
        self.count += 1
        outside = self.model.stepped_outside
        return Prediction(self.count, reading, values, of_map, force_n, arrived_s, time.monotonic(), outside)

    def _is_predicted(self) -> bool:
        """Tell whether the next reading is one of those that a device which is too fast has predicted."""
        self._turn += 1
        return (self._turn - 1) % self._every == 0

    def _is_unmeasured(self, reading: Reading) -> bool:
        """Tell whether a reading is no measurement, by what the readings so far have shown; say so when it is found.

        Frames of one number, or a channel that stands still, are known once there are enough of them: those before have
        been predicted by then.
        """
        if reading.restarted or (self._latest and reading.t_s < self._latest[-1].t_s):
            self._latest.clear()
            self._looked_s = -np.inf
        self._latest.append(reading)
        if reading.t_s >= self._looked_s + LOOK_S:
            self._looked_s = reading.t_s
            self._look()
        moved = [channel for channel, value in self._stuck.items() if reading.values[channel] != value]
        for channel in moved:
            del self._stuck[channel]
        return bool(self._stuck) or (self._constant is not None and bool((reading.values == self._constant).all()))

    def _look(self) -> None:
        """Look for what is no measurement in the latest readings."""
        times = np.array([reading.t_s for reading in self._latest])
        found = unmeasured.found(times, np.array([reading.values for reading in self._latest]))
        names = self.lines.format.names[1:]
        for kind, of_kind in unmeasured.apart(found):
            if kind not in self._told:
                self._told.add(kind)
                self._note("\n".join(unmeasured.sentences(of_kind, times, names)))
        if found.constant is not None:
            self._constant = found.constant.value
        self._stuck = {each.channel: each.value for each in found.stuck if each.stop == len(times)}

    def _evaluated(
        self, reading: np.ndarray, none: bool = False, t_s: float | None = None
    ) -> tuple[np.ndarray, list[touches.Touch], float | None]:
        """Return (values, touches, force in N) of the next reading, of time t_s; none: it is no measurement."""
        values = self.model.step(reading, none, t_s)
        if self.card.says != "map":
            return values, [], None
        if self.card.outputs.touch_kpa is None:
            return values, [], float(values.sum())
        return values, touches.touches(values[None], self.card)[0], float(touches.force_n(values[None], self.card)[0])

    def _measure(self, reading: Reading, arrived_s: float) -> Iterator[Prediction]:
        """Keep a reading; once there are enough, find the rate and predict them all."""
        if reading.restarted:
            self._measured.clear()
        self._measured.append((reading, arrived_s))
        if len(self._measured) >= LEAST_MEASURED and reading.t_s - self._measured[0][0].t_s >= MEASURED_S:
            yield from self._start()

    def _start(self) -> Iterator[Prediction]:
        times = np.array([reading.t_s for reading, _ in self._measured])
        self._rate, self._last = packets.rate(times), self._measured[0][0]
        self._choose_step()
        self.model.reset(self._frame_step)
        for reading, arrived_s in self._measured:
            if (prediction := self._predict(reading, arrived_s)) is not None:
                yield prediction
        self._measured.clear()

    def _choose_step(self) -> None:
        """Find how many readings lie between two frames, and say where the device's rate does not suit the model."""
        interval_s = self._rate.interval
        self._every = max(1, int(np.ceil(self._step_s / (MOST_LOAD * interval_s))))
        if self._every > 1:
            self._note(
                f"A prediction takes {1e3 * self._step_s:.1f} ms, longer than the device's lines are apart "
                f"({1e3 * interval_s:.1f} ms): one of {self._every} lines is predicted."
            )
        used_s = self._every * interval_s
        self._frame_step = timing.frame_step(self.card, used_s)
        for sentence in timing.differences(self.card, interval_s, used_s):
            self._note(sentence)

    def _note(self, sentence: str) -> None:
        self.notes.append(sentence)
        self.say(sentence)

    def _time_of_a_step(self) -> float:
        """Return the seconds that a prediction takes, once compiled; the model has then seen nothing."""
        reading, taken = np.arange(self.card.inputs.columns) % 7, []
        for _ in range(self.card.shapes.frames * self.card.inputs.frame_step + TIMED):  # at first a window is filled
            began = time.perf_counter()
            self._evaluated(reading)
            taken.append(time.perf_counter() - began)
        self.model.reset()
        return float(np.median(taken[-TIMED:]))
