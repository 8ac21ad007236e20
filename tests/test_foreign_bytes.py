"""Bytes of other programs come in by one door, tactile/base/foreign.py: a rule about the code, found by parsing it."""

import ast
from collections.abc import Iterator

import pytest
from builders.project import CODE, ROOT

DOOR = "tactile.base.foreign"
READERS = set(
    "json.load json.loads yaml.safe_load yaml.safe_load_all ruamel.yaml.YAML tomllib.load tomllib.loads".split()
)
READERS |= {
    f"pandas.{name}" for name in "read_csv read_table read_excel read_json read_xml read_parquet ExcelFile".split()
}
READERS |= {f"numpy.{name}" for name in "load loadtxt genfromtxt fromfile fromregex memmap".split()}
READERS |= set("scipy.io.loadmat scipy.io.whosmat openpyxl.load_workbook configparser.ConfigParser".split())
READERS |= set(
    "skops.io.load skops.io.loads safetensors.safe_open safetensors.torch.load_file safetensors.torch.load".split()
)
READERS |= set("safetensors.numpy.load_file onnx.load onnx.load_model onnxruntime.InferenceSession".split())
READERS |= {f"xml.etree.ElementTree.{name}" for name in "parse iterparse fromstring XML".split()}
READERS |= set(
    "pyarrow.parquet.read_table pyarrow.parquet.ParquetFile pyarrow.parquet.read_schema pyarrow.csv.read_csv".split()
)
READERS |= set(
    "pyarrow.ipc.open_file pyarrow.ipc.open_stream pyarrow.json.read_json pyarrow.feather.read_table".split()
)
READERS |= {f"{name}.{each}" for name in ("gzip", "bz2", "lzma") for each in ("open", "decompress")}
READERS |= set("gzip.GzipFile bz2.BZ2File lzma.LZMAFile zlib.decompress zipfile.ZipFile".split())
METHODS = {"model_validate_json"}  # of any object

OURS = "a file of the repository itself, or of this program, which is not from elsewhere"
# (file, reader) -> why it may stand outside the door.
OUTSIDE = {
    ("pipeline/claims/entries.py", "yaml.safe_load"): OURS,
    ("pipeline/reporting/page/sections.py", "yaml.safe_load"): OURS,
    ("pipeline/scenes/material.py", "json.loads"): OURS,
    ("pipeline/results/published.py", "pandas.read_csv"): OURS,
    ("pipeline/commands/evidence.py", "json.loads"): "what DVC prints, which this program called",
    ("pipeline/stability/series.py", "json.loads"): "text that the same process made",
    ("pipeline/stability/images.py", "json.loads"): "text that the same process made",
    ("tactile/inference/recordings.py", "numpy.memmap"): "a file without a name, which this process fills itself",
    ("tactile/learning/estimators.py", "json.loads"): "bytes that skops has just made",
    ("tactile/learning/estimators.py", "zipfile.ZipFile"): "bytes that skops has just made",
    ("tactile/stages/ingest.py", "pyarrow.ipc.open_stream"): OURS,
    ("tactile/own/logs.py", "ruamel.yaml.YAML"): "writes",
    ("tactile/base/params_file.py", "ruamel.yaml.YAML"): "its `load` stands in a block; it writes, too",
    ("tactile/logs/layout.py", "gzip.open"): "`opened` has the sentence for the three errors of gzip; the lines of a "
    "log are judged in its block, and a fault of that code must not pass for one of the file",
    ("tactile/logs/parse.py", "pyarrow.csv.read_csv"): "an error of it means that lines are judged one by one",
}
BLOCK = "called in a block of `foreign.reading` alone, of another file"
OUTSIDE |= {
    ("tactile/inference/onnx_network.py", "onnxruntime.InferenceSession"): BLOCK,
    ("tactile/learning/structure.py", "zipfile.ZipFile"): BLOCK,
    ("tactile/learning/structure.py", "json.loads"): BLOCK,
    ("tactile/live/server.py", "json.loads"): "of a browser's body of 1 kB, whose fault is an answer, not a sentence",
}


def full_names(tree: ast.AST) -> dict[str, str]:
    """Return name in a file -> what it was imported as: `pd` -> `pandas`."""
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {
                each.asname or each.name.split(".")[0]: each.name if each.asname else each.name.split(".")[0]
                for each in node.names
            }
        elif isinstance(node, ast.ImportFrom):
            found |= {each.asname or each.name: f"{node.module}.{each.name}" for each in node.names}
    return found


