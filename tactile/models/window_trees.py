"""Build the yardstick of sensors of one's own: extra trees on the statistics of windows, or on an image."""

from pydantic import Field
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.pipeline import make_pipeline

from tactile.learning.estimators import SklearnRegressor, tree_numbers
from tactile.learning.spec import Spec
from tactile.learning.window_statistics import Statistics
from tactile.settings.shared import Block


class Settings(Block):
    """Settings of a model `window_trees` in params.yaml."""

    trees: int = Field(ge=1, le=100_000, description="Number of trees")
    min_samples_leaf: int = Field(ge=1, le=100_000, description="Fewest windows or images of a leaf")


def build(spec: Spec, *, trees: int, min_samples_leaf: int) -> SklearnRegressor:
    """Return the unfitted model.

    No multiply-accumulates: trees compare. Of objects, a leaf holds their shares.
    """
    return SklearnRegressor(
        lambda seed: make_pipeline(
            Statistics(spec.frames),
            ExtraTreesRegressor(trees, min_samples_leaf=min_samples_leaf, random_state=seed, n_jobs=1),
        ),
        spec,
        count=lambda fitted: tree_numbers(fitted[-1].estimators_),
        macs=None,
        trusted=("tactile.learning.window_statistics.Statistics", "sklearn.tree._tree.Tree"),
    )
