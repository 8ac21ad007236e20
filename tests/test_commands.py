"""Every command that a message or a document names can be given: the module is there, takes these arguments.

How a module is called is what its own docstring says. Of `{experiment}` and the like in a message only the number is
known.
"""

import ast
import re
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from builders.project import ROOT
from dvc.repo import Repo

from pipeline.base import params
from pipeline.logs import sources

VALUES = params.load()
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
CODE = sorted((ROOT / "pipeline").rglob("*.py"))
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "data").rglob("README.md")), *sorted((ROOT / "reports").rglob("*.md"))]
# A command ends with its line, its quotes, a comment behind it, or where the next one starts.
END = r"(?=[`\"\n#;,)]|\s\s|\.\s|\.$| && | again| says | first| with |$)"
MODULE = re.compile(r"python -m pipeline\.(?P<name>[\w{}<>]+(?:\.[\w{}<>]+)*)(?P<arguments>.*?)" + END)
REPRO = re.compile(r"dvc repro(?P<arguments>.*?)" + END)
OPEN = re.compile(r"[{<].*|[A-Z]+")  # a word that stands for others: {experiment}, <name>, MODEL
ANYTHING = {"FOLDER", "PORT", "FILE", "N"}


def texts(path: Path) -> Iterator[tuple[str, bool]]:
    """(text, whether it speaks of the code to its readers) of every string of a Python file, or of a document."""
    if path.suffix == ".md":
        yield path.read_text(encoding="utf-8"), False
        return
    tree = ast.parse(path.read_text(encoding="utf-8"))
    skipped, documented = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.FunctionDef, ast.ClassDef)) and ast.get_docstring(node):
            documented.add(node.body[0].value)
        elif isinstance(node, ast.JoinedStr):
            skipped |= set(node.values)
        elif isinstance(node, ast.keyword) and node.arg == "prog":
            skipped.add(node.value)
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in skipped:
            yield node.value, node in documented
        elif isinstance(node, ast.JoinedStr):
            yield "".join(one.value if isinstance(one, ast.Constant) else "{}" for one in node.values), False


def file_of(name: str) -> Path:
    """Return the file of the module `pipeline.<name>`."""
    return ROOT.joinpath("pipeline", *name.split(".")).with_suffix(".py")


@cache
def usages(name: str) -> list[list[str]]:
    """The arguments, word by word, of every call of a module that its docstring shows."""
    docstring = ast.get_docstring(ast.parse(file_of(name).read_text())) or ""
    calls = []
    for found in MODULE.finditer(docstring):
        if found["name"] == name:
            words = found["arguments"].split()
            calls += [" ".join(words).partition("[")[0].split(), [word.strip("[]") for word in words]]
    return [list(call) for call in dict.fromkeys(map(tuple, calls))]


def fits(word: str, wanted: str, before: list[str]) -> bool:
    """Whether a word of a command can stand for one of its usage; `before`: the words before it."""
    known = set()
    for choice in wanted.split("|"):
        known |= {"EXPERIMENT": set(VALUES["experiments"]), "NAME": set(sources.SOURCES)}.get(choice, {choice})
        if choice == "MODEL" and before[-1] in VALUES["experiments"]:
            known |= set(VALUES[before[-1]]["models"])
    return wanted in ANYTHING or all(OPEN.fullmatch(part) or part in known for part in word.split("|"))


def wrong_call(name: str, arguments: list[str], named_only: bool) -> str | None:
    """What is wrong with `python -m pipeline.<name> <arguments>`, or None; named_only: it need not be complete."""
    if any(OPEN.fullmatch(part) for part in name.split(".")):
        return None
    path = file_of(name)
    if not path.is_file() or "__main__" not in path.read_text():
        return "there is no such command"
    if named_only and not arguments:
        return None
    for usage in usages(name):
        pairs = list(zip(arguments, usage, strict=False))
        if len(arguments) == len(usage) and all(fits(*pair, arguments[:k]) for k, pair in enumerate(pairs)):
            return None
    return f"it is called as {[' '.join(words) for words in usages(name)]}"


