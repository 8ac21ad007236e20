"""Damage bytes of other people for as long as one likes: `python tests/fuzz.py KIND SECONDS SEED`, or `all` kinds.

Every input is to end in a sentence (InputError), or to be read whole. Printed are how many did, and each other end
once: a traceback, a hang, a crash, a lack of memory, a sentence too long or with signs that are not seen. The first
input of it is kept in build/fuzz. Kinds: see KINDS. An attempt has LONGEST_S and MEMORY; each kind runs in a fork.
"""

import contextlib
import dataclasses
import faulthandler
import functools
import gzip
import hashlib
import io
import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from builders import own_logs
from builders.project import ROOT

from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

KEPT = ROOT / "build" / "fuzz"
LONGEST_S, MEMORY = 15, 4 << 30  # beyond what the process has when it begins
Attempt = tuple[str, bytes, Callable[[], object]]  # name of the input, the input, what reads it
TOKENS = [
    b"nan",
    b"inf",
    b"-inf",
    b"1e400",
    b"-1",
    b"0",
    b"1e308",
    b"9" * 20,
    b"",
    b" ",
    b"null",
    b"true",
    b"[]",
    b"{}",
]
TOKENS += [b'"', b"'", b"\0", b"\xff", b"\xef\xbb\xbf", b"\r", b"\n", b"\r\n", b"#", b",", b",,", b";", b"\t", b"../"]
TOKENS += [b"%s", b"{{7}}", b"$x_{$", b"<b>", b"=1+1", b"4294967296", b"9223372036854775808", b"1.5", b"0x10", b"1_000"]
TOKENS += [b"\xe2\x80\xae", b"\xc2\xa0", b"!!int", b"&a", b"*a", b"- ", b": ", b"?", b"|", b">", b"1e-400", b"x" * 300]
TOKENS += [b"9" * 400, b"[" * 60, b"\x1b[31m", b"None", b"NaN"]
VALUES = [
    None,
    True,
    -1,
    0,
    1,
    2,
    1.5,
    10**9,
    10**19,
    1e308,
    -1e308,
    "",
    "x",
    "../x",
    "a.b",
    [],
    [0],
    [1, 2, 3],
    {},
    [[]],
]
VALUES += [
    {"a": 1},
    ["a"] * 3,
    "kPa",
    "mm",
    "N",
    "windows",
    "series",
    "images",
    "strain",
    "glove",
    "touch",
    "lomp",
    "tree",
]
VALUES += ["lstm_direct", "sp_resnet", [64], 64, 3]


def mutated(data: bytes, rnd: random.Random) -> bytes:
    """Return bytes with one to eight changes: of bits, tokens, numbers, words, lines, pieces, the end."""
    changed = bytearray(data)
    for _ in range(rnd.choice([1, 1, 1, 2, 2, 3, 5, 8])):
        n, kind = len(changed), rnd.randrange(11)
        at, size = rnd.randrange(n + 1), rnd.choice([1, 1, 2, 5, 20, 100])
        if kind == 0 and n:
            changed[at % n] ^= 1 << rnd.randrange(8)
        elif kind == 1:
            changed[at:at] = rnd.choice(TOKENS) * rnd.choice([1, 1, 3, 50])
        elif kind == 2:
            del changed[at : at + size]
        elif kind == 3:
            changed[at:at] = changed[at : at + size]
        elif kind == 4:
            changed[at:at] = rnd.randbytes(size)
        elif kind in (5, 6):  # a number or a word becomes a token, or another
            found = list(re.finditer(rb"-?\d+(\.\d+)?" if kind == 5 else rb"[A-Za-z_]{2,}", changed[:200_000]))
            if found:
                one, other = rnd.choice(found), rnd.choice(found)[0]
                changed[one.start() : one.end()] = rnd.choice([*TOKENS, other])
        elif kind == 7:
            lines = bytes(changed).split(b"\n")
            k, j = rnd.randrange(len(lines)), rnd.randrange(len(lines))
            lines[k], lines[j] = lines[j], rnd.choice([lines[k], rnd.choice(TOKENS), lines[k] + b"\n" + lines[j]])
            changed = bytearray(b"\n".join(lines))
        elif kind == 8:
            del changed[at:]
        elif n > 8:
            wide = rnd.choice([1, 2, 4, 8])
            changed[at : at + wide] = rnd.choice([b"\0" * wide, b"\xff" * wide, rnd.randbytes(wide)])
    return bytes(changed)


