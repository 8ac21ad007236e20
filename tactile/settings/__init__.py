"""Settings: what params.yaml and params/<experiment>.yaml may say, as pydantic classes.

Every key has its type, limits and meaning. `touch.sensor.pitch_mm` is the field `pitch_mm` of the class `Sensor`
in touch.py: a file for each block at the top, a class for each block inside. A model's settings stand in its own file
in tactile/models (models.py says how), the recipes of networks in training.py, and what several blocks share in
shared.py. Editors complete and explain keys by params.schema.json, which `python -m tools.schema` writes.
"""

import json
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from tactile.settings.array_recorded import ArrayRecorded
from tactile.settings.glove import Glove
from tactile.settings.glove_recorded import GloveRecorded
from tactile.settings.physics import Physics
from tactile.settings.shared import Block, Distinct
from tactile.settings.strain import Strain
from tactile.settings.strain_recorded import StrainRecorded
from tactile.settings.stress import Stress
from tactile.settings.touch import Touch
from tactile.settings.velostat_recorded import VelostatRecorded


class Experiments(Block):
    """What is run, and a block for each experiment."""

    experiments: Distinct[str] = Field(description="Experiments that are run")
    device: Literal["auto", "cpu", "cuda"] = Field(description="Where networks train; auto: on a GPU if there is one")
    touch: Touch = Field(description="Presses on an array of pressure-sensitive elements (LoMP paper)")
    velostat_recorded: VelostatRecorded = Field(description="Recordings of a Velostat taxel under a load cell")
    array_recorded: ArrayRecorded = Field(description="Recordings of a capacitive array under several fingers")
    strain: Strain = Field(description="A finger with soft strain sensors on a robot arm (latent-space paper)")
    strain_recorded: StrainRecorded = Field(description="Recordings of soft strain sensors")
    glove: Glove = Field(description="Objects that a hand in a tactile glove grasps (SP-ResNet paper)")
    glove_recorded: GloveRecorded = Field(description="Recorded grasps of a robot hand with tactile sensors")


if TYPE_CHECKING:  # which ones is known when it runs
    Experiment = str
else:
    Experiment = Literal[tuple(name for name in Experiments.model_fields if name not in ("experiments", "device"))]


class Params(Experiments):
    """All settings."""

    experiments: Distinct[Experiment] = Field(description="Experiments that are run")
    stress: Stress = Field(description="What goes wrong after training, by experiment")
    physics: Physics = Field(description="Every effect of a scene left out in turn, by experiment")


def schema() -> str:
    """Return the JSON schema of each file of settings, the content of params.schema.json: any of the blocks."""
    of_all = Params.model_json_schema()
    return json.dumps({key: value for key, value in of_all.items() if key != "required"}, indent=1)