@cache
def targets() -> set[str]:
    """Return the names of DVC's stages, and of groups of them."""
    with Repo(str(ROOT)) as repo:
        names = {stage.addressing for stage in repo.index.stages}
    return names | {name.partition("@")[0] for name in names}


def wrong_commands(text: str, documented: bool) -> Iterator[str]:
    """`<command>: <what is wrong>` of every command in a text."""
    for found in MODULE.finditer(text):
        arguments = [word.strip("[]") for word in found["arguments"].split()]
        if wrong := wrong_call(found["name"], arguments, documented):
            yield f"{found[0]}: {wrong}"
    for found in REPRO.finditer(text):
        for target in found["arguments"].split():
            if target not in targets() and not OPEN.fullmatch(target):
                yield f"{found[0]}: dvc.yaml has no stage {target}"
    for file in re.findall(r"python (?:-m pytest )?(tests/[\w/.]+\w)", text):
        if not (ROOT / file).exists():
            yield f"{file}: there is no such file"
    for extra in re.findall(r"pip install [^`\n]*'?\.\[(\w+)\]", text):
        if extra not in EXTRAS:
            yield f".[{extra}]: pyproject.toml has no such extra"


@pytest.mark.parametrize("path", CODE + DOCUMENTS, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_command_can_be_given(path):
    wrong = [line for text, documented in texts(path) for line in wrong_commands(text, documented)]
    assert not wrong, "\n".join(dict.fromkeys(wrong))


@pytest.mark.parametrize(
    "text",
    [
        "x; run `python -m pipeline.pretrain` first",
        "run `python -m pipeline.stages.ingest` again",
        "`python -m pipeline.stages.ingest tuch`",
        "`python -m pipeline.stages.train touch esn`",
        "`python -m pipeline.stages.train touch`",
        "`python -m pipeline.base.files`",
        "python -m pipeline.commands.scale fulll && dvc repro",
        "run `dvc repro train` again",
        "dvc repro render@tuch      # a comment",
        "dvc repro render@touch && dvc repro rendr",
        "python -m pipeline.commands.fetch velostat",
        "python -m pipeline.stages.agreement acept",
        "python tests/kil.py",
        "FUZZ=10 python -m pytest tests/test_fault.py` tries",
        "pip install -c constraints.txt -e '.[claster]'",
    ],
)
def test_a_wrong_command_is_seen(text):
    assert list(wrong_commands(text, False))


@pytest.mark.parametrize(
    "text",
    [
        "run `python -m pipeline.stages.ingest {}` again",
        "python -m pipeline.stages.train touch lomp",
        "python -m pipeline.stages.train_series strain model_zero",
        "python -m pipeline.commands.fetch velostat_recorded --from FOLDER",
        "python -m pipeline.commands.record /dev/ttyUSB0 array.log --baud 115200",
        "python -m pipeline.stages.agreement",
        "python -m pipeline.stages.agreement accept",
        "dvc repro",
        "dvc repro evaluate",
        "dvc repro evaluate@touch render_strain",
        "`python tests/kill.py`, `python -m pytest tests/benchmarks`",
        "pip install -q -c constraints.txt -e '.[test]' && python -m pytest",
    ],
)
def test_a_right_command_is_let_pass(text):
    assert not list(wrong_commands(text, False))


@pytest.mark.parametrize("experiment", VALUES["experiments"])
def test_the_command_that_trains_a_model_can_be_given(experiment):
    for model in VALUES[experiment]["models"]:
        assert not list(wrong_commands(params.training_command(experiment, model), False))


def test_a_group_of_stages_is_a_target_for_dvc():
    with Repo(str(ROOT)) as repo:
        assert {stage.name for stage in repo.stage.collect("evaluate")} == {
            f"evaluate@{experiment}" for experiment in VALUES["experiments"]
        }
