"""Build decision tree regression (LoMP paper, Table I): one tree, a whole map in every leaf."""

from sklearn.tree import DecisionTreeRegressor

from pipeline.base.blocks import Count, Share
from pipeline.learning.estimators import SklearnRegressor
from pipeline.learning.regressors import Spec


def build(spec: Spec, *, min_samples_leaf: Count, max_features: Share) -> SklearnRegressor:
    """Return a tree that tries the share `max_features` of the inputs (drawn by the seed) at every split.

    Fitted numbers: one threshold per inner node and one map per leaf, so a tree of one leaf counts as much as
    the constant model. No multiply-accumulates: a tree only compares. No scaling: it would change nothing.

    Differs from paper: the size of the tree is not given there; here leaves hold at least `min_samples_leaf` windows.
    """
    return SklearnRegressor(
        lambda seed: DecisionTreeRegressor(
            min_samples_leaf=min_samples_leaf, max_features=float(max_features), random_state=seed
        ),
        spec,
        count=lambda fitted: fitted.tree_.node_count - fitted.tree_.n_leaves + fitted.tree_.n_leaves * spec.outputs,
        macs=None,
        trusted=("sklearn.tree._tree.Tree",),  # node indices are not checked on loading: load your own files only
    )
