"""The command line's entry: find the command, run it, and turn every error into words and a code."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from importlib import import_module

from hexacell.cli.parser import make_parser
from hexacell.errors import ExitCode, HexacellError, SeveralErrors


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the result is the process's exit code."""
    options = make_parser().parse_args(arguments)
    wants_json = bool(getattr(options, "json", False))
    try:
        command = import_module(f"hexacell.cli.commands.{options.module}")
        return int(command.main(options))
    except KeyboardInterrupt:
        print("hexacell: interrupted", file=sys.stderr)
        return int(ExitCode.INTERRUPTED)
    except HexacellError as error:
        code = error.worst if isinstance(error, SeveralErrors) else error.exit_code
        return _failed(str(error), code, wants_json=wants_json)
    except BrokenPipeError:
        # Whoever read the output has gone; there is nobody left to tell.
        sys.stderr.close()
        return int(ExitCode.DONE)


def _failed(message: str, code: ExitCode, *, wants_json: bool) -> int:
    if wants_json:
        print(json.dumps({"error": message, "exit_code": int(code)}))
    print(f"hexacell: {message}", file=sys.stderr)
    return int(code)
