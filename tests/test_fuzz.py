"""A second of tests/fuzz.py for each kind of bytes that other people may hand over."""

import fuzz
import pytest

ATTEMPTS = {"live": 4, "logs": 30, "imports": 60, "layouts": 30, "cards": 60}  # of the others 100


@pytest.mark.parametrize("kind", sorted(fuzz.KINDS))
def test_damaged_bytes_end_in_a_sentence_or_are_read(kind):
    found = fuzz.run(kind, seed=1, attempts=ATTEMPTS.get(kind, 100))
    assert found.tried == ATTEMPTS.get(kind, 100) and not found.wrong, found.wrong
    assert found.sentences + found.whole == found.tried


def raises(kind):
    def call():
        raise kind("x")

    return call


@pytest.mark.parametrize("error", [KeyError, MemoryError, RecursionError, AssertionError])
def test_the_fuzzer_sees_a_traceback(error):
    found = fuzz.Found()
    assert error.__name__ in fuzz.attempt(found, raises(error)) and (found.tried, found.sentences, found.whole) == (
        1,
        0,
        0,
    )


def test_the_fuzzer_sees_a_hang(monkeypatch):
    monkeypatch.setattr(fuzz, "LONGEST_S", 0.2)
    monkeypatch.setitem(fuzz.KINDS, "endless", lambda work: lambda rnd: ("x", b"", endless))
    monkeypatch.setattr(fuzz, "KEPT", fuzz.KEPT / "of_test")
    found = fuzz.run("endless", seed=0, attempts=1)
    assert [what.split()[0] for what in found.wrong] == ["hang"]


def endless():
    while True:
        pass


@pytest.mark.parametrize("change", sorted(fuzz.WITHOUT_EFFECT))
def test_a_change_that_must_not_matter_changes_the_bytes_alone(change):
    clean = b"".join(
        line for line in fuzz.touch_log(300).splitlines(True) if line[:1].isdigit() and line.count(b",") == 25
    )
    assert fuzz.WITHOUT_EFFECT[change](clean, fuzz.random.Random(0)) != clean
