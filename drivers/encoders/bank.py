"""What all encoder banks have in common: sessions on a thread, and plausible samples."""

import logging
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, ClassVar, Generic, TypeVar

from drivers.errors import BusError, WrongSetting, invalid_sample
from drivers.interfaces import DeviceIdentity, EncoderSample
from drivers.wire_trace import TraceRecorder
from drivers.worker_thread import WorkerThread
from hexacell.cell.devices import EncoderSettings
from hexacell.errors import DeviceError, HexacellError
from hexacell.kinematics.parameters import JointUnit

NEGATIVE = 1 << 31
MARGIN = 1.0
"""How far a joint may move beside its largest speed, in its unit: samples may follow each other at once."""

BEGINS_ANEW = "Set its preset so that it does not begin anew within the travel, then calibrate"
JUMPED = "See what changed (preset, direction, scale, cable, largest_speed_mm_s), then measure again"

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


class BankSession(ABC):
    """An open bus; used by one thread. A subclass connects at its creation.

    ``identities`` are those of the encoders of legs 1 to 6, after :meth:`start`; ``subjects`` those of
    messages about these. ``close`` closes the bus, even if it has failed.
    """

    identities: tuple[DeviceIdentity, ...]
    close: Callable[[], None]

    def __init__(self, settings: EncoderSettings, subjects: Sequence[str]) -> None:
        self.subjects = subjects
        self._settings = settings
        self._latest_sample: tuple[float, tuple[float, ...]] | None = None

    @abstractmethod
    def start(self) -> None:
        """Identify the encoders and take a first sample; closed by the caller if it fails."""

    @abstractmethod
    def _sample(self) -> tuple[int, ...]:
        """The counts of legs 1 to 6, of one instant."""

    def read(self) -> EncoderSample:
        """One complete sample.

        Raises:
            SilentNodeError: an encoder did not answer in time.
            InvalidSampleError: an encoder reports an error, or a joint jumped.
            WrongSetting: negative counts are read as unsigned ones.
            DeviceError: the positions are not of one instant, or the bus failed.
        """
        counts = self._sample()
        for subject, count in zip(self.subjects, counts, strict=True):
            if count >= NEGATIVE and not self._settings.signed:
                raise WrongSetting(
                    f"shows {count} counts, as a negative number does that is read as unsigned",
                    subject=subject,
                    action="Write `signed = true` under [encoders]",
                )
        positions = joint_variables(counts, self._settings)
        self._check_speed(positions)
        return EncoderSample(counts, positions, self._settings.unit)

    def _check_speed(self, positions: tuple[float, ...]) -> None:
        """Raise ``InvalidSampleError`` if a joint went farther than it can; else keep the sample."""
        now, speed = time.monotonic(), self._settings.largest_speed
        if self._latest_sample is not None and speed is not None:
            before_s, before = self._latest_sample
            farthest = MARGIN + speed * (now - before_s)
            for subject, one, other in zip(self.subjects, before, positions, strict=True):
                if abs(other - one) > farthest:
                    unit, action = self._settings.unit, JUMPED
                    sizes = {"one turn": 360.0} if unit is JointUnit.DEG else {}
                    sizes |= {f"{bits} bits": self._settings.step * 2**bits for bits in range(10, 33)}
                    problem = f"jumped from {one:.3f} to {other:.3f} {unit} in {now - before_s:.2g} s"
                    for what, size in sizes.items():
                        if size > 2 * farthest and abs(abs(other - one) - size) <= farthest:
                            problem, action = f"{problem}, as {what} that begin anew", BEGINS_ANEW
                    raise invalid_sample(problem, subject, action)
        self._latest_sample = now, positions


Session = TypeVar("Session", bound=BankSession)


class ThreadedBank(Generic[Session]):
    """A :class:`drivers.interfaces.EncoderBank` of sessions on a thread; ``trace`` gets all traffic.

    ``session`` opens the bus, by settings, the event that interrupts every wait, and ``trace``.
    """

    session: ClassVar[type[Any]]

    def __init__(self, settings: EncoderSettings, trace: TraceRecorder | None = None) -> None:
        self._settings = settings
        self._trace = trace
        self._worker: WorkerThread | None = None
        self._session: Session | None = None
        self._failure: HexacellError | None = None

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """The identities, legs 1 to 6, of the connected encoders.

        An open bank is closed first; after a failure nothing is left open.
        """
        await self.close()
        self._worker = WorkerThread("encoders")
        try:
            identities = await self._worker.run(partial(self._open, self._worker.closing))
        except BaseException as error:
            self._failure = error if isinstance(error, HexacellError) else None
            _log.warning("cannot be opened: %s", error)
            await self.close()
            raise
        _log.info("opened: %s", "; ".join(one.description for one in identities))
        return identities

    async def read(self) -> EncoderSample:
        """One complete sample of all six."""
        if self._worker is None or self._session is None:
            why = "" if self._failure is None else f": {self._failure.cause}"
            action = "Open them first" if self._failure is None else f"{self._failure.action}"
            raise DeviceError(f"are not open{why}", subject="encoders", action=action)
        try:
            return await self._worker.run(self._session.read)
        except DeviceError as error:
            _log.warning("no sample: %s", error)
            raise

    async def close(self) -> None:
        """Close the bus and end its threads; a read in progress fails. Closing twice is harmless."""
        worker, self._worker = self._worker, None
        if worker is not None:
            await worker.finish(self._close)

    def _open(self, closing: threading.Event) -> tuple[DeviceIdentity, ...]:
        session: Session = self.session(self._settings, closing, self._trace)
        self._session = session
        session.start()
        return session.identities

    def _close(self) -> None:
        session, self._session = self._session, None
        if session is not None:
            session.close()
