"""Every command that a message, a document or dvc.yaml names can be given: its own parser takes these arguments.

The parser of a module is the one that its `main` makes. Of `{experiment}` and the like in a message only the place is
known: such a word can be any that the parser knows.
"""

import argparse
import ast
import importlib
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from builders.project import CODE, ROOT
from dvc.repo import Repo

from tactile.base import arguments, params
from tactile.base.imports import HOUSES
from tactile.base.paths import Workspace
from tactile.commands import command_line
from tactile.commands.command_line import COMMANDS

VALUES = params.load(ROOT / "params.yaml")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
TOOLS = sorted((ROOT / "tools").glob("[a-z]*.py"))
TEXTS = [*CODE, *TOOLS]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
DOCUMENTS += [*sorted((ROOT / "data").rglob("README.md")), *sorted((ROOT / "reports").rglob("*.md"))]
# A command ends with its line, its quotes, a comment behind it, or where the next one starts.
END = r"(?=[`\"\n#;,)]|\s\s|\.\s|\.$| && | again| says | first| with |$)"
MODULE = re.compile(r"python -m (?P<name>(?:pipeline|tactile|tools)\.[\w.{}<>]*[\w}>])(?P<arguments>.*?)" + END)
# `tactile` is an adjective, too: as a command it stands in backticks, or in a document at the start of a line.
TACTILE = re.compile(r"`tactile(?P<arguments> .*?)" + END)
TACTILE_LINE = re.compile(r"^ *tactile(?P<arguments> .*?)" + END, re.MULTILINE)
REPRO = re.compile(r"dvc repro(?P<arguments>.*?)" + END)
OPEN = re.compile(r"[{<].*|[A-Z_]+")  # a word that stands for others: {experiment}, <name>, MODEL
RUN = 'if __name__ == "__main__":'
PEOPLE = "tactile.commands.command_line"  # what `tactile` starts
STAGES = sorted(
    f"{room.replace('/', '.')}.{path.stem}"
    for room in ("pipeline/stages", "pipeline/studies", "tactile/stages")
    for path in (ROOT / room).glob("*.py")
    if RUN in path.read_text()
)
BY_HAND = [f"tools.{path.stem}" for path in TOOLS if RUN in path.read_text()]


def texts(path: Path) -> Iterator[tuple[str, bool]]:
    """Yield (text, whether it speaks of the code to its readers) of every string of a Python file, or of a document."""
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
            yield "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values), False


class Made(Exception):
    """The parser that a module's `main` would have used."""

    def __init__(self, parser: argparse.ArgumentParser):
        self.parser = parser


class Words(tuple):
    """The words that an argument may be, and those that stand for them in a text."""

    def __contains__(self, word: str) -> bool:
        return all(OPEN.fullmatch(part) or tuple.__contains__(self, part) for part in word.split("|"))


@cache
def parser_of(name: str) -> argparse.ArgumentParser | None:
    """Return the parser of a module that can be run, or None; its arguments may be words that stand for others."""
    if name == PEOPLE:
        parser = command_line.parser_of(COMMANDS)
        loosen(parser)
        return parser
    path = ROOT.joinpath(*name.split(".")).with_suffix(".py")
    if not path.is_file() or RUN not in path.read_text():
        return None
    if path in TOOLS:
        tool = importlib.import_module(name)
        parser = arguments.tool_parser(tool.__doc__, getattr(tool, "add_arguments", None))
        loosen(parser)
        return parser
    parses = re.search(r"arguments\.(parse|of_study)\(", path.read_text())
    assert parses, f"{path}: main calls neither arguments.parse nor of_study"

    def stop(parser: argparse.ArgumentParser, *given):
        raise Made(parser)

    with pytest.MonkeyPatch.context() as patch, pytest.raises(Made) as caught:
        patch.setattr(argparse.ArgumentParser, "parse_args", stop)
        importlib.import_module(name).main(Workspace(ROOT))
    loosen(caught.value.parser)
    return caught.value.parser


def loosen(parser: argparse.ArgumentParser) -> None:
    """Let words stand for others in the arguments of a parser and of its commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                loosen(command)
        elif action.choices is not None:
            action.choices = Words(action.choices)
        elif isinstance(action.type, arguments.OneOf):
            action.type.known = Words(action.type.known)
        elif action.type is int:
            action.type = lambda word: word if OPEN.fullmatch(word) else int(word)


def wrong_call(name: str, words: list[str], named_only: bool) -> str | None:
    """Return what is wrong with the call of a module with these words, or None; named_only: it need not be complete."""
    if any(OPEN.fullmatch(step) for step in name.split(".")):
        return None
    parser = parser_of(name)
    if parser is None:
        return "there is no such command"
    if named_only and len(words) <= (name == PEOPLE):
        return None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(argparse.ArgumentParser, "error", refuse)
        try:
            parser.parse_args(words)
        except InvalidCall as error:
            return str(error)
        except SystemExit:  # --help
            return None
    return None


class InvalidCall(Exception):
    """What a parser says of wrong arguments."""


def refuse(parser: argparse.ArgumentParser, message: str) -> None:
    """Take the place of ArgumentParser.error, which ends the process."""
    raise InvalidCall(message)


@cache
def targets() -> set[str]:
    """Return the names of DVC's stages, and of groups of them."""
    names = {name for name, _ in stages()}
    return names | {name.partition("@")[0] for name in names}


