"""The rules of the guards: functions of the latest answers that give a trip, or None.

A function becomes a rule by its line in ``RULES``. Two are evaluated once, after a move: whether the joints
are where they were commanded, and whether each gauge moved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drivers.errors import ControllerFrozen, GaugeAtEnd
from drivers.stop_input import SUBJECT as STOP_LINE
from hexacell.kinematics.mechanism import MechanismWords
from hexacell.kinematics.rotations import Array
from hexacell.limits.gauge_travel import GaugeRoom
from procedures.guards.polling import DevicePoller, PolledDevices
from procedures.run.trips import Guard, Trip

MAX_GARBLED = 3
"""So many garbled answers in a row are a device fault; fewer are noise on the line."""

SOME_MECHANISM = MechanismWords("robot", joint="joint")

STUCK_GAUGE_MM = 1.0
"""A gauge is stuck if its display did not change over an expected displacement larger than this."""


@dataclass(frozen=True, slots=True)
class GuardLimits:
    """The limits of one action.

    Attributes:
        stale_s: longest silence of a device, s of real time.
        plate: how far the ball may go from the set's reference.
        rest: largest displacement of a joint at standstill, in its unit; None while the robot moves.
        words: the mechanism's, for a joint and its unit.
    """

    stale_s: float
    plate: GaugeRoom
    rest: float | None = None
    words: MechanismWords = SOME_MECHANISM


Rule = Callable[[PolledDevices, GuardLimits], Trip | None]
"""A function of the latest answers that gives a trip, or None."""


def fault_trip(guard: Guard, report: DevicePoller[object]) -> Trip:
    """The trip of a device that reports an error."""
    assert report.error is not None  # noqa: S101 - callers have checked it
    error = report.error
    action = error.action or "Check it, then resume"
    return Trip(guard, error.subject or report.device, error.problem, action, (error,))


def joint_trip(joint: str, difference: Array, limit: float, words: str) -> Trip | None:
    """The trip of the joint with the largest difference, if that is beyond its limit."""
    leg = int(np.argmax(np.abs(difference)))
    if abs(difference[leg]) <= limit:
        return None
    return Trip(
        Guard.FOLLOWING,
        f"{joint} {leg + 1}",
        words.format(difference[leg]),
        "Look for what holds or moves that leg, and whether encoders and controller count alike",
    )


def stop_requested(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    """A stop input forbids motion."""
    line = devices.stop_input
    return None if line is None or not line.value else motion_forbidden(line.value)


def motion_forbidden(reason: str) -> Trip:
    """The trip for an active stop input."""
    return Trip(
        Guard.STOP_LINE,
        STOP_LINE,
        f"motion is forbidden: {reason}",
        "Release it when the robot may move, then resume",
    )


def controller_not_ready(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    """The controller is in emergency stop, off, or reports a following error."""
    report = devices.controller
    if report is None or report.value is None or report.value.may_move:
        return None
    status = report.value
    messages = "; ".join(status.error_messages)
    said = f": {messages}" if messages else ""
    if status.estop:
        action = "Find out why, release it and reset it at the controller, then resume"
        return Trip(Guard.EMERGENCY_STOP, report.device, f"is in emergency stop{said}", action)
    if "following error" in messages.lower():
        action = "Look for what blocks that leg, then switch on and resume"
        return Trip(Guard.FOLLOWING, report.device, f"switched itself off: {messages}", action)
    action = "Find out why, see to it, then resume"
    return Trip(Guard.CONTROLLER, report.device, f"was switched off{said}", action)


def controller_frozen(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    """The controller answers, but always the same, although the joints move."""
    report = devices.controller
    if report is None or not isinstance(report.error, ControllerFrozen):
        return None
    return fault_trip(Guard.STALE, report)


def encoder_fault(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    """An encoder has an alarm or restarted, or a sample is incomplete."""
    report = devices.encoders
    return None if report is None or report.error is None else fault_trip(Guard.ENCODERS, report)


def gauge_at_end(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    """A plunger reached an end of its travel; one that started there may leave it."""
    for gauge in devices.gauges:
        if isinstance(gauge.error, GaugeAtEnd) and gauge.value is not None:
            return fault_trip(Guard.GAUGE_END, gauge)
    return None


def ball_off_gauge(devices: PolledDevices, limits: GuardLimits) -> Trip | None:
    """The ball leaves the gauge plate: its deviation exceeds the limit and its first value."""
    for gauge in devices.gauges:
        if gauge.value is None or gauge.first is None:
            continue
        axis, deviation_mm = gauge.value.axis, gauge.value.deviation_mm
        side = limits.plate.upper[axis] if deviation_mm > 0.0 else -limits.plate.lower[axis]
        margin = max(side, abs(gauge.first.deviation_mm))
        if abs(deviation_mm) > margin:
            return Trip(
                Guard.PLATE,
                gauge.device,
                f"the ball is {deviation_mm:+.2f} mm from its reference along {'xyz'[axis]}, farther than "
                f"{margin:.2f} mm",
                "Look at gauge and ball, then resume: this point is measured again",
            )
    return None


def unexpected_motion(devices: PolledDevices, limits: GuardLimits) -> Trip | None:
    """A joint moved during standstill."""
    report = devices.encoders
    if limits.rest is None or report is None or report.value is None or report.first is None:
        return None
    moved = np.subtract(report.value.positions, report.first.positions)
    unit = limits.words.joint_unit
    words = f"moved by {{:+.2f}} {unit} during standstill (limit {limits.rest:g} {unit})"
    return joint_trip(limits.words.joint, moved, limits.rest, words)


def device_faults(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    """Devices report a fault, or only garbled answers; all of them are named."""
    trips = [
        fault_trip(Guard.DEVICE, report)
        for report in devices.all()
        if report.error is not None
        and not isinstance(report.error, GaugeAtEnd)
        and not 0 < report.garbled_count < MAX_GARBLED
    ]
    if not trips:
        return None
    problems = [trips[0].problem, *(f"{trip.device}: {trip.problem}" for trip in trips[1:])]
    actions = dict.fromkeys(trip.action for trip in trips)
    causes = tuple(cause for trip in trips for cause in trip.causes)
    return Trip(Guard.DEVICE, trips[0].device, "; ".join(problems), ". ".join(actions), causes)


def device_silent(devices: PolledDevices, limits: GuardLimits) -> Trip | None:
    """A device is silent for longer than allowed."""
    for report in devices.all():
        if report.line.silent_s > limits.stale_s:
            problem = f"has not answered for {report.line.silent_s:.2g} s while it was needed"
            if report is devices.controller:  # one that was ended has closed its connection
                problem += ", although its connection is open: it is frozen, or its cable is out"
            return Trip(Guard.STALE, report.device, problem, "Check its cable and supply, then resume")
    return None


RULES: tuple[Rule, ...] = (
    stop_requested,
    controller_not_ready,
    controller_frozen,
    encoder_fault,
    gauge_at_end,
    ball_off_gauge,
    unexpected_motion,
    device_faults,
    device_silent,
)
"""All that are evaluated continuously, in this order: a cause comes before its effects.

