"""Check what a file of a fitted estimator holds before it is opened, and the estimator before it predicts.

skops runs no code of a file, but believes its numbers, and so does scikit-learn: it follows the nodes of a tree by
their indices, in memory, without a look at them. A crafted file could so end the process, or keep it busy for ever.
"""

import io
import json
import zipfile
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

SCHEMA = "schema.json"  # of the archive: the types, and which file has each array
FORMER = b'"__module__": "pipeline.'  # what a class of this package was named below, up to version 0.2.0
TODAY = b'"__module__": "tactile.'
SMALL = 16 << 20  # bytes unpacked that any file may come to
RATIO = 200  # times its own size that a file may come to unpacked; models come to 10 times
ESTIMATORS = (
    "sklearn.decomposition._pca.PCA",
    "sklearn.dummy.DummyRegressor",
    "sklearn.ensemble._forest.ExtraTreesClassifier",
    "sklearn.ensemble._forest.ExtraTreesRegressor",
    "sklearn.linear_model._base.LinearRegression",
    "sklearn.linear_model._ridge.Ridge",
    "sklearn.pipeline.Pipeline",
    "sklearn.preprocessing._data.StandardScaler",
    "sklearn.preprocessing._polynomial.PolynomialFeatures",
    "sklearn.tree._classes.DecisionTreeRegressor",
    "sklearn.tree._classes.ExtraTreeClassifier",
    "sklearn.tree._classes.ExtraTreeRegressor",
)  # that the models of this project are made of; skops would take any of scikit-learn's, and numpy's functions
PLAIN = {  # how skops makes a value -> of which types
    "DictNode": ("builtins.dict",),
    "JsonNode": ("builtins.str",),
    "ListNode": ("builtins.list",),
    "NdArrayNode": ("numpy.ndarray", "numpy.bool", "numpy.float32", "numpy.float64", "numpy.int32", "numpy.int64"),
    "TupleNode": ("builtins.tuple",),
    "TypeNode": ("builtins.bool", "builtins.float", "builtins.int", "builtins.str"),
}


def check_file(path: Path, trusted: Collection[str]) -> None:
    """Raise ValueError where an archive of skops unpacks to too much, or holds types that no model is made of.

    trusted: types of one model, besides ESTIMATORS. Nothing of the archive but its list of types is unpacked. Raises
    what zipfile and json raise for what is no such archive.
    """
    nodes, sizes = _nodes(path)
    most = max(SMALL, RATIO * path.stat().st_size)
    total = sum(sizes.values()) + sum(sizes.get(str(node["file"]), 0) for node in nodes if "file" in node)
    if total > most:
        raise ValueError(f"unpacks to {total} bytes, more than {most}")
    for node in nodes:
        loader, kind = str(node["__loader__"]), _type_of(node)
        known = PLAIN.get(loader, ())
        if loader == "TreeNode" or loader == "ObjectNode":
            known = {*ESTIMATORS, *trusted}
        if kind not in known:
            raise ValueError(f"holds a {kind}, which no such model is made of")


def content(path: Path) -> bytes:
    """Return an archive that `check_file` has passed; classes with the names of 0.2.0 have those of today."""
    with zipfile.ZipFile(path) as archive:
        if FORMER not in archive.read(SCHEMA):
            return path.read_bytes()
        renamed = io.BytesIO()
        with zipfile.ZipFile(renamed, "w") as target:
            for name in archive.namelist():
                target.writestr(
                    name, archive.read(name).replace(FORMER, TODAY) if name == SCHEMA else archive.read(name)
                )
    return renamed.getvalue()


def types(path: Path) -> dict[str, int]:
    """Return how many objects of each type an archive of skops asks for, none of which is made; errors as zipfile's."""
    nodes, _ = _nodes(path)
    return dict(sorted(Counter(map(_type_of, nodes)).items()))


