"""`tactile help COMMAND`: usage lines that can be typed, examples that are right, near words for wrong ones."""

import ast
import re
import shlex
import subprocess
import sys

import pytest
from builders.project import ROOT

from tactile.commands import command_line, models
from tactile.commands.command_line import COMMANDS

EXAMPLES = re.compile(r"\nExamples:\n\n((?:    .+\n?)+)\Z")


def run(*words: str) -> subprocess.CompletedProcess:
    code = (
        f"import sys; sys.argv = ['tactile', *{list(words)!r}]\nfrom tactile.commands.command_line import main; main()"
    )
    return subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_has_a_usage_line_to_type_and_examples_that_its_parser_takes(name):
    parser = command_line.parser_of([name])
    (commands,) = (action for action in parser._actions if getattr(action, "choices", None))
    command = commands.choices[name]
    assert command.format_usage().startswith(f"usage: tactile {name} [-h]")
    text = ast.get_docstring(ast.parse((ROOT / f"{COMMANDS[name].replace('.', '/')}.py").read_text()))
    assert command.description == text
    examples = EXAMPLES.search(text)
    assert examples, f"{name}: the docstring does not end with examples"
    for line in examples[1].splitlines():
        words = shlex.split(line)
        assert words[:2] == ["tactile", name]
        parser.parse_args(words[1:])


def test_help_is_the_help_of_a_command():
    said, other = run("help", "inspect"), run("inspect", "--help")
    assert said.returncode == 0 and said.stdout == other.stdout and "tactile inspect pretrained" in said.stdout
    whole = run("help")
    assert whole.returncode == 0 and whole.stdout == run().stdout
    assert all(f"\n  {name} " in whole.stdout for name in COMMANDS)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["help", "predic"], "error: there is no command 'predic'; did you mean 'predict'?"),
        (["fetch", "glove_recordd"], "there is no source 'glove_recordd'; did you mean 'glove_recorded'?"),
        (["check", "toch", "data/sample"], "there is no sensor 'toch'; did you mean 'touch'?"),
        (["import", "a.csv", "data/own/a/b/c", "--of", "strai"], "there is no sensor 'strai'; did you mean 'strain'?"),
    ],
)
def test_a_wrong_word_is_named_with_the_near_one(words, sentence):
    said = run(*words)
    assert said.returncode == 2 and sentence in said.stderr and said.stderr.count("\n") < 8


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["predict", "touch/lomp_stream", "nowhere"], r"/.*/nowhere: not found; name a log, or .*"),
        (["live", "touch/lomp_stream", "--replay", "nowhere"], "nowhere: log not found; name a recorded log .*"),
    ],
)
def test_absent_logs_are_said_before_torch_is_loaded(words, sentence):
    code = (
        f"import sys; sys.argv = ['tactile', *{words!r}]\n"
        "from tactile.commands.command_line import main\n"
        "try:\n    main()\nfinally:\n    assert 'torch' not in sys.modules"
    )
    said = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert said.returncode == 1 and re.fullmatch(f"error: {sentence}\n", said.stderr)


def test_models_are_listed_with_what_they_take_give_and_scored(capsys, tmp_path):
    workspace = models.Workspace(ROOT)
    listed = {name: models.described(name, folder) for name, folder in models.packages(workspace)}
    assert set(listed) >= {"touch/lomp_stream", "strain/lstm_direct", "glove/sp_resnet"}
    assert listed["touch/lomp_stream"]["takes"] == "25 counts" and listed["touch/lomp_stream"]["gives"] == "kPa"
    assert re.fullmatch(r"rmse [\d.]+ kPa \(double, press\)", listed["touch/lomp_stream"]["scores"])
    broken = tmp_path / "pretrained" / "touch" / "broken"
    broken.mkdir(parents=True)
    (broken / "card.json").write_text("{}")
    ((name, folder),) = models.packages(models.Workspace(tmp_path))
    assert name == "touch/broken" and "network.safetensors" in models.described(name, folder)["problem"]
