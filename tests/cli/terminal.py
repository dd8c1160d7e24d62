"""A terminal that a command is typed at."""

import os
import select
from dataclasses import dataclass, field

from tests.cli.commands import Process, Start
from tests.waiting import wait_until


@dataclass
class Terminal:
    """A terminal of 80 columns, and what was shown on it."""

    master: int
    slave: int
    shown: str = ""
    seen: int = field(default=0)

    def read_until(self, words: str) -> str:
        """What is shown from the last time up to these words."""
        while (place := self.shown.find(words, self.seen)) < 0:
            if select.select([self.master], [], [], 0.05)[0]:
                self.shown += os.read(self.master, 65536).decode()
        passage = self.shown[self.seen : place + len(words)]
        self.seen = place + len(words)
        return passage

    def drain(self) -> str:
        """All that is shown."""
        while select.select([self.master], [], [], 0.0)[0]:
            self.shown += os.read(self.master, 65536).decode()
        return self.shown

    def type(self, text: str) -> None:
        os.write(self.master, text.encode())


def start_at(terminal: Terminal, start: Start, *arguments: object) -> Process:
    """A command with its input and its stderr at a terminal; stdout goes to a file."""
    return start(*arguments, stdin=terminal.slave, stderr=terminal.slave)


def ended(process: Process, terminal: Terminal) -> int | None:
    """How it ends; its terminal is read meanwhile."""

    def is_over() -> bool:
        terminal.drain()
        return process.popen.poll() is not None

    wait_until(is_over)
    assert "Traceback" not in terminal.drain()
    return process.popen.poll()
