"""Reports as HTML: Markdown documents and tables of numbers, with links that hold from reports/index.html."""

import posixpath
import re
import struct
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from urllib.parse import quote, urlsplit

from markdown_it import MarkdownIt
from markdown_it.token import Token

from pipeline.base import paths
from pipeline.base.errors import InputError

# A line of a list that is nothing but a figure and its caption.
FIGURE = re.compile(r"^- \[[^\]]*\]\((?P<path>[^)\s]+\.png)\): (?P<caption>.+)$")
LINK = re.compile(r"\[(?P<text>[^\]]+)\]\((?P<path>[^)\s]+\.png)\)")
REFERENCE = re.compile(r'(?:href|src)="([^"#][^"]*)"')


def read(name: str) -> str:
    """A text file below reports/. Raises InputError where there is none."""
    return paths.require(paths.REPORTS / name, "dvc repro").read_text(encoding="utf-8")


def anchor(name: str) -> str:
    """The id, on the page, of the report `name` or of a heading of that name."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def sections(text: str, mark: str = "## ") -> list[tuple[str, str]]:
    """(heading, text below it) of a Markdown document, split at headings of one level.

    What stands before the first of them has an empty heading, and its own heading of the highest level is dropped.
    """
    found = [("", [])]
    for line in text.splitlines():
        if line.startswith(mark):
            found.append((line[len(mark) :].strip(), []))
        elif not line.startswith("# "):
            found[-1][1].append(line)
    return [(heading, "\n".join(lines).strip()) for heading, lines in found]


def title(text: str) -> str:
    """The heading of the highest level of a Markdown document, or nothing."""
    found = re.search(r"^# (.+)$", text, re.MULTILINE)
    return found.group(1).strip() if found else ""


class Pages:
    """Renders reports for one page. embedded: names of the reports that are on it, for links between them.

    `pictures` collects the PNG files that have been shown, as paths below reports/.
    """

    def __init__(self, embedded: Iterable[str]):
        self.embedded = set(embedded)
        self.pictures: set[str] = set()
        self._parser = MarkdownIt("commonmark", {"html": False}).enable("table")
        self._parser.add_render_rule("table_open", _table_open)
        self._parser.add_render_rule("table_close", lambda *_: "</table></div>\n")

    def link(self, folder: str, target: str) -> str:
        """`target`, as a report in `folder` (below reports/) names it, from the page."""
        if urlsplit(target).scheme or target.startswith("#"):
            return target
        name = posixpath.normpath(posixpath.join(folder, target))
        return f"#{anchor(name)}" if name in self.embedded else name

    def render(self, text: str, folder: str, level: int, name: str) -> str:
        """Markdown as HTML. level: of its highest headings on the page less one; name: of its tables, for readers.

        Lines that hold a figure and its caption become a gallery.
        """
        parts, lines, figures = [], [], []

        def flush() -> None:
            if figures:
                parts.append(self.gallery(figures))
            elif lines:
                parts.append(self._markdown("\n".join(lines), folder, level, name))
            lines.clear()
            figures.clear()

        for line in text.splitlines():
            found = FIGURE.match(line)
            if bool(found) != bool(figures):
                flush()
            if found:
                figures.append((self.link(folder, found["path"]), found["caption"]))
            else:
                lines.append(line)
        flush()
        return "\n".join(parts)

    def _markdown(self, text: str, folder: str, level: int, name: str) -> str:
        tokens = self._parser.parse(text)
        for place, token in enumerate(tokens):
            if token.type == "heading_open":
                name = tokens[place + 1].content
            if token.type in ("heading_open", "heading_close"):
                token.tag = f"h{min(6, int(token.tag[1]) + level)}"
            elif token.type == "th_open":
                token.attrSet("scope", "col")
            elif token.type == "table_open":
                token.meta["name"] = name
            for child in token.children or ():
                if child.type == "link_open":
                    child.attrSet("href", self.link(folder, child.attrs["href"]))
                elif child.type == "image":
                    self._picture(child, folder)
        return self._parser.renderer.render(tokens, self._parser.options, {})

    def _picture(self, image: Token, folder: str) -> None:
        source = self.link(folder, image.attrs["src"])
        width, height = png_size(paths.REPORTS / source)
        self.pictures.add(source)
        for key, value in (("src", source), ("width", str(width)), ("height", str(height))):
            image.attrSet(key, value)

    def gallery(self, figures: Sequence[tuple[str, str]]) -> str:
        """Figures with captions; (path below reports/, caption in Markdown)."""
        found = []
        for source, caption in figures:
            width, height = png_size(paths.REPORTS / source)
            self.pictures.add(source)
            words = self._parser.renderInline(caption)
            plain = escape(re.sub(r"[`*]", "", caption))
            found.append(
                f'<figure><a href="{quote(source)}"><img src="{quote(source)}" alt="{plain}" width="{width}" '
                f'height="{height}" decoding="async"></a><figcaption>{words}</figcaption></figure>'
            )
        return f'<div class="gallery">{"".join(found)}</div>'

    def rest(self, folder: str, text: str, names: Iterable[str]) -> str:
        """A gallery of the PNG files `names` of a folder that have not been shown yet, by the words of their links."""
        called = {found["path"]: found["text"] for found in LINK.finditer(text)}
        left = [name for name in sorted(names) if f"{folder}/{name}" not in self.pictures]
        words = {name: called.get(name, name) for name in left}
        figures = [
            (f"{folder}/{name}", Path(word).stem.replace("_", " ") if word == name else word)
            for name, word in words.items()
        ]
        return self.gallery(figures) if figures else ""


def png_size(path: Path) -> tuple[int, int]:
    """(width, height) in pixels, from the header of a PNG file. Raises InputError where it is none."""
    head = paths.require(path, "dvc repro").read_bytes()[:24]
    if len(head) < 24 or head[:8] != b"\x89PNG\r\n\x1a\n":
        raise InputError(f"{path}: not a PNG file; run `dvc repro` again")
    return struct.unpack(">II", head[16:24])


def scroll_open(name: str) -> str:
    """The start of a region that scrolls by itself, so that the page does not; keyboards reach it."""
    return f'<div class="scroll" role="region" tabindex="0" aria-label="{escape(name)}">'


def _table_open(renderer, tokens: Sequence[Token], place: int, options, environment) -> str:
    return f'{scroll_open(tokens[place].meta["name"])}<table class="sortable">\n'


def cell(text: str, value: float | None = None, html: bool = False, tag: str = "td") -> str:
    """A cell of a table. value: what it is sorted by, where that is not its text; html: `text` is HTML already."""
    sort = "" if value is None else f' data-value="{value!r}"'
    return f"<{tag}{sort}>{text if html else escape(text)}</{tag}>"


def table(name: str, header: Sequence[str], rows: Sequence[tuple[Mapping[str, str], Sequence[str]]]) -> str:
    """A sortable table. rows: (attributes of the row, its cells as `cell` makes them); name: its caption."""
    head = "".join(f'<th scope="col">{escape(one)}</th>' for one in header)
    body = []
    for attributes, cells in rows:
        words = "".join(f' {key}="{escape(value)}"' for key, value in attributes.items())
        body.append(f"<tr{words}>{''.join(cells)}</tr>")
    return (
        f'{scroll_open(name)}<table class="sortable"><caption>{escape(name)}</caption>'
        f"<thead><tr>{head}</tr></thead>\n<tbody>{chr(10).join(body)}</tbody></table></div>"
    )


def check_references(html: str) -> None:
    """InputError that names the first file which the page refers to and which is not there."""
    for target in REFERENCE.findall(html):
        if not urlsplit(target).scheme and not (paths.REPORTS / target).exists():
            raise InputError(f"reports/index.html refers to {target}, which is not there; run `dvc repro`")
