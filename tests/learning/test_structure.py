"""An estimator is checked before anything of its file is made, and trees before they predict: none ends the process."""

import io
import json
import zipfile

import numpy as np
import pytest
from sklearn.dummy import DummyRegressor
from sklearn.ensemble import ExtraTreesClassifier, ExtraTreesRegressor, RandomForestRegressor
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.tree import DecisionTreeRegressor
from sklearn.tree._tree import Tree

from tactile import models
from tactile.base.errors import InputError
from tactile.learning import estimators, structure
from tactile.learning.per_element import ElementTrees
from tactile.learning.spec import Spec

TRUSTED = ("sklearn.tree._tree.Tree", "tactile.learning.per_element.ElementTrees")
RNG = np.random.default_rng(0)
X, Y = RNG.normal(size=(200, 4)), RNG.normal(size=(200, 6))
HUGE = 10**9


def alone():
    fitted = DecisionTreeRegressor(max_depth=3, random_state=0).fit(X, Y)
    return fitted, fitted


def in_a_forest():
    fitted = ExtraTreesRegressor(3, max_depth=3, random_state=0).fit(X, Y)
    return fitted, fitted.estimators_[1]


def in_a_forest_of_classes():
    fitted = ExtraTreesClassifier(3, max_depth=3, random_state=0).fit(X, Y[:, :3].argmax(1))
    return fitted, fitted.estimators_[2]


def in_a_pipeline():
    fitted = make_pipeline(StandardScaler(), ExtraTreesRegressor(2, max_depth=3, random_state=0)).fit(X, Y)
    return fitted, fitted[-1].estimators_[0]


def per_element():
    fitted = ElementTrees((0, 0, 0, 1, 1, 1), 2, 5, 1.0, 0).fit(X, Y)
    return fitted, fitted.trees_[1]


PLACES = [alone, in_a_forest, in_a_forest_of_classes, in_a_pipeline, per_element]


def node(name: str, value: float, number: int = 0):
    """Return a change of one number of a node; number: of the node, from the root."""

    def change(state: dict) -> None:
        state["nodes"][name][number] = value

    return change


def both(state: dict, left: int, right: int, number: int = 0) -> None:
    state["nodes"]["left_child"][number], state["nodes"]["right_child"][number] = left, right


CHANGES = {
    "children far away": lambda state: both(state, HUGE, HUGE),
    "children just behind the end": lambda state: both(state, len(state["nodes"]), len(state["nodes"]) + 1),
    "its own child": lambda state: both(state, 0, 0),
    "a child that is its parent": lambda state: both(state, 0, 2, 1),
    "one child twice": lambda state: both(state, 2, 2),
    "one child": node("left_child", -1),
    "another child": node("right_child", -1),
    "a child below nothing": node("left_child", -2),
    "a column far away": node("feature", HUGE),
    "a column just behind the last": node("feature", 4),
    "a column before the first": node("feature", -1),
    "a column of a leaf": node("feature", -2),
    "no threshold": node("threshold", np.nan),
    "no number": lambda state: state["values"].__setitem__((-1, 0, 0), np.inf),
    "more nodes than it says": lambda state: state.update(node_count=1),
    "no node": lambda state: state.update(node_count=0, nodes=state["nodes"][:0], values=state["values"][:0]),
    "nodes below none": lambda state: state.update(node_count=-1),
    "a depth below none": lambda state: state.update(max_depth=-1),
    "values too few": lambda state: state.update(values=state["values"][:-1]),
    "values of too few outputs": lambda state: state.update(values=state["values"][:, :0]),
    "values of too few classes": lambda state: state.update(values=state["values"][:, :, :0]),
}


def crafted(tree: Tree, change, **of_tree) -> Tree:
    """Return a tree as a file can have it: what is written is not what scikit-learn grew."""
    state = tree.__getstate__()
    state = state | {name: np.array(state[name]) for name in ("nodes", "values")}
    change(state)
    return Described(tree, state, of_tree)


class Described:
    """A tree that cannot be, for skops to write: its constructor's arguments and its state."""

    def __init__(self, tree: Tree, state: dict, of_tree: dict):
        known = {"n_features": tree.n_features, "n_classes": tree.n_classes, "n_outputs": tree.n_outputs}
        self.made, self.state = tuple((known | of_tree).values()), state


