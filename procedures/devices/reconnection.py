"""Devices that were lost, opened again: the same ones, or none."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from drivers.controllers.errors import ConnectionLost
from drivers.encoders import errors as encoder
from drivers.gauges.errors import GaugeSilent, WrongAnswer, WrongMode, WrongUnit, ZeroVoid
from drivers.interfaces import DeviceIdentity
from drivers.serial.errors import PortLost
from hexacell.errors import DeviceError, HexacellError
from procedures.devices.device_set import Devices, MountedGauge, gather_errors
from procedures.run.events import Identity
from procedures.run.trips import Guard, GuardTripped, causes_of

OF_GAUGES = (GaugeSilent, WrongAnswer, WrongMode, WrongUnit, ZeroVoid, PortLost)
OF_ENCODERS = (
    encoder.BusError,
    encoder.SilentNodeError,
    encoder.RestartedNodeError,
    encoder.MissingNodeError,
)


class DeviceReplaced(DeviceError):
    """A device answers, and it is not the one that the run was begun with."""


async def reconnect(devices: Devices, error: HexacellError, known: Sequence[Identity]) -> bool:
    """Open what an error says is lost; whether a gauge was among it, whose zero is void then.

    Raises:
        AnotherDevice: something else answers in its place.
        HexacellError: it cannot be opened.
    """
    errors = causes_of(error)
    gauges = [mounted for mounted in devices.gauges if _concerns(mounted, errors)]
    await gather_errors("gauges cannot be let go", [mounted.gauge.close() for mounted in gauges])
    found = await gather_errors("gauges do not come back", [mounted.gauge.open() for mounted in gauges])
    if any(isinstance(one, OF_ENCODERS) or _is_stale(one, "encoders") for one in errors):
        await devices.encoders.close()
        found += await devices.encoders.open()
    if any(isinstance(one, ConnectionLost) or _is_stale(one, "controller") for one in errors):
        await devices.controller.close()
        found.append(await devices.controller.open())
    require_known(found, known)
    return bool(gauges)


def require_known(found: Iterable[DeviceIdentity | Identity], known: Sequence[Identity]) -> None:
    """Refuse devices with another serial number or name than the run was begun with.

    Raises:
        AnotherDevice: one is another; devices that nothing is known of pass.
    """
    before = {identity.name: identity for identity in known}
    for now in found:
        then = before.get(now.name)
        if then is not None and _who(then) != _who(now):
            raise DeviceReplaced(
                f"{_words(now)} answers where the run was begun with {_words(then)}",
                subject=now.name,
                action="Connect the one that was there, or begin a new run",
            )


def _concerns(mounted: MountedGauge, errors: Sequence[HexacellError]) -> bool:
    """Gauges that share a port are named together: ``gauges x, y``."""
    named = [one for one in errors if mounted.gauge.name in _named(one.subject or "")]
    return any(isinstance(one, OF_GAUGES) or _is_stale(one, one.subject or "") for one in named)


def _is_stale(error: HexacellError, device: str) -> bool:
    """Whether a guard tripped because a device did not answer any more."""
    stale = isinstance(error, GuardTripped) and error.trip.guard is Guard.STALE
    return stale and error.subject == device


def _named(subject: str) -> list[str]:
    word, _, names = subject.partition(" ")
    return names.split(", ") if word in {"gauge", "gauges"} else []


def _who(device: DeviceIdentity | Identity) -> tuple[str, str, str]:
    return device.protocol, device.serial_number, device.description


def _words(device: DeviceIdentity | Identity) -> str:
    number = f", serial number {device.serial_number}" if device.serial_number else ""
    return f"{device.protocol} {device.description}{number}"
