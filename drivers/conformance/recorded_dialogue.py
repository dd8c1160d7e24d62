"""What was said on one line of a wire trace: requests of the driver, and what came after each."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from drivers.wire_trace import TraceEntry, TrafficDirection

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


class Script(Protocol):
    """What is answered to each request of a driver."""

    def answers_to(self, request: bytes) -> tuple[RecordedAnswer, ...]:
        """What came after this request.

        Raises:
            DialogueDiffers: it was not asked, or not now.
        """
        ...


class AnswersInOrder:
    """Answers the requests of a line in the order in which they were recorded."""

    def __init__(self, recorded: RecordedTraffic) -> None:
        self._left = deque(recorded.exchanges)

    @property
    def expected(self) -> bytes:
        """The next request; nothing at the end of the trace."""
        return self._left[0].request if self._left else b""

    def answers_to(self, request: bytes) -> tuple[RecordedAnswer, ...]:
        """Those to the next request, which must be this one."""
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
        """Those to the same request, in their turn."""
        if request not in self._left:
            raise DialogueDiffers(f"asks {request!r}, which the trace has nowhere")
        left = self._left[request]
        return (left.popleft() if len(left) > 1 else left[0]).answers


def _answers(entries: Iterable[TraceEntry], since_s: float) -> tuple[RecordedAnswer, ...]:
    return tuple(RecordedAnswer(max(0.0, entry.time_s - since_s), entry.data) for entry in entries)
