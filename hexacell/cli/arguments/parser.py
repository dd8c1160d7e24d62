"""The parser, and the kinds of arguments that several commands have."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from hexacell.errors import UsageError
from hexacell.storage.output_files import LOG, OutputFile, OutputKind

LARGEST_NODE_ID = 127
LONGEST_S = 86_400.0
MODES = ("check", "quick", "optimise")


class Parser(argparse.ArgumentParser):
    """A parser that raises instead of exiting, so that every error is reported in the same form.

    Options cannot be abbreviated: an abbreviation that works today may be ambiguous tomorrow.
    """

    def __init__(self, **settings: Any) -> None:  # noqa: ANN401 - argparse's own settings
        super().__init__(allow_abbrev=False, **settings)

    def error(self, message: str) -> NoReturn:
        """Raise ``UsageError`` with argparse's message."""
        raise UsageError(message, action=f"Try `{self.prog} --help`")

    def add_commands(self, title: str, metavar: str) -> "Commands":
        """Add a choice of commands, one of which must be given."""
        return Commands(self.add_subparsers(title=title, prog=self.prog, metavar=metavar, required=True))

    def add_cell(self) -> None:
        """Add the cell file."""
        self.add_argument("cell", type=Path, metavar="CELL", help="the cell file (TOML)")

    def add_run(self, what: str = "a run folder") -> None:
        """Add the run."""
        self.add_argument("run", type=Path, metavar="RUN", help=what)

    def add_json(self) -> None:
        """Add the choice of a JSON document."""
        add_flag(self, "--json", "one JSON document on stdout; text goes to stderr")

    def add_resume(self, what: str) -> None:
        """Add the run to resume, the latest one by default."""
        words = f"resume an interrupted {what}: its folder or name (default: the latest one)"
        self.add_argument("--resume", metavar="RUN", nargs="?", const="latest", help=words)


def add_flag(container: Any, option: str, what: str) -> None:  # noqa: ANN401 - a parser, or a group of one
    """Add an option without a value."""
    container.add_argument(option, action="store_true", help=what)


def add_value(
    container: Any,  # noqa: ANN401 - a parser, or a group of one
    option: str,
    metavar: str,
    what: str,
    kind: Callable[[str], object] = str,
    default: object = None,
) -> None:
    """Add an option with one value; a default that is not None is in the help too."""
    shown = "" if default is None else " (default: %(default)s)"
    container.add_argument(option, type=kind, default=default, metavar=metavar, help=f"{what}{shown}")


def add_output(parser: Parser, option: str, kind: OutputKind, what: str) -> None:
    """Add an option that names a file to be written, which only :class:`.OutputFile` opens."""
    add_value(parser, option, "FILE", what, output_of(kind))


def output_of(kind: OutputKind) -> Callable[[str], OutputFile]:
    """The type of an argument: a file to be written."""
    return lambda name: OutputFile(Path(name), kind)


class Commands:
    """The commands of the program, or those of one of its commands."""

    def __init__(self, made: Any) -> None:  # noqa: ANN401 - argparse's own type is private
        self._made = made

    def add(self, name: str, summary: str, target: str = "") -> Parser:
        """Add a command with a summary that is its description, too.

        ``target`` is its module and function in ``hexacell.cli.commands``, by default ``main``.
        """
        parser = self.add_hidden(
            name, target or f"{name}.main", help=summary, description=f"{summary[0].upper()}{summary[1:]}."
        )
        # Suppressed defaults: the options of an action must not hide those given before its name.
        words = "append to this file what the program does; with -v also the bytes on the lines"
        kind = output_of(LOG)
        parser.add_argument("--log-file", type=kind, default=argparse.SUPPRESS, metavar="FILE", help=words)
        words = "log on stderr what the program does; twice: also the bytes on the lines"
        parser.add_argument("-v", "--verbose", action="count", default=argparse.SUPPRESS, help=words)
        return parser

    def add_hidden(self, name: str, target: str, **settings: str) -> Parser:
        """Add a command that people never type, so that the help does not list it."""
        parser: Parser = self._made.add_parser(name, **settings)
        parser.set_defaults(target=target)
        return parser


def whole_number(least: int, most: int | None = None) -> Callable[[str], int]:
    """The type of an argument: a whole number from ``least`` to ``most``, if there is a largest one."""

    def read(text: str) -> int:
        number = int(text)
        if number < least or (most is not None and number > most):
            raise ValueError  # argparse makes a message of it
        return number

    read.__name__ = f"number from {least}{'' if most is None else f' to {most}'}"
    return read


def bounded_seconds(text: str) -> float:
    """Seconds, from above 0 to a day; raises ``ValueError``."""
    seconds = float(text)
    if not 0.0 < seconds <= LONGEST_S:
        raise ValueError(text)
    return seconds
