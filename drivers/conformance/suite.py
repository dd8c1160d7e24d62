"""What all conformance suites have in common: a device against its twin, and what they ask of failures."""

import asyncio
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AbstractContextManager, asynccontextmanager
from typing import Any, Generic, TypeVar

from drivers.interfaces import Device
from hexacell.cell.simulation import FaultKind
from hexacell.errors import DeviceError

FAULTS: tuple[FaultKind, ...] = ("unplugged", "silent")
LONGEST_S = 300.0
"""No test may take longer, whatever the device does."""

TWIN_SPEED = 100.0
"""Its answers are so much quicker than those of a real line."""

DeviceT = TypeVar("DeviceT", bound=Device[Any])
TwinT = TypeVar("TwinT")


async def failure(call: Callable[[], Awaitable[Any]]) -> Exception | None:
    """What a call raises; None if it succeeds."""
    try:
        await call()
    except Exception as error:
        return error
    return None


def require_named(error: BaseException | None, name: str) -> None:
    """Fail unless it is a ``DeviceError`` whose subject has the name in it."""
    assert isinstance(error, DeviceError), f"{error!r} is no DeviceError"
    assert name in (error.subject or ""), f"{error} does not name {name}"


def against_twin(check: Callable[[Any, DeviceT, TwinT], Awaitable[None]]) -> Callable[[Any], None]:
    """A test of a suite, without arguments for pytest: the check of a device and its twin."""

    def test(self: "Suite[DeviceT, TwinT]") -> None:
        async def run() -> None:
            with self.twin() as twin:
                async with self._closed_after(twin) as device, asyncio.timeout(LONGEST_S):
                    await check(self, device, twin)

        asyncio.run(run())

    test.__name__, test.__doc__ = check.__name__, check.__doc__
    return test


class Suite(ABC, Generic[DeviceT, TwinT]):
    """Subclass one of the suites in a test file, name it ``Test...``, and say what is tested."""

    @abstractmethod
    def twin(self) -> AbstractContextManager[TwinT]:
        """The device's twin, as long as the context lasts."""

    @abstractmethod
    def _driver_of(self, twin: TwinT) -> DeviceT:
        """The driver under test, for a twin."""

    @against_twin
    async def test_it_is_the_same_when_reopened(self, device: DeviceT, twin: TwinT) -> None:
        first = await device.open()
        await device.close()
        assert await device.open() == first

    @asynccontextmanager
    async def _closed_after(self, twin: TwinT) -> AsyncIterator[DeviceT]:
        device = self._driver_of(twin)
        try:
            yield device
        finally:
            await device.close()
