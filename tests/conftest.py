"""Fixtures of all tests: the pipeline at miniature scale, and the recordings where a machine has them."""

import functools
import os
import pickle
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.abc import MetaPathFinder
from pathlib import Path

import pytest
from builders import browser
from builders.project import ROOT, SLOW_FIXTURES, Project, run_miniature
from threadpoolctl import threadpool_limits

from tactile.base.params_file import copied
from tactile.base.paths import Workspace
from tactile.logs import sources

WAIT_S = 3600


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Mark as slow what needs a slow fixture."""
    for item in items:
        if SLOW_FIXTURES.intersection(item.fixturenames):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session", autouse=True)
def miniature_under_way(request, tmp_path_factory) -> Callable[[], Project]:
    """Start the miniature before the first test, where a test of this session needs it, and return what waits for it.

    Where pytest runs in several processes (-n 2), the first one makes the miniature for all of them.
    """
    wanted = any("miniature" in item.fixturenames for item in request.session.items)
    worker, folder = os.environ.get("PYTEST_XDIST_WORKER"), tmp_path_factory.getbasetemp()
    made = (folder.parent if worker else folder) / "miniature.pickle"
    failed = made.with_suffix(".failed")

    def make() -> Project:
        try:
            project = run_miniature(tmp_path_factory.mktemp("miniature"))
        except BaseException:
            failed.touch()
            raise
        draft = made.with_suffix(".draft")
        draft.write_bytes(pickle.dumps(project))
        draft.rename(made)
        return project

    def wait() -> Project:
        for _ in range(WAIT_S):
            if made.exists():
                return pickle.loads(made.read_bytes())
            if failed.exists():
                break
            time.sleep(1)
        raise RuntimeError("the process of tests that makes the miniature did not")

    with ThreadPoolExecutor() as pool:
        yield wait if worker not in (None, "gw0") else pool.submit(make).result if wanted else None


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no file of slow tests alone where only fast ones run: the libraries of all of them take seconds."""
    skipped = config.option.markexpr == "not slow" and collection_path.suffix == ".py"
    return True if skipped and "\npytestmark = pytest.mark.slow\n" in collection_path.read_text() else None


class LimitTorch(MetaPathFinder):
    """Finds nothing, but limits the threads of torch once its library is there, where a test is the first to import it.

    A file of tests that needs no torch starts 5 s of a core sooner.
    """

    def find_spec(self, name, path=None, target=None) -> None:
        """Limit them when torch imports `torch.nn`, for which it needs its library."""
        if name == "torch.nn":
            threadpool_limits(1)


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    """Compute as in the stages, where a sum has one order; and threads of two processes would wait for each other."""
    limit = LimitTorch()
    sys.meta_path.insert(0, limit)
    with threadpool_limits(1):
        yield
    sys.meta_path.remove(limit)


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    """Return a workspace with the repository's settings, and nothing else."""
    made = Workspace(tmp_path)
    copied(ROOT / "params.yaml", made.root)
    return made


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made but not drawn: for tests that look at something else."""
    from tactile.drawing import style  # here, because it takes a second

    def save(figure, path):
        path.touch()
        style.plt.close(figure)

    monkeypatch.setattr(style, "save", save)


@pytest.fixture(scope="module")
def tab(tmp_path_factory) -> Iterator[browser.Browser]:
    """Return a tab of a browser; or skip the test."""
    if browser.executable() is None:
        pytest.skip("no Chromium here (Debian: apt-get install chromium; or CHROMIUM=/path/to/it)")
    opened = browser.Browser(tmp_path_factory.mktemp("profile"))
    yield opened
    opened.close()


@pytest.fixture(scope="session")
def miniature(miniature_under_way) -> Project:
    """Return the project in which the whole pipeline ran once, at miniature scale, with `dvc repro`."""
    return miniature_under_way()


@pytest.fixture(scope="session")
def recordings(tmp_path_factory):
    """Return `recordings(source)`: the folder of a source's recordings, laid out as `fetch` does it; or skip the test.

    Recordings are looked for where `fetch` puts them, and in <TACTILE_RECORDINGS>/<source>, there also side by side
    without their folders. A folder that holds some but not all of them as they should be is an error, never a skip.
    """

    def find(name: str) -> Path:
        listed, elsewhere = sources.files(name), os.environ.get("TACTILE_RECORDINGS")
        for folder in [sources.folder(Workspace(ROOT), name), *([Path(elsewhere) / name] if elsewhere else [])]:
            names = {one: path for path in listed for one in sources.members(path)}
            places = {one: (folder / one, *([folder / Path(one).name] if one in listed else [])) for one in names}
            present = {one: next(filter(Path.is_file, two), None) for one, two in places.items()}
            if not any(present.values()):
                continue
            of = {path: {one: present[one] for one in sources.members(path)} for path in listed}
            wrong = [path for path in listed if None in of[path].values() or sources.digest(of[path]) != listed[path]]
            assert not wrong, (
                f"{folder}: {len(wrong)} of {len(listed)} recordings are missing or changed, as {wrong[0]}"
            )
            linked = tmp_path_factory.mktemp(name)
            for path, file in present.items():
                (linked / path).parent.mkdir(parents=True, exist_ok=True)
                (linked / path).symlink_to(file.resolve())
            return linked
        pytest.skip(f"recordings not here: run `tactile fetch {name}` or set TACTILE_RECORDINGS")

    return functools.cache(find)
