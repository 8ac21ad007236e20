"""Whatever a reader of foreign bytes raises becomes one sentence."""

import re

import pytest

from pipeline.base import foreign
from pipeline.base.errors import InputError


class Odd(Exception):
    """An exception that says nothing."""


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (ValueError("bad\x1b[31m\nheader"), "not a whole table (bad [31m header); save it again"),
        (Odd(), "not a whole table (Odd); save it again"),
        (RecursionError("deep"), "not a whole table (deep); save it again"),
        (PermissionError(13, "Permission denied", "a.csv"), "not a whole table (Permission denied); save it again"),
        (FileNotFoundError(2, "x", "a.csv"), "not found; save it again"),
        (MemoryError(), "takes more memory to read than there is; save it again"),
        (ValueError("x" * 100_000), f"not a whole table ({'x' * foreign.QUOTED}); save it again"),
    ],
)
def test_an_exception_is_one_sentence(error, sentence):
    with pytest.raises(InputError, match=f"^{re.escape(f'a.csv: {sentence}')}$"):
        with foreign.reading("a.csv", "a whole table", "save it again"):
            raise error


def test_what_is_known_already_passes_as_it_is():
    with pytest.raises(InputError, match="^b.csv: no rows$"):
        with foreign.reading("a.csv", "a whole table", "save it again"):
            raise InputError("b.csv: no rows")


@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, GeneratorExit])
def test_what_ends_the_program_is_no_fault_of_the_file(error):
    with pytest.raises(error), foreign.reading("a.csv", "a whole table", "save it again"):
        raise error


def test_a_file_that_is_too_large_is_not_read(tmp_path):
    (path := tmp_path / "a.csv").write_text("12345")
    with foreign.reading(path, "a table", "look", largest=5):
        pass
    with pytest.raises(InputError, match=r"a.csv: 5 bytes are more than a table can have \(4\); look"):
        with foreign.reading(path, "a table", "look", largest=4):
            pytest.fail("it was read")
