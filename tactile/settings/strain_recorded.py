"""Settings of strain_recorded: recordings of soft strain sensors by one of the latent-space paper's authors."""

from pydantic import Field

from tactile.settings.models import Models
from tactile.settings.shared import Block, Budget, Count, Ingest, Latency, LookBack, Protocol, Split, Text


class ThinnedIngest(Ingest):
    every: Count = Field(description="Every so many-th sample is kept")


class StrainRecorded(Block):
    """Recordings of soft strain sensors by one of the latent-space paper's authors."""

    ingest: ThinnedIngest = Field(description="What is asked of the recordings")
    window: LookBack = Field(description="How far models of windows look back")
    split: Split = Field(description="How a day is divided")
    model_zero: Text = Field(description="Model that is trained on all three axes, for transfer")
    protocols: dict[Text, Protocol] = Field(
        description="<split>_<axes>, see tactile/experiments/strain_recorded.py, and their seeds"
    )
    budget: Budget
    models: Models = Field(description="The models to train, by their keys")
    latency: Latency = Field(description="How the time of a prediction is measured")
