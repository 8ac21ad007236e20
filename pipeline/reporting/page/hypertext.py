"""Turn reports into HTML: Markdown documents, with links that hold from reports/index.html, and their figures."""

import posixpath
import re
import struct
from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from urllib.parse import quote, urlsplit

from markdown_it import MarkdownIt
from markdown_it.token import Token
from markupsafe import Markup

from pipeline.base import paths
from pipeline.base.errors import InputError
from pipeline.base.paths import Workspace
from pipeline.reporting.page.templates import part

# A line that is nothing but a figure and its caption: a link in a list, or the picture itself.
FIGURE = re.compile(r"^(?:- |!)\[[^\]]*\]\((?P<path>[^)\s]+\.png)\):? (?P<caption>.+)$")
LINK = re.compile(r"\[(?P<text>[^\]]+)\]\((?P<path>[^)\s]+\.png)\)")
REFERENCE = re.compile(r'(?:href|src)="([^"#][^"]*)"')


def read(workspace: Workspace, name: str) -> str:
    """Read a text file below reports/. Raises InputError where there is none."""
    return paths.require(workspace.reports / name, "dvc repro").read_text(encoding="utf-8")


def anchor(name: str) -> str:
    """Return the id, on the page, of the report `name` or of a heading of that name."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def sections(text: str, mark: str = "## ") -> list[tuple[str, str]]:
    """Split a Markdown document at the headings of one level into (heading, text below it).

    The text before the first heading has an empty one; headings of the highest level are dropped.
    """
    parts = [("", [])]
    for line in text.splitlines():
        if line.startswith(mark):
            parts.append((line[len(mark) :].strip(), []))
        elif not line.startswith("# "):
            parts[-1][1].append(line)
    return [(heading, "\n".join(lines).strip()) for heading, lines in parts]


def title(text: str) -> str:
    """Return the heading of the highest level of a Markdown document, or nothing."""
    heading = re.search(r"^# (.+)$", text, re.MULTILINE)
    return heading[1].strip() if heading else ""


def captions(text: str) -> dict[str, str]:
    """Return path -> caption of the figures that a Markdown document lists or shows with a caption."""
    return {line["path"]: line["caption"] for line in filter(None, map(FIGURE.match, text.splitlines()))}


def bare(text: str) -> str:
    """Return Markdown without the marks of code and emphasis, for those who hear a figure's caption."""
    return re.sub(r"[`*]", "", text)


class Pages:
    """Render reports for one page. embedded: names of the reports on it, for links between them.

    `pictures` collects the PNG files that the page shows so far, as paths below reports/.
    """

    def __init__(self, workspace: Workspace, embedded: Iterable[str]):
        self.workspace, self.embedded = workspace, set(embedded)
        self.pictures: set[str] = set()
        self._tables: Counter[str] = Counter()
        self._parser = MarkdownIt("commonmark", {"html": False}).enable("table")
        self._parser.add_render_rule("table_open", _table_open)
        self._parser.add_render_rule("table_close", lambda *_: "</table></div>\n")

    def link(self, folder: str, target: str) -> str:
        """Return the address, from the page, of the file that a report in `folder` (below reports/) calls `target`."""
        if urlsplit(target).scheme or target.startswith("#"):
            return target
        name = posixpath.normpath(posixpath.join(folder, target))
        return f"#{anchor(name)}" if name in self.embedded else name

    def render(self, text: str, folder: str, level: int, name: str) -> Markup:
        """Return Markdown as HTML. level: of its highest headings on the page less one; name: of its tables.

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
            figure = FIGURE.match(line)
            if bool(figure) != bool(figures):
                flush()
            if figure:
                figures.append((self.link(folder, figure["path"]), figure["caption"]))
            else:
                lines.append(line)
        flush()
        return Markup("\n".join(parts))

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
                self._tables[name] += 1  # a screen reader lists tables by their names
                token.meta["name"] = name if self._tables[name] == 1 else f"{name} ({self._tables[name]})"
            for child in token.children or ():
                if child.type == "link_open":
                    child.attrSet("href", self.link(folder, child.attrs["href"]))
                elif child.type == "image":
                    source = self.link(folder, child.attrs["src"])
                    width, height = map(str, self.size(source))
                    child.attrs |= {"src": source, "width": width, "height": height, "loading": "lazy"}
        return self._parser.renderer.render(tokens, self._parser.options, {})

    def size(self, source: str) -> tuple[int, int]:
        """Note that the page shows a figure (path below reports/), and return its width and height in pixels."""
        self.pictures.add(source)
        return png_size(self.workspace.reports / source)

    def gallery(self, figures: Iterable[tuple[str, str]]) -> Markup:
        """Return figures with captions as HTML; figures: (path below reports/, caption in Markdown)."""
        shown = [
            {
                "source": quote(source),
                "words": bare(caption),
                "size": self.size(source),
                "caption": Markup(self._parser.renderInline(caption)),
            }
            for source, caption in figures
        ]
        return part("gallery", shown)

    def caption(self, source: str) -> str:
        """Return, without marks of Markdown, what the README.md beside a figure (path below reports/) says it shows."""
        folder, _, name = source.rpartition("/")
        return bare(captions(read(self.workspace, f"{folder}/README.md")).get(name, Path(name).stem.replace("_", " ")))

    def rest(self, folder: str, text: str, names: Iterable[str]) -> Markup:
        """Return a gallery of the PNG files `names` of a folder that the page does not show yet.

        A caption is what stands behind the link to the file in the Markdown `text`, its text, or the name of the file.
        """
        known = {link["path"]: link["text"] for link in LINK.finditer(text)} | captions(text)
        figures = []
        for name in sorted(names):
            if f"{folder}/{name}" not in self.pictures:
                caption = known.get(name, name)
                words = Path(caption).stem.replace("_", " ") if caption == name else caption
                figures.append((f"{folder}/{name}", words))
        return self.gallery(figures) if figures else Markup()


def png_size(path: Path) -> tuple[int, int]:
    """Read (width, height) in pixels from the header of a PNG file. Raises InputError where it is none."""
    head = paths.require(path, "dvc repro").read_bytes()[:24]
    if len(head) < 24 or head[:8] != b"\x89PNG\r\n\x1a\n":
        raise InputError(f"{path}: not a PNG file; run `dvc repro` again")
    return struct.unpack(">II", head[16:24])


def _table_open(renderer, tokens: Sequence[Token], place: int, options, environment) -> str:
    name = escape(tokens[place].meta["name"])
    return f'<div class="scroll" role="region" tabindex="0" aria-label="{name}"><table class="sortable">\n'


def check_references(workspace: Workspace, html: str) -> None:
    """Raise InputError that names the first file to which the page refers and which is not there."""
    for target in REFERENCE.findall(html):
        if not urlsplit(target).scheme and not (workspace.reports / target).exists():
            raise InputError(f"reports/index.html refers to {target}, which is not there; run `dvc repro`")
