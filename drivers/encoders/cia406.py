"""Six CANopen encoders after CiA 406, sampled together: one SYNC, six positions."""

from __future__ import annotations

import threading
from functools import partial

from drivers.encoders.session import EncoderSession
from drivers.encoders.worker_thread import WorkerThread
from drivers.interfaces import DeviceIdentity, EncoderSample
from drivers.wire_trace import TraceRecorder
from hexacell.cell.devices import EncoderSettings
from hexacell.errors import DeviceError


class Cia406Bank:
    """The encoder bank of a cell; implements :class:`drivers.interfaces.EncoderBank`.

    Any interface of python-can will do: ``settings.bus`` is passed to ``can.Bus`` as it is.
    ``trace`` is called from the bus's threads with every CANopen frame. Every failure is a
    ``DeviceError``, those of the bus and of nodes one of :mod:`drivers.encoders.errors`.
    """

    def __init__(self, settings: EncoderSettings, trace: TraceRecorder | None = None) -> None:
        self._settings = settings
        self._trace = trace
        self._owner: WorkerThread | None = None
        self._session: EncoderSession | None = None

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """Connect, compare, configure and start the nodes; an open bank is opened afresh.

        Returns:
            Who answered, legs 1 to 6.

        Raises:
            DeviceError: What is wrong; nothing is left open then.
        """
        await self.close()
        self._owner = WorkerThread("encoders")
        try:
            return await self._owner.run(partial(self._open, self._owner.cancelled))
        except BaseException:
            await self.close()
            raise

    async def read(self) -> EncoderSample:
        """One complete round: all six positions at the same instant.

        Raises:
            DeviceError: What is wrong.
        """
        if self._owner is None:
            raise _not_open()
        return await self._owner.run(self._read)

    async def close(self) -> None:
        """Let the bus go and end its threads; a read in progress fails. Closing twice is harmless."""
        owner, self._owner = self._owner, None
        if owner is not None:
            await owner.finish(self._close)

    def _open(self, interrupted: threading.Event) -> tuple[DeviceIdentity, ...]:
        self._session = EncoderSession(self._settings, interrupted, self._trace)
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
