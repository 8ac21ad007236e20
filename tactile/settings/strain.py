"""Settings of strain: a finger with soft strain sensors on a robot arm (latent-space paper)."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from tactile.settings.models import Models
from tactile.settings.shared import (
    AlignedIngest,
    Block,
    Budget,
    CountOrNone,
    Distinct,
    Fraction,
    Latency,
    LineFaults,
    LookBack,
    NotNegative,
    Number,
    OrAbsent,
    Positive,
    Protocol,
    RateHz,
    SceneNumber,
    Specimens,
    Split,
    Text,
    Yardstick,
)

Task = Literal["task_0", "task_1", "task_2"]


class Sensor(Block):
    channels: int = Field(ge=1, le=1024, description="Readings of a line of the DAQ's log, one per strand")
    unit: Literal["V", "ohm", "any"] = Field(default="V", description="Unit of the readings; any: pF, mV/V and others")
    tasks: dict[Text, Distinct[Literal["x", "y", "z"]]] = Field(
        default={},
        description="Tasks of your own, folder to axes, such as {stretch: [x]}; {}: task_0 (x, y, z), task_1 (z), "
        "task_2 (x, y)",
    )
    pressed_below_mm: OrAbsent[Number] = Field(
        default=None, description="Height z below which samples count (mm); without it all of them do"
    )


class Motion(Block):
    """Straight strokes of the arm between random places at random speeds, with rests."""

    width_mm: Positive = Field(description="Range of x (mm)")
    height_mm: Positive = Field(description="Range of y (mm)")
    depth_mm: Positive = Field(description="Range of z, downwards from where the finger just touches (mm)")
    sliding_depth_mm: Positive = Field(description="Depth at which task_2 slides (mm)")
    slide_slowest_mm_s: Positive = Field(description="Lowest speed in x and y (mm/s)")
    slide_fastest_mm_s: Positive = Field(description="Highest speed in x and y (mm/s)")
    press_slowest_mm_s: Positive = Field(description="Lowest speed in z (mm/s)")
    press_fastest_mm_s: Positive = Field(description="Highest speed in z (mm/s)")
    rest_s: NotNegative = Field(description="Mean rest after a stroke (s)")


class Finger(Block):
    """The finger on its surface; equations in pipeline/scenes/strain.py."""

    stiffness_n_per_mm: Positive = Field(description="k, elastic force over bending (N/mm)")
    normal_n_per_mm: Positive = Field(description="n, normal force over depth (N/mm)")
    static_friction: NotNegative = Field(description="Coefficient of friction that must be exceeded to slip")
    kinetic_friction: NotNegative = Field(description="Coefficient of friction that is left after a slip")
    press_bending: Number = Field(description="b, bending in x over depth (mm/mm)")
    compression: Number = Field(description="c, shortening over depth (mm/mm)")
    lean: Number = Field(description="Bending over place in x and y (mm/mm); 0 to 0.035 are plausible")
    friction_spread: NotNegative = Field(description="Standard deviation of log friction over the surface")
    friction_length_mm: Positive = Field(description="Correlation length of friction over the surface (mm)")
    friction_direction: Fraction = Field(description="A, how much friction changes with the direction of the drag")


class Strand(Block):
    """A strand of conductive elastomer; equations in pipeline/scenes/strain.py."""

    sensitivity_per_mm: Positive = Field(description="s, relative change of resistance over bending (1/mm)")
    gain_spread: NotNegative = Field(description="Standard deviation of a strand's log gain")
    angle_spread_deg: NotNegative = Field(
        description="Standard deviation of a strand's angle around the finger (degrees)"
    )
    slack_mm: NotNegative = Field(description="b_0, bending before a strand stretches (mm)")
    fast_share: Fraction = Field(description="w_1, share of a change of strain that breaks fast paths")
    fast_time_s: Positive = Field(description="T_1, time in which fast paths form again (s)")
    slow_share: Fraction = Field(description="w_2, share of a change of strain that breaks slow paths")
    slow_time_s: Positive = Field(description="T_2, time in which slow paths form again (s)")
    break_spread: NotNegative = Field(description="Log-normal spread of how many paths break")
    break_time_s: Positive = Field(description="Correlation time of how many paths break (s)")
    loading_time_s: Positive = Field(description="Time constant of the response while strain rises (s)")
    unloading_time_s: Positive = Field(description="Time constant of the response while strain falls (s)")


class Drift(Block):
    wander: NotNegative = Field(description="Standard deviation of the drift of a strand, relative")
    wander_time_s: Positive = Field(description="Correlation time of that drift (s)")
    ageing: Number = Field(description="Relative change of resistance for each factor e of time")
    ageing_time_s: Positive = Field(description="Time after which ageing begins to slow down (s)")


class Circuit(Block):
    supply_v: Positive = Field(description="Supply voltage (V)")
    reference_share: Positive = Field(description="Reference resistor over the strand's resistance at rest")
    noise_v: NotNegative = Field(description="Standard deviation of the noise of a reading (V)")


class Devices(Block):
    """The two devices that print the logs, and their clocks."""

    daq_hz: RateHz = Field(description="Samples of the DAQ per second (Hz)")
    robot_hz: RateHz = Field(description="Lines of the robot per second (Hz)")
    jitter_s: NotNegative = Field(description="Standard deviation of a sample's time (s)")
    clock_offset_s: NotNegative = Field(description="Latest start of a device after the recording's (s)")
    clock_drift_ppm: NotNegative = Field(description="Largest drift of a device's clock (parts per million)")


class Faults(LineFaults):
    gaps: CountOrNone = Field(description="Times that the DAQ falls silent in a recording")
    gap_s: NotNegative = Field(description="Length of each silence (s)")


class Effects(Block):
    """Switches of the scene's effects, see reports/physics."""

    relaxation: bool = Field(description="Conductive paths break with a change of strain and form again")
    asymmetry: bool = Field(description="Unloading lags behind loading")
    drift: bool = Field(description="The resistance at rest wanders and ages")
    noise: bool = Field(description="Noise of the DAQ's readings")
    stick_slip: bool = Field(description="The finger sticks and slips; without it, it is dragged evenly")
    friction_spread: bool = Field(description="Friction differs from place to place and with the direction")
    jitter: bool = Field(description="The DAQ's samples are not evenly spaced")
    line_faults: bool = Field(description="Torn, duplicated, missing and swapped lines, silences")


