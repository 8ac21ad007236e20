"""Fill the Markdown templates of the reports on the papers, which are in `templates`."""

from pathlib import Path
from typing import Any

from tactile.drawing import templates

FOLDER = Path(__file__).with_name("templates")


def render(name: str, /, **values: Any) -> str:
    """Return templates/<name>.md with these values in it, as `drawing.templates.render` does."""
    return templates.render(FOLDER, name, **values)
