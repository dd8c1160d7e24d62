"""The server of one simulated gauge line, with the timing of a real one."""

import logging
import os
import queue
import re
import select
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from enum import StrEnum
from time import monotonic

import numpy as np

from drivers.simulated.gauges.instruments import Instrument
from drivers.simulated.serial_line import SerialLine
from drivers.simulated.served_device import Closeable
from hexacell.clock import CellClock

COMMAND_LIMIT = 256
SHORTEST_PERIOD_S = 0.005
"""Shortest period of what is sent unasked, s of real time, however quick the cell's clock is."""
JOB_TIMEOUT_S = 60.0
_log = logging.getLogger(__name__)
LATE_TIMEOUTS = 1.5
"""A late answer comes after so many of the driver's time-outs."""
LATE_EVERY = 4
DAMAGED_EVERY = 5
NULS = b"\0\0"
VALUE = re.compile(rb"\d\.\d|[\x03\x04]")
"""Found in an answer with a value: a number, or a function of Modbus that reads registers."""


class LineFault(StrEnum):
    """A fault of a line, by its name in a cell file."""

    DAMAGED = "damaged"
    CUT_SHORT = "cut short"
    REPEATED = "repeated"
    UNASKED = "unasked"
    LATE = "late"
    ECHOING = "echoing"
    NUL_BYTES = "NUL bytes"