class Simulate(Block):
    seed: SceneNumber = Field(description="Seed of motion, drift, noise and line faults")
    specimen: SceneNumber = Field(description="Number of the first finger")
    specimens: Specimens = Field(description="Recordings of each task, each of another finger")
    samples: int = Field(ge=100, le=10_000_000, description="Samples of a recording")
    motion: Motion = Field(description="How the arm moves")
    finger: Finger = Field(description="The finger on its surface")
    strand: Strand = Field(description="A strand of conductive elastomer")
    drift: Drift = Field(description="How the resistance at rest drifts")
    circuit: Circuit = Field(description="The voltage divider of a strand")
    devices: Devices = Field(description="The devices that print the logs")
    faults: Faults = Field(description="What goes wrong with the lines of the logs")
    effects: Effects = Field(description="Switches of the scene's effects")


class StrainIngest(AlignedIngest):
    rate_hz: RateHz = Field(description="Uniform rate of the samples that models see (Hz)")
    max_gap_s: Positive = Field(description="Longest silence that is interpolated (s)")
    average: bool = Field(default=False, description="Take means over 1 / rate_hz, for a fast DAQ")


class StrainSplit(Split):
    test_recordings: list[Text] = Field(
        default=[], description="Recordings that are test data alone, of another day, say; the others then train"
    )


class StrainProtocol(Protocol):
    """How often a task is run, and what differs from the others."""

    samples: OrAbsent[Annotated[int, Field(ge=2, le=1_000_000)]] = Field(
        default=None,
        description="Samples that are trained on at most, the last ones before the test part, none of them for "
        "validation; without it all",
    )
    base: OrAbsent[Task] = Field(default=None, description="Task whose network transfer starts from; without it task 0")


class Strain(Block):
    source: Text = Field(description="`simulated`, or a folder of your own logs: <task>/<recording>/{daq,robot}.log")
    sensor: Sensor = Field(description="The strain sensors")
    yardstick: Yardstick = Field(description="The published ratio that sets the scene's difficulty")
    yardstick_task_2: Yardstick = Field(description="The published ratio of task 2, by which nothing is set")
    simulate: Simulate = Field(description="The scene that writes the raw logs")
    ingest: StrainIngest = Field(description="What is asked of the logs")
    split: StrainSplit = Field(description="How recordings are divided")
    window: LookBack = Field(description="How far models of windows look back")
    model_zero: Text = Field(description="Model that is trained on task 0, for transfer")
    protocols: Annotated[dict[Text, StrainProtocol], Field(min_length=1)] = Field(description="Tasks that are run")
    budget: Budget
    models: Models = Field(description="The models to train, by their keys")
    latency: Latency = Field(description="How the time of a prediction is measured")

    @model_validator(mode="after")
    def _resistance_is_not_turned(self) -> "Strain":
        daq = self.ingest.format.get("daq.log")
        if self.sensor.unit == "ohm" and daq is not None and not daq.rises_when_pressed:  # 1e9 less a reading
            raise ValueError(
                "resistance has no highest value that falling readings could be taken from; remove "
                "rises_when_pressed from strain.ingest.format: a resistance may fall when pressed"
            )
        return self