def in_archive(archive: bytes, rnd: random.Random) -> bytes:
    """Return a zip file, whole, of which one member is changed."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(archive)) as former, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as new:
        names = former.namelist()
        picked = rnd.choice(names)
        for name in names:
            new.writestr(name, mutated(former.read(name), rnd) if name == picked else former.read(name))
    return made.getvalue()


def touch_log(lines: int) -> bytes:
    """Return the first lines of a log of the array of 5 x 5."""
    return b"".join((ROOT / "data/sample/double/two_touches/array.log").read_bytes().splitlines(True)[:lines])


@functools.cache
def logs_of_models() -> dict[str, tuple[str, bytes]]:
    """Return experiment -> folder below pretrained/ and a log for it, with the log's name."""
    t, rng = np.arange(200) / 50, np.random.default_rng(0)
    strain = np.column_stack([t, *(2 + 0.1 * np.sin(5 * t / 2 + j) for j in range(20))])
    glove = np.column_stack([np.arange(12) * 66_000, rng.integers(0, 900, (12, 405))])
    texts = {"strain": ("%.5f", strain), "glove": ("%d", glove)}
    made = {
        name: "\n".join(",".join(form % v for v in row) for row in rows) + "\n" for name, (form, rows) in texts.items()
    }
    return {
        "touch": ("touch/lomp_stream", touch_log(300), "array.log"),
        "strain": ("strain/lstm_direct", made["strain"].encode(), "daq.log"),
        "glove": ("glove/sp_resnet", made["glove"].encode(), "scanner.log"),
    }


def logs(work: Path) -> Callable[[random.Random], Attempt]:
    """Logs that `predict` reads; changes that must not matter give the same numbers."""
    from tactile.inference import predictor, recordings

    models = {}
    for name, (folder, data, log) in logs_of_models().items():
        path = work / name / "c" / "r" / log
        path.parent.mkdir(parents=True)
        models[name] = predictor.load(ROOT / "pretrained" / folder), data, path

    def predicted(model, path: Path, data: bytes):
        path.write_bytes(data)
        recording = recordings.read(path, "n", model.card)
        found = recordings.predict(model, recording).values
        assert np.isfinite(recording.x).all() and np.isfinite(recording.t_s).all(), "a reading is not finite"
        assert not np.isinf(found).any() and len(found) == len(recording.t_s) == len(recording.x), "predictions"
        return recording.t_s, found

    usual = {}

    def one(rnd: random.Random) -> Attempt:
        name = rnd.choice(["touch", "touch", "strain", "glove"])
        model, data, path = models[name]
        if rnd.random() < 0.25:
            change = rnd.choice(sorted(WITHOUT_EFFECT))
            lines = [line for line in data.splitlines() if line.count(b",") == data.splitlines()[-2].count(b",")]
            clean = b"\n".join(line for line in lines if line[:1].isdigit()) + b"\n"
            changed = WITHOUT_EFFECT[change](clean, rnd)

            def same():
                if name not in usual:
                    usual[name] = predicted(model, path, clean)
                found = predicted(model, path, changed)
                for one, other in zip(found, usual[name], strict=True):
                    assert np.array_equal(one, other, equal_nan=True), f"other numbers: {change}"

            return f"log-{name}.log", changed, same
        changed = mutated(data, rnd)
        return f"log-{name}.log", changed, lambda: predicted(model, path, changed)

    return one


def _permuted(data: bytes, rnd: random.Random) -> bytes:
    """Return a log of the array of 5 x 5 with its columns in another order, which a header says."""
    rows = [b"t_us," + b",".join(b"v%d" % k for k in range(25)), *data.splitlines()]
    order = rnd.sample(range(26), 26)
    return b"".join(b",".join(row.split(b",")[k] for k in order) + b"\n" for row in rows)