def _nodes(path: Path) -> tuple[list[dict], dict[str, int]]:
    """Return what describes the objects of an archive, and the bytes that its files come to."""
    with zipfile.ZipFile(path) as archive:
        sizes = {member.filename: member.file_size for member in archive.infolist()}
        if sizes.get(SCHEMA, 0) > max(SMALL, RATIO * path.stat().st_size):
            raise ValueError(f"its list of types has {sizes[SCHEMA]} bytes")
        todo, found = [json.loads(archive.read(SCHEMA).replace(FORMER, TODAY))], []
    while todo:
        node = todo.pop()
        if isinstance(node, dict):
            found += [node] if "__loader__" in node else []
            todo += node.values()
        elif isinstance(node, list):
            todo += node
    return found, sizes


def _type_of(node: dict) -> str:
    return f"{node.get('__module__')}.{node.get('__class__')}"


def check_estimator(estimator: Any) -> None:
    """Raise ValueError for a tree, wherever it sits in an estimator, that must not predict.

    That is one whose nodes lead out of it or back, which looks at a column that it is not given, or which holds what
    is no number. Also for what asks for many threads, or has other outputs than it says.
    """
    from sklearn.tree._tree import Tree

    for one in _parts(estimator):
        if isinstance(one, Tree):
            _check_tree(one)
            continue
        own = getattr(one, "__dict__", {})
        if own.get("n_jobs") not in (None, 1):
            raise ValueError(f"asks for n_jobs {own['n_jobs']}")
        if "tree_" in own:
            _check_shapes(one, one)
        for each in own.get("estimators_", ()):
            _check_shapes(each, one)
        if "constant_" in own and np.shape(own["constant_"]) != (1, own["n_outputs_"]):
            raise ValueError(f"a constant of the shape {np.shape(own['constant_'])} has {own['n_outputs_']} outputs")


def _parts(estimator: Any) -> Iterator[Any]:
    """Yield every object that an estimator is made of, each once."""
    todo, seen = [estimator], set()
    while todo:
        one = todo.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        yield one
        if isinstance(one, dict):
            todo += one.values()
        elif isinstance(one, list | tuple):
            todo += one
        elif isinstance(one, np.ndarray):
            todo += one.ravel().tolist() if one.dtype == object else []
        elif hasattr(one, "__dict__"):
            todo += vars(one).values()


def _check_shapes(holder: Any, given: Any) -> None:
    """Raise ValueError where the tree of `holder` has other columns or outputs than the estimator `given` hands on."""
    from sklearn.tree._tree import Tree

    tree, own = vars(holder).get("tree_"), vars(given)
    if not isinstance(tree, Tree):
        raise ValueError("has no tree where one should be")
    said = [own.get("n_features_in_"), own.get("n_outputs_"), *np.atleast_1d(own.get("n_classes_", tree.n_classes))]
    if said != [tree.n_features, tree.n_outputs, *tree.n_classes]:
        raise ValueError(
            f"a tree of {tree.n_features} columns and {tree.n_outputs} outputs is in an estimator of others"
        )


def _check_tree(tree: Any) -> None:
    """Raise ValueError where a tree's nodes are not those of a tree; an inner node comes before its children."""
    n = tree.node_count
    if n < 1 or n != tree.capacity:  # else the arrays below would reach beyond the tree
        raise ValueError(f"a tree says to have {n} nodes, and has {tree.capacity}")
    left, right, feature = tree.children_left, tree.children_right, tree.feature
    inner = np.flatnonzero((left != -1) | (right != -1))
    children = np.stack([left[inner], right[inner]])
    if not ((children > inner) & (children < n)).all() or len(np.unique(children)) < children.size:
        raise ValueError("the nodes of a tree lead out of it, or back")
    if not ((feature[inner] >= 0) & (feature[inner] < tree.n_features)).all():
        raise ValueError(f"a tree of {tree.n_features} columns looks at others")
    if tree.n_outputs < 1 or (tree.n_classes < 1).any() or not 0 <= tree.max_depth < n:
        raise ValueError("a tree has no outputs, or no depth that fits")
    if tree.value.shape != (n, tree.n_outputs, tree.n_classes.max()):
        raise ValueError(f"the values of a tree have the shape {tree.value.shape}")
    if not (np.isfinite(tree.value).all() and np.isfinite(tree.threshold[inner]).all()):
        raise ValueError("a tree holds what is no number")
