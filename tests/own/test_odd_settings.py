"""Settings of a sensor that are odd or hostile: each is one sentence, or its logs are read, within seconds."""

import functools
import json
import signal

import numpy as np
import pytest
from builders import own_logs
from builders.project import ROOT

from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.experiments import touch
from tactile.logs import layout, parse
from tactile.own import settings as own_settings
from tactile.settings.shared import Layout
from tactile.targets import read as targets

LONGEST_S = 5
PAD = {"rows": 2, "cols": 3, "pitch_mm": 10.0, "element_mm": 9.0, "order": []}
ENCODINGS = "zlib bz2 hex base64 rot13 uu quopri undefined unicode_escape raw_unicode_escape punycode idna utf-7 utf-16"
ENCODINGS += " utf-32 cp037 mbcs oem utf-8-sig koi8-r tactis string_escape"
TIMES = (
    "%",
    "%Q",
    "%Y%Y",
    "%Z",
    "%j",
    "%s",
    "%H:%M:%S.%f",
    "%U %W",
    "[",
    "%-d",
    "%y%",
    "%(",
    "%c %x %X",
    "%B%B",
    "%%",
    "a\0",
)
PATTERNS = ("(a+)+$", "([0-9,]*)*x", r"(\d+,?)+z", "^", "", "(?i)(x|x)*y", ".{0,1000}.{0,1000}.{0,1000}z", "(")
PATTERNS += ("(?P<a>1)(?P=a)", "(?<=1)2", "a{1001}", "[[:alpha:]]", r"\bv", "(" * 500 + ")" * 500, "\0")
PATTERNS += ("(?x)a", "1?")
LAYOUTS = """skip_lines: 1000000000000000000 | width: 1000000000000000000 | columns: 2..99999999999, width: 7 |
columns: 7..2, width: 7 | columns: [2,2,2,2,2,2], width: 7 | columns: [0,1,2,3,4,5], width: 7 |
columns: 2..7, width: 3 | lines_per_frame: 1000000000 | rate_hz: 1.0e-300 | rate_hz: 1.0e+300 |
scale: 1.0e+308 | scale: 0 | scale: -1 |
offset: 1.0e+300 | scale: .inf | offset: .nan | scale: [1,2,3] | time: 99 | time: 0 | time: -1 | time: v3 |
columns: v0..v5 | decimal: "," | time_unit: ns | repeats: spread | missing: previous | rises_when_pressed: false |
separator: text, width: 7, time: 7, columns: 1..6 | skip_lines: null | encoding: null | strip: null | columns: [] |
columns: "" | columns: ".." | columns: "2.." | columns: "..7", width: 7 | columns: "a..b..c" | time_pattern: null"""
KEYS = """rows 1000000000 | rows 0 | rows -1 | rows 2.0 | rows true | pitch_mm 1.0e-300 |
pitch_mm 1.0e+300 | element_mm 1.0e+9 | order [5,4,3,2,1,0] | order [0,0,0,0,0,0] | order [9,1]"""
BLOCKS = """touch.window.frames: 1000000000 | touch.window.stride: 1000000000000 | touch.label.map_rows: 100000000 |
touch.window.frame_step: 1000000000000000000000 |
touch.label.tip_radius_mm: 1.0e-300 | touch.ingest.min_correlation: 0 |
touch.ingest.max_clock_offset_s: 1.0e+12 | touch.ingest.highest_count: 1000000000000000000000000 | touch.source: /etc |
touch.ingest.max_reject_fraction: 1 | touch.models: {} | touch.models: null | touch.protocols: {} | device: cuda |
touch.protocols: {press: {seeds: []}} | touch.protocols: {'../x': {seeds: [0]}} | device: "'; rm -rf /'" | touch: {} |
touch.protocols: {press: {seeds: [-1]}} | touch.: 1 | .touch: 1 | 'touch..sensor': 1 | 1: 2 | null: 2 | true: 2 |
[1,2]: 2 | {a: 1}: 2 | touch.sensor: 5 | touch.sensor.rows.deep: 1 | touch.split: {} | experiments: [touch] |
touch.budget: 0 | touch.budget: 1.0e+9 | touch.models.lomp.training.epochs: 1000000000 | glove.sensor: {} |
touch.window.contact_threshold_n: -1 | touch.window.contact_threshold_n: 1.0e+300 | strain.sensor.channels: 3"""
TARGETS = [
    {"file": name}
    for name in ("../../../../etc/passwd", "/etc/passwd", "/dev/zero", ".", "", "daq.log", "a\0b", "x" * 300)
]
TARGETS += [{"column": value} for value in (10**18, 0, -1, 1, "x", "", 2.5)]
TARGETS += [{"window_s": value} for value in (1e9, 1e-9, 1e300)]
TARGETS += [
    {"name": name} for name in ("../../x", "a\nb", "<script>", "$\\frac{$", "x" * 5000, "predicted", "t_s", "line")
]
TARGETS += [{"name": name} for name in ("segment", "time_s", "a,b")] + [
    {"unit": unit} for unit in ("$\\frac$", "x" * 4000, "\n#")
]
TARGETS += [{"kind": "event"}, {"kind": "class"}]
TARGETS += [
    {"split": {"by": "session", "pattern": one}}
    for one in ("(.*)", "((anna_)+)+$", "(([a-z_0-9/]+)*)!", "()", "(x)?anna")
]
TARGETS += [{"split": split} for split in ({"by": "time"}, {"by": "recording"}, {"by": "day", "pattern": r"run(\d)"})]
YAMLS = {
    "binary": b"\xff\xfe\x00", "alias": b"a: &x [1,1]\nb: *x\n", "deep": b"a: " + b"[" * 30 + b"]" * 30,
    "very deep": b"a: " + b"[" * 100_000, "twice": b"touch.sensor.rows: 2\ntouch.sensor.rows: 3\n", "list": b"- 1\n",
    "empty": b"", "null": b"null", "tag": b"!!python/object/apply:os.system ['echo HACKED']\n",
    "tag of a value": b"touch.sensor.rows: !!python/object/apply:os.system ['echo HACKED']\n",
    "tag of bytes": b"!!binary aGk=\n", "complex key": b"? [a, b]\n: 1\n", "octal": b"touch.sensor.rows: 0o17\n",
    "date": b"touch.sensor.rows: 2020-13-01\n", "digits": b"touch.sensor.rows: " + b"9" * 5000 + b"\n",
    "comment of 2 MB": b"#" * 2_000_000, "value of 2 MB": b"x: " + b"y" * 2_000_000, "two": b"a: 1\n---\nb: 2\n",
    "version": b"%YAML 1.1\n---\ntouch.sensor.rows: yes\n", "tab": b"\t", "merge": b"<<: {touch.sensor.rows: 2}\n",
    "float": b"touch.sensor.rows: !!float 2\n", "timestamp": b"touch.sensor.rows: !!timestamp 2001-01-01\n",
    "set": b"touch.sensor.order: !!set {1,2}\n", "omap": b"touch.sensor.order: !!omap [a: 1]\n", "bell": b"a: \x07\n",
    "stamp": b"touch.sensor.rows: !!timestamp x\n", "int": b"touch.sensor.rows: !!int x\n",
}  # fmt: skip


