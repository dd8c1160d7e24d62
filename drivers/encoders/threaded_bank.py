"""The life cycle of an encoder bank whose bus is used by one thread."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from functools import partial
from typing import Generic, Protocol, TypeVar

from drivers.interfaces import DeviceIdentity, EncoderSample
from drivers.worker_thread import WorkerThread
from hexacell.errors import DeviceError


class BankSession(Protocol):
    """An open bank; used by one thread."""

    @property
    def identities(self) -> tuple[DeviceIdentity, ...]:
        """Legs 1 to 6."""
        ...

    def read(self) -> EncoderSample:
        """One complete sample."""
        ...

    def close(self) -> None:
        """Close the bus, even if it has failed."""
        ...


Session = TypeVar("Session", bound=BankSession)


class ThreadedBank(ABC, Generic[Session]):
    """A :class:`drivers.interfaces.EncoderBank` of sessions on a thread."""

    def __init__(self) -> None:
        self._worker: WorkerThread | None = None
        self._session: Session | None = None

    @abstractmethod
    def _begin(self, closing: threading.Event) -> Session:
        """Open the bus; nothing stays open after a failure. ``closing`` interrupts it."""

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """The identities, legs 1 to 6, of the connected encoders.

        An open bank is closed first; after a failure nothing is left open.
        """
        await self.close()
        self._worker = WorkerThread("encoders")
        try:
            return await self._worker.run(partial(self._open, self._worker.closing))
        except BaseException:
            await self.close()
            raise

    async def read(self) -> EncoderSample:
        """One complete sample of all six."""
        if self._worker is None:
            raise _not_open()
        return await self._worker.run(self._read)

    async def close(self) -> None:
        """Close the bus and end its threads; a read in progress fails. Closing twice is harmless."""
        worker, self._worker = self._worker, None
        if worker is not None:
            await worker.finish(self._close)

    def _open(self, closing: threading.Event) -> tuple[DeviceIdentity, ...]:
        self._session = self._begin(closing)
        return self._session.identities

    def _read(self) -> EncoderSample:
        if self._session is None:
            raise _not_open()
        return self._session.read()

    def _close(self) -> None:
        session, self._session = self._session, None
        if session is not None:
            session.close()


def _not_open() -> DeviceError:
    return DeviceError("are not open", subject="encoders", action="Open them first")
