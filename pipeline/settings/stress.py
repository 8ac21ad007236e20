"""Settings of the stress tests: what goes wrong after training, and how badly. Severity 0 is always done."""

from typing import Annotated

from pydantic import AfterValidator, Field, model_validator

from pipeline.settings.shared import Block, Distinct, Number, Positive, Seeds, SomeOf, Text


def without_zero(severities: list[float]) -> list[float]:
    """Return the severities; ValueError where 0 is among them."""
    if 0 in severities:
        raise ValueError("should not list severity 0, which is always done")
    return severities


Severities = Annotated[Distinct[Number], AfterValidator(without_zero)]


class Readings(SomeOf):
    """Faults of the readings that all sensors have."""

    noise: Severities = Field(default=None, description="White noise: standard deviation, share of the range")
    gain_drift: Severities = Field(
        default=None, description="Gain of each element: standard deviation of its logarithm"
    )
    offset_drift: Severities = Field(
        default=None, description="Offset of each element: standard deviation, share of the range"
    )
    dead: Severities = Field(default=None, description="Elements that stop responding (number)")
    stuck: Severities = Field(default=None, description="Elements that repeat one reading (number)")
    lost_frames: Severities = Field(default=None, description="Probability that a frame repeats the one before")
    jitter: Severities = Field(default=None, description="Error of a frame's time: standard deviation (frames)")


class ReadingsOfArea(Readings):
    """Faults of sensors whose elements lie in rows and columns."""

    dead_line: Severities = Field(default=None, description="Whole rows or columns that read the lowest value (number)")


class ReadingsOfSeries(Readings):
    """Faults of sensors whose readings are a series."""

    half: Severities = Field(default=None, description="As dead, half way through the test part (number)")
    time: Severities = Field(
        default=None, description="No fault: age of the samples since the start of the test part (minutes)"
    )


class TouchPerturbations(ReadingsOfArea):
    """Faults of the readings, and changes of the scene."""

    specimen: Severities = Field(
        default=None, description="Another array of the same make: its number from the trained"
    )
    peak_pressure: Severities = Field(default=None, description="Factor of all pressures, less 1")
    press_speed: Severities = Field(default=None, description="Factor of the speed of presses (log2)")
    tip_radius: Severities = Field(default=None, description="Change of the tip's radius (mm)")
    touches: Severities = Field(default=None, description="Touches at once (number)")
    distance: Severities = Field(default=None, description="Distance between two touches (mm)")


class StrainPerturbations(ReadingsOfSeries):
    """Faults of the readings, and changes of the scene."""

    rate: Severities = Field(default=None, description="Factor of the sampling rate (log2)")
    speed: Severities = Field(default=None, description="Factor of the arm's speed (log2)")
    specimen: Severities = Field(
        default=None, description="Another finger of the same make: its number from the trained"
    )


class GlovePerturbations(ReadingsOfArea):
    """Faults of the readings, and changes of the scene."""

    specimen: Severities = Field(
        default=None, description="Another glove of the same make: its number from the trained"
    )
    shift: Severities = Field(default=None, description="Shift of the object towards the fingers (mm)")
    turn: Severities = Field(default=None, description="Turn of the object's axis on the palm (degrees)")
    grip: Severities = Field(default=None, description="Factor of the grip's margin over the slip force (log2)")


class Tested(Block):
    """What is tested of an experiment."""

    protocols: Distinct[Text] = Field(description="Protocols whose trained models are tested")
    usable: dict[Text, Positive] = Field(
        description="Largest error at which a model is still usable, by protocol, in the unit of the experiment's error"
    )
    recordings: dict[Text, Annotated[int, Field(ge=1, le=100_000)]] = Field(
        default={}, description="Of windows: how many recordings of a condition, the first, are perturbed"
    )

    @model_validator(mode="after")
    def _usable_for_each(self) -> "Tested":
        if set(self.usable) != set(self.protocols):
            raise ValueError(f"usable should have these keys: {', '.join(self.protocols)}")
        return self


class SeededTest(Tested):
    """What is tested of an experiment on images."""

    seeds: Seeds = Field(description="Seeds whose trained models are tested")


class StressTouch(Tested):
    perturbations: TouchPerturbations = Field(description="Severities by what goes wrong; range: the ADC's 1023 counts")


class StressVelostatRecorded(Tested):
    perturbations: ReadingsOfArea = Field(description="Severities by what goes wrong; range: of training readings")


class StressStrain(Tested):
    perturbations: StrainPerturbations = Field(description="Severities by what goes wrong; range: each channel's")


class StressStrainRecorded(Tested):
    perturbations: ReadingsOfSeries = Field(description="Severities by what goes wrong; range: each channel's")


class StressGlove(SeededTest):
    perturbations: GlovePerturbations = Field(description="Severities by what goes wrong; range: each area's")


class StressGloveRecorded(SeededTest):
    perturbations: ReadingsOfArea = Field(description="Severities by what goes wrong; range: each area's")


class Stress(Block):
    touch: StressTouch = Field(description="Stress tests of touch")
    velostat_recorded: StressVelostatRecorded = Field(description="Stress tests of velostat_recorded")
    strain: StressStrain = Field(description="Stress tests of strain")
    strain_recorded: StressStrainRecorded = Field(description="Stress tests of strain_recorded")
    glove: StressGlove = Field(description="Stress tests of glove")
    glove_recorded: StressGloveRecorded = Field(description="Stress tests of glove_recorded")
