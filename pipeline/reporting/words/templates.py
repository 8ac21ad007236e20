"""Fill the Markdown templates in pipeline/reporting/templates: fixed text, with numbers and tables in their places."""

from functools import cache
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from pipeline.base import paths
from pipeline.reporting.words import markdown

FOLDER = paths.CODE / "reporting" / "templates"


def render(name: str, /, **values: Any) -> str:
    """Return templates/<name>.md with these values in it. Raises jinja2.UndefinedError for one that is missing."""
    return _environment().get_template(f"{name}.md").render(values)


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"number": markdown.number, "interval": markdown.interval}
    environment.globals["table"] = markdown.table
    return environment