@pytest.fixture
def written(tmp_path, monkeypatch):
    """`written(estimator)` writes an estimator, Described trees as trees, and returns the folder."""
    from skops.io import _sklearn, _utils

    def state_of(one, context):
        kept = {"args": _utils.get_state(one.made, context)}
        made = {"__class__": "Tree", "__module__": "sklearn.tree._tree", "__loader__": "TreeNode", "__reduce__": kept}
        return made | {"content": _utils.get_state(one.state, context)}

    _utils._get_state.register(Described, state_of)
    assert _sklearn.Tree is Tree

    def write(estimator):
        estimators.write(tmp_path, estimator)
        return tmp_path

    return write


@pytest.mark.parametrize("place", PLACES)
def test_a_tree_as_it_was_grown_predicts_the_same(written, place):
    fitted, _ = place()
    again = estimators.read(written(fitted), TRUSTED)
    np.testing.assert_array_equal(again.predict(X), fitted.predict(X))


@pytest.mark.parametrize("words", CHANGES)
@pytest.mark.parametrize("place", PLACES)
def test_a_crafted_tree_is_refused_wherever_it_sits(written, place, words):
    fitted, holder = place()
    change = CHANGES[words]
    if words == "a column just behind the last":
        change = node("feature", holder.tree_.n_features)
    holder.tree_ = crafted(holder.tree_, change)
    with pytest.raises(InputError, match=r"estimator\.skops: not a model of this kind \(.*train the model again$"):
        estimators.read(written(fitted), TRUSTED)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("of_tree", [{"n_features": 5}, {"n_features": 3}, {"n_features": -1}, {"n_features": HUGE}])
def test_a_tree_of_other_columns_than_it_is_given_is_refused(written, place, of_tree):
    fitted, holder = place()
    holder.tree_ = crafted(holder.tree_, lambda state: None, **of_tree)
    if place is per_element:  # which is told at the prediction
        holder.n_features_in_ = of_tree["n_features"]
    with pytest.raises((InputError, ValueError), match="columns|negative|argument"):
        estimators.read(written(fitted), TRUSTED).predict(X)


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize(
    "of_tree",
    [
        {"n_classes": np.array([HUGE] * 6)},
        {"n_classes": np.array([0] * 6)},
        {"n_classes": np.array([], int)},
        {"n_outputs": 0},
        {"n_outputs": 1000},
        {"n_outputs": -1},
    ],
)
def test_a_tree_of_other_outputs_than_it_has_is_refused(written, place, of_tree):
    fitted, holder = place()
    holder.tree_ = crafted(holder.tree_, lambda state: None, **of_tree)
    with pytest.raises(InputError, match="not a model of this kind|more memory"):
        estimators.read(written(fitted), TRUSTED)


def test_what_an_estimator_says_of_itself_has_to_be_so(written):
    for change in (
        {"n_outputs_": HUGE},
        {"n_features_in_": 5},
        {"n_jobs": 10_000},
        {"estimators_": [None]},
    ):
        fitted, _ = in_a_forest()
        vars(fitted).update(change)
        with pytest.raises(InputError, match="not a model of this kind"):
            estimators.read(written(fitted), TRUSTED)
    fitted, _ = in_a_forest()
    del fitted.n_features_in_  # scikit-learn then looks at no number of columns
    with pytest.raises(InputError, match="a tree of 4 columns"):
        estimators.read(written(fitted), TRUSTED)
    constant = DummyRegressor().fit(X, Y[:, :1])
    constant.n_outputs_ = HUGE
    with pytest.raises(InputError, match="has 1000000000 outputs"):
        estimators.read(written(constant), TRUSTED)


@pytest.mark.parametrize("estimator", [KNeighborsRegressor(), RandomForestRegressor(2)])
def test_an_estimator_that_no_model_is_made_of_is_refused(written, estimator):
    """Others than trees follow indices in memory, too; skops would take them all."""
    with pytest.raises(InputError, match=f"{type(estimator).__name__}, which no such model is made of"):
        estimators.read(written(estimator.fit(X, Y)), TRUSTED)


