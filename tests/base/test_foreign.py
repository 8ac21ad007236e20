"""The door for bytes of other programs: limits of size, memory and time, and one sentence for any end."""

import io
import os
import re
import struct
import threading
import time
import zipfile
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from tactile.base import foreign
from tactile.base.errors import InputError
from tactile.own import tables


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


ON_LINUX = pytest.mark.skipif(not Path("/proc/self/statm").is_file(), reason="memory is limited on Linux only")
LIMITS = {"memory": 64 << 20, "seconds": 20}


def takes(memory):
    return len(bytes(memory))


def sleeps():
    time.sleep(600)


def refuses():
    raise InputError("a.csv: no; do")


def fails():
    raise UnboundLocalError("of\x1b\na library")


def number():
    return os.getpid()


def apart(function, *arguments, **limits):
    return foreign.apart("a.npz", "whole", "get it again", function, *arguments, **(LIMITS | limits))


def test_one_process_reads_file_after_file():
    first = apart(number)
    for function, said in ((refuses, "a.csv: no; do"), (fails, "a.npz: not whole (of  a library); get it again")):
        with pytest.raises(InputError) as error:
            apart(function)
        assert str(error.value) == said
    assert apart(number) == first != os.getpid()


@ON_LINUX
def test_memory_has_a_limit():
    assert apart(takes, 32 << 20) == 32 << 20
    with pytest.raises(
        InputError, match="a.npz: takes more than 64 MiB of memory to read, and the data cannot need that;"
    ):
        apart(takes, 256 << 20)
    assert apart(takes, 32 << 20)  # the next file has a process again


@pytest.mark.parametrize("ends", [os.abort, sleeps])
def test_a_crash_and_a_reader_without_end_are_sentences(ends):
    begun = time.monotonic()
    with pytest.raises(
        InputError, match=r"not whole \(it crashes the reader\)|takes more than 2 s to read; get it again"
    ):
        apart(ends, seconds=2)
    assert time.monotonic() - begun < 300 and apart(number)


def test_an_answer_that_nobody_waits_for_is_not_the_next_ones(monkeypatch):
    reader = foreign._reader(os.getpid())
    with monkeypatch.context() as patch:
        patch.setattr(type(reader), "asked", lambda self, seconds, *call: (self._ours.send(call), 1 / 0))
        with pytest.raises(ZeroDivisionError):  # as Ctrl-C
            apart(takes, 17)
    assert apart(takes, 5) == 5


def test_threads_wait_for_each_other():
    found = {}
    threads = [threading.Thread(target=lambda k=k: found.update({k: apart(takes, k)})) for k in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == {k: k for k in range(6)}


def test_a_fork_has_a_process_of_its_own():
    ours = apart(number)
    reading, writing = os.pipe()
    if not (child := os.fork()):
        os.write(writing, str(apart(number)).encode())
        foreign._reader(os.getpid()).end()
        os._exit(0)
    os.waitpid(child, 0)
    assert int(os.read(reading, 20)) != ours == apart(number)


@pytest.fixture(scope="module")
def bombs(tmp_path_factory):
    """Return a folder with a.npz and a.xlsx, some 100 kB that unpack to 128 MB."""
    folder = tmp_path_factory.mktemp("bombs")
    np.savez_compressed(folder / "a.npz", t=np.zeros(1 << 24))
    book = openpyxl.Workbook()
    book.active.append([1, 2])
    book.save(small := io.BytesIO())
    with zipfile.ZipFile(small) as former, zipfile.ZipFile(folder / "a.xlsx", "w", zipfile.ZIP_DEFLATED) as new:
        for name in former.namelist():
            new.writestr(name, former.read(name) + (b" " * (1 << 27) if "sheet1" in name else b""))
    return folder


@pytest.mark.parametrize("name", ["a.npz", "a.xlsx"])
def test_an_archive_that_says_that_it_unpacks_to_far_more_is_refused_at_once(name, bombs, tmp_path):
    begun = time.process_time()
    with pytest.raises(
        InputError, match=rf"{name}: its \d+ bytes unpack to 1342?\d+, and readings do not shrink to 1/200;"
    ):
        tables.text_of(bombs / name, tmp_path)
    assert time.process_time() - begun < 1


@pytest.mark.parametrize("name", ["a.npz", "a.xlsx"])
def test_an_archive_whose_directory_lies_is_refused(name, bombs, tmp_path):
    data = bytearray((bombs / name).read_bytes())
    at = -1
    while (at := data.find(b"PK\x01\x02", at + 1)) >= 0:
        data[at + 24 : at + 28] = struct.pack("<I", min(1000, *struct.unpack("<I", data[at + 24 : at + 28])))
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=f"{name}: not a whole "):
        tables.text_of(tmp_path / name, tmp_path)


@ON_LINUX
def test_an_array_that_says_to_have_more_numbers_than_it_has_is_refused(tmp_path, monkeypatch):
    """The head of an array in an archive tells how much memory numpy takes, whatever follows it."""
    monkeypatch.setattr(tables, "LIMITS", {"memory": 256 << 20, "seconds": 20})
    np.save(head := io.BytesIO(), np.zeros(3))
    lies = head.getvalue().replace(b"(3,), }" + b" " * 10, b"(999999999,), }  "[:17])
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("t.npy", lies)
    with pytest.raises(InputError, match="a.npz: takes more than 256 MiB of memory to read"):
        tables.text_of(tmp_path / "a.npz", tmp_path)


def test_readings_that_pack_well_are_read(tmp_path):
    """Zeros with a touch now and then: a sensor at rest, 40 times smaller when packed."""
    values = np.zeros((300_000, 25))
    values[::1000] = np.random.default_rng(0).normal(size=(300, 25))
    np.savez_compressed(tmp_path / "a.npz", t=np.arange(300_000) / 100, v=values)
    assert values.nbytes > 40 * (tmp_path / "a.npz").stat().st_size
    foreign.check_archive(tmp_path / "a.npz", "whole", "get it again")


def test_a_sentence_shows_no_sign_that_a_terminal_obeys():
    said = str(InputError("a: \x1b[31m\u202e\x07 b\r\n  c\u2028d \ud800"))
    assert said == r"a: \x1b[31m\u202e\x07 b c\u2028d \ud800" and said.isprintable()
