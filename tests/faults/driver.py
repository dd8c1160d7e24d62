"""Runs the real program again and again in processes of their own, and breaks it where it is told to.

``python -m tests.faults.driver`` imports everything once, then forks a child for each order that it
reads, one line of JSON each, and answers with one line when the child has ended. A child is the
program as it is installed; only the number of candidate poses is smaller, which decides how good a
result is and not what becomes of it.
"""

import json
import os
import pickle
import pwd
import signal
import sys
import tempfile
import time
import traceback
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import can.interfaces.virtual
import scipy.stats

import hexacell.cli.commands.run
import hexacell.cli.commands.serve
from drivers.simulated import cell as simulated_cell
from drivers.simulated import robot
from hexacell.cli.app import main
from hexacell.plugins import Group, load
from hexacell.services import search_effort
from procedures.journal import journal
from tests.faults.interception import Failing, intercepted
from tests.faults.steps import pull_out
from tests.small_cell import FEW_CHOICES

UNEXPECTED = 70
"""The exit code for an error that the program did not expect."""

LOADED: tuple[object, ...] = (can.interfaces.virtual, pwd, scipy.stats, simulated_cell)
LOADED += (hexacell.cli.commands.run, hexacell.cli.commands.serve)
"""What the program would import on its way; here once for all its processes."""


@dataclass(frozen=True)
class Order:
    """One run of the program.

    Attributes:
        arguments: as typed.
        folder: where it is typed, and where its temporary files go.
        output: where stdout and stderr go.
        die_after_records: SIGKILL once so many records were appended by this process, before it
            does anything else.
        tear_record: SIGKILL with only half of this record, from 1, written.
        die_after_s: SIGKILL from outside after so many seconds.
        failing: calls to the file system that fail.
        file_size_limit: no file may become larger, bytes (RLIMIT_FSIZE).
        user: run as this user.
        pull: ``device`` whose plug is pulled when ``step`` begins for the first time, and put back when
            ``back`` is written down, if ever.
    """

    arguments: tuple[str, ...]
    folder: str
    output: str
    die_after_records: int | None = None
    tear_record: int | None = None
    die_after_s: float | None = None
    failing: dict[str, Any] | None = None
    file_size_limit: int | None = None
    user: int | None = None
    pull: dict[str, str] | None = None

    def to_json(self) -> str:
        return json.dumps(asdict(self))


def serve() -> None:
    """Carry out orders until there are none."""
    for group, name in (
        (Group.MECHANISMS, "hexaglide"),
        (Group.GAUGES, "sylvac"),
        (Group.GAUGES, "mux10"),
        (Group.GAUGES, "cdi"),
        (Group.ENCODERS, "cia406"),
        (Group.CONTROLLERS, "linuxcncrsh"),
        (Group.CONFIG_FORMATS, "toml"),
    ):
        load(group, name)
    search_effort.EFFORT = FEW_CHOICES
    robot.LINE_STEPS = 8
    scipy.stats.qmc.Sobol(3).random(2)  # which reads a file that not everybody may read
    print("ready", flush=True)
    for line in sys.stdin:
        print(_carried_out(Order(**json.loads(line))), flush=True)


def _carried_out(order: Order) -> int:
    """The exit code; for a process that was killed the signal, negative."""
    child = os.fork()
    if not child:
        _be_the_program(order)
    if order.die_after_s is not None:
        time.sleep(order.die_after_s)
        os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _be_the_program(order: Order) -> None:
    code = UNEXPECTED
    try:
        _surround(order)
        _arm(order)
        code = _run(order)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _surround(order: Order) -> None:
    os.chdir(order.folder)
    tempfile.tempdir = order.output + ".temporary"
    Path(tempfile.tempdir).mkdir(exist_ok=True)
    Path(tempfile.tempdir).chmod(0o777)
    nowhere = os.open(os.devnull, os.O_RDONLY)
    output = os.open(order.output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
    os.dup2(nowhere, 0)
    os.dup2(output, 1)
    os.dup2(output, 2)
    if order.user is not None:
        os.setgroups([])
        os.setgid(order.user)
        os.setuid(order.user)


def _arm(order: Order) -> None:
    if order.die_after_records is not None:
        _die_after(order.die_after_records)
    if order.tear_record is not None:
        _tear(order.tear_record)
    if order.pull is not None:
        pull_out(**order.pull)
    if order.file_size_limit is not None:
        import resource

        resource.setrlimit(resource.RLIMIT_FSIZE, (order.file_size_limit, order.file_size_limit))


def _run(order: Order) -> int:
    if order.failing is None:
        return main(order.arguments)
    failing = Failing(**order.failing)
    try:
        with intercepted(Path(order.folder), failing):
            return main(order.arguments)
    finally:
        Path(order.output + ".calls").write_bytes(pickle.dumps(failing.calls))


def _die_after(records: int) -> None:
    append, appended = journal.Journal.append, 0

    def counting(self: journal.Journal, event: Any) -> None:
        nonlocal appended
        append(self, event)
        appended += 1
        if appended == records:
            os.kill(os.getpid(), signal.SIGKILL)

    journal.Journal.append = counting  # type: ignore[method-assign]


def _tear(record: int) -> None:
    write_whole, written = journal._write_whole, 0

    def tearing(descriptor: int, data: bytes) -> None:
        nonlocal written
        written += 1
        if written == record:
            os.write(descriptor, data[: len(data) // 2])
            os.kill(os.getpid(), signal.SIGKILL)
        write_whole(descriptor, data)

    journal._write_whole = tearing


if __name__ == "__main__":
    serve()
