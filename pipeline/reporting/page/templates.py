"""Turn what the page holds into HTML, by the templates beside this module; text is escaped unless it is Markup."""

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from pipeline.base import paths
from pipeline.claims.rules import CALIBRATED, CONTRADICTED, NOT_TESTABLE, REPRODUCED, UNDECIDED

FOLDER = paths.CODE / "reporting" / "page"


class Sign(NamedTuple):
    """How a verdict looks: a class of page.css, and a sign for those who do not see colours."""

    style: str
    sign: str


SIGNS = {
    REPRODUCED: Sign("yes", "✓"),
    CONTRADICTED: Sign("no", "✗"),
    UNDECIDED: Sign("unclear", "?"),
    NOT_TESTABLE: Sign("open", "–"),
    CALIBRATED: Sign("open", "="),
}


class Cell(NamedTuple):
    """A cell of a table; value: what it is sorted by, where that is not the text."""

    text: str | Markup
    value: float | None = None
    column: str = ""  # its heading, where the row becomes a card on a narrow screen
    best: bool = False  # of its column


class Row(NamedTuple):
    """A row of a table; attributes: of its element."""

    cells: list[Cell]
    attributes: Mapping[str, str] = {}


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(FOLDER / "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["signs"] = SIGNS
    environment.policies["json.dumps_kwargs"] = {"sort_keys": False}  # models stay in the order of params.yaml
    return environment


def fill(template: str, /, **values: Any) -> Markup:
    """Return `template`.html with these values in it."""
    return Markup(_environment().get_template(f"{template}.html").render(**values))


def part(name: str, *values: Any) -> Markup:
    """Return one of the small parts of parts.html: badge, folded, table, gallery."""
    return getattr(_environment().get_template("parts.html").module, name)(*values)


def script(name: str) -> Markup:
    """Return a file of this folder as it is, for a style or script element of the page."""
    return Markup((FOLDER / name).read_text(encoding="utf-8"))
