"""Fit a scikit-learn model to windows, and store it as a skops file whose bytes repeat."""

import io
import json
import warnings
import zipfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from tactile.base import foreign
from tactile.learning import structure
from tactile.learning.regressors import Windows, check_windows
from tactile.learning.spec import Spec
from tactile.learning.training import FitSummary, Progress, solved
from tactile.learning.weights import existing

if TYPE_CHECKING:
    from sklearn.base import BaseEstimator

ESTIMATOR_FILE = "estimator.skops"
AGAIN = "train the model again"
SEEDS = ("random_state", "seed")  # parameters that a fit is free in


class SklearnRegressor:
    """A scikit-learn estimator on flattened windows, fitted in closed form (or grown, for a tree).

    `make_estimator(seed)` returns an unfitted estimator; `count(estimator)` returns the number of its fitted numbers;
    `macs` is the number of multiply-accumulates for one window, or None where there are none to count.
    With `last_frame` the estimator sees only the last frame of a window.
    `trusted`: types by module path that a saved estimator may hold besides those that skops knows.
    """

    streams = False

    def __init__(
        self,
        make_estimator: Callable[[int], "BaseEstimator"],
        spec: Spec,
        *,
        count: Callable[["BaseEstimator"], int],
        macs: int | None,
        last_frame: bool = False,
        trusted: tuple[str, ...] = (),
    ):
        self.make_estimator = make_estimator
        self.spec = spec
        self.count = count
        self.cost = macs
        self.last_frame = last_frame
        self.trusted = trusted
        self.summary: FitSummary | None = None
        self.estimator: BaseEstimator | None = None

    def fit(
        self,
        train: Windows,
        validation: Windows,
        *,
        seed: int,
        device: str = "auto",
        progress: Progress = None,
    ) -> list[dict]:
        """Fit once; arguments and result as for TorchRegressor.fit, with a history of one row.

        Runs on one CPU thread whatever `device` says (sums in thread order would not repeat bit for bit). The
        row's learning_rate is 0: there is none. Raises InputError for arrays of the wrong shape.
        """
        from sklearn.exceptions import DataConversionWarning

        check_windows(self.spec, train, "training")
        check_windows(self.spec, validation, "validation")
        estimator = self.make_estimator(seed)
        with threadpool_limits(1), warnings.catch_warnings():
            warnings.simplefilter("ignore", DataConversionWarning)  # a column of one output is what we mean
            estimator.fit(self._features(train[0]).astype(np.float64), train[1].astype(np.float64))
            self.estimator = estimator
            losses = [float(np.mean(np.square(self.predict(x) - y, dtype=np.float64))) for x, y in (train, validation)]
        if progress:
            progress(1, 1, *losses)
        history, self.summary = solved(*losses)
        return history

    def predict(self, x: np.ndarray) -> np.ndarray:
        """Return pressure maps (n, outputs) in kPa, float32, for windows x (n, frames, elements) in ADC counts."""
        maps = self._fitted().predict(self._features(x))
        return maps.reshape(len(x), self.spec.outputs).astype(np.float32, copy=False)

    def save(self, folder: Path) -> None:
        """Write the fitted estimator, scaling included, to `folder` (which exists), as skops."""
        write(folder, self._fitted())

    def load(self, folder: Path) -> None:
        """Read the fitted estimator from `folder`; only types that skops knows or `trusted` names.

        Raises InputError for a file that is absent, damaged, crafted, or of another model or other settings.
        """
        self.estimator = read(folder, self.trusted)
        with foreign.reading(Path(folder) / ESTIMATOR_FILE, "a model with these settings", AGAIN):
            _check_same(self.estimator, self.make_estimator(0))
            check_prediction(self.predict, np.zeros((1, self.spec.frames, self.spec.elements)), self.spec.outputs)

    def parameters(self) -> int:
        """Return the number of fitted numbers (scaling constants not counted, as for networks)."""
        return int(self.count(self._fitted()))

    def macs(self) -> int | None:
        """Return the multiply-accumulates for one window; None for a model that only compares."""
        return self.cost

    def _features(self, x: np.ndarray) -> np.ndarray:
        return x[:, -1] if self.last_frame else x.reshape(len(x), -1)

    def _fitted(self) -> "BaseEstimator":
        if self.estimator is None:
            raise RuntimeError("fit or load the model first")
        return self.estimator