@cache
def stages() -> list[tuple[str, str]]:
    """Return (name, command) of every stage of dvc.yaml."""
    with Repo(str(ROOT)) as repo:
        commands = [(stage.addressing, stage.cmd) for stage in repo.index.stages]
    return [(name, one) for name, cmd in commands for one in ([cmd] if isinstance(cmd, str) else cmd)]


def words_of(arguments: str) -> list[str]:
    """Return the words of a call as a text shows it: what is in brackets may be left out."""
    return [word.strip("[]") for word in arguments.split()]


def wrong_commands(text: str, documented: bool, lines: bool = True) -> Iterator[str]:
    """Yield `<command>: <what is wrong>` of every command in a text; lines: `tactile` may start one."""
    calls = [(call, call["name"]) for call in MODULE.finditer(text)]
    calls += [(call, PEOPLE) for pattern in [TACTILE, TACTILE_LINE][: 1 + lines] for call in pattern.finditer(text)]
    for call, name in calls:
        if wrong := wrong_call(name, words_of(call["arguments"]), documented):
            yield f"{call[0]}: {wrong}"
    for call in REPRO.finditer(text):
        for target in call["arguments"].split():
            if not target.startswith("-") and target not in targets() and not OPEN.fullmatch(target):
                yield f"{call[0]}: dvc.yaml has no stage {target}"
    for file in re.findall(r"python (?:-m pytest )?(tests/[\w/.]+\w)", text):
        if not (ROOT / file).exists():
            yield f"{file}: there is no such file"
    for extra in re.findall(r"pip install [^`\n]*'?\.\[(\w+)\]", text):
        if extra not in PROJECT["optional-dependencies"]:
            yield f".[{extra}]: pyproject.toml has no such extra"


def test_every_command_can_be_given():
    wrong = [
        f"{path.relative_to(ROOT)}: {line}"
        for path in TEXTS + DOCUMENTS
        for text, documented in texts(path)
        for line in wrong_commands(text, documented, path.suffix == ".md")
    ]
    assert not wrong, "\n".join(dict.fromkeys(wrong))


def test_every_command_of_dvc_yaml_can_be_given():
    wrong = {name: list(wrong_commands(command, False)) for name, command in stages()}
    assert not any(wrong.values()), wrong


@pytest.mark.parametrize("call", [*STAGES, *BY_HAND, PEOPLE, *(f"{PEOPLE} {command}" for command in COMMANDS)])
def test_every_stage_and_command_has_help(call, capsys):
    name, *command = call.split()
    with pytest.raises(SystemExit) as ended:
        parser_of(name).parse_args([*command, "--help"])
    assert ended.value.code == 0
    assert "usage: " in capsys.readouterr().out


def test_the_installed_command_is_that_of_the_room():
    module, _, function = PROJECT["scripts"]["tactile"].partition(":")
    assert (module, function) == (PEOPLE, "main") and list(PROJECT["scripts"]) == ["tactile"]
    modules = {
        f"{house}.commands.{path.stem}" for house in HOUSES for path in (ROOT / house / "commands").glob("[a-z]*.py")
    }
    assert set(COMMANDS.values()) == modules - {PEOPLE}
    renamed = {"try": "quick_look", "import": "import_logs", "map": "map_elements"}  # words of Python itself
    assert all(
        module.rpartition(".")[2] == renamed.get(name, name.replace("-", "_")) for name, module in COMMANDS.items()
    )


@pytest.mark.parametrize("words", [[], ["--help"]])
def test_help_shows_groups_and_imports_no_heavy_library(words):
    code = (
        "import atexit, sys\n"
        "from tactile.commands.command_line import main\n"
        "atexit.register(lambda: print(sorted({name.partition('.')[0] for name in sys.modules})))\n"
        "main()"
    )
    done = subprocess.run([sys.executable, "-c", code, *words], capture_output=True, text=True, check=True, cwd=ROOT)
    said, _, imported = done.stdout.strip().rpartition("\n")
    places = [said.index(f"\n{heading}:\n") for heading in command_line.GROUPS]
    assert places == sorted(places)
    assert all(re.search(rf"^  {name} +\S", said, re.MULTILINE) for name in COMMANDS)
    assert not {"matplotlib", "mlflow", "numpy", "pandas", "pyarrow", "pydantic", "scipy", "sklearn", "torch"} & set(
        ast.literal_eval(imported)
    )


