"""What all encoder banks have in common: sessions on a thread, and plausible samples."""

from __future__ import annotations

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial
from typing import Generic, TypeVar

from drivers.encoders.node_monitor import invalid_sample
from drivers.errors import BusError, WrongSetting
from drivers.interfaces import DeviceIdentity, EncoderSample
from drivers.wire_trace import TraceRecorder
from drivers.worker_thread import WorkerThread
from hexacell.cell.devices import EncoderSettings
from hexacell.errors import DeviceError

NEGATIVE = 1 << 31
MARGIN = 1.0
"""How far a joint may move beside its largest speed, in its unit: samples may follow each other at once."""

_log = logging.getLogger("drivers.encoders")


def joint_variables(counts: tuple[int, ...], settings: EncoderSettings) -> tuple[float, ...]:
    """Joint variables q, in their unit: direction x counts x step + offset."""
    step = settings.step
    terms = zip(settings.direction, counts, settings.offset, strict=True)
    return tuple([direction * count * step + offset for direction, count, offset in terms])


def bus_settings(settings: EncoderSettings) -> dict[str, object]:
    """The settings of the cell file for ``can.Bus``; raises ``BusError`` if it has none."""
    if settings.bus is None:
        raise BusError(
            "is not configured in the cell file",
            subject="encoder bus",
            action="State `bus` under [encoders], for example "
            '{ interface = "slcan", channel = "/dev/ttyACM0", bitrate = 500000 }',
        )
    return settings.bus


class SampleHistory:
    """The latest sample of six joints, for one opening of the encoders.

    ``subjects`` are the subjects of messages about legs 1 to 6.
    """

    def __init__(self, settings: EncoderSettings, subjects: Sequence[str]) -> None:
        self._settings = settings
        self._subjects = subjects
        self._latest: tuple[float, tuple[float, ...]] | None = None

    def check_signs(self, counts: tuple[int, ...]) -> None:
        """Raise ``WrongSetting`` if counts are negative ones, read as unsigned."""
        if self._settings.signed:
            return
        for subject, count in zip(self._subjects, counts, strict=True):
            if count >= NEGATIVE:
                raise WrongSetting(
                    f"shows {count} counts, as a negative number does that is read as unsigned",
                    subject=subject,
                    action="Write `signed = true` under [encoders]",
                )

    def check_speed(self, positions: tuple[float, ...]) -> None:
        """Raise ``InvalidSampleError`` if a joint went farther than it can; else keep the sample."""
        now, speed = time.monotonic(), self._settings.largest_speed
        if self._latest is not None and speed is not None:
            before_s, before = self._latest
            farthest = MARGIN + speed * (now - before_s)
            for subject, one, other in zip(self._subjects, before, positions, strict=True):
                if abs(other - one) > farthest:
                    unit = self._settings.unit
                    raise invalid_sample(
                        f"jumped from {one:.3f} to {other:.3f} {unit} in {now - before_s:.2g} s", subject
                    )
        self._latest = now, positions


class BankSession(ABC):
    """An open bank; used by one thread. ``subjects`` are those of messages about legs 1 to 6."""

    def __init__(self, settings: EncoderSettings, subjects: Sequence[str]) -> None:
        self._settings = settings
        self._history = SampleHistory(settings, subjects)

    @property
    @abstractmethod
    def identities(self) -> tuple[DeviceIdentity, ...]:
        """The identities of the encoders of legs 1 to 6."""

    @abstractmethod
    def _sample(self) -> tuple[int, ...]:
        """The counts of legs 1 to 6, of one instant."""

    @abstractmethod
    def close(self) -> None:
        """Close the bus, even if it has failed."""

    def read(self) -> EncoderSample:
        """One complete sample.

        Raises:
            SilentNodeError: an encoder did not answer in time.
            InvalidSampleError: an encoder reports an error, or a joint jumped.
            WrongSetting: negative counts are read as unsigned ones.
            DeviceError: the positions are not of one instant, or the bus failed.
        """
        counts = self._sample()
        self._history.check_signs(counts)
        positions = joint_variables(counts, self._settings)
        self._history.check_speed(positions)
        return EncoderSample(counts, positions, self._settings.unit)


Session = TypeVar("Session", bound=BankSession)


class ThreadedBank(ABC, Generic[Session]):
    """A :class:`drivers.interfaces.EncoderBank` of sessions on a thread.

    Args:
        settings: of the cell file.
        trace: gets all traffic, in the threads of the bus.
    """

    def __init__(self, settings: EncoderSettings, trace: TraceRecorder | None = None) -> None:
        self._settings = settings
        self._trace = trace
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
            identities = await self._worker.run(partial(self._open, self._worker.closing))
        except BaseException as error:
            _log.warning("cannot be opened: %s", error)
            await self.close()
            raise
        _log.info("opened: %s", "; ".join(one.description for one in identities))
        return identities

    async def read(self) -> EncoderSample:
        """One complete sample of all six."""
        if self._worker is None:
            raise _not_open()
        try:
            return await self._worker.run(self._read)
        except DeviceError as error:
            _log.warning("no sample: %s", error)
            raise

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
