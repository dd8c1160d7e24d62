"""Live values of a run's devices: kept while the run reads them, and read while it waits for a person."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import aclosing, suppress

from hexacell.cell.devices import GaugeSettings
from hexacell.run_process.live_feed import LiveFeed
from hexacell.run_process.snapshots import LiveSnapshot
from procedures.devices.device_set import Devices
from procedures.devices.live_polling import poll_for_screens
from procedures.devices.live_values import SAMPLE_PERIOD_S, LiveValues
from procedures.engine.command_loop import Status
from procedures.engine.engine import Engine
from procedures.run.questions import Question
from procedures.run.state import RunState
from procedures.steps import events
from procedures.steps.move import Move

FRESH_S = 1.0
"""How long a device that does not answer is waited for when somebody asks what it shows, s."""


class RunDeviceWatch:
    """Follows one engine, whose devices keep their values in ``live``."""

    def __init__(self, gauges: Sequence[GaugeSettings]) -> None:
        self.live = LiveValues()
        self._feed = LiveFeed(self.live, gauges)
        self._devices: Devices | None = None
        self._polling: asyncio.Task[None] | None = None
        self._is_asking = False
        self._is_paused = False

    @property
    def is_waiting(self) -> bool:
        """Whether the run waits for a person: a question is open, or it is paused."""
        return self._is_asking or self._is_paused

    def follow(self, engine: Engine, devices: Devices) -> None:
        """Follow an engine that has not begun; ``devices`` are those that it uses."""
        self._devices = devices
        engine.watch(self._on_status)
        engine.watch_questions(self._on_question)

    def note(self, event: events.Event, _: RunState | None = None) -> None:
        """Take an event of the run, as its listener: while the robot moves, readings tell no noise."""
        match event:
            case events.StepBegun(step=step):
                self._feed.is_moving = isinstance(step, Move)
            case _:
                self._feed.is_moving = False

    def snapshot(self) -> LiveSnapshot:
        """What the devices show now."""
        return self._feed.snapshot()

    async def fresh_snapshot(self) -> LiveSnapshot:
        """What they show once the gauges were read anew; at once if the run itself reads them."""
        if self.is_waiting:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._until_fresh(), FRESH_S)
        return self.snapshot()

    async def _until_fresh(self) -> None:
        async with aclosing(self.live.changes(0.0)) as changes:
            while any(gauge.age_s > SAMPLE_PERIOD_S for gauge in self._feed.gauges):
                await anext(changes)

    async def snapshots(self) -> AsyncIterator[LiveSnapshot]:
        """The same after each change, until cancelled; noise is known only while they are taken."""
        async for _ in self.live.changes():
            yield self.snapshot()

    def close(self) -> None:
        """Read nothing any more."""
        self._is_asking = self._is_paused = False
        self._reconsider()

    def _on_status(self, status: Status) -> None:
        self._is_paused = status is Status.PAUSED
        self._reconsider()

    def _on_question(self, question: Question | None) -> None:
        self._is_asking = question is not None
        self._reconsider()

    def _reconsider(self) -> None:
        if self.is_waiting and self._polling is None and self._devices is not None:
            self._polling = asyncio.ensure_future(poll_for_screens(self._devices))
        elif not self.is_waiting and self._polling is not None:
            self._polling.cancel()
            self._polling = None
