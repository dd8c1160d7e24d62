"""Progress of a run at a terminal: a bar, a line for each set, and answers to what a person asks."""

import asyncio
import os
import sys
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager

from rich.console import Console as RichConsole
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from hexacell.cli.console import Console
from hexacell.printable import printable
from hexacell.run_process.run_device_watch import RunDeviceWatch
from hexacell.text.layout import wrapped
from hexacell.text.line_face import EventFormatter, activity, gauges_text, record_text
from procedures.run.cancellation import cancel_and_wait
from procedures.run.state import RunState
from procedures.steps import events
from procedures.steps.commit import Commit
from procedures.steps.place import Place

PLAIN_TERMINALS = {"dumb", "unknown"}
"""Values of TERM: no bar is drawn, and each record has a line."""


class RunProgress:
    """A listener of the engine that prints events and moves ``bar``, a context manager.

    ``has_started`` is whether the run exists on the disk, and so can be resumed.
    """

    def __init__(self, console: Console, expected_records: int) -> None:
        self.has_started = False
        self._expected = expected_records
        self._console = console
        self._formatter = EventFormatter()
        self.bar = _bar()
        self._is_plain = is_plain_terminal()
        self._task = self.bar.add_task("connecting", total=expected_records)

    def __call__(self, event: events.Event, state: RunState) -> None:
        """Show one event."""
        if not self.has_started:
            # Reset, not updated: records of an earlier attempt do not count for the present speed.
            self.bar.reset(self._task, completed=state.completed)
            self.has_started = True
        if _may_ask(event):
            self.bar.stop()
        else:
            self.bar.start()
        doing = activity(event)
        self.bar.update(self._task, completed=state.completed, description=doing and printable(doing))
        for line in self._formatter.lines(event, state):
            self._console.print(line)
        if self._is_plain and isinstance(event, events.RecordTaken):
            line = f"{state.completed} of {self._expected}: {record_text(event)}"
            self._console.print(wrapped(line, indent=2))

    def print_status(self) -> None:
        """Print where the run is."""
        self._console.print(self._formatter.status_text(self._expected))


@contextmanager
def task_bar(name: str) -> Iterator[Callable[[int, int], None]]:
    """A bar for tasks; call what it gives with the number done and the number of all."""
    with _bar() as bar:
        task = bar.add_task(name, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def is_plain_terminal() -> bool:
    """Whether people read lines only: a dumb terminal, or a screen reader's."""
    terminal = sys.stderr is not None and sys.stderr.isatty()
    return terminal and os.environ.get("TERM", "dumb") in PLAIN_TERMINALS


def _may_ask(event: events.Event) -> bool:
    """Whether a person may be asked something until the next event."""
    if isinstance(event, events.StepBegun):
        return isinstance(event.step, Place | Commit)
    return isinstance(event, events.Paused | events.Interrupted)


def _bar() -> Progress:
    terminal = sys.stderr is not None and sys.stderr.isatty()
    return Progress(
        TextColumn("{task.description:<40}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("left"),
        console=RichConsole(file=sys.stderr),
        transient=True,
        disable=not terminal or is_plain_terminal(),
        # Text for the same terminal goes above the bar; text for a file or a pipe goes there.
        redirect_stdout=sys.stdout is not None and sys.stdout.isatty(),
    )


@asynccontextmanager
async def gauges_on_request(
    console: Console, watching: RunDeviceWatch
) -> AsyncIterator[Callable[[], None]]:
    """Gives what prints the gauges when a person at a plain terminal asks, without delaying the run."""

    async def note_noise() -> None:
        async for _ in watching.snapshots():
            pass

    async def print_fresh() -> None:
        console.print(gauges_text(await watching.fresh_snapshot()))

    tasks = [asyncio.ensure_future(note_noise())]
    try:
        yield lambda: tasks.append(asyncio.ensure_future(print_fresh()))
    finally:
        watching.close()
        for task in tasks:
            await cancel_and_wait(task)
