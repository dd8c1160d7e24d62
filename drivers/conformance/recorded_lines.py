"""Lines that answer as a wire trace has it, and say where a driver asks something else."""

import re
import select
import threading
import time
import uuid
from collections import defaultdict, deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import Any

import can

from drivers.simulated.serial_line import PtyLine
from drivers.wire_trace import TraceEntry, TrafficDirection

SLICE_S = 0.02
FRAME = re.compile(r"(?P<id>[0-9A-F]{3})#(?P<data>(?:[0-9A-F]{2})*)")
UNASKED_DELAY_S = 0.05
"""What came before the first request comes so long after the line was opened."""

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


@contextmanager
def _served(
    requests: Callable[[float], Iterator[Answers]],
    send: Callable[[bytes], None],
    break_off: Callable[[], None] = lambda: None,
) -> Iterator[None]:
    """Answer from a thread as long as the context lasts, or until the driver asks something else.

    At the end that is raised: it is the cause of whatever was raised before. ``requests`` waits for some,
    no longer than it is told, and gives the answers to each; ``break_off`` breaks the line, where that is
    possible, so that the driver need not wait for its time-out.
    """
    stopping, failures = threading.Event(), list[Exception]()

    def run() -> None:
        due = deque[tuple[float, bytes]]()
        try:
            while not stopping.is_set():
                left_s = due[0][0] - time.monotonic() if due else SLICE_S
                for answers in requests(min(SLICE_S, max(0.0, left_s))):
                    now_s = time.monotonic()
                    # Those to the request before come first, whatever is left of their delay.
                    due = deque((now_s, data) for _, data in due)
                    due += [(now_s + delay_s, data) for delay_s, data in answers]
                while due and due[0][0] <= time.monotonic():
                    send(due.popleft()[1])
        except Exception as error:  # it must reach the test
            failures.append(error)
            break_off()

    thread = threading.Thread(target=run, name="recorded line", daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopping.set()
        thread.join()
        if failures:
            raise failures[0]


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
    unasked, exchanges = traffic(entries, line)
    left, received = deque(exchanges), b""

    def requests(wait_s: float) -> Iterator[Answers]:
        nonlocal unasked, received
        ready, _, _ = select.select(served.descriptors(), [], [], wait_s)
        if not ready:
            return
        yield unasked  # the line is open now
        unasked = ()
        received += served.receive(ready)
        while received:
            expected = left[0].request if left else b""
            request = received[: len(expected)] or received
            if expected.startswith(received) and request != expected:
                return  # the rest of it comes yet
            if not left:
                raise DialogueDiffers(f"asks {request!r} after the last request of the trace")
            if request != expected:
                raise DialogueDiffers(f"asks {request!r}, where {left[0]}, is {expected!r}")
            received = received[len(request) :]
            yield left.popleft().answers

    with closing(PtyLine("recorded")) as served, _served(requests, served.send, served.unplug):
        yield served.url


@contextmanager
def recorded_bus(entries: Iterable[TraceEntry], line: str) -> Iterator[Mapping[str, Any]]:
    """Serve the encoders' bus of a trace on a virtual bus, and give the settings for ``can.Bus``.

    Each frame is answered as the same one was, the first time, the second time and so on: the time of day
    decides when alarm entries are read. The last answers are repeated.

    Raises:
        ValueError: the trace has no such line.
        DialogueDiffers: at the end, if the driver asked something else.
    """
    unasked, exchanges = traffic(entries, line)
    left: defaultdict[bytes, deque[Answers]] = defaultdict(deque)
    for exchange in exchanges:
        left[exchange.request].append(exchange.answers)

    def requests(wait_s: float) -> Iterator[Answers]:
        nonlocal unasked
        if (message := bus.recv(wait_s)) is None:
            return
        yield unasked  # the line is open now
        unasked = ()
        request = f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}".encode()
        if request not in left:
            raise DialogueDiffers(f"asks {request!r}, which the trace has nowhere")
        same = left[request]
        yield same.popleft() if len(same) > 1 else same[0]

    def send(data: bytes) -> None:
        if (match := FRAME.fullmatch(data.decode())) is None:
            raise ValueError(f"{data!r} is no frame of a trace")
        number, content = int(match["id"], 16), bytes.fromhex(match["data"])
        bus.send(can.Message(arbitration_id=number, data=content, is_extended_id=False))

    address: dict[str, Any] = {"interface": "virtual", "channel": f"recorded-{uuid.uuid4().hex}"}
    with can.Bus(**address) as bus, _served(requests, send):
        yield address
