"""Everything that must hold before motion, checked at once; nothing moves."""

from collections.abc import Awaitable, Iterator
from pathlib import Path

from drivers.errors import GaugeAtEnd, NotHomedError
from drivers.interfaces import CheckedController, EncoderSample, GaugeReading
from hexacell.campaign import feasibility
from hexacell.errors import AnswerNeeded, HexacellError, LimitError, flatten_errors, joined
from hexacell.kinematics.pose import Pose
from hexacell.noise.allowances import Allowances
from procedures.calibration.calibration import Calibration, Mode
from procedures.devices.device_set import Devices, gather_errors
from procedures.guards.position_check import PositionCheck
from procedures.guards.rules.stop_requested import motion_forbidden
from procedures.guards.supervision import low_disk_space
from procedures.run.cancellation import in_thread
from procedures.workflow.next_step import length_poses


async def plan_failures(calibration: Calibration, *, unattended: bool) -> list[HexacellError]:
    """What is wrong with the plan itself, before any device is asked.

    It takes a second or more. A stop takes effect after the current part of the work.
    """
    pieces = _plan_failures(calibration, unattended=unattended)
    failures: list[HexacellError] = []
    while (found := await in_thread(next, pieces, None)) is not None:
        failures += found
    return failures


def _plan_failures(calibration: Calibration, *, unattended: bool) -> Iterator[list[HexacellError]]:
    """What each piece of the work found."""
    yield [*_length_failures(calibration, unattended=unattended)]
    if calibration.mode is Mode.LENGTH:
        return
    is_check = calibration.mode is Mode.CHECK
    is_known = is_check or calibration.mode is Mode.QUICK
    failures = [*feasibility.reach_failures(calibration.plan)]
    held_out = () if is_check else calibration.settings.verification.points
    for number, point in enumerate(held_out, start=1):
        failures += feasibility.pose_failures(
            calibration.plan, f"verification point {number}", Pose(*point)
        )
    yield failures
    too_few = [] if is_check else [*feasibility.too_few_records(calibration.plan)]
    yield too_few
    plan = calibration.plan
    if not failures and plan.robot.noise.stops:
        try:
            Allowances(plan.settings, plan.robot).require_travel(plan.reference_pose(plan.points[0]))
        except LimitError as error:  # for which every pose would fail as well
            yield [error]
            return
    if not failures and not too_few:
        find = feasibility.measuring_failures if is_known else feasibility.optimisation_failures
        yield from find(plan)
    if unattended and calibration.settings.stations.placement == "by-hand":
        yield [
            AnswerNeeded(
                "unattended running is not possible: the gauges are put at each point by hand",
                action='Give every point fixed gauges and set placement = "fixed" in [stations]',
            )
        ]


def _length_failures(calibration: Calibration, *, unattended: bool) -> Iterator[HexacellError]:
    """What prevents a length check, if one is wanted: poses out of reach, nobody to mount the gauges."""
    poses, fixture = length_poses(calibration), calibration.settings.length_check
    for name, pose in poses:
        yield from feasibility.pose_failures(calibration.plan, name, pose)
    if poses and fixture is not None and unattended and fixture.mounting == "by-hand":
        yield AnswerNeeded(
            "unattended running is not possible: the gauges are mounted in the two seats by hand",
            action='Run it attended, or set mounting = "fixed" in [length_check] if no person is needed',
        )


async def device_failures(devices: Devices) -> list[HexacellError]:
    """What is wrong with opened devices: each is asked for one reading, the controller what it is set to.

    A plunger at an end of its travel is no failure: the robot is not at the gauges yet. Nor are joints that
    are not homed, where the controller reads the encoders.
    """
    calls: list[Awaitable[GaugeReading | EncoderSample | None]] = [m.gauge.read() for m in devices.gauges]
    calls.append(devices.encoders.read())
    if isinstance(devices.controller, CheckedController):
        calls.append(devices.controller.check())
    try:
        await gather_errors("devices cannot be read", calls)
    except HexacellError as error:
        return [one for one in flatten_errors(error) if not isinstance(one, GaugeAtEnd | NotHomedError)]
    return []


async def start_failures(devices: Devices, folder: Path, free_disk_mb: float) -> list[HexacellError]:
    """What prevents the start of a run, apart from the devices: the stop line, and a full disk."""
    pressed = await devices.stop_input.active_reason()
    trips = [None if pressed is None else motion_forbidden(pressed), low_disk_space(folder, free_disk_mb)]
    return [trip.as_error() for trip in trips if trip is not None]


async def position_failures(check: PositionCheck) -> list[HexacellError]:
    """That controller and encoders do not agree on where the robot is: the controller runs another config.

    Before the controller is homed nobody knows; then this is checked before the first move.
    """
    try:
        found = await check.read()
    except HexacellError as error:
        return flatten_errors(error)
    return [] if found.reports is None or found.trip is None else [found.trip.as_error()]


def raise_all(failures: list[HexacellError]) -> None:
    """Raise one failure as it is, several in one report; nothing is raised without any."""
    if failures:
        raise joined(f"{len(failures)} problems prevent the run", failures)