def tree_numbers(trees: Iterable) -> int:
    """Return the fitted numbers of scikit-learn's trees: a threshold per inner node, the outputs of every leaf."""
    return sum(tree.tree_.node_count + (tree.n_outputs_ - 1) * tree.tree_.n_leaves for tree in trees)


def write(folder: Path, estimator: "BaseEstimator") -> None:
    """Write a fitted estimator to `folder` (which exists), as skops."""
    (Path(folder) / ESTIMATOR_FILE).write_bytes(_stable_skops(estimator))


def read(folder: Path, trusted: Sequence[str]) -> "BaseEstimator":
    """Return the estimator that `write` wrote; trusted: as of `SklearnRegressor`.

    Raises InputError for a file that is absent, damaged or holds other types, or trees that must not predict.
    """
    import skops.io  # 3 s, for which no network has to wait

    path = existing(Path(folder) / ESTIMATOR_FILE)
    with foreign.reading(path, "a model of this kind", AGAIN):
        structure.check_file(path, trusted)
        estimator = skops.io.loads(structure.content(path), trusted=list(trusted))
        structure.check_estimator(estimator)
    return estimator


def check_prediction(predict: Callable[[np.ndarray], np.ndarray], x: np.ndarray, outputs: int) -> None:
    """Raise ValueError where the prediction of x (n, ...) is not (n, outputs): parts that do not fit each other."""
    with np.errstate(all="ignore"):
        shape = np.shape(predict(x))
    if shape != (len(x), outputs):
        raise ValueError(f"predicts {shape}, the model {(len(x), outputs)}")


def _check_same(estimator: "BaseEstimator", fresh: "BaseEstimator") -> None:
    """Raise ValueError where an estimator was not made as `fresh`, which is not fitted, but for its seed."""
    if type(estimator) is not type(fresh):
        raise ValueError(f"is a {type(estimator).__name__}, the model a {type(fresh).__name__}")
    given = estimator.get_params(deep=False)
    for name, value in fresh.get_params(deep=False).items():
        if name == "steps" and [each for each, _ in given[name]] == [each for each, _ in value]:
            for (_, of_file), (_, wanted) in zip(given[name], value, strict=True):
                _check_same(of_file, wanted)
        elif name not in SEEDS and given[name] != value:
            raise ValueError(f"was fitted with another {name}")


def _stable_skops(estimator: "BaseEstimator") -> bytes:
    """Return skops bytes that depend on the estimator only.

    skops numbers objects by memory address, names array files after it, and stamps the archive with the
    clock; here objects are numbered in the order in which they occur, and the date is the archive's zero.
    """
    import skops.io

    archive = zipfile.ZipFile(io.BytesIO(skops.io.dumps(estimator)))
    schema = json.loads(archive.read("schema.json"))
    numbers: dict[int, int] = {}
    files: dict[str, str] = {}

    def renumber(node) -> None:
        if isinstance(node, dict):
            if "__id__" in node:
                node["__id__"] = numbers.setdefault(node["__id__"], len(numbers))
            if isinstance(node.get("file"), str):
                node["file"] = files.setdefault(node["file"], f"{len(files)}.npy")
            node = list(node.values())
        if isinstance(node, list):
            for child in node:
                renumber(child)

    renumber(schema)
    stable = io.BytesIO()
    with zipfile.ZipFile(stable, "w", zipfile.ZIP_DEFLATED) as target:
        for name, content in [(new, archive.read(old)) for old, new in files.items()] + [
            ("schema.json", json.dumps(schema, sort_keys=True).encode())
        ]:
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            target.writestr(info, content, compress_type=zipfile.ZIP_DEFLATED)
    return stable.getvalue()
