"""Encoders that are wired to the robot's controller: their positions as it reports them.

In most machines the scales are those of the drives, and nothing but the controller can read them. What
it reports is as old as its last cycle (10 ms of LinuxCNC's task) and a position only once the joints are
homed. It is kept in counts of the size that the cell file states. A comparison of encoders and controller
says nothing then: both are one reading, and a scale that slips moves both.

Where the joints that it reports include the zeros of its geometry, an encoder shows what is reported less
the zero in its config. That the controller runs these zeros is not seen before others are written: then the
joints change by other amounts than the config does, and the records do not agree.
"""

from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

from drivers.encoders.bank import joint_variables
from drivers.errors import NotHomedError
from drivers.interfaces import DeviceIdentity, EncoderSample
from hexacell.cell.devices import OF_CONTROLLER, EncoderSettings
from hexacell.errors import DeviceError, UsageError

Zeros = Callable[[], Sequence[float]]
"""By how much the joints that a controller reports exceed what its encoders show; raises ``FileError``."""


@runtime_checkable
class JointPositions(Protocol):
    """A controller that reports where its joints are, also during a move."""

    async def joints_now(self) -> tuple[float, ...] | None:
        """The joints, in the unit of the joint variables; None before they are homed."""


class ControllerScales:
    """``drivers.interfaces.EncoderBank`` of the scales at a controller; opened and closed with that.

    Raises ``UsageError`` for a controller that does not report its joints.
    """

    def __init__(self, settings: EncoderSettings, controller: object, zeros: Zeros | None = None) -> None:
        if not isinstance(controller, JointPositions):
            raise UsageError(
                "the controller does not report where its joints are",
                action="Give the encoders a bus of their own, in [encoders]",
            )
        self._settings = settings
        self._controller = controller
        self._zeros = zeros or (lambda: (0.0,) * len(settings.offset))

    async def open(self) -> tuple[DeviceIdentity, ...]:
        """One identity a leg; nothing is asked."""
        return tuple(
            DeviceIdentity(f"encoder of leg {leg}", OF_CONTROLLER, "as the controller reports its joints")
            for leg in range(1, len(self._settings.offset) + 1)
        )

    async def read(self) -> EncoderSample:
        """One sample; raises ``NotHomedError``, ``DeviceError``, or ``FileError`` if no zeros are known."""
        joints = await self._controller.joints_now()
        legs = len(self._settings.offset)
        if joints is not None and len(joints) != legs:
            raise DeviceError(
                f"reports {len(joints)} joints, and the robot has {legs}",
                subject="controller",
                action="Correct robot.mechanism in the cell file, or the controller's joints",
            )
        if joints is None:
            raise NotHomedError(
                "are not homed: what the controller reports of its joints is not a position yet",
                subject="encoders",
                action="Home the controller, or let controller.startup do it",
            )
        settings = self._settings
        terms = zip(joints, self._zeros(), settings.direction, settings.offset, strict=True)
        counts = tuple(round(sign * (q - zero - offset) / settings.step) for q, zero, sign, offset in terms)
        return EncoderSample(counts, joint_variables(counts, settings), settings.unit)

    async def close(self) -> None:
        """Nothing is open."""