# Changes of a log that must not change a number. Lines of data begin with a digit, and each is whole.
WITHOUT_EFFECT: dict[str, Callable[[bytes, random.Random], bytes]] = {
    "blank lines behind": lambda data, rnd: data + b"\n" * rnd.randrange(1, 6),
    "CR LF": lambda data, rnd: data.replace(b"\n", b"\r\n"),
    "byte order mark": lambda data, rnd: b"\xef\xbb\xbf" + data,
    "no last line end": lambda data, rnd: data.rstrip(b"\n"),
    "comment in front": lambda data, rnd: b"# a note\n" + data,
    "blanks around fields": lambda data, rnd: re.sub(rb"(?m)^(\d.*)$", lambda m: m[1].replace(b",", b", "), data),
    "gzip": lambda data, rnd: gzip.compress(data, mtime=0),
    "order of columns": lambda data, rnd: _permuted(data, rnd) if data.splitlines()[0].count(b",") == 25 else data,
}


def live(work: Path) -> Callable[[random.Random], Attempt]:
    """Bytes of a device that `live` reads, in pieces of any size."""
    from unittest.mock import patch

    from tactile.inference import predictor
    from tactile.live import outputs, server, source
    from tactile.live.session import Session

    model, data = predictor.load(ROOT / "pretrained/touch/lomp_stream"), touch_log(200)
    layouts = [
        None,
        None,
        {"separator": "text", "time": 1},
        {"separator": ",", "missing": "previous", "repeats": "spread"},
    ]

    def refuse(constant):
        raise ValueError(f"no JSON: {constant}")

    def one(rnd: random.Random) -> Attempt:
        changed, laid_out, sizes = mutated(data, rnd), rnd.choice(layouts), random.Random(rnd.random())

        def call():
            model.reset()
            lines = source.Lines(source.line_format(model.card), "x", "y", (), laid_out)
            with patch.object(Session, "_time_of_a_step", lambda self: 1e-4):
                session = Session(model, lines, lambda said: None)
            table, at = outputs.Table(io.StringIO(), model.card), 0
            while at < len(changed):
                size = sizes.choice([1, 7, 64, 512, 4096])
                for picture in session.take(changed[at : at + size], 1.0):
                    table.add(picture)
                    event = server.event("picture", server.picture(picture, model.card))
                    json.loads(event.split("data: ", 1)[1], parse_constant=refuse)
                at += size
            list(session.finish())

        return "live.log", changed, call

    return one


def _paths(value, above: tuple = ()) -> Iterator[tuple]:
    """Yield the path of every value in nested blocks and lists."""
    yield above
    if isinstance(value, dict | list):
        for key in value if isinstance(value, dict) else range(min(3, len(value))):
            yield from _paths(value[key], (*above, key))


def cards(work: Path) -> Callable[[random.Random], Attempt]:
    """Cards of saved models, beside their weights, for which a log is predicted."""
    from tactile.base import cards as base_cards
    from tactile.inference import predictor, recordings

    paths, whole, every = {}, {}, {}
    for name, (folder, data, log) in logs_of_models().items():
        paths[name] = work / name / "c" / "r" / log
        paths[name].parent.mkdir(parents=True)
        paths[name].write_bytes(b"".join(data.splitlines(True)[:60]))
        whole[name] = json.loads((ROOT / "pretrained" / folder / "card.json").read_text())
        left = ("files", "scores", "commit", "calibration")
        every[name] = [path for path in _paths(whole[name]) if path and path[0] not in left]

    def one(rnd: random.Random) -> Attempt:
        name, target = rnd.choice(list(whole)), work / "package"
        source = ROOT / "pretrained" / logs_of_models()[name][0]
        card = json.loads(json.dumps(whole[name]))
        for _ in range(rnd.choice([1, 1, 2, 3])):
            path, block = rnd.choice(every[name]), card
            with contextlib.suppress(KeyError, IndexError, TypeError):
                for key in path[:-1]:
                    block = block[key]
                if rnd.random() < 0.2:
                    del block[path[-1]]
                else:
                    block[path[-1]] = rnd.choice(VALUES)
        if rnd.random() < 0.8:  # as one who crafts a card would write its digest
            content = base_cards.sealed(json.dumps(card, indent=1), "card.json").encode()
        else:
            content = mutated((source / "card.json").read_bytes(), rnd)

        def call():
            shutil.rmtree(target, ignore_errors=True)
            shutil.copytree(
                source, target, ignore=shutil.ignore_patterns("*.md", *([] if rnd.random() < 0.3 else ["*.onnx"]))
            )
            (target / "card.json").write_bytes(content)
            model = predictor.load(target)
            if model.card.experiment not in paths:
                raise InputError("a card of another experiment")
            recordings.predict(model, recordings.read(paths[model.card.experiment], "n", model.card))

        return f"card-{name}.json", content, call

    return one


