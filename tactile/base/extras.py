"""Say what to install for a library that only some commands need: an extra of pyproject.toml has it."""

import re
from collections import Counter
from importlib import metadata

from tactile.base.installed import BROUGHT, INSTALLED, PACKAGE


def sentence(error: BaseException) -> str | None:
    """Return what to do about a library that is not installed; None for any other error, and where no extra has it."""
    if not isinstance(error, ModuleNotFoundError) or not error.name:
        return None
    name = error.name.partition(".")[0].replace("_", "-")
    found = [re.match(r"([\w.-]+).*; extra == .(\w+)", line) for line in metadata.requires(PACKAGE) or []]
    pairs = [match.groups() for match in found if match]
    size = Counter(extra for _, extra in pairs)
    smallest = min((extra for library, extra in pairs if library == name), key=size.__getitem__, default=None)
    if smallest is None:
        return None
    where = PACKAGE if BROUGHT == INSTALLED else "."
    options = "" if where == PACKAGE else "-c constraints.txt -e "
    return f"{name} is not installed; run `pip install {options}'{where}[{smallest}]'`"
