"""Command lines of stages, studies and commands: one parser, with `--help` from the module's own docstring."""

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from tactile.base.errors import InputError, run_stage
from tactile.base.paths import Workspace
from tactile.base.processes import ONE_THREAD


def add_root(parser: argparse.ArgumentParser) -> None:
    """Add `--root FOLDER`, the workspace; without it the current folder."""
    parser.add_argument(
        "--root", type=_workspace, default=Workspace(Path()), metavar="FOLDER", help="work there, not in this folder"
    )


def _workspace(text: str) -> Workspace:
    if not Path(text).is_dir():
        raise argparse.ArgumentTypeError(f"there is no folder {text}")
    return Workspace(Path(text))


class OneOf:
    """Reads an argument that has to be one of some words; `what` they are, for the sentence on another."""

    def __init__(self, what: str, known: Collection[str]):
        self.what, self.known = what, known

    def __call__(self, word: str) -> str:
        if word not in self.known:
            from tactile.base.params import hint  # here: it takes longer than all else of the help

            raise argparse.ArgumentTypeError(f"there is no {self.what} '{word}'; {hint(word, self.known)}")
        return word


def one_of(what: str, known: Collection[str]) -> dict:
    """Return the keywords of an argument that has to be one of these words."""
    return {"type": OneOf(what, tuple(known)), "metavar": f"{{{','.join(known)}}}"}


QUIET = {"-q", "--quiet"}


def add_output(parser: argparse.ArgumentParser) -> None:
    """Add what a program that calls a command wants: `--json`, which `answer` heeds, and `--quiet`."""
    output = parser.add_mutually_exclusive_group()
    output.add_argument("--json", action="store_true", help="print the result as JSON; words go to standard error")
    output.add_argument(*sorted(QUIET, key=len), action="store_true", help="print errors alone")


@contextlib.contextmanager
def silenced(given: argparse.Namespace) -> Iterator[None]:
    """Keep what is printed for people off standard output, where `--json` or `--quiet` of `add_output` was given."""
    with contextlib.ExitStack() as stack:
        if getattr(given, "quiet", False):
            stack.enter_context(contextlib.redirect_stdout(stack.enter_context(open(os.devnull, "w"))))
        elif getattr(given, "json", False) and hasattr(given, "quiet"):
            stack.enter_context(contextlib.redirect_stdout(sys.stderr))
        yield


def answer(given: argparse.Namespace, result: Mapping) -> None:
    """Print the result of a command on standard output, where `--json` was given."""
    if getattr(given, "json", False):
        print(json.dumps(result, indent=1), file=sys.__stdout__, flush=True)


def of_study(doc: str | None, experiments: Sequence[str]) -> tuple[str, int]:
    """Return the experiment and the seed that the command line of a study names."""
    given = parse(doc, experiment=experiments, seed=None)
    if not given.seed.isdecimal():
        raise InputError(f"seed '{given.seed}': expected a whole number")
    return given.experiment, int(given.seed)


def run(main: Callable[[Workspace], None]) -> None:
    """Run the `main` of a stage or study, as `run_stage`, in the workspace that the command line names, on one thread.

    With more, the last digits of a sum depend on the number of cores, and the many small products of a search for
    clocks take three to six times the processor time, because threads wait for each other.
    """
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    add_root(parser)
    workspace = parser.parse_known_args()[0].root
    os.environ |= ONE_THREAD  # of libraries that `main` loads
    with threadpool_limits(1):
        run_stage(lambda: main(workspace), workspace.params)


def run_tool(description: str | None, main: Callable, add_arguments: Callable | None = None) -> None:
    """Run the `main` of a tool as a command of `tactile`: with the workspace and the arguments given."""
    given = tool_parser(description, add_arguments).parse_args()
    run_stage(lambda: main(given.root, given), given.root.params)


def tool_parser(description: str | None, add_arguments: Callable | None) -> argparse.ArgumentParser:
    """Return the parser of a tool; description: the docstring of its module."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    add_root(parser)
    if add_arguments:
        add_arguments(parser)
    return parser


def parse(description: str | None, **positionals: Sequence[str | None] | None) -> argparse.Namespace:
    """Return the positional arguments of the module that runs; a wrong one ends it with a sentence (exit status 2).

    description: the module's docstring; positionals: name -> allowed words, or None where any text will do. An
    argument with None among its words may be left out. `--root` is that of `run`.
    """
    spec = getattr(sys.modules["__main__"], "__spec__", None)
    parser = argparse.ArgumentParser(
        prog=f"python -m {spec.name}" if spec else None,
        description=(description or "").partition("\nUsage:")[0],  # python -OO has no docstrings
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add_root(parser)
    for name, words in positionals.items():
        known = [word for word in words or () if word is not None]
        optional = "?" if words and None in words else None
        parser.add_argument(name, nargs=optional, choices=known or None, metavar=None if known else name.upper())
    return parser.parse_args()
