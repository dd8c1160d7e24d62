"""``hexacell replay``: puts a recorded run through the real procedure."""

import argparse
import asyncio

from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.history.run_export import export_run
from hexacell.services.run.replay_run import replay
from hexacell.text.documents import replay_document
from hexacell.text.run import replay_report
from procedures.replay.recorded_executor import TOLERANCE
from procedures.replay.replayer import Scope


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Replay, and report what differs from the recording; or export the run, and replay nothing."""
    if options.export is not None:
        names = export_run(options.run, options.export)
        console.show(
            {"exported": str(options.export), "files": list(names)},
            f"{options.export}: {len(names)} files of the run, every password masked",
        )
        return ExitCode.DONE
    tolerance = TOLERANCE if options.tolerance is None else options.tolerance
    if not 0.0 <= tolerance < float("inf"):
        raise UsageError(f"--tolerance {tolerance:g} is not a tolerance", action="Give a number from 0")
    replayed = asyncio.run(replay(options.run, Scope(options.only or "all"), tolerance))
    console.show(replay_document(replayed), replay_report(replayed))
    return ExitCode.DONE if replayed.is_same else ExitCode.OUT_OF_LIMITS
