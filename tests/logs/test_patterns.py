"""Expressions of settings mean what `re` means by them, and end: see tactile/settings/patterns.py."""

import itertools
import re
import time

import pytest
import yaml
from builders.project import ROOT

from tactile.logs import sniff
from tactile.settings import patterns

# In settings of documents, tests and recorded logs, and those that `check` proposes.
USED = [
    "/(.*)_",
    "(day.)",
    "flag",
    "",
    "Time,(.*)",
    "t (.*)",
    "a+",
    r"(anna_\d+)/",
    r"run(\d)",
    "(.*)",
    "()",
    sniff.CHECKSUM,
]
USED += [
    patterns.ZONE,
    re.escape("--- frame; é ~#&-"),
    re.escape("Time [s]: ") + "(.*)" + re.escape(" ok."),
    r"^\s*#.*",
]
USED += [
    "[]a]",
    "[^]a]",
    "[[]",
    "[[:alpha:]]+",
    "a{,3}",
    "a{,}",
    "x{,a",
    "[{,3}]",
    r"[\w.]+",
    r"[^\d_]",
    r"[\]a]",
    "[^^]",
]
USED += [r"\w+", r"\W", r"\d{2}", r"\D+$", r"\s+", r"\S+", "(?i)é+", r"(?P<n>\d+)_", "a|b|", r"[\D]", r"[\s,]+", r"\.$"]
TEXTS = [
    "bend/anna_0",
    "day1/jürgen_12",
    "12:00:00Z,1,2",
    "1,2+02:00",
    "1+02:001",
    "$GP,1,2*4F",
    "Time [s]: 1.5 ok.",
    "flag",
]
TEXTS += [
    "--- frame; é ~#&-",
    "Time,12.5",
    "t 3",
    "# é",
    "٣٤ µs\u00a0x\u2028y",
    "1,5\x1c2\x0b",
    "ÉÉé_",
    "a\tb  c.",
    "run1",
    "²½Ⅷ",
]


@pytest.mark.parametrize("pattern", USED)
def test_a_pattern_means_what_it_means_to_re(pattern):
    ours, theirs = patterns.compiled(pattern), re.compile(pattern)
    assert ours.groups == theirs.groups
    short = ("".join(some) for n in range(4) for some in itertools.product("a[]^:{,3}\\_.é", repeat=n))
    for text in itertools.chain(TEXTS, short):
        for found in ("search", "fullmatch"):
            one, other = getattr(ours, found)(text), getattr(theirs, found)(text)
            assert (one is None) == (other is None), (text, found)
            if other:
                assert one.span() == other.span() and one.groups() == other.groups(), text
        assert ours.sub("", text) == theirs.sub("", text), text


@pytest.mark.parametrize("name", [r"\w", r"\W", r"\d", r"\D", r"\s", r"\S"])
def test_a_class_has_the_characters_that_it_has_for_re(name):
    """Up to U+10FFF; the two have the letters of different years beyond that."""
    ours, theirs = patterns.compiled(name), re.compile(name)
    every = [chr(number) for number in range(0x11000) if not 0xD800 <= number < 0xE000]
    unlike = [one for one in every if (ours.fullmatch(one) is None) != (theirs.fullmatch(one) is None)]
    assert len(unlike) < 100 and all(ord(one) > 0x8FF for one in unlike)  # of the newest years


@pytest.mark.parametrize(
    "pattern", ["([0-9,]*)*x", r"(\d+,?)+z", "(a+)+$", "(x|x)*y", "(([a-z_0-9/]+)*)!", "(.*)*=(.*)*;"]
)
def test_a_pattern_that_never_ends_for_re_ends(pattern):
    begun = time.process_time()
    for line in ("1,2,3,4" * 2000, "a" * 14_000, "x" * 14_000):
        patterns.compiled(pattern).search(line + "-")
        patterns.compiled(pattern).sub("", line + "-")
    assert time.process_time() - begun < 1


@pytest.mark.parametrize(
    "pattern", ["(?=a)", "(?<!a)b", r"(a)\1", "(?P<a>1)(?P=a)", r"\bv", "a{1001}", r"[\W\d]", "(a", "a**"]
)
def test_what_cannot_be_searched_so_is_refused(pattern):
    with pytest.raises(ValueError, match="no regular expression|in a time that grows with the line alone"):
        patterns.compiled(pattern)


def test_zones_behind_times_end_too():
    begun = time.process_time()
    for text in ("1" * 2**20, "1+" * 2**19, "1+00:" * 2**18):
        patterns.compiled(patterns.ZONE).sub("", text)
    assert time.process_time() - begun < 1


def test_the_settings_of_the_repository_are_taken():
    """Also those of the documents: each block of YAML in docs that has an expression."""
    text = (ROOT / "docs" / "own_sensor.md").read_text()
    found = [
        yaml.safe_load(block)["split"]
        for block in re.findall(r"^split: \{.*?\}", text, re.MULTILINE)
        for block in [block]
    ]
    assert found and all(patterns.compiled(each["pattern"]).groups == 1 for each in found)
