"""Kills before every change of files, and two processes on one target: what is there is former or new, and whole."""

import errno
import functools
import platform
import shutil
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from builders import free_targets, kills, live_models, own_logs
from builders.project import ROOT

from pipeline.results import shards
from pipeline.results.shards import Shard
from pipeline.stages import shard
from tactile.base import files, params, processes
from tactile.base.params_file import copied
from tactile.base.paths import Workspace
from tactile.commands import command_line, export, import_logs, own, predict, sheet  # noqa: F401 - else each fork would import them
from tactile.drawing import style
from tactile.inference import packages, predictions, predictor, recordings  # noqa: F401
from tactile.logs import parse, sources
from tactile.settings.shards import ShardSet
from tactile.sheet import quantities

FEW = 4  # kills of a command that takes half a second, else all
SLOW = functools.partial(pytest.param, marks=pytest.mark.slow)
FEW_OR_ALL = [FEW, SLOW(1000)]


@pytest.fixture
def room(tmp_path, monkeypatch) -> Path:
    """Return the root of a workspace in which commands are called."""
    root = tmp_path / "root"
    root.mkdir()
    copied(ROOT / "params.yaml", root)
    monkeypatch.setenv("WORKERS", "1")
    monkeypatch.setenv("TQDM_DISABLE", "1")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.chdir(root)
    return root


def tactile(*words):
    """Return what calls a command of `tactile`."""

    def call() -> None:
        sys.argv = ["tactile", *map(str, words)]
        command_line.main()

    return call


def putting(target: Path, former: Path | None):
    """Return what restores a target: to a copy of `former`, or to nothing."""

    def put() -> None:
        shutil.rmtree(target.parent, ignore_errors=True)
        target.parent.mkdir(parents=True)
        if former is not None:
            shutil.copytree(former, target)

    return put


def former(call, target: Path, tmp_path: Path, mark: str) -> Path:
    """Return a copy of what a call writes, with another content in the file `mark`."""
    assert kills.run(call, target.parent, tmp_path / "notes").code == 0
    copy = tmp_path / "former"
    shutil.copytree(target, copy)
    (copy / mark).write_text((copy / mark).read_text() + "\n")
    return copy


@pytest.fixture(scope="module")
def linear(tmp_path_factory) -> Path:
    return live_models.linear(tmp_path_factory.mktemp("models") / "linear")


@pytest.fixture
def array(room) -> Path:
    """Return a sensor with the log of an array of 2 x 3 elements."""
    sensor = room / "data" / "own" / "pad"
    own_logs.touch(sensor, 2, 3, 50.0, seconds=20.0, recordings=1, conditions=())
    settings = "touch.sensor: {rows: 2, cols: 3, pitch_mm: 10.0, element_mm: 9.0, order: []}\n"
    (sensor / "settings.yaml").write_text(settings + "touch.label.map_rows: 8\ntouch.label.map_cols: 12\n")
    return sensor


@pytest.fixture
def table(tmp_path) -> Path:
    """Return a file of columns that `tactile import` reads."""
    t = np.arange(0, 20, 0.02)
    np.savez(tmp_path / "run.npz", t=t, v=np.round(500 + 300 * np.sin(t[:, None] * np.arange(1, 7))))
    return tmp_path / "run.npz"


@pytest.mark.parametrize("most", FEW_OR_ALL)
@pytest.mark.parametrize("there", [False, True])
def test_predict(most, there, linear, array, tmp_path):
    target = tmp_path / "made" / "out"
    logs = shutil.copytree(array / "single", tmp_path / "logs", ignore=shutil.ignore_patterns("load_cell.log"))
    call = tactile("predict", linear, logs, "--no-pictures", "--out", target)
    before = former(call, target, tmp_path, "summary.json") if there else None
    assert kills.sweep(call, putting(target, before), target, tmp_path / "notes", most) >= FEW


@pytest.mark.parametrize("most", FEW_OR_ALL)
@pytest.mark.parametrize("there", [SLOW("nothing"), SLOW("imported"), "imported, with notes"])
def test_import(most, there, array, table, tmp_path):
    target = array / "single" / "run0"
    call = tactile("import", table, target, "--of", "touch")
    shutil.rmtree(array / "single")
    before = former(call, target, tmp_path, "array.log") if there != "nothing" else None
    if there.endswith("notes"):
        (before / "notes.txt").write_text("kept")
    assert kills.sweep(call, putting(target, before), target, tmp_path / "notes", most) >= FEW
    assert (target / "notes.txt").exists() == there.endswith("notes")


