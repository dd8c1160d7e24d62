"""Everything that must hold before motion, checked at once; nothing moves."""

from __future__ import annotations

from collections.abc import Awaitable, Iterator

from drivers.gauges.errors import GaugeAtEnd
from drivers.ports import EncoderRound, GaugeReading
from hexacell.errors import AnswerNeeded, HexacellError, SeveralErrors, UsageError
from hexacell.pose import Pose
from procedures.calibration import Calibration, Mode
from procedures.devices import Devices, each, gathered


def plan_failures(calibration: Calibration, *, unattended: bool) -> Iterator[HexacellError]:
    """What is wrong with the plan itself, before any device is asked."""
    for name, pose in _references(calibration):
        try:
            calibration.robot.require_reach(name, pose)
        except HexacellError as error:
            yield error if error.subject else type(error)(error.problem, subject=name, action=error.action)
    yield from _too_few_records(calibration)
    if unattended and calibration.settings.stations.placement == "by-hand":
        yield AnswerNeeded(
            "unattended running is not possible: the gauges are put at each point by hand",
            action='Give every point fixed gauges and say placement = "fixed" in [stations]',
        )


def _too_few_records(calibration: Calibration) -> Iterator[UsageError]:
    if calibration.mode is Mode.CHECK:
        return
    plan = calibration.settings.identification
    unknowns = len(calibration.robot.mechanism.convention.free_names())
    equations = 3 * len(plan.points) * (plan.orientations - 1)
    if equations < unknowns:
        needed = 1 - (-unknowns // (3 * len(plan.points)))
        yield UsageError(
            f"{len(plan.points)} points with {plan.orientations} orientations give {equations} equations "
            f"for {unknowns} parameters",
            subject="[identification]",
            action=f"Have at least {needed} orientations at each point",
        )


async def device_failures(devices: Devices) -> list[HexacellError]:
    """What is wrong with opened devices: each is asked for one reading.

    A plunger at an end of its travel is no failure: the robot is not at the gauges yet.
    """
    calls: list[Awaitable[GaugeReading | EncoderRound]] = [m.gauge.read() for m in devices.gauges]
    try:
        await gathered("devices cannot be read", [*calls, devices.encoders.read()])
    except HexacellError as error:
        return [one for one in each(error) if not isinstance(one, GaugeAtEnd)]
    return []


def raise_all(failures: list[HexacellError]) -> None:
    """Raise one failure as it is, several in one report, none not at all."""
    if len(failures) == 1:
        raise failures[0]
    if failures:
        raise SeveralErrors(f"{len(failures)} things stand in the way", failures)


def _references(calibration: Calibration) -> Iterator[tuple[str, Pose]]:
    settings = calibration.settings
    for number, point in enumerate(settings.identification.points, start=1):
        yield f"identification point {number}", Pose(*point)
    for number, point in enumerate(settings.verification.points, start=1):
        yield f"verification point {number}", Pose(*point)
