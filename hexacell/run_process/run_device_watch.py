"""What the devices show while a run reads them or waits for a person."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import aclosing, suppress

from hexacell.cell.devices import GaugeSettings
from hexacell.run_process.live_devices import LiveFeed
from hexacell.run_process.live_snapshot import LiveSnapshot
from procedures.devices.device_set import SAMPLE_PERIOD_S, Devices, LiveValues, poll_for_screens
from procedures.engine.command_loop import Status
from procedures.engine.engine import Engine
from procedures.run.state import RunState
from procedures.steps import events
from procedures.steps.move import Move

FRESH_S = 1.0
"""How long a device that does not answer is waited for when somebody asks what it shows, s."""


class RunDeviceWatch:
    """Follows one engine, whose devices keep their values in ``live``."""

    def __init__(self, gauges: Sequence[GaugeSettings]) -> None:
        self.live = LiveValues()
        self._gauges = tuple(gauges)
        self._feed = LiveFeed(self.live, gauges)
        self._engine: Engine | None = None
        self._devices: Devices | None = None
        self._polling: asyncio.Task[None] | None = None

    @property
    def is_waiting(self) -> bool:
        """Whether the run waits for a person: a question is open, or it is paused."""
        engine = self._engine
        return engine is not None and (engine.broker.open is not None or engine.status is Status.PAUSED)

    def follow(self, engine: Engine, devices: Devices) -> None:
        """Follow an engine that has not begun; ``devices`` are those that it uses."""
        self._engine, self._devices = engine, devices
        engine.commands.watchers.append(self._reconsider)
        engine.broker.watchers.append(self._reconsider)

    def note(self, event: events.Event, _: RunState | None = None) -> None:
        """Take an event of the run, as its listener: while the robot moves, noise is unknown."""
        self._feed.is_moving = isinstance(event, events.StepBegun) and isinstance(event.step, Move)

    async def fresh_snapshot(self) -> LiveSnapshot:
        """What they show once the gauges were read anew; at once if the run itself reads them."""
        if self.is_waiting:
            with suppress(TimeoutError):
                async with asyncio.timeout(FRESH_S), aclosing(self.live.changes(0.0)) as changes:
                    while any(self.live.gauge(one.name).age_s > SAMPLE_PERIOD_S for one in self._gauges):
                        await anext(changes)
        return self._feed.snapshot()

    async def snapshots(self) -> AsyncIterator[LiveSnapshot]:
        """Snapshots after each change, until cancelled; noise is known only while they are taken."""
        async for _ in self.live.changes():
            yield self._feed.snapshot()

    def close(self) -> None:
        """Read nothing any more."""
        self._engine = None
        self._reconsider()

    def _reconsider(self, _: object = None) -> None:
        if self.is_waiting and self._polling is None and self._devices is not None:
            self._polling = asyncio.ensure_future(poll_for_screens(self._devices))
        elif not self.is_waiting and self._polling is not None:
            self._polling.cancel()
            self._polling = None
