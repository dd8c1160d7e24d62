"""Lines that answer as a wire trace has it, and say where a driver asks something else."""

import re
import select
import threading
import time
import uuid
from abc import ABC, abstractmethod
from collections import defaultdict, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import can

from drivers.simulated.serial_line import PtyLine
from drivers.wire_trace import TraceEntry, TrafficDirection

SLICE_S = 0.02
FRAME = re.compile(r"(?P<id>[0-9A-F]{3})#(?P<data>(?:[0-9A-F]{2})*)")
UNASKED_DELAY_S = 0.05
"""What came before the first request comes so long after the line was opened."""

Address = TypeVar("Address")
"""Where a driver finds the line."""

Answers = tuple[tuple[float, bytes], ...]
"""Bytes that came, each with how long after the request before them, s."""


class DialogueDiffers(AssertionError):
    """The driver asks something else than it did when the trace was recorded."""


@dataclass(frozen=True, slots=True)
class RecordedExchange:
    """A request, its number among those of the line, when it was sent, and what came after it."""

    number: int
    time_s: float
    request: bytes
    answers: Answers

    def __str__(self) -> str:
        return f"request {self.number} of the trace, at {self.time_s:.6f}"


def traffic(entries: Iterable[TraceEntry], line: str) -> tuple[Answers, list[RecordedExchange]]:
    """All of one line: what came before the first request, and the exchanges in their order.

    Raises:
        ValueError: the trace has nothing of it.
    """
    entries = list(entries)
    if not (said := [entry for entry in entries if entry.line == line]):
        others = ", ".join(sorted({entry.line for entry in entries})) or "none"
        raise ValueError(f"the trace has no line {line!r}; its lines: {others}")

    def answers(start: int, end: int, since_s: float) -> Answers:
        return tuple((max(0.0, entry.time_s - since_s), entry.data) for entry in said[start:end])

    sent = [at for at, entry in enumerate(said) if entry.direction is TrafficDirection.SENT]
    ends = [*sent, len(said)]
    exchanges = [
        RecordedExchange(
            number, said[at].time_s, said[at].data, answers(at + 1, ends[number], said[at].time_s)
        )
        for number, at in enumerate(sent, 1)
    ]
    return answers(0, ends[0], said[0].time_s - UNASKED_DELAY_S), exchanges


class _Served(ABC, Generic[Address]):
    """A thread that answers as long as the context lasts, or until the driver asks something else.

    At the end that is raised: it is the cause of whatever was raised before.
    """

    _address: Address

    def __init__(self, unasked: Answers) -> None:
        self._failure: Exception | None = None
        self._stopping = threading.Event()
        self._due: deque[tuple[float, bytes]] = deque()
        self._unasked = unasked
        self._thread = threading.Thread(target=self._run, name="recorded line", daemon=True)

    def __enter__(self) -> Address:
        self._thread.start()
        return self._address

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join()
        self._close()
        if self._failure is not None:
            raise self._failure

    @abstractmethod
    def _serve_once(self) -> None:
        """Wait for a request for no longer than ``_wait_s``, and schedule its answers."""

    @abstractmethod
    def _send(self, data: bytes) -> None: ...

    @abstractmethod
    def _close(self) -> None: ...

    def _break(self) -> None:
        """Break the line, where that is possible, so that the driver need not wait for its time-out."""

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._serve_once()
                while self._due and self._due[0][0] <= time.monotonic():
                    self._send(self._due.popleft()[1])
        except Exception as error:  # it must reach the test
            self._failure = error
            self._break()

    def _schedule(self, answers: Answers) -> None:
        """Answers to come; those to the request before come first, whatever is left of their delay."""
        now_s = time.monotonic()
        self._due = deque((now_s, data) for _, data in self._due)
        self._due += [(now_s + delay_s, data) for delay_s, data in answers]

    def _wait_s(self) -> float:
        left_s = self._due[0][0] - time.monotonic() if self._due else SLICE_S
        return min(SLICE_S, max(0.0, left_s))


class recorded_line(_Served[str]):  # noqa: N801 - named as what a test writes behind ``with``
    """Serve a serial line of a trace on a pseudo-terminal, and give its URL.

    Requests must come in the order of the trace; what came after each comes again, as late as it did, or
    before the next request.

    Raises:
        ValueError: the trace has no such line.
        DialogueDiffers: at the end, whatever else was raised, if the driver asked something else. The line
            is broken from there on.
    """

    def __init__(self, entries: Iterable[TraceEntry], line: str) -> None:
        unasked, exchanges = traffic(entries, line)
        super().__init__(unasked)
        self._left = deque(exchanges)
        self._line = PtyLine("recorded")
        self._address = self._line.url
        self._received = b""

    def _serve_once(self) -> None:
        ready, _, _ = select.select(self._line.descriptors(), [], [], self._wait_s())
        if not ready:
            return
        self._schedule(self._unasked)  # the line is open now
        self._unasked = ()
        self._received += self._line.receive(ready)
        while self._received:
            expected = self._left[0].request if self._left else b""
            request = self._received[: len(expected)] or self._received
            if expected.startswith(self._received) and request != expected:
                return  # the rest of it comes yet
            if not self._left:
                raise DialogueDiffers(f"asks {request!r} after the last request of the trace")
            if request != expected:
                raise DialogueDiffers(f"asks {request!r}, where {self._left[0]}, is {expected!r}")
            self._received = self._received[len(request) :]
            self._schedule(self._left.popleft().answers)

    def _send(self, data: bytes) -> None:
        self._line.send(data)

    def _break(self) -> None:
        self._line.unplug()

    def _close(self) -> None:
        self._line.close()


class recorded_bus(_Served[Mapping[str, Any]]):  # noqa: N801
    """Serve the encoders' bus of a trace on a virtual bus, and give the settings for ``can.Bus``.

    Each frame is answered as the same one was, the first time, the second time and so on: the time of day
    decides when alarm entries are read. The last answers are repeated.

    Raises:
        ValueError: the trace has no such line.
        DialogueDiffers: at the end, if the driver asked something else.
    """

    def __init__(self, entries: Iterable[TraceEntry], line: str) -> None:
        unasked, exchanges = traffic(entries, line)
        super().__init__(unasked)
        self._left: defaultdict[bytes, deque[RecordedExchange]] = defaultdict(deque)
        for exchange in exchanges:
            self._left[exchange.request].append(exchange)
        self._address = {"interface": "virtual", "channel": f"recorded-{uuid.uuid4().hex}"}
        self._bus = can.Bus(**self._address)

    def _serve_once(self) -> None:
        if (message := self._bus.recv(self._wait_s())) is None:
            return
        self._schedule(self._unasked)  # the line is open now
        self._unasked = ()
        request = f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}".encode()
        if request not in self._left:
            raise DialogueDiffers(f"asks {request!r}, which the trace has nowhere")
        left = self._left[request]
        self._schedule((left.popleft() if len(left) > 1 else left[0]).answers)

    def _send(self, data: bytes) -> None:
        if (match := FRAME.fullmatch(data.decode())) is None:
            raise ValueError(f"{data!r} is no frame of a trace")
        number, content = int(match["id"], 16), bytes.fromhex(match["data"])
        self._bus.send(can.Message(arbitration_id=number, data=content, is_extended_id=False))

    def _close(self) -> None:
        self._bus.shutdown()