def pieces(text: str) -> list[str]:
    """Return what stands between the bars of a list."""
    return [" ".join(piece.split()) for piece in text.split("|")]


def formats() -> list[str]:
    """Return blocks of `format` of a log."""
    blocks = [{"encoding": name} for name in [*ENCODINGS.split(), "a\0b"]]
    blocks += [{"time_pattern": one} | time for one in TIMES for time in ({}, {"time": 1})]
    blocks += [block for one in PATTERNS for block in ({"strip": [one]}, {"frame_begins": one})]
    texts = [json.dumps({"separator": ","} | block) for block in blocks]
    return texts + ["{" + ("" if "separator" in one else "separator: ',', ") + one + "}" for one in pieces(LAYOUTS)]


@pytest.fixture(autouse=True)
def in_time():
    """Fails a test that takes longer than LONGEST_S, wherever it is."""

    def late(*_):
        raise AssertionError(f"takes more than {LONGEST_S} s")

    former = signal.signal(signal.SIGALRM, late)
    signal.alarm(LONGEST_S)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, former)


@pytest.fixture(scope="module")
def pad(tmp_path_factory):
    """Return a folder of logs of an array of 2 x 3."""
    folder = tmp_path_factory.mktemp("pad")
    own_logs.touch(folder, 2, 3, 50, seconds=4.0, recordings=1, conditions=())
    return folder


@pytest.fixture(scope="module")
def bent(tmp_path_factory):
    """Return a folder of logs of a strain sensor with an angle beside each."""
    folder, t = tmp_path_factory.mktemp("bent"), np.arange(0, 8, 0.05)
    for k in range(4):
        place = folder / f"anna_{k // 2}" / f"run{k % 2}"
        place.mkdir(parents=True)
        angle = 30 * np.sin(t * (0.5 + 0.1 * k))
        readings = 2 + 0.01 * angle[:, None] * [1, 0.5, 0.2, 0.1]
        lines = (f"{at:.3f}," + ",".join(f"{value:.5f}" for value in row) for at, row in zip(t, readings, strict=True))
        (place / "daq.log").write_text("\n".join(lines) + "\n")
        (place / "angle.csv").write_text("".join(f"{at:.3f},{value:.3f}\n" for at, value in zip(t, angle, strict=True)))
    return folder


