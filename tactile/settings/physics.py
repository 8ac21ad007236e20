"""Settings of the physics study: every effect of a scene is left out in turn, in small scenes with short trainings."""

from typing import Annotated, Any, Literal

from pydantic import Field

from tactile.settings.models import Models
from tactile.settings.shared import Block, Distinct


class Ablation(Block):
    """What is trained on the scenes of an experiment."""

    scene: Annotated[dict[Any, Any], Field(min_length=1)] = Field(
        description="What differs from the experiment's own settings, as a part of its block"
    )
    models: Models = Field(description="The models to train, by their keys")


class TouchAblation(Ablation):
    """What is trained on the scenes of touch."""

    protocols: Distinct[Literal["press"]] = Field(description="Ways of dividing the data")


class StrainAblation(Ablation):
    """What is trained on the scenes of strain."""

    protocols: Distinct[Literal["task_1", "task_2"]] = Field(description="Tasks that are run")


class GloveAblation(Ablation):
    """What is trained on the scenes of glove."""

    protocols: Distinct[Literal["session_pressure", "session_strain", "session_combined"]] = Field(
        description="Ways of dividing the data"
    )


class Physics(Block):
    touch: TouchAblation = Field(description="Scenes of touch")
    strain: StrainAblation = Field(description="Scenes of strain")
    glove: GloveAblation = Field(description="Scenes of glove")
