"""A package is as it was made, or refused in a sentence: every file, every bit, every value of its card."""

import copy
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import onnx
import pytest
from builders import live_models, random_models
from builders.project import ROOT

from tactile.base import cards as base_cards
from tactile.base.errors import InputError
from tactile.inference import card as cards
from tactile.inference import consistent, onnx_export, onnx_network, predictions, predictor, recordings
from tactile.targets import kept, read

LONGEST_S, LARGEST_KB = 5.0, 500_000  # of processor time and of memory that a card may take
BITS, MUTATIONS = 60, 150  # of every file, of every package
LINES = 40


class Package(NamedTuple):
    """A package, and what is done with it."""

    folder: Path
    use: Callable[[Path], None]  # all that predicts with such a folder

    @property
    def card(self) -> Path:
        """Its card."""
        return next(self.folder / name for name in (cards.NAME, kept.CARD) if (self.folder / name).is_file())

    def copied(self, place: Path) -> "Package":
        """Return a copy of it."""
        shutil.rmtree(place, ignore_errors=True)
        return self._replace(folder=shutil.copytree(self.folder, place))


def described(kind: str, folder: Path) -> Path:
    """Save a model whose card has all that a card can have."""
    model = live_models.calibrated(kind, folder) if kind in live_models.BOUNDS else None
    card = model.card if model else consistent.read(live_models.KINDS[kind](folder))
    seen = card.inputs.chosen or list(range(card.inputs.columns))
    known = {"margin": 1.0, "mean_low": 0.0, "mean_high": 900.0, "mean_margin": 1.0}
    first, parts = 0, {"p": 270, "s": 135} if kind == "images" else {"v": len(seen)}
    ranges_ = []
    for name, count in parts.items():
        columns = list(range(count)) if kind == "images" else seen
        span = {"low": [0.0] * count, "high": [900.0] * count}
        ranges_.append({"name": name, "first": first, "columns": columns} | span | known)
        first += count
    score = cards.Score(condition="single", metric="rmse", unit="kPa", value=1.0, n=3)
    log = cards.Log(name="single/a", sha256="0" * 64, parts=["train"])
    changed = {"trained_on": ranges_, "source": "simulated", "scores": [score], "logs": [log]}
    if kind == "series":
        apart = {"lengths": [300, 1000], "most_apart": [0.1, 0.1], "most_gain": [0.1, 0.1]}
        matrix = {"columns": seen, "lag": 1, "correlation": np.eye(3).tolist(), "spread": [1.0] * 3}
        changed["correlation"] = matrix | apart
    whole = cards.Card.model_validate(json.loads(card.model_dump_json()) | changed_to_json(changed))
    cards.write(folder, whole)
    return folder


def changed_to_json(changed: dict) -> dict:
    return json.loads(json.dumps(changed, default=lambda part: part.model_dump()))


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> dict[str, Path]:
    """Return a log of each sensor."""
    place, rng = tmp_path_factory.mktemp("logs") / "single" / "run", np.random.default_rng(0)
    place.mkdir(parents=True)
    (place / "array.log").write_bytes(live_models.printed(live_models.press(LINES)))
    rows = {
        "daq.log": (0.2, 2 + rng.normal(0, 0.1, (LINES, 5))),
        "scanner.log": (100_000, rng.integers(0, 900, (9, 405))),
    }
    for name, (step, values) in rows.items():
        lines = [",".join([f"{k * step:.6g}", *(f"{value:.6g}" for value in row)]) for k, row in enumerate(values)]
        (place / name).write_text("\n".join(lines) + "\n")
    return {name.stem: name for name in place.iterdir()}


