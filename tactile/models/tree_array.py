"""Build decision tree regression from the whole array: one tree, a whole map in every leaf."""

from pydantic import Field
from sklearn.tree import DecisionTreeRegressor

from tactile.learning.estimators import SklearnRegressor, tree_numbers
from tactile.learning.spec import Spec
from tactile.settings.shared import Block, Share


class Settings(Block):
    """Settings of a model `tree_array` in params.yaml."""

    min_samples_leaf: int = Field(ge=1, le=100_000, description="Fewest windows of a leaf")
    max_features: Share = Field(description="Share of the inputs, drawn anew, that a split tries")


def build(spec: Spec, *, min_samples_leaf: int, max_features: float) -> SklearnRegressor:
    """Return a tree that tries the share `max_features` of the inputs (drawn by the seed) at every split.

    A tree of one leaf has as many fitted numbers as the constant model. No multiply-accumulates: a tree only
    compares. No scaling: it would change nothing.

    Not the paper's, which calibrates each element by itself (`tree`): a stronger baseline.
    """
    return SklearnRegressor(
        lambda seed: DecisionTreeRegressor(
            min_samples_leaf=min_samples_leaf, max_features=float(max_features), random_state=seed
        ),
        spec,
        count=lambda fitted: tree_numbers([fitted]),
        macs=None,
        trusted=("sklearn.tree._tree.Tree",),
    )
