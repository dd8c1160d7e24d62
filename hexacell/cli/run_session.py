"""Running the engine from the command line, shared by ``demo`` and ``run``."""

from __future__ import annotations

import shlex
import sys
from typing import Any

from hexacell.application.calibration_run import RunRequest, calibrate
from hexacell.campaign.pose_list import pose_list_of
from hexacell.cli.console import Console
from hexacell.cli.progress import RunProgress
from hexacell.cli.signals import Signals
from hexacell.cli.terminal import HELP, KeyboardCommands, TerminalOperator
from hexacell.errors import ExitCode, HexacellError
from procedures.calibration.workflow import Mode, expected_records
from procedures.journal.journal import read_journal
from procedures.run import events
from procedures.run.commands import CommandQueue
from procedures.run.state import fold


def execute_run(order: RunRequest, console: Console) -> events.Ended:
    """Run to the end with a progress bar.

    Ctrl-C, SIGTERM or SIGHUP ends it after the step that is being done, Ctrl-C once more at once.

    Raises:
        HexacellError: it could not begin, could not go on, or somebody stopped it.
    """
    factor = order.cell.settings.timing.clock_factor
    if factor != 1.0:
        console.say(f"The cell's clock runs {factor:g} times as fast as the one on the wall.")
    listed = pose_list_of(order.cell)
    progress = RunProgress(console, expected_records(order.cell.settings, order.mode, listed))
    signals = Signals(console)
    try:
        with progress:
            return signals.run(_with_keys(order, console, progress, signals.inbox))
    except HexacellError:
        _say_how_to_go_on(order, console, has_begun=progress.has_begun)
        raise


async def _with_keys(
    order: RunRequest, console: Console, progress: RunProgress, inbox: CommandQueue
) -> events.Ended:
    """Calibrate; a person who is asked at a terminal may also type there what is to happen."""
    if not isinstance(order.operator, TerminalOperator):
        return await calibrate(order, [progress], inbox)
    keys = KeyboardCommands(console, inbox, sys.stdin)
    order.operator.before, order.operator.afterwards = progress.make_room, keys.listen
    console.say(HELP)
    return await keys.run_cancellable(calibrate(order, [progress, keys], inbox))


def _say_how_to_go_on(order: RunRequest, console: Console, *, has_begun: bool) -> None:
    if has_begun:
        console.say(f"Stopped; what was measured is kept. To go on:\n  {resume_command(order)}")
    if (has_begun or order.resume) and _is_unverified(order):
        console.error(
            "The controller's config holds the new geometry, which is not verified yet: going on "
            "verifies it, or puts the old one back."
        )


def _is_unverified(order: RunRequest) -> bool:
    try:
        return fold(read_journal(order.folder.journal)).is_unverified
    except HexacellError:
        return False


def resume_command(order: RunRequest) -> str:
    """What to type to go on with a run, by somebody at a terminal."""
    mode = ["--mode", "check"] if order.mode is Mode.CHECK else []
    words = ["hexacell", "run", str(order.cell.path), "--resume", str(order.folder.path), *mode]
    return shlex.join(words)


def run_document(order: RunRequest, ended: events.Ended) -> dict[str, Any]:
    """What ``run --json`` and ``demo --json`` print."""
    measurements = order.folder.measurements
    return {
        "exit_code": ended.exit_code,
        "line": ended.line,
        "run": str(order.folder.path),
        "measurements": str(measurements) if measurements.is_file() else None,
        "config": str(order.cell.config_path),
    }


def finish(order: RunRequest, ended: events.Ended, console: Console) -> ExitCode:
    """Say how it ended and where everything is."""
    console.document(run_document(order, ended))
    console.say(f"Everything about this run is in {order.folder.path}")
    console.say(ended.line)
    return ExitCode(ended.exit_code)
