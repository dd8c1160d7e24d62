"""``hexacell run``: the whole job on a cell."""

from __future__ import annotations

import argparse

from hexacell.application.calibration_run import RunRequest
from hexacell.cell.loader import load_cell
from hexacell.cli.console import Console
from hexacell.cli.run_session import run_to_end
from hexacell.cli.terminal import TerminalOperator, is_interactive
from hexacell.errors import ExitCode
from hexacell.runs.run_folder import find_run, new_run
from procedures.calibration.workflow import Mode
from procedures.run.questions import UnattendedOperator


def main(options: argparse.Namespace) -> ExitCode:
    """Calibrate, or check."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    attended = is_interactive() and not options.unattended
    request = RunRequest(
        cell=cell,
        folder=find_run(cell, options.resume) if options.resume else new_run(cell),
        mode=_mode(options),
        operator=TerminalOperator(console) if attended else UnattendedOperator(),
        unattended=not attended,
        resume=options.resume is not None,
    )
    return run_to_end(request, console)


def _mode(options: argparse.Namespace) -> Mode:
    if options.mode:
        return Mode(options.mode)
    return Mode.CHECK if options.unattended else Mode.OPTIMISE
