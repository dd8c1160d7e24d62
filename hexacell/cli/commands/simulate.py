"""``hexacell simulate``: serves a simulated cell to other processes."""

import argparse
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from hexacell.cli.cell_argument import cell_at
from hexacell.cli.console import Console
from hexacell.errors import ExitCode, UsageError
from hexacell.services.run.demo import served_cell, with_faults
from hexacell.storage.atomic_files import write_atomically


def main(options: argparse.Namespace, console: Console) -> ExitCode:
    """Serve until interrupted; stdout gets a cell file with the addresses of the served devices."""
    cell = with_faults(cell_at(options.cell, console), options.fault)
    if options.output is not None:
        own = {path.resolve() for path in (cell.path, *cell.config_paths)}
        if options.output.resolve() in own:
            problem = f"--output {options.output} is a file of the simulated cell"
            raise UsageError(problem, action="Name another file")
    with _blocked_signals() as stops, served_cell(cell) as text:
        if options.output is None:
            print(text, flush=True)
        else:
            write_atomically(options.output, text.encode())
        print("serving; Ctrl-C ends it", file=sys.stderr, flush=True)
        signal.sigwait(stops)
    return ExitCode.DONE


@contextmanager
def _blocked_signals() -> Iterator[set[signal.Signals]]:
    """Block the signals that end it in this thread and those it starts; ``sigwait`` receives them.

    Otherwise a thread of a simulated device may take the signal, and the main thread waits on.
    """
    stops = {signal.SIGINT, signal.SIGTERM}
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup has it
        stops.add(signal.SIGHUP)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, stops)
    try:
        yield stops
    finally:
        while pending := signal.sigpending() & stops:
            signal.sigwait(pending)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
