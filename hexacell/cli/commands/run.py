"""``hexacell run``: the whole job on a cell."""

from __future__ import annotations

import argparse

from hexacell.archive import find_run, new_run
from hexacell.cell.file import Cell, load_cell
from hexacell.cli.calibrating import carry_out, finish
from hexacell.cli.console import Console
from hexacell.cli.people import AtTerminal
from hexacell.composition.calibration import Order
from hexacell.errors import ExitCode
from procedures.calibration import Mode
from procedures.operators import Nobody, Operator


def main(options: argparse.Namespace) -> ExitCode:
    """Calibrate, or check."""
    console = Console(options.json)
    cell = load_cell(options.cell)
    order = Order(
        cell=cell,
        folder=find_run(cell, options.resume) if options.resume else new_run(cell),
        mode=_mode(options),
        operator=_operator(options, cell, console),
        unattended=options.unattended,
        resume=options.resume is not None,
    )
    return finish(order, carry_out(order, console), console)


def _mode(options: argparse.Namespace) -> Mode:
    if options.mode:
        return Mode(options.mode)
    return Mode.CHECK if options.unattended else Mode.OPTIMISE


def _operator(options: argparse.Namespace, cell: Cell, console: Console) -> Operator:
    del cell
    return Nobody() if options.unattended else AtTerminal(console)
