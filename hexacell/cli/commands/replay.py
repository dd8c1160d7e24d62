"""``hexacell replay``: a recorded run through the real procedure."""

from __future__ import annotations

import argparse
import asyncio

from hexacell.application.replay_run import replay
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.presentation.replay import replay_document, replay_words
from procedures.replay.comparison import TOLERANCE
from procedures.replay.replayer import Scope


def main(options: argparse.Namespace) -> ExitCode:
    """Replay, and say what is not as it was recorded."""
    console = Console(options.json)
    tolerance = TOLERANCE if options.tolerance is None else options.tolerance
    if not 0.0 <= tolerance < float("inf"):
        raise UsageError(f"a tolerance of {tolerance:g} is none", action="Give a number from 0")
    replayed = asyncio.run(replay(options.run, Scope(options.only or "all"), tolerance))
    console.document(replay_document(replayed))
    console.say(replay_words(replayed))
    return ExitCode.DONE if replayed.is_same else ExitCode.OUT_OF_LIMITS
