"""Settings of glove: objects that a hand in a tactile glove grasps (SP-ResNet paper)."""

from typing import Annotated, Literal

from pydantic import Field

from tactile.settings.models import Models
from tactile.settings.shared import (
    Block,
    Budget,
    Count,
    Distinct,
    Fraction,
    Ingest,
    Latency,
    LineFaults,
    NotNegative,
    Number,
    Positive,
    Protocol,
    RateHz,
    SceneNumber,
    Specimens,
    SplitInThree,
    Text,
    Yardstick,
)


class Area(Block):
    """One area of a sensor: where its readings lie in an image, and what they can be."""

    rows: int = Field(ge=1, le=512, description="Rows of cells")
    cols: int = Field(ge=1, le=512, description="Columns of cells")
    top: int = Field(default=0, ge=0, le=512, description="First row in the image")
    left: int = Field(
        default=0, ge=0, le=512, description="First column in the image; without it beside the one before"
    )
    joint: int = Field(default=1, ge=1, le=64, description="Side of the squares of cells that show their mean (cells)")
    lowest: Number = Field(default=0, description="Smallest reading")
    highest: Number = Field(default=1023, description="Largest reading")


class Sensor(Block):
    reference_ohm: Positive = Field(description="Reference resistor of the scanner (ohm)")
    scale: Literal["frame", "range"] = Field(
        default="frame",
        description="What stretches an image: its own lowest and highest conductance (equation 6), or the range of its "
        "area's readings",
    )
    areas: dict[Text, Area] = Field(
        default={}, description="Areas of a sensor of your own, see docs/own_sensor.md; {}: those of the paper's glove"
    )


class Session(Block):
    """How grasps of one object differ; equations in pipeline/scenes/glove.py."""

    along_mm: NotNegative = Field(description="Standard deviation of the object's shift towards the fingers (mm)")
    across_mm: NotNegative = Field(description="Standard deviation of its shift along its axis (mm)")
    tilt_deg: NotNegative = Field(description="Standard deviation of its axis's tilt on the palm (degrees)")
    margin: Positive = Field(description="Grip force over the one at which the object slips")
    margin_spread: NotNegative = Field(description="Standard deviation of the log margin")
    share_spread: NotNegative = Field(description="Standard deviation of the log shares of fingers and of phalanges")
    seat_spread: NotNegative = Field(description="Standard deviation of the log share of a cell: folds of the cloth")
    fit_deg: NotNegative = Field(description="Standard deviation of the glove's misfit at a joint (degrees)")
    least_grip_n: NotNegative = Field(description="Grip force on an object without weight (N)")
    wander: Fraction = Field(description="Share of each quantity's variance that lies within a session")
    wander_time_s: Positive = Field(description="Correlation time of what wanders within a session (s)")


class Film(Block):
    rest_ohm: Positive = Field(description="Resistance of a pressure cell at rest (ohm)")
    force_scale: Positive = Field(description="Factor of a cell's force in the law of the recorded taxel")
    gain_spread: NotNegative = Field(description="Standard deviation of a cell's log gain")
    rest_bend_ohm: Positive = Field(description="Resistance of a cell on a straight joint (ohm)")
    bend_gain: NotNegative = Field(description="Relative change of conductance of a joint bent by 90 degrees")


class Circuit(Block):
    supply_v: Positive = Field(description="Supply voltage (V)")
    noise_counts: NotNegative = Field(description="Standard deviation of the read-out noise (counts)")


class Effects(Block):
    """Switches of the scene's effects, see reports/physics."""

    session: bool = Field(description="Grasps of one object differ")
    wander: bool = Field(description="A grasp changes while it lasts")
    element_spread: bool = Field(description="Every cell has its own gain")
    softness: bool = Field(description="Objects yield under the fingers")
    noise: bool = Field(description="Noise of the read-out")
    line_faults: bool = Field(description="Torn, duplicated, missing and swapped lines")


class Simulate(Block):
    seed: SceneNumber = Field(description="Seed of what is done with the glove: moved, all grasps are others")
    specimen: SceneNumber = Field(description="Number of the first glove: the gains of its cells")
    specimens: Specimens = Field(description="Gloves; seed s has glove s")
    sessions: Count = Field(description="Sessions with each object, one grasp each")
    test_sessions: int = Field(
        ge=0,
        le=1000,
        description="Further sessions with each object, which a split by session tests on and never trains on",
    )
    frames_per_object: Count = Field(description="Frames of an object over all of its sessions but the further ones")
    frame_hz: RateHz = Field(description="Frames of the scanner per second (Hz)")
    session: Session = Field(description="How grasps of one object differ")
    film: Film = Field(description="The Velostat film of the cells")
    circuit: Circuit = Field(description="The scanner's circuit")
    faults: LineFaults = Field(description="What goes wrong with the lines of the logs")
    effects: Effects = Field(description="Switches of the scene's effects")


class Thinning(Block):
    stride: Count = Field(description="Every so many-th frame of a session becomes an image")


class InputFrames(Block):
    """Figure 15: networks that see several frames of a session at once."""

    dataset: Literal["pressure", "combined"] = Field(description="Dataset of images, one with claims on figure 15")
    split: Text = Field(description="How data are divided, `session` or `random_frames`")
    numbers: Distinct[Annotated[int, Field(ge=1, le=8)]] = Field(description="Numbers of frames that a network sees")


class Glove(Block):
    source: Text = Field(description="`simulated`, or a folder of your own logs: <object>/<session>/scanner.log")
    sensor: Sensor = Field(description="The glove, or another sensor whose readings make an image")
    yardstick: Yardstick = Field(description="The published ratio that sets the scene's difficulty")
    simulate: Simulate = Field(description="The scene that writes the raw logs")
    ingest: Ingest = Field(description="What is asked of the logs")
    window: Thinning = Field(description="Which frames become images")
    split: SplitInThree = Field(description="How sessions or frames are divided")
    protocols: dict[Text, Protocol] = Field(description="<split>_<dataset of images>, and their seeds")
    budget: Budget
    models: Models = Field(description="The models to train, by their keys")
    input_frames: InputFrames = Field(description="Figure 15: networks that see several frames at once")
    latency: Latency = Field(description="How the time of a prediction is measured")