@pytest.fixture(scope="module")
def packages(tmp_path_factory, logs) -> dict[str, Package]:
    """Return a package of each kind, as ONNX too where that can be."""
    place, out = tmp_path_factory.mktemp("packages"), tmp_path_factory.mktemp("out")
    named = {"windows": "array", "series": "daq", "images": "scanner"}

    def use(folder: Path) -> None:
        model = predictor.load(folder)
        log = logs[named[model.card.kind]]
        recording = recordings.read(log, "run", model.card)
        with predictions.writing(out, log.parent, model.card) as write:
            write(recording, recordings.predict(model, recording), {})
        for reading in recording.x[:3]:
            model.step(reading)

    def use_target(folder: Path) -> None:
        model = kept.load(folder)
        log = read.sensor_log(logs["array"], model.card.experiment, model.card.settings)
        said = kept.predict(model, log)
        kept.table("run", log, said, model.card).cast(kept.schema(model.card))
        kept.summary("run", logs["array"], log, said, model.card)
        kept.interval(model.card)

    made = {kind: Package(described(kind, place / kind), use) for kind in live_models.KINDS}
    for kind in ("linear", "series"):
        onnx_export.export(predictor.load(place / kind), place / kind)
    made["angle"] = Package(live_models.target(place / "angle"), use_target)
    made["object"] = Package(live_models.target(place / "object", ("can", "cup", "pen")), use_target)
    for package in made.values():
        package.use(package.folder)  # whole, each is taken
    return made


