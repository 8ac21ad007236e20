"""Settings of touch: presses on an array of pressure-sensitive elements (LoMP paper)."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from tactile.settings.models import Models
from tactile.settings.shared import (
    AlignedIngest,
    Block,
    Budget,
    Count,
    CountOrNone,
    Distinct,
    Fraction,
    Latency,
    LineFaults,
    NotNegative,
    OrAbsent,
    Positive,
    Protocol,
    RateHz,
    SceneNumber,
    Seed,
    SomeOf,
    Specimens,
    SplitInThree,
    Text,
    Window,
    Yardstick,
    without_repeats,
)


class Sensor(Block):
    rows: int = Field(ge=1, le=256, description="Rows of elements")
    cols: int = Field(ge=1, le=256, description="Columns of elements")
    pitch_mm: Positive = Field(description="Distance between the centres of neighbouring elements (mm)")
    element_mm: Positive = Field(description="Side of an element (mm)")
    order: Annotated[list[CountOrNone], Field(max_length=65_536), AfterValidator(without_repeats)] = Field(
        default=[],
        description="Number of the printed column v0, v1, ... of each element, row by row from the bottom; [] where "
        "they are printed so",
    )


class Single(Block):
    """Single touches: a CNC presses a raster of points."""

    points_per_side: Count = Field(description="Points of a side of the square raster")
    depths: Count = Field(description="Peak pressures at each point, evenly spaced")
    repetitions: Count = Field(description="How often the whole raster is pressed")
    presses_per_recording: int = Field(ge=2, le=1_000_000, description="Presses of one recording")


class Double(Block):
    """Double touches: the CNC presses one element, a hand another."""

    recordings: Count = Field(description="Number of recordings")
    presses_per_recording: int = Field(ge=2, le=1_000_000, description="Pairs of presses of one recording")


class Demonstrations(Block):
    """The three demonstrations of section IV-E: three touches, two sliding touches, a rolled tape."""

    repetitions: Count = Field(description="How often each is shown")
    places: Literal["paper", "random"] = Field(
        default="paper", description="Where they are: as in the paper's pictures, or each time somewhere else"
    )


class Pressure(Block):
    lowest_kpa: Positive = Field(description="Smallest peak pressure (kPa)")
    highest_kpa: Positive = Field(description="Largest peak pressure (kPa)")
    location_spread: Fraction = Field(description="Largest relative deviation of a press's peak pressure")


class Press(Block):
    approach_s: Positive = Field(description="Time in which the tip goes down (s)")
    hold_s: Positive = Field(description="Time for which it stays (s)")
    release_s: Positive = Field(description="Time in which it goes up (s)")
    rest_s: Positive = Field(description="Time between two presses (s)")
    timing_spread: Fraction = Field(description="Largest relative deviation of each of these times")
    cnc_mm_s: Positive = Field(description="Speed of the CNC between two presses (mm/s)")


class Hand(Block):
    slower: Positive = Field(description="Factor of its times over those of the CNC")
    tip_radius_mm: Positive = Field(description="Radius of its tip (mm)")
    shift_mm: NotNegative = Field(description="Standard deviation in x and y from the place that was told (mm)")
    tilt_deg: float = Field(ge=0, le=45, description="Standard deviation of its tilt (degrees)")
    tremor_share: NotNegative = Field(description="Standard deviation of its force, relative")
    tremor_mm: NotNegative = Field(description="Standard deviation of its place in x and y while it trembles (mm)")


class Contact(Block):
    silicone_spread_mm: NotNegative = Field(description="Standard deviation of the load's spread in the silicone (mm)")
    full_kpa: Positive = Field(description="Pressure at which all of the tip lies on the sensor (kPa)")


class Material(Block):
    resistance_scale_ohm: Positive = Field(description="Factor of the recorded taxel's resistances")
    correlation_mm: Positive = Field(description="Correlation length of gain and exponent over the film (mm)")
    repeat_spread: NotNegative = Field(
        description="Standard deviation of the log gain between presses at one place, under each element by itself"
    )


class Circuit(Block):
    """The read-out of figure 2c."""

    supply_v: Positive = Field(description="Supply voltage (V)")
    reference_ohm: Positive = Field(description="Reference resistor of a column (ohm)")
    driver_ohm: Positive = Field(description="Output resistance of a row driver (ohm)")
    read_us: NotNegative = Field(description="Time to read one element (us)")
    adc_levels: int = Field(ge=2, le=2**31, description="Levels of the analogue-to-digital converter")
    noise_counts: NotNegative = Field(description="Standard deviation of the read-out noise (counts)")


class Devices(Block):
    """The three devices that print the logs, and their clocks."""

    array_hz: RateHz = Field(description="Frames of the array per second (Hz)")
    load_cell_hz: RateHz = Field(description="Lines of a load cell per second (Hz)")
    cnc_hz: RateHz = Field(description="Lines of the CNC per second (Hz)")
    force_noise_n: NotNegative = Field(description="Standard deviation of a load cell's noise (N)")
    clock_offset_s: NotNegative = Field(description="Latest start of a device after the recording's (s)")
    clock_drift_ppm: NotNegative = Field(description="Largest drift of a device's clock (parts per million)")


class Faults(LineFaults):
    resets: CountOrNone = Field(description="Recordings of an array in which its microcontroller restarts")


class Effects(Block):
    """Switches of the scene's effects, see reports/physics."""

    load_sharing: bool = Field(description="Contact pressure spreads over neighbouring elements")
    contact_growth: bool = Field(description="The contact widens with force")
    places: bool = Field(description="Gain and exponent of the film differ from place to place")
    repeats: bool = Field(description="Gain of the film differs from press to press")
    creep: bool = Field(description="Fading memory of the Velostat, below a second")
    slow_creep: bool = Field(description="Fading memory of the Velostat, over seconds")
    hysteresis: bool = Field(description="Hysteresis of the Velostat (play operators)")
    release: bool = Field(description="Overshoot after release")
    crosstalk: bool = Field(description="Elements of one column load each other's divider")
    row_sag: bool = Field(description="Row drivers have an output resistance")
    scan_time: bool = Field(description="Elements are read one after the other")
    noise: bool = Field(description="Noise of read-out and load cells")
    hand_error: bool = Field(description="The second load cell is held by hand")
    line_faults: bool = Field(description="Torn, duplicated, missing and swapped lines, resets")


