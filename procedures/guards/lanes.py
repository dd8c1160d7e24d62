"""Asking one device again and again, without waiting for the others."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from drivers.gauges.errors import GaugeAtEnd, WrongAnswer
from drivers.wire import FRAME_GAP_S
from hexacell.clock import CellClock
from hexacell.errors import HexacellError
from procedures.guards.snapshot import Heard

T = TypeVar("T")

RECOVERY_S = FRAME_GAP_S
"""How long a line is left alone after an answer that made no sense, before anything is asked again."""


@dataclass(slots=True, eq=False)
class Line:
    """What answers come over, and how long none has, s on the wall.

    Devices on one line are answered one after the other: while any of them is, none is silent.
    """

    silent_s: float = 0.0


class Lane(Generic[T]):
    """One device under watch: what was heard of it, and in ``looks`` how often that made sense.

    ``ask`` gives the value now or raises.
    """

    def __init__(
        self, device: str, ask: Callable[[], Awaitable[T]], pause_s: float, line: Line | None = None
    ) -> None:
        self.looks = 0
        self.line = line or Line()
        self._heard: Heard[T] = Heard(device)
        self._ask = ask
        self._pause_s = pause_s

    @property
    def heard(self) -> Heard[T]:
        """The latest of it."""
        return replace(self._heard, silent_s=self.line.silent_s)

    async def run(self, clock: CellClock, news: Callable[[], None]) -> None:
        """Ask until cancelled; ``news`` is called after every answer and every failure."""
        while True:
            self._heard = await self._look()
            self.looks += not self._heard.garbled
            news()
            await clock.sleep(self._pause_s * clock.factor)

    async def _look(self) -> Heard[T]:
        try:
            value = await self._ask()
        except WrongAnswer as error:
            self.line.silent_s = -RECOVERY_S
            return replace(self._heard, error=error, garbled=self._heard.garbled + 1)
        except GaugeAtEnd as error:
            self.line.silent_s = 0.0
            return replace(self._heard, error=error, garbled=0)
        except HexacellError as error:
            return replace(self._heard, error=error, garbled=0)
        self.line.silent_s = 0.0
        first = value if self._heard.first is None else self._heard.first
        return replace(self._heard, value=value, first=first, error=None, garbled=0)
