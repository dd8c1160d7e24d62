"""``hexacell simulate``: a simulated cell for other processes."""

from __future__ import annotations

import argparse
import signal
import sys
import threading

from hexacell.cell.file import dump, load_cell
from hexacell.composition.devices import served
from hexacell.errors import ExitCode, UsageError
from hexacell.files import write_atomically


def main(options: argparse.Namespace) -> ExitCode:
    """Serve until interrupted; stdout gets the cell file that reaches it."""
    cell = load_cell(options.cell)
    if cell.settings.simulation is None:
        raise UsageError("there is no [simulation] in it: this is a real cell", subject=cell.path)
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    with served(cell, other_processes=True) as settings:
        controller = settings.controller.model_copy(update={"config": str(cell.config_path.resolve())})
        text = dump(settings.model_copy(update={"controller": controller}))
        if options.output is None:
            print(text, flush=True)
        else:
            write_atomically(options.output, text.encode())
        print("serving; Ctrl-C ends it", file=sys.stderr, flush=True)
        stop.wait()
    return ExitCode.DONE
