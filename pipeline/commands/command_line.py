"""What people run by hand: check, sheet, try, record; predict, export, live; fetch, calibrate, search rates, pack.

Each command of `tactile` is a module of this room: its `add_arguments(parser)` says what the command takes, and its
`main(workspace, given)` runs it with the arguments given. Only the module of the command that is called is imported;
`tactile --help` reads the first line of the others. `--help` behind a command says more.
"""

import argparse
import ast
import difflib
import importlib
import sys
from collections.abc import Collection
from pathlib import Path

from pipeline.base import arguments
from pipeline.base.errors import run_stage

COMMANDS = {  # command -> its module
    "check": "check",
    "sheet": "sheet",
    "import": "import_logs",
    "fetch": "fetch",
    "record": "record",
    "try": "quick_look",
    "own": "own",
    "predict": "predict",
    "export": "export",
    "live": "live",
    "fit-material": "fit_material",
    "fit-strain": "fit_strain",
    "evidence": "evidence",
    "pack": "pack",
    "unpack": "unpack",
    "calibrate": "calibrate",
    "rates": "rates",
    "bundle": "bundle",
}


def parser_of(called: Collection[str]) -> argparse.ArgumentParser:
    """Return the parser of `tactile`, in which the commands `called` know their arguments and the others do not."""
    parser = argparse.ArgumentParser(prog="tactile", description=_words("command_line").partition("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, module in COMMANDS.items():
        words = _words(module)
        command = commands.add_parser(name, help=words.partition("\n")[0])
        if name in called:
            imported = importlib.import_module(f"pipeline.commands.{module}")
            command.description = words
            command.formatter_class = argparse.RawDescriptionHelpFormatter
            arguments.add_root(command)
            imported.add_arguments(command)
            command.set_defaults(main=imported.main)
    return parser


def _words(module: str) -> str:
    """Return the docstring of a module of this room, which is not imported, and which python -OO would not keep."""
    text = Path(__file__).with_name(f"{module}.py").read_text(encoding="utf-8")
    return ast.get_docstring(ast.parse(text))


def main() -> None:
    """Run the command named on the command line; a wrong one ends with a sentence and exit status 2."""
    if not sys.argv[1:]:
        parser_of(()).print_help()
        return
    name = sys.argv[1]
    if not name.startswith("-") and name not in COMMANDS:
        near = difflib.get_close_matches(name, COMMANDS, n=1)
        said = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(COMMANDS)}"
        sys.exit(f"error: there is no command '{name}'; {said}")
    given = parser_of(sys.argv[1:2]).parse_args()
    run_stage(lambda: given.main(given.root, given), given.root.params)


if __name__ == "__main__":
    main()