def weights(work: Path) -> Callable[[random.Random], Attempt]:
    """Files of weights whose card has their digest."""
    from tactile.base import cards as base_cards
    from tactile.inference import predictor

    def one(rnd: random.Random) -> Attempt:
        source = ROOT / "pretrained" / rnd.choice(["strain/lstm_direct", "touch/lomp_stream"])
        card, data = json.loads((source / "card.json").read_text()), (source / "network.safetensors").read_bytes()
        head = 8 + int.from_bytes(data[:8], "little")
        changed = mutated(data[:head], rnd) + data[head:] if rnd.random() < 0.7 else mutated(data, rnd)
        card["files"] = {"network.safetensors": hashlib.sha256(changed).hexdigest(), "card.json": ""}
        target = work / "package"
        target.mkdir(exist_ok=True)
        (target / "network.safetensors").write_bytes(changed)
        (target / "card.json").write_text(base_cards.sealed(json.dumps(card, indent=1), "card.json"))
        return "network.safetensors", changed, lambda: predictor.load(target)

    return one


def estimators(work: Path) -> Callable[[random.Random], Attempt]:
    """Trees as skops keeps them, which predict."""
    from sklearn.tree import DecisionTreeRegressor

    from tactile.learning import estimators as kept

    x = np.random.default_rng(0).normal(size=(80, 4))
    kept.write(work, DecisionTreeRegressor(max_depth=4).fit(x, x[:, 0]))
    data = (work / kept.ESTIMATOR_FILE).read_bytes()

    def one(rnd: random.Random) -> Attempt:
        changed = in_archive(data, rnd)
        (work / kept.ESTIMATOR_FILE).write_bytes(changed)
        return "estimator.skops", changed, lambda: kept.read(work, ("sklearn.tree._tree.Tree",)).predict(x)

    return one


SETTINGS = {
    "touch": """touch.sensor: {rows: 2, cols: 3, pitch_mm: 10.0, element_mm: 9.0, order: []}
touch.label.map_rows: 8
touch.label.map_cols: 12
touch.ingest.format:
  array.log: {separator: ",", time: 2, columns: 3..8, width: 8}
  load_cell.log: {separator: text, scale: 0.00981, strip: ['a+']}
touch.ingest.clock: shared
touch.models.lomp.hidden: 32
""",
    "strain": """strain.sensor.channels: 4
strain.sensor.tasks: {task_0: {axes: [x, y, z]}}
strain.sensor.pressed_below_mm: 1.0
target: {name: angle, kind: continuous, unit: deg, file: angle.csv, column: 2}
split: {by: session, pattern: '(anna_\\d+)/'}
""",
    "glove": """glove.sensor.areas:
  pressure: {rows: 1, cols: 5, lowest: 0, highest: 1023}
  strain: {rows: 1, cols: 5, lowest: -180, highest: 180}
""",
}


def settings(work: Path) -> Callable[[random.Random], Attempt]:
    """Files settings.yaml of sensors of one's own."""
    from tactile.own import settings as own_settings

    def one(rnd: random.Random) -> Attempt:
        experiment = rnd.choice(list(SETTINGS))
        changed = mutated(SETTINGS[experiment].encode(), rnd)
        (work / own_settings.FILE).write_bytes(changed)

        def call():
            own_settings.asked(work)
            own_settings.of_logs(Workspace(ROOT), experiment, work)

        return f"settings-{experiment}.yaml", changed, call

    return one


def parameters(work: Path) -> Callable[[random.Random], Attempt]:
    """Files params.yaml and params/*.yaml."""
    names = ["params.yaml", *(f"params/{path.name}" for path in (ROOT / "params").glob("*.yaml"))]
    texts = {name: (ROOT / name).read_bytes() for name in sorted(names)}
    (work / "params").mkdir()
    for name, text in texts.items():
        (work / name).write_bytes(text)

    def one(rnd: random.Random) -> Attempt:
        name = rnd.choice(list(texts))
        changed = mutated(texts[name], rnd)

        def call():
            (work / name).write_bytes(changed)
            try:
                params.load(work / "params.yaml")
            finally:
                (work / name).write_bytes(texts[name])

        return f"params-{Path(name).name}", changed, call

    return one