def called(monkeypatch, capsys, *words: str) -> tuple[str, str]:
    """Return what `tactile` with these words prints, on standard output and on standard error."""
    monkeypatch.setattr(sys, "argv", ["tactile", *words])
    command_line.main()
    return capsys.readouterr()


def test_the_version_names_the_commit(monkeypatch, capsys):
    said = called(monkeypatch, capsys, "--version")[0]
    assert re.match(rf"tactile {re.escape(PROJECT['version'])}, commit ([0-9a-f]{{40}}|unknown)", said)


@pytest.mark.parametrize(("word", "said"), [("predcit", "did you mean 'predict'?"), ("xyz", "known: demo, predict")])
def test_an_unknown_command_is_one_sentence(monkeypatch, capsys, word, said):
    with pytest.raises(SystemExit) as ended:
        called(monkeypatch, capsys, word)
    assert ended.value.code == 2
    assert capsys.readouterr().err.startswith(f"error: there is no command '{word}'; {said}")


@pytest.mark.parametrize("where", ["parser_of", "run_stage"])
def test_ctrl_c_prints_nothing(monkeypatch, capsys, where):
    def interrupted(*given):
        raise KeyboardInterrupt

    monkeypatch.setattr(command_line, where, interrupted)
    with pytest.raises(SystemExit) as ended:
        called(monkeypatch, capsys, "check", "data/own/none")
    assert ended.value.code == 130 and not "".join(capsys.readouterr())


@pytest.mark.parametrize("option", ["--json", "--quiet"])
def test_a_program_reads_json_or_nothing(monkeypatch, capfd, option):
    def talks(workspace, given):
        print("words")
        arguments.answer(given, {"ready": True})

    def parser_of(called):
        parser = argparse.ArgumentParser()
        arguments.add_root(parser)
        arguments.add_output(parser)
        parser.set_defaults(main=talks)
        parser.add_argument("command")
        return parser

    monkeypatch.setattr(command_line, "parser_of", parser_of)
    monkeypatch.setenv("TQDM_DISABLE", "")
    monkeypatch.setattr(sys, "__stdout__", sys.stdout)  # pytest has put another in its place
    out, err = called(monkeypatch, capfd, "check", option)
    assert (out, err) == (('{\n "ready": true\n}\n', "words\n") if option == "--json" else ("", ""))


@pytest.mark.parametrize(("terminal", "disabled"), [(True, ""), (False, "1")])
def test_bars_are_for_a_terminal(monkeypatch, capfd, terminal, disabled):
    """In a file each step of a bar is a line."""
    found = []

    def parser_of(called):
        parser = argparse.ArgumentParser()
        arguments.add_root(parser)
        parser.set_defaults(main=lambda *given: found.append(os.environ["TQDM_DISABLE"]))
        parser.add_argument("command")
        return parser

    monkeypatch.setattr(command_line, "parser_of", parser_of)
    monkeypatch.setenv("TQDM_DISABLE", "")
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    called(monkeypatch, capfd, "track")
    assert found == [disabled]


@pytest.mark.parametrize(
    "text",
    [
        "x; run `python -m pipeline.pretrain` first",
        "`python -m tactile.stages.ingest tuch`",
        "`python -m tactile.stages.train tuch`",
        "`python -m tactile.stages.train touch esn`",
        "`python -m tactile.commands.fetch velostat_recorded`",
        "python -m tools.calibrate tuch && dvc repro",
        "run `dvc repro train@touch@lomp` again",
        "dvc repro render@touch && dvc repro rendr",
        "run `tactile fecth velostat_recorded`",
        "`tactile check tuch FOLDER`",
        "python tests/kil.py",
        "pip install -c constraints.txt -e '.[claster]'",
    ],
)
def test_a_wrong_command_is_seen(text):
    assert list(wrong_commands(text, False))


@pytest.mark.parametrize(
    "text",
    [
        "run `python -m tactile.stages.ingest {}` again",
        "python -m tactile.stages.train EXPERIMENT",
        "run `tactile fetch {}`, which",
        "the tactile images of `glove`",
        "tactile record /dev/ttyUSB0 array.log --baud 115200",
        "tactile check touch|strain|glove FOLDER",
        "dvc repro",
        "dvc repro evaluate@touch train@strain",
        "`python tests/kill.py`, `python -m pytest benchmarks`",
        "pip install -q -c constraints.txt -e '.[test]' && python -m pytest",
    ],
)
def test_a_right_command_is_let_pass(text):
    assert not list(wrong_commands(text, False))


@pytest.mark.parametrize("experiment", VALUES["experiments"])
def test_the_command_that_trains_the_models_can_be_given(experiment):
    assert not list(wrong_commands(params.training_command(experiment), False))


def test_the_readme_has_the_command_that_ci_runs():
    program = re.search(r"awk '([^']*)' README\.md", (ROOT / ".ci" / "run").read_text())[1]
    found = subprocess.run(["awk", program, "README.md"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "pip install" in found and "python -m pytest" in found and found.count("\n") == 1
