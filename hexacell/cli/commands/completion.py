"""``hexacell completion``: a script that lets a shell complete commands, options, choices and files.

It is made of the program's own parser by shtab, so that it has whatever the installed version has. The
shell runs it, and never the program.
"""

import argparse
from collections.abc import Iterator

import shtab

from hexacell.cell.bundled import bundled_names
from hexacell.cli.arguments import make_parser
from hexacell.cli.console import Console
from hexacell.errors import ExitCode

FOLDER, FILE = shtab.DIRECTORY, shtab.FILE
# Zsh takes a single pattern in parentheses for a qualifier of files, so there are two of each.
TOML_FILE, CSV_FILE = shtab.glob("*.toml", "*.TOML"), shtab.glob("*.csv", "*.CSV")

BY_NAME = {"CELL": TOML_FILE, "RUN": FOLDER, "FOLDER": FOLDER, "FILE": FILE, "PORT": FILE}
"""What a shell offers for a value, by the value's name in the help."""

BY_OPTION = {"--measurements": CSV_FILE}
"""What a shell offers by the option, where its value's name says less."""


def main(options: argparse.Namespace, _: Console) -> ExitCode:
    """Print the script for a shell."""
    parser = make_parser()
    for action in _actions(parser):
        _state_what_it_takes(action)
    print(shtab.complete(parser, options.shell))
    return ExitCode.DONE


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All arguments of a parser and of the commands below it."""
    for action in parser._actions:  # argparse has no public way to them; shtab goes this one too
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)


def _state_what_it_takes(action: argparse.Action) -> None:
    """Mark an argument for shtab; one whose values are no files is left as it is."""
    if "--config" in action.option_strings:
        action.choices = bundled_names()
        return
    name = action.metavar[0] if isinstance(action.metavar, tuple) else action.metavar or action.dest.upper()
    by_option = (BY_OPTION[option] for option in action.option_strings if option in BY_OPTION)
    if (taken := next(by_option, BY_NAME.get(name))) is not None:
        action.complete = taken  # type: ignore[attr-defined] # where shtab looks for it
