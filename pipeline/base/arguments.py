"""Command lines of stages, studies and commands: one parser, with `--help` from the module's own docstring."""

import argparse
import sys
from collections.abc import Sequence


def parse(description: str, **positionals: Sequence[str | None] | None) -> argparse.Namespace:
    """Return the positional arguments of the module that runs; a wrong one ends it with a sentence (exit status 2).

    description: the module's docstring; positionals: name -> allowed words, or None where any text will do. An
    argument with None among its words may be left out.
    """
    spec = getattr(sys.modules["__main__"], "__spec__", None)
    parser = argparse.ArgumentParser(
        prog=f"python -m {spec.name}" if spec else None,
        description=description.partition("\nUsage:")[0],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for name, words in positionals.items():
        known = [word for word in words or () if word is not None]
        optional = "?" if words and None in words else None
        parser.add_argument(name, nargs=optional, choices=known or None, metavar=None if known else name.upper())
    return parser.parse_args()
