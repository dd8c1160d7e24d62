"""Lines that answer as a wire trace has it, and say where a driver asks something else."""

from __future__ import annotations

import re
import select
import threading
import time
import uuid
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import can

from drivers.conformance.recorded_dialogue import (
    AnswersByRequest,
    AnswersInOrder,
    RecordedAnswer,
    RecordedTraffic,
)
from drivers.simulated.serial_line import PtyLine
from drivers.simulated.served_device import Closeable
from drivers.wire_trace import TraceEntry

SLICE_S = 0.02
FRAME = re.compile(r"(?P<id>[0-9A-F]{3})#(?P<data>(?:[0-9A-F]{2})*)")


@contextmanager
def recorded_line(entries: Iterable[TraceEntry], line: str) -> Iterator[str]:
    """Serve a serial line of a trace on a pseudo-terminal, and give its URL.

    Requests must come in the order of the trace; what came after each comes again, as late as it did, or
    before the next request.

    Raises:
        ValueError: the trace has no such line.
        DialogueDiffers: at the end, whatever else was raised, if the driver asked something else. The line
            is broken from there on.
    """
    with RecordedLine(RecordedTraffic.of(entries, line)) as served, _in_agreement(served):
        yield served.url


@contextmanager
def recorded_bus(entries: Iterable[TraceEntry], line: str) -> Iterator[Mapping[str, Any]]:
    """Serve the encoders' bus of a trace, and give the settings for ``can.Bus``.

    Each frame is answered as the same frame was, whatever the order.

    Raises:
        ValueError: as :func:`recorded_line`.
        DialogueDiffers: as :func:`recorded_line`.
    """
    with RecordedBus(RecordedTraffic.of(entries, line)) as served, _in_agreement(served):
        yield served.settings


@contextmanager
def _in_agreement(served: _Served) -> Iterator[None]:
    """Say at the end where the driver asked something else: the cause of whatever it raised for that."""
    try:
        yield
    finally:
        served.stop()
        served.require_agreement()


class _Served(Closeable, ABC):
    """A thread that answers until it is closed, or until the driver asks something else."""

    def __init__(self, name: str, unasked: Iterable[RecordedAnswer]) -> None:
        self._failure: Exception | None = None
        self._stopping = threading.Event()
        self._due: deque[tuple[float, bytes]] = deque()
        self._unasked = tuple(unasked)
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def require_agreement(self) -> None:
        """Raise ``DialogueDiffers`` if the driver asked something else."""
        if self._failure is not None:
            raise self._failure

    def stop(self) -> None:
        """Answer no more; stopping twice is harmless."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join()

    @abstractmethod
    def _serve_once(self) -> None:
        """Wait for a request for no longer than ``_wait_s``, and schedule its answers."""

    @abstractmethod
    def _send(self, data: bytes) -> None: ...

    def _break(self) -> None:
        """Break the line, so that the driver need not wait for its time-out."""

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._serve_once()
                while self._due and self._due[0][0] <= time.monotonic():
                    self._send(self._due.popleft()[1])
        except Exception as error:  # it must reach the test
            self._failure = error
            self._break()

    def _schedule(self, answers: Iterable[RecordedAnswer]) -> None:
        """Answers to come; those to the request before come first, whatever is left of their delay."""
        now_s = time.monotonic()
        self._due = deque((now_s, data) for _, data in self._due)
        self._due += [(now_s + answer.delay_s, answer.data) for answer in answers]

    def _begin(self) -> None:
        """The line is open: what nobody asked for comes."""
        answers, self._unasked = self._unasked, ()
        self._schedule(answers)

    def _wait_s(self) -> float:
        left_s = self._due[0][0] - time.monotonic() if self._due else SLICE_S
        return min(SLICE_S, max(0.0, left_s))


class RecordedLine(_Served):
    """A serial line of a trace, on a pseudo-terminal at ``url``."""

    def __init__(self, recorded: RecordedTraffic) -> None:
        super().__init__("recorded line", recorded.unasked)
        self._line = PtyLine("recorded")
        self.url = self._line.url
        self._script = AnswersInOrder(recorded)
        self._received = b""
        self._thread.start()

    def close(self) -> None:
        """End the thread and close the line."""
        self.stop()
        self._line.close()

    def _serve_once(self) -> None:
        ready, _, _ = select.select(self._line.descriptors(), [], [], self._wait_s())
        if not ready:
            return
        if self._unasked:
            self._begin()
        self._received += self._line.receive(ready)
        while self._received:
            request = self._received[: len(self._script.expected)] or self._received
            if self._script.expected.startswith(self._received) and request != self._script.expected:
                return  # the rest of it comes yet
            answers = self._script.answers_to(request)
            self._received = self._received[len(request) :]
            self._schedule(answers)

    def _send(self, data: bytes) -> None:
        self._line.send(data)

    def _break(self) -> None:
        self._line.unplug()


class RecordedBus(_Served):
    """The encoders' bus of a trace, on a virtual bus that ``settings`` open."""

    def __init__(self, recorded: RecordedTraffic) -> None:
        super().__init__("recorded bus", recorded.unasked)
        self.settings: dict[str, Any] = {"interface": "virtual", "channel": f"recorded-{uuid.uuid4().hex}"}
        self._bus = can.Bus(**self.settings)
        self._script = AnswersByRequest(recorded)
        self._thread.start()

    def close(self) -> None:
        """End the thread and close the bus."""
        self.stop()
        self._bus.shutdown()

    def _serve_once(self) -> None:
        message = self._bus.recv(self._wait_s())
        if message is not None:
            if self._unasked:
                self._begin()
            text = f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}"
            self._schedule(self._script.answers_to(text.encode()))

    def _send(self, data: bytes) -> None:
        match = FRAME.fullmatch(data.decode())
        if match is None:
            raise ValueError(f"{data!r} is no frame of a trace")
        self._bus.send(
            can.Message(
                arbitration_id=int(match["id"], 16), data=bytes.fromhex(match["data"]), is_extended_id=False
            )
        )