def shards(work: Path) -> Callable[[random.Random], Attempt]:
    """The tables and settings of the evidence."""
    from pipeline.results import shards as kept
    from pipeline.results.claim_inputs import COLUMNS
    from tactile.scoring.estimates import read_csv

    evidence = work / "evidence"
    evidence.mkdir()
    results = sorted((ROOT / "evidence" / "results").glob("*.csv"))
    index, times = ((ROOT / "evidence" / name).read_bytes() for name in ("index.csv", "times.csv"))
    sources = {
        "shards.yaml": (
            (ROOT / "evidence" / "shards.yaml").read_bytes(),
            lambda: kept.shards(kept.read_sets(Workspace(work))),
        ),
        "index.csv": (index[:3000].rsplit(b"\n", 1)[0], lambda: kept.table(evidence / "index.csv", kept.INDEX)),
        "times.csv": (times[:3000].rsplit(b"\n", 1)[0], lambda: kept.table(evidence / "times.csv", kept.TIMES)),
        "result.csv": (results[0].read_bytes()[:20_000], lambda: read_csv(evidence / "result.csv", COLUMNS, "this")),
    }

    def one(rnd: random.Random) -> Attempt:
        name = rnd.choice(list(sources))
        data, read = sources[name]
        changed = mutated(data, rnd)
        (evidence / name).write_bytes(changed)
        return f"shards-{name}", changed, read

    return one


def imports(work: Path) -> Callable[[random.Random], Attempt]:
    """Workbooks, numpy's archives and MATLAB files that `import` reads."""
    import openpyxl
    import scipy.io

    from tactile.own import tables

    t = np.arange(0, 3, 0.02)
    values = np.column_stack([np.round(500 + 300 * np.sin(t + j)) for j in range(6)])
    book, packed, matlab = openpyxl.Workbook(), io.BytesIO(), io.BytesIO()
    for row in np.column_stack([t, values]).tolist():
        book.active.append(row)
    book.save(workbook := io.BytesIO())
    np.savez_compressed(packed, t=t, v=values)
    scipy.io.savemat(matlab, {"t": t, "v": values, "s": {"a": t}})
    sources = {".xlsx": workbook.getvalue(), ".npz": packed.getvalue(), ".mat": matlab.getvalue()}

    def one(rnd: random.Random) -> Attempt:
        kind = rnd.choice([".xlsx", ".xlsx", ".npz", ".npz", ".mat"])
        whole = kind != ".mat" and rnd.random() < 0.7
        changed = in_archive(sources[kind], rnd) if whole else mutated(sources[kind], rnd)
        path = work / f"file{kind}"
        path.write_bytes(changed)
        return f"import{kind}", changed, lambda: tables.text_of(path, work)

    return one


