"""``hexacell run``: the whole job on a cell."""

from __future__ import annotations

import argparse

from hexacell.archive import find_run, new_run
from hexacell.cell.file import load_cell
from hexacell.cli.calibrating import carry_out, finish
from hexacell.cli.console import Console
from hexacell.cli.people import AtTerminal, somebody_is_there
from hexacell.composition.calibration import Order
from hexacell.errors import ExitCode
from procedures.calibration import Mode
from procedures.operators import Nobody


def main(options: argparse.Namespace) -> ExitCode:
    """Calibrate, or check."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    attended = somebody_is_there() and not options.unattended
    order = Order(
        cell=cell,
        folder=find_run(cell, options.resume) if options.resume else new_run(cell),
        mode=_mode(options),
        operator=AtTerminal(console) if attended else Nobody(),
        unattended=not attended,
        resume=options.resume is not None,
    )
    return finish(order, carry_out(order, console), console)


def _mode(options: argparse.Namespace) -> Mode:
    if options.mode:
        return Mode(options.mode)
    return Mode.CHECK if options.unattended else Mode.OPTIMISE