def dotted(node, names: dict[str, str]) -> str:
    """Return the full dotted name of an expression, '' for anything else."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value, names)}.{node.attr}"
    return names.get(node.id, node.id) if isinstance(node, ast.Name) else ""


def writes(call: ast.AST) -> bool:
    """Tell whether a call opens an archive to write it."""
    mode = [*call.args[1:2], *(word.value for word in call.keywords if word.arg == "mode")]
    return bool(mode) and isinstance(mode[0], ast.Constant) and str(mode[0].value)[:1] in ("w", "x", "a")


def outside(source: str) -> Iterator[tuple[int, str]]:
    """Yield the line and the name of each reader that stands outside the door.

    Inside is what stands in a block of `foreign.reading`, or among what `foreign.apart` is given, and a private
    function that is named inside alone.
    """
    tree = ast.parse(source)
    names, functions, uses = full_names(tree), {}, []

    def visit(node, inside: bool, within: str | None) -> None:
        if isinstance(node, ast.With):
            for item in node.items:
                visit(item, inside, within)
                inside |= isinstance(item.context_expr, ast.Call) and (
                    dotted(item.context_expr.func, names) == f"{DOOR}.reading"
                )
            for each in node.body:
                visit(each, inside, within)
            return
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if within is None:
                functions[within := node.name] = node
            for each in [*node.decorator_list, *node.args.defaults, *node.body]:  # no annotations
                visit(each, inside, within)
            return
        if isinstance(node, ast.AnnAssign):
            if node.value:
                visit(node.value, inside, within)
            return
        if isinstance(node, ast.Call):
            if dotted(node.func, names) == f"{DOOR}.apart":
                inside = True
            if dotted(node.func, names) == "zipfile.ZipFile" and writes(node):
                return
        if isinstance(node, ast.Attribute | ast.Name) and isinstance(node.ctx, ast.Load):
            name = dotted(node, names)
            method = node.attr if isinstance(node, ast.Attribute) and node.attr in METHODS else None
            uses.append((node.lineno, f".{method}" if method else name, inside, within))
        for each in ast.iter_child_nodes(node):
            visit(each, inside, within)

    visit(tree, False, None)

    def is_inside(name: str | None, above: tuple = ()) -> bool:
        if name is None or not name.startswith("_") or name in above:
            return False
        named = [(inside, within) for _, used, inside, within in uses if used == name]
        return bool(named) and all(inside or is_inside(within, (*above, name)) for inside, within in named)

    for line, name, inside, within in uses:
        if (name in READERS or name[1:] in METHODS and name[0] == ".") and not (inside or is_inside(within)):
            yield line, name


@pytest.fixture(scope="module")
def found() -> dict[tuple[str, str], list[int]]:
    """Return (file, reader) -> lines of the readers outside the door."""
    lines: dict[tuple[str, str], list[int]] = {}
    for path in CODE:
        if path != ROOT / "tactile" / "base" / "foreign.py":
            for line, name in outside(path.read_text(encoding="utf-8")):
                lines.setdefault((path.relative_to(ROOT).as_posix(), name), []).append(line)
    return lines


def test_bytes_of_other_programs_come_in_by_the_door(found):
    wrong = {key: lines for key, lines in found.items() if key not in OUTSIDE}
    assert not wrong, f"put these into `with foreign.reading(...)`, or give them to `foreign.apart`: {wrong}"


def test_what_may_stand_outside_does(found):
    assert not set(OUTSIDE) - set(found), "take these out of OUTSIDE"


IMPORTS = "import gzip, json, zipfile\nimport numpy as np\nimport pandas as pd\nfrom tactile.base import foreign\n"


@pytest.mark.parametrize(
    "source",
    [
        "def f(p):\n    return json.loads(p.read_text())",
        "def f(p):\n    with open(p) as file:\n        return json.load(file)",
        "def f(p):\n    with foreign.reading(p, 'a', 'b'):\n        pass\n    return pd.read_csv(p)",
        "def f(p):\n    packed = gzip.open\n    with foreign.reading(p, 'a', 'b'):\n        packed(p)",
        "def f(p):\n    return zipfile.ZipFile(p)",
        "def f(p):\n    return zipfile.ZipFile(p, 'r')",
        "def f(p):\n    return foreign.check_archive(p, 'a', 'b'), np.load(p)",
        "def _g(p):\n    return np.load(p)\ndef f(p):\n    return _g(p)",
        "def _g(p):\n    return np.load(p)\ndef f(p):\n    foreign.apart(p, 'a', 'b', _g, p)\n    return _g(p)",
        "def g(p):\n    return np.load(p)\ndef f(p):\n    return foreign.apart(p, 'a', 'b', g, p)",
        "def _g(p):\n    return np.load(p)",
        "from safetensors.torch import load_file\ndef f(p):\n    return load_file(p)",
        "from safetensors.torch import load_file as other\ndef f(p):\n    return other(p)",
        "import xml.etree.ElementTree as E\ndef f(p):\n    return E.parse(p)",
        "from ruamel.yaml import YAML\ndef f(p):\n    return YAML().load(p)",
        "def f(p, kind):\n    return kind.model_validate_json(p.read_text())",
        "from other.foreign import reading\ndef f(p):\n    with reading(p, 'a', 'b'):\n        return np.load(p)",
    ],
)
def test_the_rule_sees_what_it_forbids(source):
    assert list(outside(IMPORTS + source + "\n"))


@pytest.mark.parametrize(
    "source",
    [
        "def f(p):\n    with foreign.reading(p, 'a', 'b'):\n        return json.loads(p.read_text())",
        "def f(p):\n    with foreign.reading(p, 'a', 'b'), gzip.open(p) as file:\n        return json.load(file)",
        "def f(p):\n    return foreign.apart(p, 'a', 'b', np.load, p)",
        "def _g(p):\n    return np.load(p)\ndef f(p):\n    return foreign.apart(p, 'a', 'b', _g, p)",
        "def _h(p):\n    return np.load(p)\ndef _g(p):\n    return _h(p)\ndef f(p):\n"
        "    with foreign.reading(p, 'a', 'b'):\n        return _g(p)",
        "def f(p):\n    return zipfile.ZipFile(p, 'w')",
        "def f(p) -> zipfile.ZipFile:\n    return p.loads('')",
    ],
)
def test_the_rule_allows_what_is_inside(source):
    assert not list(outside(IMPORTS + source + "\n"))
