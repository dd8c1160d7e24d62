"""Tells a person at a plain terminal what the devices show, when it is asked for."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from types import TracebackType
from typing import Any, Self

from hexacell.cli.console import Console
from hexacell.run_process.run_device_watch import RunDeviceWatch
from hexacell.text.line_face import gauges_text
from procedures.run.cancellation import cancel_and_wait


class Telling:
    """Answers while a run goes on, without delaying it; used as ``async with``."""

    def __init__(self, console: Console, watching: RunDeviceWatch) -> None:
        self._console = console
        self._watching = watching
        self._tasks: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> Self:
        self._begin(self._note_noise())
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._watching.close()
        for task in tuple(self._tasks):
            await cancel_and_wait(task)

    def gauges(self) -> None:
        """Have it told what the gauges show, as soon as they are read."""
        self._begin(self._tell_gauges())

    def _begin(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _tell_gauges(self) -> None:
        self._console.print(gauges_text(await self._watching.fresh_snapshot()))

    async def _note_noise(self) -> None:
        async for _ in self._watching.snapshots():
            pass
