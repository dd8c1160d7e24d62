"""Reopening devices that were lost: the same ones, or none."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from drivers import errors
from drivers.interfaces import DeviceIdentity
from hexacell.errors import DeviceError, HexacellError
from procedures.devices.device_set import Devices, MountedGauge, gather_errors
from procedures.run.trips import Guard, GuardTripped, causes_of

GAUGE_ERRORS = (
    errors.GaugeSilent,
    errors.WrongAnswer,
    errors.WrongSetting,
    errors.ZeroVoid,
    errors.PortLost,
)
ENCODER_ERRORS = (errors.BusError, errors.SilentNodeError, errors.RestartedNodeError)


class DeviceReplaced(DeviceError):
    """Another device answers than the one that the run began with."""


async def reconnect(devices: Devices, error: HexacellError, known: Sequence[DeviceIdentity]) -> bool:
    """Reopen the devices that are lost by an error; True if a gauge is among them: its zero is void.

    Raises ``DeviceReplaced`` if another device answers, another ``HexacellError`` if none does.
    """
    causes = causes_of(error)
    gauges = [mounted for mounted in devices.gauges if _concerns(mounted, causes)]
    await gather_errors("gauges cannot be closed", [mounted.gauge.close() for mounted in gauges])
    found = await gather_errors("gauges cannot be reopened", [mounted.gauge.open() for mounted in gauges])
    if any(isinstance(one, ENCODER_ERRORS) or _has_failed(one, "encoders") for one in causes):
        await devices.encoders.close()
        found += await devices.encoders.open()
    if any(isinstance(one, errors.ConnectionLost) or _has_failed(one, "controller") for one in causes):
        await devices.controller.close()
        found.append(await devices.controller.open())
    require_known(found, known)
    return bool(gauges)


def require_known(found: Iterable[DeviceIdentity], known: Sequence[DeviceIdentity]) -> None:
    """Refuse devices with another protocol, serial number or description than the run began with.

    Raises ``DeviceReplaced``, which names both. Devices that were not known before pass. Settings and port
    count where both are known.
    """
    before = {identity.name: identity for identity in known}
    for now in found:
        then = before.get(now.name, now)
        unknown = {name: getattr(now, name) for name in ("settings", "port") if not getattr(then, name)}
        if replace(then, **unknown) != now:
            raise DeviceReplaced(
                f"{_words(now)} answers where the run was begun with {_words(then)}",
                subject=now.name,
                action="Connect the one that was there, or begin a new run",
            )


def _concerns(mounted: MountedGauge, causes: Sequence[HexacellError]) -> bool:
    """Whether an error names the gauge; gauges on one port are named together: ``gauges x, y``."""
    for one in causes:
        word, _, names = (one.subject or "").partition(" ")
        is_named = word in {"gauge", "gauges"} and mounted.gauge.name in names.split(", ")
        if is_named and (isinstance(one, GAUGE_ERRORS) or _has_failed(one, one.subject or "")):
            return True
    return False


def _has_failed(error: HexacellError, device: str) -> bool:
    """Whether a guard tripped because a device did not answer, or its driver has no better word for it."""
    is_stale = isinstance(error, GuardTripped) and error.trip.guard is Guard.STALE
    return error.subject == device and (is_stale or type(error) is DeviceError)


def _words(device: DeviceIdentity) -> str:
    number = f", serial number {device.serial_number}" if device.serial_number else ""
    more = "".join(f", {words}" for words in (device.settings, device.port) if words)
    return f"{device.protocol} {device.description}{number}{more}"