KINDS = [*live_models.KINDS, "angle", "object"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_flipped_bit_anywhere_is_a_sentence(packages, kind, tmp_path):
    package, rng = packages[kind].copied(tmp_path / "package"), np.random.default_rng(0)
    files = sorted(package.folder.iterdir())
    assert len(files) == 3 if kind in ("linear", "series") else 2
    for file in files:
        whole = file.read_bytes()
        for place in [0, 8 * len(whole) - 1, *rng.integers(8 * len(whole), size=BITS)]:
            flipped = bytearray(whole)
            flipped[place // 8] ^= 1 << place % 8
            file.write_bytes(flipped)
            with pytest.raises(InputError, match=f"^{package.folder}/.*; (make the folder|train it) again"):
                package.use(package.folder)
        file.write_bytes(whole)
    package.use(package.folder)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_too_few_or_too_many_is_a_sentence(packages, kind, tmp_path):
    package = packages[kind].copied(tmp_path / "package")
    card = package.card.name
    for file in sorted(package.folder.iterdir()):
        away = file.rename(tmp_path / "away")
        words = "not found" if file.name in (card, cards.ONNX) or card == kept.CARD else "no network.safetensors or"
        if file.name != kept.CARD:  # whose absence makes it no model of a target
            with pytest.raises(InputError, match=words):
                package.use(package.folder)
        away.rename(file)
    (package.folder / "notes.txt").write_text("what nothing reads may lie there")
    package.use(package.folder)
    for name in {*cards.WEIGHTS, cards.ONNX} if card == cards.NAME else ():
        if not (package.folder / name).exists():
            (package.folder / name).write_bytes(b"more")
            with pytest.raises(InputError, match=f"{name}: is not among the files that card.json names|names network"):
                package.use(package.folder)
            (package.folder / name).unlink()
    text = json.loads(package.card.read_text())
    for names in ({"../away": "0" * 64}, {"/etc/passwd": "0" * 64}, {"notes.txt": "0" * 64}):
        changed = text | {"files": text["files"] | names}
        package.card.write_text(base_cards.sealed(json.dumps(changed), card))
        with pytest.raises(InputError, match="which is no file of a package"):
            package.use(package.folder)


@pytest.mark.parametrize("kind", ["linear", "angle"])
def test_a_card_of_before_says_how_to_make_it_again(packages, kind, tmp_path):
    package = packages[kind].copied(tmp_path / "package")
    text = json.loads(package.card.read_text())
    digest = {name: each for name, each in text.pop("files").items() if name in cards.WEIGHTS}
    package.card.write_text(json.dumps(text | {"sha256": digest.popitem()[1]}))
    again = "tactile export MODEL FOLDER" if kind == "linear" else "tactile own FOLDER"
    with pytest.raises(InputError, match=f"named one file by its digest, and not every one; .* again with `{again}`"):
        package.use(package.folder)


def test_line_ends_that_git_changed_are_no_change(packages, tmp_path):
    package = packages["linear"].copied(tmp_path / "package")
    package.card.write_bytes(package.card.read_bytes().replace(b"\n", b"\r\n"))
    package.use(package.folder)


def test_onnx_of_other_weights_is_refused_and_the_card_repeated_in_it_has_no_digest_of_it(packages, tmp_path):
    package = packages["series"].copied(tmp_path / "package")
    path, card = package.folder / cards.ONNX, consistent.read(package.folder)
    model = onnx.load(path)
    held = {entry.key: entry.value for entry in model.metadata_props}
    assert cards.Card.model_validate_json(held["card"]).files.keys() == {"network.safetensors"}
    largest = max(model.graph.initializer, key=lambda each: len(each.raw_data))
    largest.raw_data = (1.5 * np.frombuffer(largest.raw_data, np.float32)).tobytes()
    onnx.save(model, path)
    with pytest.raises(InputError, match=r"model\.onnx: is not the file that card\.json describes"):
        package.use(package.folder)
    path.write_bytes((packages["series"].folder / cards.ONNX).read_bytes())
    cards.write(package.folder, card)
    assert package.card.read_bytes() == packages["series"].card.read_bytes()


def crafted(model: onnx.ModelProto) -> Iterator[tuple[str, onnx.ModelProto]]:
    """Yield files of ONNX that are whole, and no network of this project."""
    for key in ("card", "tensors"):
        for value in (None, "", "[]", "{}", "null", '{"readings": 1}', '{"readings": {"shape": [], "what": ""}}'):
            other = copy.deepcopy(model)
            (entry,) = [entry for entry in other.metadata_props if entry.key == key]
            other.metadata_props.remove(entry)
            if value is not None:
                other.metadata_props.add(key=key, value=value)
            yield f"{key} {value}", other
    for place in (model.graph.input, model.graph.output):
        for k in range(len(place)):
            for change in ("name", "type", "shape")[
                : 3 if place is model.graph.input else 2
            ]:  # that of outputs is inferred
                other = copy.deepcopy(model)
                one = (other.graph.input if place is model.graph.input else other.graph.output)[k]
                if change == "name":
                    one.name += "x"
                elif change == "shape":
                    one.type.tensor_type.shape.dim[-1].dim_value = 10**12
                else:
                    one.type.tensor_type.elem_type = onnx.TensorProto.DOUBLE
                yield f"{change} of {one.name}", other
    outside = copy.deepcopy(model)
    largest = max(outside.graph.initializer, key=lambda each: len(each.raw_data))
    for key, value in {"location": "weights.bin", "offset": "0", "length": str(len(largest.raw_data))}.items():
        largest.external_data.add(key=key, value=value)
    largest.ClearField("raw_data")
    largest.data_location = onnx.TensorProto.EXTERNAL
    yield "weights in another file", outside
    empty = copy.deepcopy(model)
    del empty.graph.node[:]
    yield "no node", empty


@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # of numbers that a damaged network can give
@pytest.mark.parametrize("kind", ["linear", "series"])
def test_a_damaged_or_crafted_onnx_is_a_sentence(packages, kind, tmp_path, monkeypatch):
    """Also where the card names it as it is, as whoever crafts it can see to."""
    package = packages[kind].copied(tmp_path / "package")
    path, card, whole = (
        package.folder / cards.ONNX,
        consistent.read(package.folder),
        onnx.load(package.folder / cards.ONNX),
    )
    largest = max(whole.graph.initializer, key=lambda each: len(each.raw_data))
    for place in (package.folder, tmp_path):
        (place / "weights.bin").write_bytes(largest.raw_data)
    monkeypatch.chdir(tmp_path)
    for words, model in crafted(whole):
        path.write_bytes(model.SerializeToString())
        cards.write(package.folder, card)
        with pytest.raises(InputError, match=r"model\.onnx: .*; make the folder again"):
            package.use(package.folder)
            pytest.fail(words)
    rnd, data = random.Random(0), whole.SerializeToString()
    refused = 0
    for _ in range(60):
        damaged = bytearray(data)
        for _ in range(rnd.choice([1, 3, 30])):
            damaged[rnd.randrange(len(damaged))] = rnd.randrange(256)
        path.write_bytes(damaged[: rnd.choice([len(damaged), len(damaged), rnd.randrange(len(damaged))])])
        cards.write(package.folder, card)
        try:
            package.use(package.folder)
        except InputError:
            refused += 1
    assert refused > 10


def test_onnx_that_fails_while_it_predicts_is_a_sentence(packages):
    network = onnx_network.OnnxNetwork(packages["linear"].folder / cards.ONNX)
    with pytest.raises(InputError, match="model.onnx: not a network"):
        network.predict(np.zeros((1, 2, 5), np.float32))


VALUES = [None, True, -1, 0, 1, 3, 64, 1.5, 10**9, 10**19, 10**40, 1e308, -1e308, 1e-300, "", "x", "../x", "\x1b[31m"]
VALUES += ["y" * 3000, [], [0], [3, 2, 1], {}, {"a": 1}, ["a"] * 3, [[]], [8192] * 50, 8192, "kPa", "mm", "images"]
VALUES += ["touch", "strain", "glove", "velostat_recorded", "linear", "tree", "lomp", "esn", "vgg", "ridge"]


def paths(value, before: tuple = ()) -> Iterator[tuple]:
    """Yield the way to every inner value; of a list to its first two."""
    inside = value.items() if isinstance(value, dict) else enumerate(value[:2]) if isinstance(value, list) else ()
    for key, each in inside:
        yield (*before, key)
        yield from paths(each, (*before, key))


def put(card: dict, way: tuple, value) -> None:
    """Put a value at the end of a way."""
    for key in way[:-1]:
        card = card[key]
    card[way[-1]] = value


@pytest.mark.parametrize("kind", KINDS)
def test_a_card_of_any_values_is_a_sentence_or_a_whole_result(packages, kind, tmp_path):
    """Whoever writes a card can write its digest, so that what it says has to be looked at, too."""
    package, rnd = packages[kind].copied(tmp_path / "package"), random.Random(kind)
    whole = json.loads(package.card.read_text())
    ways = [way for way in paths(whole) if way[0] != "files"]
    tried = [(way, None if k else ...) for way in ways for k in (0, 1)]
    tried += [(rnd.choice(ways), rnd.choice(VALUES)) for _ in range(MUTATIONS)]
    told, before = 0, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for way, value in tried:
        card = copy.deepcopy(whole)
        if value is ...:
            put(card, way[:-1], {}) if len(way) > 1 else card.pop(way[0])
        else:
            put(card, way, value)
        package.card.write_text(base_cards.sealed(json.dumps(card, indent=1), package.card.name))
        started = time.process_time()
        try:
            package.use(package.folder)
        except InputError as error:
            told += 1
            assert str(error).isprintable() and len(str(error)) < 3000, (way, value)
        assert time.process_time() - started < LONGEST_S, (way, value)
    assert told > len(tried) / 2
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < LARGEST_KB


@pytest.mark.parametrize(
    ("kind", "way", "value", "words"),
    [
        ("linear", ("reading", "sensor", "pitch_mm"), {"a": 1}, r"reading\.sensor\.pitch_mm: input should be a valid"),
        (
            "linear",
            ("reading", "ingest", "max_reject_fraction"),
            2,
            r"reading\.ingest\.max_reject_fraction: .* 1, got 2",
        ),
        ("linear", ("reading", "label"), None, r"reading\.label: Input should be an object"),
        ("linear", ("reading", "more"), {}, "has the blocks sensor, ingest, window, label and no other"),
        ("linear", ("settings", "hidden"), 8, r"unknown key 'hidden'"),
        ("linear", ("experiment",), "os", "experiment: Input should be 'touch'"),
        ("linear", ("model",), "os", "model: there is no model 'os'"),
        ("linear", ("model",), "../os", "model: there is no model"),
        ("linear", ("kind",), "series", "kind: of touch it is windows"),
        ("linear", ("inputs", "columns"), 7, r"inputs\.columns: by reading\.sensor it is 6"),
        ("linear", ("shapes", "rows"), 3, r"shapes\.rows: by reading and outputs it is 2"),
        ("linear", ("shapes", "frames"), 4, r"shapes\.frames: .* 3"),
        ("linear", ("outputs", "touch_kpa"), None, r"outputs\.touch_kpa: maps in kPa have one"),
        ("linear", ("outputs", "unit"), "N", r"outputs\.unit: of touch it is kPa"),
        ("linear", ("trained_on", 0, "columns"), [0, 1, 2, 3, 4, 6], "a range for each column that the model sees"),
        ("linear", ("trained_on", 0, "low"), [0.0] * 5, "one entry for each column"),
        ("linear", ("trained_on",), [], "trained_on: List should have at least 1 item"),
        ("linear", ("calibration", "bounds", 0, "output"), "x", "the outputs are force_n, peak_kpa"),
        (
            "series",
            ("outputs", "names"),
            ["x_mm", "z_mm"],
            r"outputs\.names: by the protocol task_2 they are x_mm, y_mm",
        ),
        ("series", ("inputs", "chosen"), [4, 0, 5], r"inputs\.chosen: it has to name some of the columns 0 to 4"),
        ("series", ("inputs", "chosen"), [4, 0, 0], r"inputs\.chosen: .* each once"),
        ("series", ("protocol",), "task_9", "no task 'task_9'"),
        ("series", ("correlation", "columns"), [4, 0, 9], r"correlation\.columns: a reading has the columns 0 to 4"),
        ("series", ("correlation", "correlation"), [[1.0]], "a row and a column for each channel"),
        ("images", ("outputs", "names"), ["can", "cup"], r"shapes\.map_cols: by reading and outputs it is 2"),
        ("images", ("outputs", "names"), ["can", "can", "cup"], r"outputs\.names: .* each once"),
        ("images", ("protocol",), "session_x", "protocol: it has to end in one of _pressure, _strain, _combined"),
        ("images", ("commit",), "\x1b[2J", "commit: .*cannot be printed"),
        ("stream", ("settings", "hidden"), 4096, "was saved by a model with other settings"),
        ("stream", ("settings", "readout"), [8192] * 9, "was saved by a model with other settings"),
        ("angle", ("elements",), 7, r"elements: by settings\.sensor it is 6"),
        ("angle", ("elements",), 10**12, "elements: Input should be less"),
        ("angle", ("classes",), ["a"], "classes: a number has none"),
        ("object", ("classes",), ["a", "a", "b"], "each once"),
        ("object", ("classes",), ["a", "b"], "not a model of target.json"),
        ("object", ("model",), "x", "model: it is one of constant, ridge"),
        ("object", ("settings", "sensor", "rows"), 3, r"elements: by settings\.sensor it is 9"),
    ],
)
def test_the_key_of_a_card_that_does_not_fit_is_named(packages, kind, way, value, words, tmp_path):
    package = packages[kind].copied(tmp_path / "package")
    card = json.loads(package.card.read_text())
    put(card, way, value)
    package.card.write_text(base_cards.sealed(json.dumps(card, indent=1), package.card.name))
    with pytest.raises(InputError, match=f"^{package.folder}/.*{words}.*again"):
        package.use(package.folder)


def test_a_network_larger_than_its_weights_is_not_made(tmp_path):
    """In torch it would take its memory before the weights are found to be others."""
    folder = random_models.save("cnn", tmp_path)
    card = json.loads((folder / cards.NAME).read_text())
    card["settings"]["hidden"] = [8192, 8192]
    (folder / cards.NAME).write_text(base_cards.sealed(json.dumps(card, indent=1), cards.NAME))
    with pytest.raises(InputError, match="its network has [0-9]+ bytes, the file of weights less"):
        predictor.load(folder)


def test_the_size_of_a_network_is_told_without_the_compiler_of_torch():
    """`eye`, `randn` and divisions on the device `meta` take a second of imports; of all, lstm_highpass takes it."""
    code = (
        "import sys\nfrom builders.random_models import CASES\nfrom tactile.inference import torch_model\n"
        "del CASES['lstm_highpass']\nfor key, case in CASES.items():\n"
        "    torch_model.network_bytes(key, case.spec, case.settings)\n"
        "    assert 'torch._dynamo' not in sys.modules, key\n"
    )
    path = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    done = subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": path}, capture_output=True)
    assert done.returncode == 0, done.stderr.decode()
