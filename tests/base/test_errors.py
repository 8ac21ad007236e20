"""What surrounds a command ends in no traceback: closed pipes, encodings, python -OO, a notebook's plots."""

import errno
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from builders.project import ROOT

from tactile.base import errors
from tactile.base.errors import InputError

RUN = """
import sys
from pathlib import Path
from tactile.base.errors import run_stage
run_stage(lambda: [print("größe 双指", k) for k in range(int(sys.argv[1]))], Path("none"))
"""


def ran(code, *arguments, **environment):
    """Start a program with other variables of its surroundings."""
    return subprocess.Popen(
        [sys.executable, *code, *arguments],
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def test_a_message_of_several_lines_becomes_one_line():
    assert str(InputError("a\n b")) == "a b"


def test_a_name_that_the_encoding_lacks_is_printed_escaped():
    said, wrong = ran(["-c", RUN], "1", PYTHONIOENCODING="cp1252").communicate()
    assert said.decode("cp1252").split() == ["größe", "\\u53cc\\u6307", "0"] and not wrong


def test_who_closes_the_pipe_hears_no_more():
    process = ran(["-c", RUN], "100000")
    process.stdout.readline()
    process.stdout.close()
    assert process.stderr.read() == b"" and process.wait() == 141
    process.stderr.close()


@pytest.mark.parametrize("name", ["ENAMETOOLONG", "ELOOP", "ENOTDIR", "EISDIR"])
def test_a_name_that_the_system_refuses_is_a_sentence(name, capsys):
    def stage():
        raise OSError(getattr(errno, name), "x", "a" * 300)

    with pytest.raises(SystemExit) as ended:
        errors.run_stage(stage, Path("none"))
    said = os.strerror(getattr(errno, name))
    assert str(ended.value).startswith("error: aaa") and said in str(ended.value) and len(str(ended.value)) < 300


@pytest.mark.parametrize("error", [OSError(errno.ENOTDIR, "x"), OSError("x"), ValueError("x"), KeyError("x")])
def test_an_error_that_names_no_file_keeps_its_traceback(error):
    def stage():
        raise error

    with pytest.raises(type(error)):
        errors.run_stage(stage, Path("none"))


OF_ALL, OF_CHECK = b"Predict with trained models", b"Read a folder of your own logs"
SLOW = pytest.mark.slow  # -OO compiles torch and all else that `check` imports, where no bytecode of it is kept


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--help"], OF_ALL),
        ([], OF_ALL),
        (["record", "--help"], b"Record what devices print on serial ports"),
        pytest.param(["check", "--help"], OF_CHECK, marks=SLOW),
    ],
)
def test_help_stands_without_docstrings_and_in_a_notebook(arguments, words):
    backend = {"MPLBACKEND": "module://not_installed.backend"}
    said, wrong = ran(["-OO", "-m", "tactile.commands.command_line"], *arguments, **backend).communicate()
    assert b"usage: tactile" in said and words in said and not wrong


def test_a_matplotlibrc_changes_no_figure(tmp_path):
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nfont.size: 30\n")
    style = "from tactile.drawing.style import plt"
    code = f"{style}; print(plt.rcParams['text.usetex'], plt.rcParams['font.size'])"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True
    )
    assert done.stdout.split() == [b"False", b"9.0"]


def test_a_command_without_standard_output_runs():
    code = [sys.executable, "-c", RUN, "3"]
    shell = f"exec {' '.join(map(shlex.quote, code))} >&-"
    done = subprocess.run(["sh", "-c", shell], env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True)
    assert done.returncode == 0 and not done.stderr


@pytest.mark.parametrize(
    ("absent", "extra"),
    [("torch", "train"), ("onnx", "onnx"), ("mlflow.entities", "reproduction"), ("distributed", "cluster")],
)
def test_a_library_of_an_extra_that_is_absent_is_named_with_the_smallest_extra_that_has_it(absent, extra, tmp_path):
    def main():
        raise ModuleNotFoundError(f"No module named '{absent}'", name=absent)

    install = f"run `pip install -c constraints.txt -e '.[{extra}]'`"
    with pytest.raises(SystemExit, match=re.escape(f"error: {absent.partition('.')[0]} is not installed; {install}")):
        errors.run_stage(main, tmp_path / "params.yaml")


def test_a_module_that_no_extra_has_is_a_fault_of_the_code(tmp_path):
    def main():
        raise ModuleNotFoundError("No module named 'pipeline.absent'", name="pipeline.absent")

    with pytest.raises(ModuleNotFoundError):
        errors.run_stage(main, tmp_path / "params.yaml")
