"""Build decision trees (LoMP paper, Table I, one per element; SP-ResNet paper, Table 1, one for the image)."""

from typing import Literal

from pydantic import Field

from tactile.learning import per_element
from tactile.learning.estimators import SklearnRegressor
from tactile.learning.spec import Spec
from tactile.models import tree_array
from tactile.settings.shared import Block, Share


class Settings(Block):
    """Settings of a model `tree` in params.yaml."""

    each: Literal["element", "input"] = Field(
        description="What has a tree: `element`, each one from its own readings to its block of the map; `input`, the "
        "whole window or image, as in `tree_array`"
    )
    min_samples_leaf: int = Field(ge=1, le=100_000, description="Fewest windows or images of a leaf")
    max_features: Share = Field(description="Share of the inputs, drawn anew, that a split tries")


def build(spec: Spec, *, each: str, min_samples_leaf: int, max_features: float) -> SklearnRegressor:
    """Return trees that try the share `max_features` of their inputs (drawn by the seed) at every split.

    Differs from paper: neither says how large its tree is; here leaves hold at least `min_samples_leaf` windows or
    images, and those of the tables are grown in full.
    """
    if each == "input":
        return tree_array.build(spec, min_samples_leaf=min_samples_leaf, max_features=max_features)
    return per_element.trees(spec, min_samples_leaf, max_features)