An emergency stop, for example, comes before the encoder that lost its supply with it.
"""


def first_trip(devices: PolledDevices, limits: GuardLimits) -> Trip | None:
    """The first trip, in the order of ``RULES``."""
    return next((trip for rule in RULES if (trip := rule(devices, limits))), None)


def following_error(
    commanded: Array, measured: Array, limit: float, of: MechanismWords = SOME_MECHANISM
) -> Trip | None:
    """After a move: a joint (6,) is too far from its commanded position; ``of`` has its word and unit."""
    unit = of.joint_unit
    words = f"is {{:+.3f}} {unit} from its commanded position (limit {limit:g} {unit})"
    return joint_trip(of.joint, np.subtract(measured, commanded), limit, words)


def stuck_gauge(gauge: str, displayed: tuple[str, ...], expected_mm: float) -> Trip | None:
    """After a move: a gauge displayed one value all the time although its ball must have moved."""
    if len(displayed) < MAX_GARBLED or len(set(displayed)) > 1 or abs(expected_mm) <= STUCK_GAUGE_MM:
        return None
    return Trip(
        Guard.STALE,
        gauge,
        f"shows {displayed[0]} unchanged although the ball should have moved {expected_mm:+.2f} mm",
        "See whether its plunger is free and its display alive, then resume",
    )
