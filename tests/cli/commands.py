"""Commands in processes of their own: run to their end, or started and watched."""

import json
import os
import secrets
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.signals import terminal_signals
from tests.waiting import wait_until


@dataclass(frozen=True)
class Outcome:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def document(self) -> Any:
        """The one JSON document that is all of stdout."""
        assert self.out.endswith("\n")
        return json.loads(self.out)


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "hexacell", *map(str, arguments)]


def run_of_little_effort(*arguments: object) -> list[str]:
    return [sys.executable, str(Path(__file__).with_name("little_effort.py")), *map(str, arguments)]


def surroundings(temporary: Path) -> dict[str, str]:
    """An environment with a folder of its own for temporary files, and help of the usual width."""
    temporary.mkdir()
    return {**os.environ, "COLUMNS": "80", "TMPDIR": str(temporary)}


def run_command(folder: Path, *arguments: object) -> Outcome:
    """Run a command in ``folder`` without a terminal, and wait until it ends."""
    temporary = folder / f"temporary-{secrets.token_hex(4)}"
    with terminal_signals():
        ended = subprocess.run(
            command(*arguments),
            cwd=folder,
            env=surroundings(temporary),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
    assert "Traceback" not in ended.stderr, ended.stderr
    temporary.rmdir()  # which fails where something was left in it
    return Outcome(ended.returncode, ended.stdout, ended.stderr)


@dataclass
class Process:
    """A running command; its output goes to files."""

    popen: subprocess.Popen[str]
    out_path: Path
    err_path: Path
    temporary: Path

    @property
    def out(self) -> str:
        return self.out_path.read_text()

    @property
    def err(self) -> str:
        return self.err_path.read_text()

    def wait_for(self, words: str, where: Callable[[], str]) -> None:
        """Wait until it has printed some text."""
        self.wait_until(lambda: words in where(), words)

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        wait_until(lambda: condition() or self.popen.poll() is not None)
        if not condition():
            pytest.fail(f"waiting for {what!r}: {self.popen.poll()}\n{self.out}\n{self.err}")

    def ended(self) -> Outcome:
        """How it ends by itself; it leaves no temporary files."""
        code = self.popen.wait()
        assert "Traceback" not in self.err, self.err
        assert list(self.temporary.iterdir()) == []
        return Outcome(code, self.out, self.err)

    def stopped(self, number: signal.Signals) -> Outcome:
        """How it ends on a signal."""
        self.popen.send_signal(number)
        return self.ended()


Start = Callable[..., Process]


@contextmanager
def started_in(folder: Path) -> Iterator[Start]:
    """Starts commands in a folder, ``through`` a shell's script if there is one; kills them in the end."""
    processes: list[Process] = []

    def start(*arguments: object, through: str | None = None, **streams: int) -> Process:
        out, err, temporary = (folder / f"{name}-{len(processes)}" for name in ("out", "err", "temporary"))
        with out.open("w") as to_out, err.open("w") as to_err, terminal_signals():
            words = run_of_little_effort if arguments[0] in {"run", "apply"} else command
            popen = subprocess.Popen(
                [*(["sh", "-c", through, "sh"] if through else []), *words(*arguments)],
                cwd=folder,
                env=surroundings(temporary),
                stdin=streams.get("stdin", subprocess.DEVNULL),
                stdout=streams.get("stdout", to_out),
                stderr=streams.get("stderr", to_err),
                text=True,
            )
        processes.append(Process(popen, out, err, temporary))
        return processes[-1]

    try:
        yield start
    finally:
        for process in processes:
            process.popen.kill()
            process.popen.wait()
