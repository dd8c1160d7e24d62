"""Entry of the command line: runs a command and turns every error into a message and an exit code."""

import argparse
import logging
import os
import shlex
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from importlib import import_module

from hexacell import __version__
from hexacell.cli.arguments import make_parser
from hexacell.cli.arguments.parser import output_of
from hexacell.cli.console import Console, lost_output, unhindered_output
from hexacell.cli.process import OVER_A_SOCKET, fault_line, log, require_platform, stop_signals_as_sigint
from hexacell.errors import ExitCode, HexacellError, UsageError
from hexacell.printable import PrintableFormatter
from hexacell.storage.atomic_files import shortage
from hexacell.storage.output_files import LOG, OutputFile

_log = logging.getLogger(__name__)

LOG_FILE = "HEXACELL_LOG_FILE"
"""Variable of the environment with the file of ``--log-file``, for services and for the screen's runs."""

LONGEST_NAME_BYTES, LONGEST_PATH = 255, 4000


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return the process's exit code."""
    # Before numpy is imported, which reads it: the matrices are small, threads only slow them down.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if logging.lastResort is not None:  # which prints warnings where no log was asked for
        logging.lastResort.setFormatter(PrintableFormatter())
    typed = sys.argv[1:] if arguments is None else list(arguments)
    console = Console("--json" in typed)
    try:
        parser = make_parser()
        if not typed:
            parser.print_help(sys.stderr)
            return int(ExitCode.USAGE)
        with stop_signals_as_sigint():
            _require_usable(typed)
            options = parser.parse_args(typed)
            require_platform(options.target)
            for named in vars(options).values():
                if isinstance(named, OutputFile):  # before anything is done
                    named.require()
            with nullcontext() if options.target in OVER_A_SOCKET else unhindered_output():
                code = _carried_out(options, typed, console)
            if code or (lost := lost_output()) is None:
                return code
            # What nobody can read is not done.
            console.error(f"hexacell: the output could not be written: {lost.strerror}")
            return int(ExitCode.USAGE)
    except KeyboardInterrupt:
        return _failed("interrupted", ExitCode.INTERRUPTED, console)
    except HexacellError as error:
        return _failed(str(error), error.exit_code, console)
    except Exception as error:
        return _unforeseen(error, typed, console)


def _carried_out(options: argparse.Namespace, typed: Sequence[str], console: Console) -> int:
    """The exit code of the command, whose beginning, end and failure are logged where that is asked for."""
    inherited = os.environ.get(LOG_FILE)
    file = getattr(options, "log_file", None if inherited is None else output_of(LOG)(inherited))
    verbosity = getattr(options, "verbose", 0)
    if options.target == "tui.main" and file is not None:
        os.environ[LOG_FILE] = str(file.path.absolute())  # the screen's run is in a process of its own
    elif options.target == "tui.main" and verbosity:
        raise UsageError("the screen takes the whole terminal", action="Name a file: --log-file FILE")

    def carry_out() -> int:
        module, _, command = options.target.partition(".")
        return int(getattr(import_module(f"hexacell.cli.commands.{module}"), command)(options, console))

    if file is None and not verbosity:
        return carry_out()
    with log(file, verbosity):
        _log.info("hexacell %s: %s", __version__, shlex.join(typed))
        try:
            code = carry_out()
        except HexacellError as error:
            _log.error("exit code %d: %s", error.exit_code, error)
            raise
        except BaseException:
            _log.exception("the command ended without a result")
            raise
        _log.info("exit code %d", code)
        return code


def _require_usable(typed: Sequence[str]) -> None:
    """Refuse arguments that are too long or have characters to be even the name of a file."""
    for argument in typed:
        try:
            parts = os.fsencode(argument).split(b"/")
        except UnicodeEncodeError:
            parts = [b"\0"]
        is_too_long = max(map(len, parts)) > LONGEST_NAME_BYTES or len(argument) > LONGEST_PATH
        if is_too_long or any(b"\0" in part for part in parts):
            raise UsageError(
                f"'{argument[:20]}...' is not a valid file name", action="Shorten or correct it"
            )


def _unforeseen(error: Exception, typed: Sequence[str], console: Console) -> int:
    from hexacell.plugins import plugin_failure  # noqa: PLC0415 - slow, and only of use here

    if (failed := plugin_failure(error) or shortage(error)) is not None:
        return _failed(str(failed), failed.exit_code, console)
    return _failed(fault_line(error, typed), ExitCode.FAULT, console)


def _failed(message: str, code: ExitCode, console: Console) -> int:
    console.document({"error": message, "exit_code": int(code)})
    console.error(f"hexacell: {message}")
    return int(code)