class Simulate(Block):
    seed: SceneNumber = Field(description="Seed of motions, clocks, noise and faults")
    specimen: SceneNumber = Field(description="Number of the first array: how its film differs from place to place")
    specimens: Specimens = Field(description="Arrays, each with motions of its own; seed s has array s")
    single: Single = Field(description="Single touches")
    double: Double = Field(description="Double touches")
    demonstrations: Demonstrations = Field(description="The demonstrations of section IV-E")
    pressure: Pressure = Field(description="How hard the tips press")
    press: Press = Field(description="The course of a press")
    hand: Hand = Field(description="The second load cell, which is held by hand")
    contact: Contact = Field(description="How a tip's load spreads over the elements")
    material: Material = Field(description="The Velostat film")
    circuit: Circuit = Field(description="The read-out circuit")
    devices: Devices = Field(description="The devices that print the logs")
    faults: Faults = Field(description="What goes wrong with the lines of the logs")
    effects: Effects = Field(description="Switches of the scene's effects")


class TouchIngest(AlignedIngest):
    max_touches: Count = Field(description="Most touches at once")
    highest_count: int = Field(ge=1, le=2**31 - 1, description="Largest reading: 1023 of 10 bits, 4095 of 12")


class Sliding(Block):
    """Which conditions also have windows that slide frame by frame, and how many of them."""

    single: Fraction = Field(description="Share of the sliding windows of single touches that is used")


class TouchWindow(Window):
    sliding: Sliding = Field(description="Windows that overlap, for the protocol random_window")


class Label(Block):
    tip_radius_mm: Positive = Field(description="Radius of the tip that turns force into pressure (mm)")
    tip_radius_by_condition_mm: dict[Text, Positive] = Field(
        default={}, description="Radius of the tip of conditions with another one (mm)"
    )
    map_rows: int = Field(ge=1, le=1024, description="Rows of a map, a multiple of the array's")
    map_cols: int = Field(ge=1, le=1024, description="Columns of a map, a multiple of the array's")


class TouchSplit(SplitInThree):
    """How single touches are divided; all other conditions are test data."""

    seed: Seed = Field(description="Seed of the division, beside a run's own")
    train_on: Distinct[Text] = Field(default=["single"], description="Conditions that are divided")


class RandomWindow(Protocol):
    """The paper's way of dividing: windows that overlap, at random."""

    passes: int = Field(ge=1, le=1000, description="Factor of the models' epochs")


class Protocols(SomeOf):
    """How the data are divided."""

    press: OrAbsent[Protocol] = Field(default=None, description="By press: none is on two sides")
    random_window: OrAbsent[RandomWindow] = Field(default=None, description="By window, as the paper: windows overlap")


class Touch(Block):
    source: Text = Field(
        description="`simulated`, or a folder of your own logs: <condition>/<recording>/{array,load_cell,cnc}.log"
    )
    sensor: Sensor = Field(description="The array")
    yardstick: Yardstick = Field(description="The published ratio that sets the scene's difficulty")
    simulate: Simulate = Field(description="The scene that writes the raw logs")
    ingest: TouchIngest = Field(description="What is asked of the logs")
    window: TouchWindow = Field(description="How frames are cut into windows")
    label: Label = Field(description="The pressure maps that models are asked for")
    split: TouchSplit = Field(description="How single touches are divided")
    protocols: Protocols = Field(description="Ways of dividing the data, and their seeds")
    budget: Budget
    models: Models = Field(description="The models to train, by their keys")
    latency: Latency = Field(description="How the time of a prediction is measured")
