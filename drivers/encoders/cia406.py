"""Six CANopen encoders (CiA 406), sampled simultaneously: one SYNC, six positions."""

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

    ``settings.bus`` is passed unchanged to ``can.Bus``, so every interface of python-can works.
    ``trace`` is called with every CANopen frame, from the threads of the bus. Every failure is a
    ``DeviceError``, those with a reaction of their own one of :mod:`drivers.errors`.
    """

    def __init__(self, settings: EncoderSettings, trace: TraceRecorder | None = None) -> None:
        self._settings = settings
        self._trace = trace
        self._worker: WorkerThread | None = None
        self._session: EncoderSession | None = None

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """Connect, identify, configure and start the nodes; an open bank is closed first.

        Returns:
            The identities, legs 1 to 6.

        Raises:
            DeviceError: The reason of the failure; nothing is left open.
        """
        await self.close()
        self._worker = WorkerThread("encoders")
        try:
            return await self._worker.run(partial(self._open, self._worker.cancelled))
        except BaseException:
            await self.close()
            raise

    async def read(self) -> EncoderSample:
        """One complete sample: all six positions at the same instant.

        Raises:
            DeviceError: The sample is incomplete or not valid.
        """
        if self._worker is None:
            raise _not_open()
        return await self._worker.run(self._read)

    async def close(self) -> None:
        """Close the bus and end its threads; a read in progress fails. Closing twice is harmless."""
        worker, self._worker = self._worker, None
        if worker is not None:
            await worker.finish(self._close)

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
