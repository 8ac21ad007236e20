"""Names that a user chose stand in tables and sentences as they are."""

import re
from html import escape, unescape
from urllib.parse import urlsplit

import pytest
from builders import own_logs

from pipeline.reporting.page import hypertext
from tactile.drawing import markdown

NAMES = (*own_logs.NAMES, "``x`", "&amp;", "~~a~~ **b** __c__", "<script>alert(1)</script>", "a\\|b|", "$x$")


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_a_name_in_a_table_is_shown_as_it_is(name):
    shown = markdown.literal(name)
    text = markdown.table(["Model", shown, "other"], [["LoMP", "1", "2"], [shown, "3", "4"]])
    assert len({len(line) for line in text.splitlines()}) == 1
    html = hypertext.markdown(text, "Table")
    assert html.count("<table") == 1 and "<script" not in html
    head = re.findall("<th[^>]*>(.*?)</th>", html)
    first = re.findall("<tr>\\s*<td[^>]*>(.*?)</td>", html)
    cells = [unescape(cell) for cell in (head[1], first[1])]
    assert (len(head), cells) == (3, [name, name])


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_a_name_in_a_sentence_is_shown_as_it_is(name):
    html = hypertext.markdown(f"- Object {markdown.literal(name)}.", "")
    assert f"Object {escape(name)}." in html


@pytest.mark.parametrize(
    "address", ["./javascript:alert(1)", "a/../javascript:alert(1)", "./data:text/html,x", ".//vbscript:x"]
)
def test_an_address_of_a_file_stays_one(address):
    """markdown-it judges it as it is written; joined to a folder and normalised it must not become a program."""
    (link,) = re.findall('href="([^"]*)"', hypertext.markdown(f"[x]({address})", ""))
    assert not urlsplit(link).scheme
