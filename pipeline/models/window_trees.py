"""Build the yardstick of sensors of one's own: extra trees on the statistics of windows, or on an image."""

import warnings

from pydantic import Field
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.exceptions import DataConversionWarning
from sklearn.pipeline import make_pipeline

from pipeline.learning.estimators import SklearnRegressor
from pipeline.learning.regressors import Spec
from pipeline.learning.window_statistics import Statistics
from pipeline.settings.shared import Block


class Settings(Block):
    """Settings of a model `window_trees` in params.yaml."""

    trees: int = Field(ge=1, le=100_000, description="Number of trees")
    min_samples_leaf: int = Field(ge=1, le=100_000, description="Fewest windows or images of a leaf")


def build(spec: Spec, *, trees: int, min_samples_leaf: int) -> SklearnRegressor:
    """Return the unfitted model.

    Fitted numbers: one threshold per inner node, the outputs of every leaf. No multiply-accumulates: trees compare.
    Of objects, a leaf holds their shares.
    """
    return WindowTrees(
        lambda seed: make_pipeline(
            Statistics(spec.frames),
            ExtraTreesRegressor(trees, min_samples_leaf=min_samples_leaf, random_state=seed, n_jobs=1),
        ),
        spec,
        count=lambda fitted: sum(
            tree.tree_.node_count + (spec.outputs - 1) * tree.tree_.n_leaves for tree in fitted[-1].estimators_
        ),
        macs=None,
        trusted=("pipeline.learning.window_statistics.Statistics", "sklearn.tree._tree.Tree"),
    )


class WindowTrees(SklearnRegressor):
    """Extra trees, without scikit-learn's warning that a column of one output is given."""

    def fit(self, *parts, **options) -> list[dict]:
        """Fit once; arguments and result as for SklearnRegressor.fit."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DataConversionWarning)
            return super().fit(*parts, **options)
