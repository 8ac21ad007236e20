"""What people run by hand: check, try, record; predict, export, live; fetch, calibrate, search rates, pack.

Each command of `tactile` is a module of this room: its `add_arguments(parser)` says what the command takes, and its
`main(given)` runs it with the arguments given. `--help` behind a command says more.
"""

import argparse

from pipeline.base import arguments
from pipeline.base.errors import run_stage
from pipeline.commands import (
    bundle,
    calibrate,
    check,
    evidence,
    export,
    fetch,
    fit_material,
    fit_strain,
    live,
    own,
    predict,
    quick_look,
    rates,
    record,
)

COMMANDS = {
    "check": check,
    "fetch": fetch,
    "record": record,
    "try": quick_look,
    "own": own,
    "predict": predict,
    "export": export,
    "live": live,
    "fit-material": fit_material,
    "fit-strain": fit_strain,
    "evidence": evidence,
    "calibrate": calibrate,
    "rates": rates,
    "bundle": bundle,
}


def main() -> None:
    """Run the command named on the command line; a wrong one ends with a sentence and exit status 2."""
    parser = argparse.ArgumentParser(prog="tactile", description=__doc__.partition("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, module in COMMANDS.items():
        command = commands.add_parser(
            name,
            help=module.__doc__.partition("\n")[0],
            description=module.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        arguments.add_root(command)
        module.add_arguments(command)
    given = parser.parse_args()
    run_stage(lambda: COMMANDS[given.command].main(given.root, given), given.root.params)


if __name__ == "__main__":
    main()