@pytest.mark.parametrize("most", FEW_OR_ALL)
@pytest.mark.parametrize("there", [SLOW("nothing"), SLOW("a sheet"), "a sheet, and more"])
def test_sheet(most, there, array, room, tmp_path, monkeypatch):
    made = [*sheet.sensors(Workspace(room), params.load(room / "params.yaml"), str(array))]
    sheets = [quantities.sheet(sensor) for sensor in made]  # once, as they take a second
    monkeypatch.setattr(sheet, "sensors", lambda *given: sheets)
    monkeypatch.setattr(quantities, "sheet", lambda given: given)
    target = tmp_path / "made" / "sheet"
    call = tactile("sheet", array, "--out", target)
    before = former(call, target, tmp_path, "README.md") if there != "nothing" else None
    if there.endswith("more"):
        (before / "more").mkdir()
        (before / "more" / "photo.jpg").write_bytes(b"kept")
    assert kills.sweep(call, putting(target, before), target, tmp_path / "notes", most) >= FEW
    assert (target / "more" / "photo.jpg").exists() == there.endswith("more")


def test_export(linear, tmp_path):
    target = tmp_path / "made" / "package"
    call = tactile("export", linear, target)
    assert kills.run(call, target.parent, tmp_path / "notes").code == 0
    whole = kills.tree(target)
    for number in range(1, 30):
        putting(target, None)()
        ended = kills.run(call, target.parent, tmp_path / "notes", number)
        assert kills.tree(target) in (None, whole)
        if ended.code == 0:
            break
        if kills.tree(target) is None:  # else it refuses to replace a package
            assert kills.run(call, target.parent, tmp_path / "notes").code == 0
            assert kills.tree(target) == whole and not kills.drafts(target.parent)
    assert number > 5


@pytest.mark.parametrize("there", [False, True])
def test_picture(there, tmp_path):
    """Of `tactile check`, and of `tactile sheet --figure`."""
    target = tmp_path / "made" / "check.png"

    def put() -> None:
        shutil.rmtree(target.parent, ignore_errors=True)
        target.parent.mkdir()
        if there:
            target.write_bytes(b"a former picture")

    def call() -> None:
        figure, ax = style.plt.subplots(figsize=(1, 1))
        ax.plot([0, 1])
        style.save(figure, target)

    assert kills.sweep(call, put, target, tmp_path / "notes") > 1


