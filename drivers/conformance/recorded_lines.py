"""Lines that answer as a wire trace has it, and say where a driver asks something else."""

from __future__ import annotations

import re
import select
import threading
import time
import uuid
from abc import ABC, abstractmethod
from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import can

from drivers.simulated.serial_line import PtyLine
from drivers.simulated.served_device import Closeable
from drivers.wire_trace import TraceEntry, TrafficDirection

SLICE_S = 0.02
FRAME = re.compile(r"(?P<id>[0-9A-F]{3})#(?P<data>(?:[0-9A-F]{2})*)")
UNASKED_DELAY_S = 0.05
"""What came before the first request comes so long after the line was opened."""


class DialogueDiffers(AssertionError):
    """The driver asks something else than it did when the trace was recorded."""


@dataclass(frozen=True, slots=True)
class RecordedAnswer:
    """Bytes that came, so long after the request before them."""

    delay_s: float
    data: bytes


@dataclass(frozen=True, slots=True)
class RecordedExchange:
    """A request, its number among those of the line, when it was sent, and what came after it."""

    number: int
    time_s: float
    request: bytes
    answers: tuple[RecordedAnswer, ...]

    def __str__(self) -> str:
        return f"request {self.number} of the trace, at {self.time_s:.6f}"


@dataclass(frozen=True, slots=True)
class RecordedTraffic:
    """All of one line: what came before the first request, and the exchanges in their order."""

    unasked: tuple[RecordedAnswer, ...]
    exchanges: tuple[RecordedExchange, ...]

    @classmethod
    def of(cls, entries: Iterable[TraceEntry], line: str) -> RecordedTraffic:
        """What was said on ``line``.

        Raises:
            ValueError: the trace has nothing of it.
        """
        entries = list(entries)
        said = [entry for entry in entries if entry.line == line]
        if not said:
            others = ", ".join(sorted({entry.line for entry in entries})) or "none"
            raise ValueError(f"the trace has no line {line!r}; its lines: {others}")
        sent = [at for at, entry in enumerate(said) if entry.direction is TrafficDirection.SENT]
        ends = [*sent[1:], len(said)]
        return cls(
            _answers(said[: sent[0] if sent else len(said)], said[0].time_s - UNASKED_DELAY_S),
            tuple(
                RecordedExchange(
                    number, said[at].time_s, said[at].data, _answers(said[at + 1 : end], said[at].time_s)
                )
                for number, (at, end) in enumerate(zip(sent, ends, strict=True), 1)
            ),
        )


def _answers(entries: Iterable[TraceEntry], since_s: float) -> tuple[RecordedAnswer, ...]:
    return tuple(RecordedAnswer(max(0.0, entry.time_s - since_s), entry.data) for entry in entries)


class AnswersInOrder:
    """Answers the requests of a line in the order in which they were recorded."""

    def __init__(self, recorded: RecordedTraffic) -> None:
        self._left = deque(recorded.exchanges)

    @property
    def expected(self) -> bytes:
        """The next request; nothing at the end of the trace."""
        return self._left[0].request if self._left else b""

    def answers_to(self, request: bytes) -> tuple[RecordedAnswer, ...]:
        """The answers to the next request, which must be this one."""
        if not self._left:
            raise DialogueDiffers(f"asks {request!r} after the last request of the trace")
        if request != self.expected:
            raise DialogueDiffers(f"asks {request!r}, where {self._left[0]}, is {self.expected!r}")
        return self._left.popleft().answers


class AnswersByRequest:
    """Answers each request as the same one was answered, the first time, the second time and so on.

    For a bus, on which the time of day decides when alarm entries are read. The last answers are repeated.
    """

    def __init__(self, recorded: RecordedTraffic) -> None:
        self._left: defaultdict[bytes, deque[RecordedExchange]] = defaultdict(deque)
        for exchange in recorded.exchanges:
            self._left[exchange.request].append(exchange)

    def answers_to(self, request: bytes) -> tuple[RecordedAnswer, ...]:
        """The answers to the same request, in their turn."""
        if request not in self._left:
            raise DialogueDiffers(f"asks {request!r}, which the trace has nowhere")
        left = self._left[request]
        return (left.popleft() if len(left) > 1 else left[0]).answers


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
        ValueError: the trace has no such line.
        DialogueDiffers: at the end, if the driver asked something else.
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
