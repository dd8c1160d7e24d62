"""One run from the command line, shared by ``demo`` and ``run``: progress, signals, keys, outcome."""

from __future__ import annotations

import sys

from hexacell.application.calibration_run import RunRequest, calibrate, is_unverified
from hexacell.campaign.pose_list import pose_list_of
from hexacell.cli.console import Console
from hexacell.cli.progress import RunProgress
from hexacell.cli.signal_commands import SignalCommands
from hexacell.cli.terminal import HELP, KeyboardCommands, TerminalOperator
from hexacell.errors import ExitCode, HexacellError
from hexacell.presentation.documents import run_document
from hexacell.presentation.run import UNVERIFIED, clock_notice, closing_lines, resume_hint
from procedures.calibration.workflow import expected_records
from procedures.run import events
from procedures.run.commands import CommandQueue


def run_to_end(request: RunRequest, console: Console) -> ExitCode:
    """Carry out a run with a progress bar and print its outcome.

    Ctrl-C, SIGTERM or SIGHUP ends it after the step in progress, a second Ctrl-C at once.

    Raises:
        HexacellError: it could not begin, could not continue, or was stopped.
    """
    factor = request.cell.settings.timing.clock_factor
    if factor != 1.0:
        console.print(clock_notice(factor))
    ended = execute_run(request, console)
    console.document(run_document(request, ended))
    for line in closing_lines(request, ended):
        console.print(line)
    return ExitCode(ended.exit_code)


def execute_run(request: RunRequest, console: Console) -> events.Ended:
    """Run the engine to its end; see :func:`run_to_end`."""
    listed = pose_list_of(request.cell)
    progress = RunProgress(console, expected_records(request.cell.settings, request.mode, listed))
    signals = SignalCommands(console)
    try:
        with progress:
            return signals.run(_calibrate(request, console, progress, signals.queue))
    except HexacellError:
        _print_how_to_resume(request, console, has_started=progress.has_started)
        raise


async def _calibrate(
    request: RunRequest, console: Console, progress: RunProgress, queue: CommandQueue
) -> events.Ended:
    """Calibrate; a person at a terminal may also type commands."""
    if not isinstance(request.operator, TerminalOperator):
        return await calibrate(request, [progress], queue)
    keys = KeyboardCommands(console, queue, sys.stdin)
    request.operator.before_question, request.operator.after_question = progress.hide, keys.listen
    console.print(HELP)
    return await keys.listen_during(calibrate(request, [progress, keys], queue))


def _print_how_to_resume(request: RunRequest, console: Console, *, has_started: bool) -> None:
    if has_started:
        console.print(resume_hint(request))
    if (has_started or request.resume) and is_unverified(request.folder):
        console.error(UNVERIFIED)