def outcome(call) -> str:
    """Return the sentence of a call, or "read"."""
    try:
        call()
    except InputError as error:
        sentence = str(error)
        assert 10 < len(sentence) < 2000 and sentence.isprintable(), sentence
        return sentence
    return "read"


def read_pad(folder, text: str | bytes) -> None:
    """Read settings.yaml of a folder, and its log as they say."""
    path = folder / "settings.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    own_settings.asked(folder)
    settings = own_settings.of_logs(Workspace(ROOT), "touch", folder)["touch"]
    log = next(folder.glob("*/*/array.log"))
    if settings["sensor"]["rows"] * settings["sensor"]["cols"] < 1000:
        parse.read_log(log, touch.array_format(settings), layout=layout.of(settings["ingest"], log.name))


def settings_of(**sensor) -> str:
    """Return the text of settings with a block `touch.sensor`."""
    return f"touch.sensor: {json.dumps(PAD | sensor)}\n"


@pytest.mark.parametrize("block", formats())
def test_an_odd_format_of_a_log(block, pad):
    (pad / "settings.yaml").write_text(f"touch.ingest.format: {{array.log: {block}}}\n")

    def read():
        given = own_settings.read(pad)["touch.ingest.format"]["array.log"]
        laid_out = params.check_block(given, Layout, "touch.ingest.format.array.log")
        log = next(pad.glob("*/*/array.log"))
        fmt = touch.array_format({"sensor": PAD, "ingest": {"highest_count": 1023}})
        parse.read_log(log, fmt, layout=laid_out.model_dump(exclude_unset=True))

    outcome(read)


@pytest.mark.parametrize("pattern", ["([0-9,]*)*x", "(a+)+$", "(?<=1)2", "(?P<a>1)(?P=a)", "a{1001}", r"\bv"])
@pytest.mark.parametrize("key", ["strip", "frame_begins"])
def test_an_expression_that_never_ends_is_read_and_one_that_re2_lacks_names_its_key(key, pattern, pad):
    block = {"separator": ",", key: [pattern] if key == "strip" else pattern}
    text = settings_of() + f"touch.ingest.format: {{array.log: {json.dumps(block)}}}\n"
    said = outcome(lambda: read_pad(pad, text))
    if pattern in ("([0-9,]*)*x", "(a+)+$"):
        assert said == "read" if key == "strip" else "no line is laid out" in said, said
    else:
        assert f"array.log.{key}" in said and "in a time that grows with the line" in said, said


@pytest.mark.parametrize("line", [*pieces(KEYS), *pieces(BLOCKS)])
def test_an_odd_value_of_a_key(line, pad):
    key, _, value = line.partition(" ")
    if ":" not in key:
        text = "".join(f"touch.sensor.{one}: {value if one == key else json.dumps(PAD[one])}\n" for one in PAD)
    else:
        text = settings_of() + line + "\n"
    outcome(lambda: read_pad(pad, text))


@pytest.mark.parametrize("name", YAMLS)
def test_an_odd_file(name, pad, capfd):
    outcome(lambda: read_pad(pad, YAMLS[name]))
    assert "HACKED" not in capfd.readouterr().out


@functools.cache
def strain_settings(folder) -> dict:
    return own_settings.of_logs(Workspace(ROOT), "strain", folder)


def asked_of_bent(folder, odd: dict) -> targets.Data:
    """Read settings and recordings of a target."""
    target = {"name": "angle", "kind": "continuous", "unit": "deg", "file": "angle.csv", "column": 2}
    target |= {key: value for key, value in odd.items() if key != "split"}
    split = odd.get("split", {"by": "session", "pattern": r"(anna_\d+)/"})
    text = f"strain.sensor.channels: 4\ntarget: {json.dumps(target)}\nsplit: {json.dumps(split)}\n"
    (folder / "settings.yaml").write_text(text)
    asked = own_settings.asked(folder)
    settings = strain_settings(folder)["strain"]
    return targets.own("strain", folder, settings, asked)


@pytest.mark.parametrize("odd", TARGETS, ids=lambda odd: ascii(odd)[:60])
def test_an_odd_target(odd, bent):
    outcome(lambda: asked_of_bent(bent, odd))


@pytest.mark.parametrize("name", ["line", "segment", "t_s", "time_s", "angle"])
def test_a_target_may_be_called_as_a_column_of_every_log(name, bent):
    usual, odd = (asked_of_bent(bent, {"name": one}) for one in ("elbow", name))
    for one, other in zip(usual.series, odd.series, strict=True):
        np.testing.assert_array_equal(one.truth, other.truth)
    assert np.ptp(usual.series[0].truth) > 20
