"""Nothing that a file says is ever executed: rules about the code, found by parsing it."""

import ast
import re

import pytest
import yaml
from builders.project import CODE, ROOT

UNSAFE_MODULES = set("pickle cPickle _pickle dill cloudpickle joblib shelve marshal shutil.unpack_archive".split())
UNSAFE_MODULES |= set("tarfile xmlrpc xml.sax xml.dom lxml telnetlib ftplib imp code".split())
UNSAFE_CALLS = set("eval exec compile __import__ os.system os.popen os.execv os.execvp tempfile.mktemp".split())
UNSAFE_CALLS |= set("torch.load torch.save torch.jit.load sklearn.externals.joblib ElementTree.parse".split())
UNSAFE_CALLS |= set("yaml.load yaml.load_all yaml.full_load yaml.unsafe_load yaml.FullLoader yaml.Loader".split())
UNSAFE_CALLS |= set("pd.read_pickle pandas.read_pickle shutil.unpack_archive".split())
UNSAFE_CALLS |= set("subprocess.getoutput subprocess.getstatusoutput".split())


def dotted(node) -> str:
    """`a.b.c` of an expression, '' for anything else."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def unsafe(source: str) -> list[str]:
    """What a piece of code does that could execute data, each with its line."""
    found = []
    for node in ast.walk(ast.parse(source)):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
        found += [(node.lineno, name) for name in names if name in UNSAFE_MODULES | UNSAFE_CALLS]
        if isinstance(node, ast.Call):
            name, keywords = dotted(node.func), {word.arg: word.value for word in node.keywords}
            if name in UNSAFE_CALLS:
                found.append((node.lineno, name))
            if name.startswith("subprocess.") and (
                "shell" in keywords or not isinstance(node.args[0], ast.List | ast.Name)
            ):
                found.append((node.lineno, f"{name} with a shell or a text"))
            if name.endswith((".extract", ".extractall")):
                found.append((node.lineno, name))
            allowed = keywords.get("allow_pickle")
            if allowed is not None and not (isinstance(allowed, ast.Constant) and allowed.value is False):
                found.append((node.lineno, "allow_pickle"))
            if name == "skops.io.load" and "trusted" not in keywords:
                found.append((node.lineno, "skops.io.load without trusted"))
    return [f"line {line}: {what}" for line, what in found]


def test_no_file_executes_what_it_reads():
    found = {path.relative_to(ROOT).as_posix(): unsafe(path.read_text()) for path in CODE}
    runs = found.pop("tactile/settings/models.py")  # the class Settings of models of this package, which are code
    assert {line.partition(": ")[2] for line in runs} == {"exec", "compile"}
    assert len(found) > 100 and not {path: lines for path, lines in found.items() if lines}


@pytest.mark.parametrize(
    "source",
    [
        "import pickle",
        "from joblib import load",
        "import torch\ntorch.load('a.pt')",
        "from torch import load",
        "import yaml\nyaml.load('a', yaml.Loader)",
        "eval('1')",
        "import subprocess\nsubprocess.run('ls', shell=True)",
        "import subprocess\nsubprocess.run(f'ls {name}')",
        "import os\nos.system('ls')",
        "import zipfile\nzipfile.ZipFile('a').extractall('b')",
        "import numpy as np\nnp.load('a', allow_pickle=True)",
        "import skops.io\nskops.io.load('a')",
    ],
)
def test_the_rule_sees_what_it_forbids(source):
    assert unsafe(source + "\n")


def test_trusted_types_are_named_one_by_one():
    """skops loads the types that it knows and those that a model names; never all that a file asks for."""
    for path in CODE:
        source = path.read_text()
        assert "get_untrusted_types" not in source and "trusted=True" not in source, path
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.keyword) and node.arg == "trusted" and isinstance(node.value, ast.Tuple | ast.List):
                assert all(isinstance(one, ast.Constant) for one in node.value.elts), path


def test_analytics_are_off_and_mlflows_pages_are_served_on_loopback():
    config = (ROOT / ".dvc" / "config").read_text()
    assert re.search(r"analytics\s*=\s*false", config)
    store, track = ROOT / "tactile" / "inference" / "mlflow_store.py", ROOT / "pipeline" / "commands" / "track.py"
    assert "tactile track --serve" in (ROOT / "docs" / "runs.md").read_text()
    assert re.search(r'^UI = "http://127\.0\.0\.1:\d+"', store.read_text(), re.MULTILINE)
    assert re.search(r'"mlflow", "ui", .*"--host", host', track.read_text())
    assert all("MLFLOW_DISABLE_TELEMETRY" in path.read_text() for path in (store, track))


def test_settings_are_plain_data():
    """params.yaml holds no tag that would make YAML build an object."""
    for name in ("params.yaml", "dvc.yaml", "evidence/dvc.yaml", "evidence/shards.yaml"):
        tokens = yaml.scan((ROOT / name).read_text())
        assert not [token for token in tokens if isinstance(token, yaml.TagToken)], name