@pytest.mark.slow
@pytest.mark.parametrize("there", [False, True])
def test_own(there, room, tmp_path):
    """Of a target of one's own: its report and its model, each whole."""
    sensor = room / "data" / "own" / "aim"
    free_targets.angles(sensor, seconds=20.0)
    call, notes = tactile("own", sensor), tmp_path / "notes"
    places = (room / "reports" / "own" / "aim", room / "build" / "own" / "aim" / "trained")
    quiet = kills.run(call, room, notes)
    assert quiet.code == 0, quiet.said
    whole = [kills.tree(place) for place in places]
    before = [{**content, "former": b""} if there else None for content in whole]

    def put() -> None:
        for place, content in zip(places, before, strict=True):
            shutil.rmtree(place, ignore_errors=True)
            for name, each in (content or {}).items():
                (place / name).parent.mkdir(parents=True, exist_ok=True)
                (place / name).write_bytes(each)

    put()
    count = len(kills.run(call, room, notes).changes)
    for number in sorted({1 + k * (count - 1) // 5 for k in range(6)}):
        put()
        kills.run(call, room, notes, number)
        for place, *either in zip(places, before, whole, strict=True):
            assert kills.tree(place) in either, number
        again = kills.run(call, room, notes)
        assert again.code == 0, again.said
        assert [kills.tree(place) for place in places] == whole and not kills.drafts(room)


LINE = {"experiment": "strain", "protocol": "task_1", "seed": 0, "budget": "half", "core_s": 1, "machine": "a"}


@pytest.mark.parametrize("there", [False, True])
def test_lines_of_the_evidence(there, tmp_path):
    target = tmp_path / "evidence" / "index.csv"

    def put() -> None:
        shutil.rmtree(target.parent, ignore_errors=True)
        target.parent.mkdir()
        if there:
            shards.upsert(target, shards.INDEX, "strain-0-half", [{"shard": "strain-0-half", **LINE, "core_s": 2}])
        shards.upsert(target, shards.INDEX, "strain-1-half", [{"shard": "strain-1-half", **LINE}])

    def call() -> None:
        shards.upsert(target, shards.INDEX, "strain-0-half", [{"shard": "strain-0-half", **LINE}])

    assert kills.sweep(call, put, target, tmp_path / "notes") >= 2


@pytest.mark.parametrize("there", [False, True])
def test_files_of_a_shard(there, room, tmp_path, monkeypatch):
    """Each is former or new, the line of the index comes last, and a mixture has not the digest that it tells of."""
    workspace = Workspace(room)
    described = {"experiment": "touch", "data": "a", "protocols": ["press"], "seeds": 1, "minutes": 1}
    own_data = ShardSet(**described, study="physics", own_data=True)
    monkeypatch.setattr(shard.provenance, "git_state", lambda workspace: ("a" * 40, "false"))
    monkeypatch.setattr(shard, "machine", lambda *given: "a machine")
    one, target = Shard("physics_touch", 0, "full"), room / "evidence"
    places = [shards.study_file(workspace, "touch", name, 0) for name in ("physics", "other")]

    def call(words: str = "new") -> None:
        made = Workspace(tmp_path / "made")
        for name in ("physics", "other"):
            files.write_text(made.study_result("touch", name), f"value\n{words} {name}\n")
        shard.keep_study(workspace, made, one, own_data, {"device": "cpu"}, 1.0)

    def put() -> None:
        shutil.rmtree(target, ignore_errors=True)
        if there:
            call("former")

    put()
    before = kills.tree(target) or {}
    count = len(kills.run(call, target, tmp_path / "notes").changes)
    whole = kills.tree(target)
    for number in range(1, count + 1):
        put()
        assert kills.run(call, target, tmp_path / "notes", number).code == -9
        left = {name: each for name, each in (kills.tree(target) or {}).items() if not name.endswith(files.UNFINISHED)}
        assert all(each in (before.get(name), whole[name]) for name, each in left.items())
        lines = shards.table(target / "index.csv", shards.INDEX)
        if len(lines) and shards.digest(places) == lines["sha256"].iloc[0]:
            assert len({path.read_text().split()[1] for path in places}) == 1, "of one run"
        if left.get("index.csv") == whole["index.csv"]:
            assert left == whole
        assert kills.run(call, target, tmp_path / "notes").code == 0
        assert kills.tree(target) == whole and not kills.drafts(target)


def test_a_killed_import_leaves_no_recording(array, table, tmp_path):
    """The draft of a recording lies among recordings, until the next import removes it."""
    draft = array / "single" / f"run0.999999999-{platform.node()}{files.UNFINISHED}"
    shutil.copytree(array / "single" / "day1_0", draft)
    found = [path.name for path in parse.folders(array, "*/*")]
    assert found == ["day1_0"]
    assert [path.parent.name for path in recordings.logs(array, "touch")] == ["day1_0"]


BOTH = ("predict", "import", "sheet", "export", "fetch")


@pytest.mark.parametrize("delay_s", [0.0, 0.1])
@pytest.mark.parametrize("what", BOTH)
def test_two_processes_on_one_target(what, delay_s, linear, array, table, room, tmp_path, monkeypatch):
    """Each ends with a result or with one sentence, and what is there is whole."""
    target, notes = tmp_path / "made" / "out", tmp_path / "notes"
    logs = shutil.copytree(array / "single", tmp_path / "logs", ignore=shutil.ignore_patterns("load_cell.log"))
    source = tmp_path / "source"
    source.mkdir()
    (source / "a.txt").write_text("1" * 1000)
    if what == "fetch":
        monkeypatch.setattr(sources, "files", lambda name: {"a.txt": files.sha256(source / "a.txt")})
        target = room / "data" / "sources" / "strain_recorded"
    call = {
        "predict": tactile("predict", linear, logs, "--no-pictures", "--out", target),
        "import": tactile("import", table, target, "--of", "touch"),
        "sheet": tactile("sheet", array, "--out", target),
        "export": tactile("export", linear, target),
        "fetch": tactile("fetch", "strain_recorded", "--from", source),
    }[what]
    if what == "import":
        (target.parent).mkdir()
        shutil.copy(array / "settings.yaml", target.parents[1])
    alone = kills.run(call, target.parent, notes)
    assert alone.code == 0, alone.said
    whole = kills.tree(target)
    shutil.rmtree(target)
    first = kills.Running(call, target.parent, notes)
    time.sleep(delay_s)
    second = kills.Running(call, target.parent, notes)
    ends = [first.ended(), second.ended()]
    assert 0 in [end.code for end in ends]
    for end in ends:
        assert "Traceback" not in end.said and end.code in (0, 1), end.said
        assert end.code == 0 or end.said.splitlines()[-1].startswith("error: "), end.said
    assert kills.tree(target) == whole and not kills.drafts(target.parent)


@pytest.mark.parametrize("name", ["ENOLCK", "EOPNOTSUPP", "ENOSYS"])
def test_a_file_system_without_locks_is_said(name, tmp_path, monkeypatch, capsys):
    def refused(*given):
        raise OSError(getattr(errno, name), "no locks")

    monkeypatch.setattr(processes.fcntl, "flock", refused)
    with processes.holding(tmp_path / "lock", pytest.fail):
        pass
    assert f"cannot lock {tmp_path / 'lock'} here: start nothing else" in capsys.readouterr().err