@pytest.mark.parametrize("name", ["FunctionNode", "PartialNode", "OperatorFuncNode", "MethodNode", "TypeNode"])
def test_what_is_no_value_is_refused_before_it_is_made(written, name):
    folder = written(alone()[0])
    path = folder / estimators.ESTIMATOR_FILE
    with zipfile.ZipFile(path) as archive:
        held = {member: archive.read(member) for member in archive.namelist()}
    schema = json.loads(held["schema.json"])
    schema["content"]["content"]["more"] = {"__loader__": name, "__module__": "os", "__class__": "system"}
    with zipfile.ZipFile(path, "w") as archive:
        for member, data in (held | {"schema.json": json.dumps(schema).encode()}).items():
            archive.writestr(member, data)
    with pytest.raises(InputError, match=r"holds a os\.system, which no such model is made of"):
        estimators.read(folder, TRUSTED)


@pytest.mark.parametrize("times", [1, 5000])
def test_a_file_that_unpacks_to_much_more_than_itself_is_refused_unread(written, monkeypatch, times):
    """As zeros do, and an array that the list of types asks for again and again."""
    folder = written(DummyRegressor().fit(X, Y))
    path = folder / estimators.ESTIMATOR_FILE
    with zipfile.ZipFile(path) as archive:
        held = {member: archive.read(member) for member in archive.namelist()}
    zeros = io.BytesIO()
    np.save(zeros, np.zeros((1, (8 << 20) // times)))
    schema = json.loads(held["schema.json"])
    text = json.dumps(schema["content"]["content"]["constant_"])
    schema["more"] = [json.loads(text) for _ in range(times - 1)]
    held |= {"0.npy": zeros.getvalue(), "schema.json": json.dumps(schema).encode()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, data in held.items():
            archive.writestr(member, data)
    assert path.stat().st_size < 1 << 20
    monkeypatch.setattr(np, "load", None)
    with pytest.raises(InputError, match=r"not a model of this kind \(unpacks to 1?\d{8} bytes, more than 16777216\)"):
        estimators.read(folder, TRUSTED)


def test_the_types_of_a_file_are_told_without_making_any(written, monkeypatch):
    folder = written(in_a_forest()[0])
    monkeypatch.setattr("skops.io.load", None)
    found = structure.types(folder / estimators.ESTIMATOR_FILE)
    assert found["sklearn.tree._tree.Tree"] == 3 and found["sklearn.ensemble._forest.ExtraTreesRegressor"] == 1


@pytest.mark.parametrize("key", ["linear_array", "poly", "tree"])
def test_an_estimator_of_other_settings_or_shapes_is_refused(tmp_path, key):
    spec, part = Spec(2, 2, 2, 4, 4), (RNG.normal(size=(40, 2, 4)).astype(np.float32), RNG.normal(size=(40, 16)))
    settings = {"poly": {"degree": 2, "ridge": 1.0}, "tree": {"each": "element", "min_samples_leaf": 1}}.get(key, {})
    settings |= {"max_features": 1.0} if key == "tree" else {}
    model = models.build(key, spec, settings, "test")
    model.fit(part, part, seed=3)
    model.save(tmp_path)
    again = models.build(key, spec, settings, "test")
    again.load(tmp_path)
    np.testing.assert_array_equal(again.predict(part[0]), model.predict(part[0]))
    others = [models.build(key, other, settings, "test") for other in (Spec(2, 2, 3, 4, 6), Spec(2, 2, 2, 4, 2))]
    if key == "poly":
        others.append(models.build(key, spec, settings | {"degree": 3}, "test"))
    others.append(models.build("constant", spec, {}, "test"))
    for other in others:
        with pytest.raises(InputError, match="not a model (with these settings|of this kind)"):
            other.load(tmp_path)


def test_an_archive_of_the_former_names_is_read(tmp_path):
    """Packages of version 0.2.0 name the classes of this package below `pipeline`."""
    fitted, _ = per_element()
    estimators.write(tmp_path, fitted)
    path = tmp_path / estimators.ESTIMATOR_FILE
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    former = members["schema.json"].replace(b"tactile.learning", b"pipeline.learning")
    assert former != members["schema.json"]
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in (members | {"schema.json": former}).items():
            archive.writestr(name, content)
    assert structure.types(path)["tactile.learning.per_element.ElementTrees"] == 1
    assert np.array_equal(estimators.read(tmp_path, TRUSTED).predict(X), fitted.predict(X))
