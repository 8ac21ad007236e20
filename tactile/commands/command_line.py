"""Predict with trained models, read your own sensor, and compute the evidence on three papers of soft tactile sensing.

Each command of `tactile` is a module of this room, or of pipeline/commands in a checkout: its
`add_arguments(parser)`, if there is one, says what the command takes, and its `main(workspace, given)` runs it with
the arguments given. Only the module of the command that is called is imported; `tactile --help` reads the first line
of the others. `tactile help COMMAND` prints the docstring, which ends with examples.
"""

import argparse
import ast
import importlib
import os
import signal
import sys
import textwrap
from collections.abc import Collection

from tactile.base import arguments, paths
from tactile.base.errors import run_stage
from tactile.base.installed import BROUGHT, INSTALLED

REPRODUCTION = "pipeline"  # the house beside this one, in a checkout
TOOL = {  # heading of the help -> command -> its module in this room
    "Use a trained model": {
        "demo": "demo",
        "predict": "predict",
        "live": "live",
        "export": "export",
        "inspect": "inspect",
        "models": "models",
        "coverage": "coverage",
    },
    "Your own sensor": {
        "import": "import_logs",
        "record": "record",
        "weigh": "weigh",
        "map": "map_elements",
        "check": "check",
        "sheet": "sheet",
        "try": "quick_look",
        "own": "own",
    },
    "Public recordings": {
        "fetch": "fetch",
        "targets": "targets",
    },
}


def _groups() -> dict[str, dict[str, str]]:
    """Return heading -> command -> its module, with those of the reproduction where this is a checkout of it."""
    named = {heading: {name: f"tactile.commands.{of}" for name, of in group.items()} for heading, group in TOOL.items()}
    reproduction = f"{REPRODUCTION}.commands"
    if (paths.CODE.parent / REPRODUCTION / "commands" / "__init__.py").is_file():
        further = importlib.import_module(reproduction).GROUPS.items()
        named |= {heading: {name: f"{reproduction}.{of}" for name, of in group.items()} for heading, group in further}
    return named


GROUPS = _groups()
COMMANDS = {command: module for commands in GROUPS.values() for command, module in commands.items()}
HELP = "help"
WIDTH, COLUMN = 100, 15  # characters of a line of the help, and before the words on a command


def parser_of(called: Collection[str]) -> argparse.ArgumentParser:
    """Return the parser of `tactile`, in which the commands `called` know their arguments and the others do not."""
    parser = argparse.ArgumentParser(
        prog="tactile",
        usage="tactile COMMAND ...",
        description=_words("tactile.commands.command_line").partition("\n")[0],
        epilog="\n\n".join(_group(heading, commands) for heading, commands in GROUPS.items())
        + "\n\n`tactile help COMMAND` says more, with examples. A first look: `tactile demo`.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="store_true", help="print the version and the commit, and exit")
    commands = parser.add_subparsers(
        prog="tactile", dest="command", required=True, metavar="COMMAND", help=argparse.SUPPRESS
    )
    commands.add_parser(HELP).add_argument("of", nargs="?", metavar="COMMAND")  # which `main` turns into --help
    for name, module in COMMANDS.items():
        command = commands.add_parser(name)
        if name in called:
            imported = importlib.import_module(module)
            command.description = _words(module)
            command.formatter_class = argparse.RawDescriptionHelpFormatter
            arguments.add_root(command)
            if hasattr(imported, "add_arguments"):
                imported.add_arguments(command)
            command.set_defaults(main=imported.main)
    return parser


def _group(heading: str, commands: Collection[str]) -> str:
    """Return a heading with its commands below, each with the first line of its module."""
    lines = [
        textwrap.fill(
            _words(COMMANDS[name]).partition("\n")[0],
            WIDTH,
            initial_indent=f"  {name}".ljust(COLUMN),
            subsequent_indent=" " * COLUMN,
        )
        for name in commands
    ]
    return "\n".join([f"{heading}:", *lines])


def _words(module: str) -> str:
    """Return the docstring of a module, which is not imported, and which python -OO would not keep."""
    text = (paths.CODE.parent / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8")
    return ast.get_docstring(ast.parse(text))


def version() -> str:
    """Return the version of the package and, of a checkout, its commit."""
    from tactile.base import provenance  # here: it takes longer than all else of the help

    commit, changed = provenance.code()
    of_checkout = f", commit {commit}{' with changes' if changed == 'true' else ''}"
    return f"tactile {provenance.version()}{'' if BROUGHT == INSTALLED else of_checkout}"


def main() -> None:
    """Run the command named on the command line; a wrong one ends with a sentence and exit status 2."""
    words = sys.argv[1:]
    if words[:1] == [HELP]:
        words = [*words[1:2], "--help"]
    name = next(iter(words), "--help")
    if name == "--version":
        print(version())
        return
    if not name.startswith("-") and name not in COMMANDS:
        from tactile.base.params import hint  # here: it takes longer than all else of the help

        further = "" if GROUPS.keys() - TOOL.keys() else "; a checkout of the reproduction has more"
        print(f"error: there is no command '{name}'; {hint(name, COMMANDS)}{further}", file=sys.stderr)
        sys.exit(2)
    if odd := next((word for word in words if "\0" in word), None):
        print(f"error: {ascii(odd)}: no name of a file or folder has a NUL character; give another", file=sys.stderr)
        sys.exit(2)
    if arguments.QUIET & set(words[1:]) or not sys.stderr.isatty():  # in a file a bar is a line of every step of it
        os.environ["TQDM_DISABLE"] = "1"  # read when tqdm is imported
    try:
        given = parser_of([name]).parse_args(words or [name])
        with arguments.silenced(given):
            run_stage(lambda: given.main(given.root, given), given.root.params)
    except KeyboardInterrupt:  # while modules are imported, which takes seconds
        sys.exit(128 + signal.SIGINT)


if __name__ == "__main__":
    main()
