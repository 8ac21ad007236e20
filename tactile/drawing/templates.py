"""Fill Markdown templates: fixed text, with numbers and tables in their places."""

import re
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tactile.drawing import labels, markdown

TEXTS = Path(__file__).with_name("texts")  # templates of what people read of their own sensors


def render(folder: Path, name: str, /, **values: Any) -> str:
    """Return <folder>/<name>.md with these values in it. Raises jinja2.UndefinedError for one that is missing.

    Lines have no spaces at their ends, and no two empty ones follow each other: tags of the template leave some.
    """
    lines = map(str.rstrip, _environment(folder).get_template(f"{name}.md").render(values).splitlines())
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines)).strip("\n") + "\n"


@cache
def _environment(folder: Path) -> Environment:
    environment = Environment(
        loader=FileSystemLoader(folder),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"number": markdown.number, "interval": markdown.interval, "size": markdown.size}
    environment.filters |= {"model_name": labels.model_name, "literal": markdown.literal, "plain": labels.plain}
    environment.filters |= {"task_name": labels.task_name, "split_name": labels.split_name}
    environment.globals |= {"table": markdown.table, "zip": zip}
    return environment
