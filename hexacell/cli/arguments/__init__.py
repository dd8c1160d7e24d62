"""Arguments of all commands. Only the standard library is imported, so that ``--help`` is instant."""

import argparse

from hexacell import __version__
from hexacell.cli.arguments.cells import CELLS
from hexacell.cli.arguments.parser import Parser
from hexacell.cli.arguments.runs import RUNS

EXIT_CODES = """exit codes:
  0 done, within limits            4 an answer or approval is needed
  1 not within limits; a better    5 the cell is in use
    geometry may have stayed       6 write-back failed and was undone
  2 usage or file error            7 out of its time; it can be resumed
  3 hardware or link               70 a fault of the program
                                   130 interrupted"""


def make_parser() -> Parser:
    """The parser of all commands; ``options.target`` is the command's module and function.

    Its ``parse_args`` raises ``UsageError``.
    """
    parser = Parser(
        prog="hexacell",
        usage="hexacell [-h] [--version] COMMAND ...",
        description="Make a 6-DOF parallel robot accurate with three dial gauges and a ball.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"hexacell {__version__}")
    # argparse aligns the commands below with the metavar, which must be about as long as they are.
    commands = parser.add_commands("commands", "COMMAND [...]")
    for add in (*RUNS, *CELLS):
        add(commands)
    return parser