class LineFaults:
    """The faults of one line that are on. Used by the thread of the line; switched from any."""

    def __init__(self, late_s: float) -> None:
        self._late_s = late_s
        self._on: set[LineFault] = set()
        self._random = np.random.default_rng(1)
        self._answers = 0
        self._latest = b""

    def switch(self, fault: LineFault, *, on: bool) -> None:
        self._on = self._on | {fault} if on else self._on - {fault}

    def delay_s(self) -> float:
        """Real seconds by which the next answer is later."""
        is_late = LineFault.LATE in self._on and self._answers % LATE_EVERY == 0
        return self._late_s if is_late else 0.0

    def sent(self, command: bytes, answer: bytes) -> bytes:
        """What is sent instead of an answer."""
        self._answers += 1
        if not answer:
            return answer
        unchanged, before = answer, self._latest
        is_whole = self._answers % DAMAGED_EVERY != 0
        changes: dict[LineFault, Callable[[bytes], bytes]] = {
            LineFault.DAMAGED: lambda sent: sent if is_whole else self._damaged(sent),
            LineFault.CUT_SHORT: lambda sent: sent if is_whole else sent[: len(sent) // 2],
            LineFault.REPEATED: lambda sent: sent + unchanged,
            LineFault.UNASKED: lambda sent: before + sent,
            LineFault.ECHOING: lambda sent: command + sent,
            LineFault.NUL_BYTES: lambda sent: NULS + sent,
        }
        for fault, change in changes.items():
            if fault in self._on:
                answer = change(answer)
        if VALUE.search(unchanged):
            self._latest = unchanged
        return answer

    def _damaged(self, answer: bytes) -> bytes:
        """One bit is another."""
        place = int(self._random.integers(len(answer)))
        changed = answer[place] ^ 1 << int(self._random.integers(7))
        return answer[:place] + bytes((changed,)) + answer[place + 1 :]


class GaugeLineServer(Closeable):
    """Serves an instrument on a serial line, from a thread of its own, until it is closed.

    An answer is sent after ``latency_s`` plus the transmission time of request and answer, in seconds
    of the cell's clock. Answers are sent one after another, as on a cable.
    An instrument with a period sends by itself. One that restarts when its port is opened hears and
    sends nothing for ``restart_s``.
    """

    def __init__(
        self,
        instrument: Instrument,
        line: SerialLine,
        clock: CellClock,
        *,
        latency_s: float,
        restart_s: float = 0.0,
        baudrate: int | None = None,
        faults: LineFaults | None = None,
    ) -> None:
        self.instrument = instrument
        self.faults = faults or LineFaults(late_s=0.0)
        self.url = line.url
        self.address = instrument.address(line.url)
        self._line = line
        self._clock = clock
        self._latency_s = latency_s
        self._byte_s = instrument.bits_a_byte / (baudrate or instrument.baudrate)
        self.is_silent = False  # every answer is lost
        self._restart_s, self._openings, self._restarted_s = restart_s, line.openings, 0.0
        self._received = b""
        self._answers: deque[tuple[float, bytes]] = deque()
        self._jobs: queue.SimpleQueue[tuple[Callable[[], None], Future[None]]] = queue.SimpleQueue()
        self._wake_read, self._wake_write = os.pipe()
        self._stopping = False
        self._next_unasked = None if instrument.period_s is None else clock.now()
        self._thread = threading.Thread(target=self._serve, name=f"gauges on {self.url}")
        self._thread.start()

    def set_unplugged(self, *, on: bool) -> None:
        """Unplug the line, or plug it in again."""
        self._run_on_thread(self._unplug if on else self._line.plug_in)

    def switch_on(self, channel: int = 1) -> None:
        """Switch an indicator on again; the instrument sends its introduction."""

        def switch_on() -> None:
            self.instrument.indicators[channel].switch_on()
            self._line.send(self.instrument.introduction)

        self._run_on_thread(switch_on)

    def close(self) -> None:
        if self._stopping:
            return
        self._stopping = True
        os.write(self._wake_write, b"x")
        self._thread.join()
        self._line.close()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _run_on_thread(self, job: Callable[[], None]) -> None:
        """Run a job on the thread of the line, which avoids concurrent access."""
        if self._stopping:
            raise RuntimeError(f"{self.url} is closed")
        done: Future[None] = Future()
        self._jobs.put((job, done))
        os.write(self._wake_write, b"x")
        done.result(JOB_TIMEOUT_S)

    def _serve(self) -> None:
        try:
            while not self._stopping:
                self._wait_and_serve()
        except Exception:  # an error of the simulated physics appears as a broken line
            _log.exception("the simulated gauges on %s have failed", self.url)
            self._unplug()

    def _wait_and_serve(self) -> None:
        times = [due for due, _ in self._answers][:1]
        if self._next_unasked is not None:
            times.append(self._next_unasked)
        until_next_s = max(0.0, self._clock.real_seconds(min(times) - self._clock.now())) if times else None
        ready, _, _ = select.select([self._wake_read, *self._line.descriptors()], [], [], until_next_s)
        if self._wake_read in ready:
            os.read(self._wake_read, COMMAND_LIMIT)
            while not self._jobs.empty():
                job, done = self._jobs.get()
                try:
                    job()
                except Exception as error:
                    done.set_exception(error)
                else:
                    done.set_result(None)
        else:
            received = self._line.receive(ready)
            if self._line.openings != self._openings:
                self._openings, self._restarted_s = self._line.openings, monotonic() + self._restart_s
            if self._is_restarting():
                received = self._received = b""
            commands, rest = self.instrument.split(self._received + received)
            self._received = rest[-COMMAND_LIMIT:]
            for command in commands:
                self._answer(command)
        self._prepare_unasked()
        while self._answers and self._answers[0][0] <= self._clock.now():
            self._line.send(self._answers.popleft()[1])

    def _is_restarting(self) -> bool:
        return monotonic() < self._restarted_s

    def _answer(self, command: bytes) -> None:
        answer = self.instrument.answer(command)
        if self.is_silent:
            answer = b""
        late_s = self.faults.delay_s() / self._clock.real_seconds(1.0)
        answer = self.faults.sent(command + self.instrument.command_end, answer)
        wire_s = (len(command) + len(self.instrument.command_end) + len(answer)) * self._byte_s
        free_at = max([self._clock.now(), *(due for due, _ in self._answers)])
        self._answers.append((free_at + self._latency_s + late_s + wire_s, answer))

    def _prepare_unasked(self) -> None:
        """What the instrument sends by itself, when it is time; a late one is lost."""
        period_s, now = self.instrument.period_s, self._clock.now()
        if period_s is None or self._next_unasked is None or now < self._next_unasked:
            return
        scale = self._clock.real_seconds(1.0)
        if late_s := self.faults.delay_s():
            self.faults.sent(b"", b"")
            self._next_unasked = now + late_s / scale
            return
        self._next_unasked = now + max(period_s, SHORTEST_PERIOD_S / scale)
        for frame in () if self.is_silent or self._is_restarting() else self.instrument.unasked():
            sent = self.faults.sent(b"", frame)
            self._answers.append((now + len(sent) * self._byte_s, sent))

    def _unplug(self) -> None:
        self._received = b""
        self._answers.clear()
        self._line.unplug()
