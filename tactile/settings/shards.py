"""Settings of the evidence: what evidence/shards.yaml may say."""

from typing import Annotated, Any, Literal

from pydantic import Field

from tactile.settings.shared import Block, Count, Distinct, Listed, Text


class Variant(Block):
    """Models of a set's experiment with something changed."""

    models: Distinct[Text] = Field(description="Models that are trained and scored")
    protocols: Listed[Text] = Field(
        default_factory=list, description="How the data are divided; without this key all of the set"
    )
    like: str = Field(
        default="",
        description="Variant that it is compared with, and whose keys, and entries of `set`, it has where it names "
        "no own",
    )
    set: dict[str, Any] = Field(default_factory=dict, description="Dotted settings that differ from those of the set")


class ShardSet(Block):
    """Shards of one experiment on one amount of data: one for each seed and budget."""

    experiment: Text = Field(description="Experiment that is run")
    data: Text = Field(description="How much of what the paper has it has, as reports say it")
    protocols: Distinct[Text] = Field(description="How its data are divided; a shard runs all of these")
    seeds: Annotated[int, Field(ge=1, le=1000)] = Field(description="Seeds from 0 on")
    models: Listed[Text] = Field(
        default_factory=list,
        description="Models that are run; without this key all of the settings; with `study` or `variants` those that "
        "it looks into or starts from",
    )
    by_unit: Listed[Text] = Field(
        default_factory=list,
        description="Protocols of recordings that are scored press by press, too, under stress in blocks of presses",
    )
    variant: str = Field(default="", description="Variant of the rows, where another set has the same protocols")
    minutes: Count = Field(description="Of a `full` shard on two cores, about; the next shards are chosen by it")
    budgets: Distinct[Literal["half", "full"]] = Field(
        default=["half", "full"], description="Shares of the epochs; `full` alone where no model is trained in epochs"
    )
    stress: bool = Field(
        default=False,
        description="Whether shards of the budget `full` are scored on perturbed readings and scenes, too",
    )
    study: str = Field(default="", description="Module of pipeline/studies that is run, in place of the protocols")
    variants: dict[Text, Variant] = Field(
        default_factory=dict, description="Models with something changed that are run, in place of the models"
    )
    own_data: bool = Field(default=False, description="Whether the study makes its own data, not the set's")
    like: str = Field(
        default="",
        description="Set whose data it shares, and whose keys, and entries of `set`, it has where it names no own; "
        "it has neither `stress` nor, with a study or variants, models of it",
    )
    set: dict[str, Any] = Field(default_factory=dict, description="Dotted settings that differ from those in params/")
