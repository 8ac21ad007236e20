"""Describe a saved model beside its weights, so that it can be used without this checkout's settings and data."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

from tactile.base import cards, files, ranges
from tactile.base.cards import Words
from tactile.base.correlation import Correlation
from tactile.base.errors import InputError
from tactile.settings import Experiment

NAME = "card.json"
WEIGHTS = ("network.safetensors", "estimator.skops")
ONNX = "model.onnx"
AGAIN = "make the folder again with `tactile export MODEL FOLDER`"

Size = Annotated[int, Field(ge=1, le=1 << 20)]
Count = Annotated[int, Field(ge=0)]
Positive = Annotated[float, Field(gt=0, le=1e9)]
Distance = Annotated[float, Field(ge=0, le=1e9)]
Case = Literal["always", "touch", "no touch"]


class Part(BaseModel):
    """A part of a card: every key known, no NaN, nothing changed later."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Shapes(Part):
    """Shapes of a model's input and output, as learning.spec.Spec."""

    frames: Size
    rows: Size
    cols: Size
    map_rows: Size
    map_cols: Size


class Inputs(Part):
    """What one reading is: `columns` values in `unit`, one reading every `interval_s` seconds."""

    columns: Size
    unit: Literal["counts", "V", "ohm", "any", "levels"]
    order: Words
    interval_s: Positive
    frame_step: Size  # readings from one frame of a window to the next
    chosen: list[int] | None = None  # columns that the model sees, in its order; None: all of them


class Outputs(Part):
    """What one prediction is: values in `unit`; `names` of the outputs where they are no map."""

    best: ClassVar[str] = "object"  # the name of what is likeliest, where outputs are probabilities,
    set_of_them: ClassVar[str] = "objects"  # and of the set that holds the truth

    unit: Literal["kPa", "% contact", "N", "mm", "probability"]
    names: list[Words] | None = None
    touch_kpa: Positive | None = None  # peak of a map from which on it is a touch
    force_gain: Positive | None = None  # of a pressure map: force on the load cells in N over the map's integral in N


class Score(Part):
    """One row of scores.csv."""

    condition: Words
    metric: Words
    unit: Words
    value: float | None  # None where there is nothing to score
    n: Count


class Bound(Part):
    """How far one output may be off, from the validation part; the interval is prediction +- value x scale."""

    output: Words  # kpa (of a touch), force_n, object, or one of `outputs.names`
    case: Case  # the predictions that it is for
    value: Distance | None  # half width; of an object the probability from which on it is in the set; None: cannot tell
    floor: Distance | None = None  # scale is sqrt(prediction + floor), in the output's unit; None: scale is 1
    groups: Count  # that it was calibrated on
    rows: Count


class Coverage(Part):
    """How often the intervals held the truth on the test part, each group with the same weight."""

    condition: Words
    output: Words
    case: Case
    width: float  # mean width of the intervals, or size of the sets
    share: float
    low: float  # of the 95 % binomial interval over groups
    high: float
    groups: Count
    rows: Count
    reason: Words  # why the share may be outside what is plausible; empty where it is inside


class Calibration(Part):
    """Split-conformal calibration of a model's intervals, see scoring/conformal.py."""

    level: Annotated[float, Field(gt=0, le=0.999)]  # share of truths that an interval is to hold
    group: Words  # what counts as one: press, grasp, session, block of 10 s
    shared: bool  # groups of the validation part were also trained on, so that new ones have larger errors
    refitted: bool  # the errors are of the same model fitted without the validation part: this one was fitted to it
    bounds: list[Bound]
    coverage: list[Coverage]


class Log(Part):
    """A recording of the dataset that a model was trained or tested on."""

    name: Words  # condition/recording
    sha256: cards.Digest  # of the sensor's log, files.content_sha256
    parts: list[Literal["train", "validation", "test"]]  # of the split that its rows are in


class Card(Part):
    """All that a saved model needs beside its weights."""

    experiment: Experiment
    kind: Literal["windows", "series", "images"]
    model: Words
    protocol: Words
    seed: Count
    commit: Words
    version: Words | None = None  # of this project; None: the card was written before 0.2.0
    settings: dict  # the model's block of settings
    reading: dict[str, dict]  # consistent.READING: those that the experiment has
    shapes: Shapes
    inputs: Inputs
    outputs: Outputs
    precision: Words | None  # of products in training
    best_epoch: Count
    scores: list[Score]  # of the test part
    files: cards.Files  # of the package, by name: one of WEIGHTS, ONNX where there is one, and the card itself
    correlation: Correlation | None = None  # of the channels in training; None: not known, or it tells nothing
    calibration: Calibration | None = None  # None: predictions have no interval
    trained_on: Annotated[list[ranges.Columns], Field(min_length=1)] | None = (
        None  # None: nobody knows which readings lie outside the training
    )
    source: Words | None = None  # of its logs: simulated, data/own/..., or the public recordings' name; None: not known
    logs: list[Log] | None = None  # None: nobody knows which logs it was trained on

    @property
    def title(self) -> str:
        """The model's name for people."""
        return f"{self.experiment}/{self.model}"

    @property
    def heading(self) -> str:
        """What its predictions are, for people."""
        if self.says == "map":
            return "Force in N" if self.outputs.touch_kpa is None else "Pressure map"
        return "Object" if self.says == "classes" else f"Position in {self.outputs.unit}"

    @property
    def lacks(self) -> str:
        """Why there is no prediction where there is none, for people."""
        if self.kind == "images":
            return "This reading makes no image."
        return "No prediction yet: the model must see a whole window without a gap."

    @property
    def says(self) -> Literal["map", "numbers", "classes"]:
        """What one prediction is."""
        if self.outputs.names is None:
            return "map"
        return "classes" if self.outputs.unit == "probability" else "numbers"

    @property
    def output_shape(self) -> tuple[int, ...]:
        """Shape of one prediction: (map_rows, map_cols) in kPa, % contact or N, (outputs,) in mm, or (classes,)."""
        shapes = self.shapes
        return (shapes.map_rows, shapes.map_cols) if self.kind == "windows" else (shapes.map_rows * shapes.map_cols,)

    @property
    def weights_sha256(self) -> str:
        """Digest of the file of weights."""
        return next(self.files[name] for name in WEIGHTS if name in self.files)

    def of_network(self) -> "Card":
        """Return the card as ONNX repeats it: of the files the weights alone, without the logs of the training."""
        weights = {name: digest for name, digest in self.files.items() if name in WEIGHTS}
        return self.model_copy(update={"source": None, "logs": None, "files": weights})

    def reach(self, frame_step: int | None = None) -> int:
        """Return how many readings lie between the first and the last frame of a window: those without a prediction.

        frame_step: readings from one frame to the next; None: `inputs.frame_step`.
        """
        return (self.shapes.frames - 1) * (frame_step or self.inputs.frame_step) if self.kind == "windows" else 0


def weights_file(folder: Path) -> Path:
    """Return the file of weights in a folder; InputError where there is none."""
    for name in WEIGHTS:
        if (folder / name).is_file():
            return folder / name
    raise InputError(f"{folder}: no {' or '.join(WEIGHTS)} in it; train it again, or name the folder of a saved model")


def write(folder: Path, card: Card) -> None:
    """Write a card beside the weights that it names, and beside ONNX where that is there, which it then names, too."""
    named = card.of_network().files
    if (folder / ONNX).is_file():
        named |= {ONNX: files.sha256(folder / ONNX)}
    cards.write(folder / NAME, card.model_copy(update={"files": named}))