def layouts(work: Path) -> Callable[[random.Random], Attempt]:
    """Logs of which `check` finds out how they are laid out."""
    from tactile.experiments import touch
    from tactile.own import logs as own

    own_logs.touch(work / "pad", 2, 3, 50, seconds=4.0, recordings=1, conditions=())
    block = params.load(ROOT / "params.yaml")["touch"]
    block |= {"sensor": block["sensor"] | {"rows": 2, "cols": 3}}
    formats = {"array.log": touch.array_format(block), "load_cell.log": touch.LOAD_CELL, "cnc.log": touch.CNC}
    sources = []
    for name, fmt in formats.items():
        data = b"".join(next((work / "pad").glob(f"*/*/{name}")).read_bytes().splitlines(True)[:150])
        lines = data.splitlines()
        stamped = b"\n".join(b"[12:00:%02d.%03d] a=%s" % (k // 50, k * 20 % 1000, line) for k, line in enumerate(lines))
        named = b"\n".join(b'{"t": %s}' % line.replace(b",", b', "x": ', 1) for line in lines)
        decimal = data.replace(b",", b";").replace(b".", b",")
        sources += [(name, fmt, one) for one in (data, data.replace(b",", b"\t"), decimal, stamped, named)]

    def one(rnd: random.Random) -> Attempt:
        name, fmt, data = rnd.choice(sources)
        changed = mutated(data, rnd)
        (work / name).write_bytes(changed)
        return f"layout-{name}", changed, lambda: own.proposed("touch", work / name, fmt, block, None)

    return one


KINDS = {
    each.__name__: each
    for each in (logs, settings, cards, parameters, shards, imports, weights, estimators, layouts, live)
}


@dataclasses.dataclass
class Found:
    """What came of the inputs of a kind."""

    tried: int = 0
    sentences: int = 0
    whole: int = 0
    wrong: Counter = dataclasses.field(default_factory=Counter)  # other ends

    def __str__(self) -> str:
        hangs = sum(count for what, count in self.wrong.items() if what.startswith("hang"))
        others = sum(self.wrong.values()) - hangs
        return f"tried {self.tried}, sentences {self.sentences}, whole {self.whole}, tracebacks {others}, hangs {hangs}"


class Hang(BaseException):
    """An attempt took LONGEST_S."""


def _late(*_) -> None:
    raise Hang


def where(error: BaseException) -> str:
    """Return the type of an error and the last line of this project that it passed."""
    frames = traceback.extract_tb(error.__traceback__)
    ours = re.compile("/(pipeline|tactile)/")
    frame = [each for each in frames if ours.search(each.filename) or each.filename == __file__][-1:] or frames[-1:]
    return f"{type(error).__name__} at {Path(frame[0].filename).name}:{frame[0].lineno} ({str(error)[:100]!a})"


def attempt(found: Found, call: Callable[[], object]) -> str | None:
    """Call, count what comes, and return what is wrong, None where nothing is."""
    found.tried += 1
    faulthandler.dump_traceback_later(3 * LONGEST_S, exit=True)  # a library that never comes back to Python
    signal.setitimer(signal.ITIMER_REAL, LONGEST_S)
    try:
        call()
        found.whole += 1
    except InputError as error:
        found.sentences += 1
        sentence = str(error)
        if len(sentence) > 2000 or not re.sub("[\u00a0\u202f]", "", sentence).isprintable():
            return f"a sentence of {len(sentence)} characters, or with signs not seen, {where(error)}"
    except Hang as error:
        return f"hang {where(error)}"
    except Exception as error:
        return where(error)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        faulthandler.cancel_dump_traceback_later()
    return None


def run(kind: str, seed: int, seconds: float = np.inf, attempts: float = np.inf) -> Found:
    """Try inputs of a kind until the time is over, or so many; what goes wrong is kept in KEPT."""
    found, rnd, begun = Found(), random.Random(seed), time.monotonic()
    former = signal.signal(signal.SIGALRM, _late)
    try:
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
            one = KINDS[kind](Path(folder))
            begun = time.monotonic()
            while time.monotonic() - begun < seconds and found.tried < attempts:
                name, data, call = one(rnd)
                if wrong := attempt(found, call):
                    found.wrong[wrong] += 1
                    if found.wrong[wrong] == 1:
                        KEPT.mkdir(parents=True, exist_ok=True)
                        kept = KEPT / f"{hashlib.sha256(wrong.encode()).hexdigest()[:8]}-{name}"
                        kept.write_bytes(data)
                        print(f"{kind}: {wrong}: {kept.relative_to(ROOT)}", file=sys.stderr, flush=True)
    finally:
        signal.signal(signal.SIGALRM, former)
    return found


def main(kind: str, seconds: str, seed: str) -> None:
    """Run one kind, or all, each in a fork."""
    import torch

    torch.set_num_threads(1)
    kinds = list(KINDS) if kind == "all" else [kind]
    for name in kinds:
        sys.stdout.flush()
        child = os.fork()
        if not child:
            size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, resource.RLIM_INFINITY))
            print(f"{name}: {run(name, int(seed), float(seconds))}", flush=True)
            os._exit(0)
        if code := os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
            print(f"{name}: crashed or hung (exit status {code})", flush=True)


if __name__ == "__main__":
    if len(sys.argv) != 4 or sys.argv[1] not in (*KINDS, "all"):
        sys.exit(f"usage: python tests/fuzz.py KIND SECONDS SEED; KIND: all, {', '.join(KINDS)}")
    main(*sys.argv[1:])
