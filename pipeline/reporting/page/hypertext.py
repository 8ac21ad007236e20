"""Turn tables, figures and Markdown into HTML by the templates of this folder; text is escaped unless it is Markup."""

import posixpath
import re
import struct
from collections.abc import Mapping
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markdown_it import MarkdownIt
from markupsafe import Markup, escape

from pipeline.claims.rules import BAD, BEYOND, CALIBRATED, GOOD, OUTSIDE, UNDECIDED
from tactile.base import paths
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

FOLDER = Path(__file__).parent
# Verdict -> a class of page.css, and a sign for those who do not see colours.
SIGNS = dict.fromkeys(GOOD, ("yes", "✓")) | dict.fromkeys(BAD, ("no", "✗")) | {UNDECIDED: ("unclear", "?")}
SIGNS |= {OUTSIDE: ("open", "–"), CALIBRATED: ("open", "="), BEYOND: ("open", "+")}
NUMBER = re.compile(r"(?:[<>] )?[-+]?[\d.]+\b|-$|failed$")


class Figure(NamedTuple):
    """A PNG file (path below reports/), what it shows, and its width and height in pixels."""

    source: str
    caption: str
    size: tuple[int, int]


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(FOLDER / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"signs": SIGNS, "script": script}
    environment.tests["numeric"] = lambda cell: bool(NUMBER.match(Markup(cell).striptags()))
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}  # models stay in the order of params.yaml
    return environment


def fill(template: str, /, **values: Any) -> Markup:
    """Return `template`.html with these values in it."""
    return Markup(_environment().get_template(f"{template}.html").render(**values))


def script(name: str) -> Markup:
    """Return a file of this folder as it is, for a style or script element of the page."""
    return Markup((FOLDER / name).read_text(encoding="utf-8"))


def anchor(name: str) -> str:
    """Return the id, on the page, of a claim or a heading of that name."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def figure(workspace: Workspace, source: str, caption: str) -> Figure:
    """Return a figure of reports/ with its size. Raises InputError where it is no PNG file."""
    path = workspace.reports / source
    head = paths.require(path, "dvc repro").read_bytes()[:24]
    if len(head) < 24 or head[:8] != b"\x89PNG\r\n\x1a\n":
        raise InputError(f"{path}: not a PNG file; run `dvc repro` again")
    return Figure(source, caption, struct.unpack(">II", head[16:24]))


def markdown(text: str, name: str, folder: str = "", level: int = 0) -> Markup:
    """Return Markdown as HTML. name: of its tables; folder: below reports/, where its links start; level: see below.

    A heading of the first level becomes one of level + 1, and so on.
    """
    parser, tables = MarkdownIt("commonmark", {"html": False}).enable("table"), 0
    tokens = parser.parse(text)
    for token in tokens:
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{min(6, int(token.tag[1]) + level)}"
        elif token.type == "th_open":
            token.attrSet("scope", "col")
        elif token.type == "table_open":
            tables += 1  # a screen reader lists tables by their names
            token.meta["name"] = f"{name}, table {tables}"
        for child in token.children or ():
            for key in {"href", "src"} & set(child.attrs):
                child.attrSet(key, linked(folder, str(child.attrs[key])))
    parser.add_render_rule("table_open", _table_open)
    parser.add_render_rule("table_close", lambda *_: "</table></div>\n")
    return Markup(parser.renderer.render(tokens, parser.options, {}))


def _table_open(renderer, tokens, place: int, options, environment) -> str:
    name = escape(tokens[place].meta["name"])
    return f'<div class="scroll" role="region" tabindex="0" aria-label="{name}"><table class="sortable">\n'


def linked(folder: str, target: str) -> str:
    """Return the address, from reports/index.html, of what a document in `folder` (below reports/) calls `target`."""
    if urlsplit(target).scheme or target.startswith("#"):
        return target
    inside = posixpath.normpath(posixpath.join(folder, target))
    return f"./{inside}" if ":" in inside else inside  # ./javascript:x is a file, javascript:x is run


class _References(HTMLParser):
    def __init__(self, html: str):
        super().__init__()
        self.found: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attributes) -> None:
        self.found += [value for key, value in attributes if key in ("href", "src") and value]


def check_references(workspace: Workspace, name: str, pages: Mapping[str, str]) -> None:
    """Raise InputError for the first file, or place on a page, to which a page refers and which is not there.

    name: of the page; pages: file name in reports/ -> HTML of all of them.
    """
    for target in _References(pages[name]).found:
        address = urlsplit(target)
        if address.scheme:
            continue
        place, there = address.fragment.partition("?")[0], address.path or name
        known = f' id="{place}"' in pages[there] if there in pages else (workspace.reports / there).exists()
        if not known and (place or there not in pages):
            raise InputError(f"reports/{name} refers to {target}, which is not there; run `dvc repro`")
