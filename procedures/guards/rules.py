"""The guards: each a function of a snapshot that says what is wrong, or nothing.

They are asked in the order of ``RULES``, so that the plainest cause is named: a machine that was
switched off by the emergency stop, not the encoder that lost its supply with it.

How much room is left where a run is kept.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from drivers.gauges.errors import GaugeAtEnd
from drivers.stop_input.stop_input import SUBJECT as STOP_LINE
from hexacell.kinematics.rotations import Array
from hexacell.storage import atomic_files
from procedures.guards.snapshot import DeviceReport, GuardLimits, Snapshot
from procedures.run.trips import Guard, Trip

MAX_GARBLED = 3
"""So many answers in a row that make no sense are a broken device, fewer a noisy line."""

STUCK_GAUGE_MM = 1.0
"""A plunger that should have moved farther than this, and shows the same to the last digit, has not."""

Rule = Callable[[Snapshot, GuardLimits], Trip | None]


def first_trip(snapshot: Snapshot, limits: GuardLimits) -> Trip | None:
    """What trips first, if anything does."""
    return next((trip for rule in RULES if (trip := rule(snapshot, limits))), None)


def stop_requested(snapshot: Snapshot, _limits: GuardLimits) -> Trip | None:
    """Somebody forbids motion."""
    line = snapshot.stop_input
    return None if line is None or not line.value else motion_forbidden(line.value)


def controller_not_ready(snapshot: Snapshot, _limits: GuardLimits) -> Trip | None:
    """The controller is in emergency stop, off, or complains of a following error."""
    heard = snapshot.controller
    if heard is None or heard.value is None or heard.value.may_move:
        return None
    status = heard.value
    said = "; ".join(status.error_messages)
    if any("following error" in complaint.lower() for complaint in status.error_messages):
        action = "Look for what blocks that leg, then switch on and resume"
        return Trip(Guard.FOLLOWING, heard.device, f"switched itself off: {said}", action)
    problem = "is in emergency stop" if status.estop else "was switched off"
    release = "release the emergency stop" if status.estop else "see to it"
    action = f"Find out why, {release}, then resume"
    return Trip(Guard.CONTROLLER, heard.device, f"{problem}: {said}" if said else problem, action)


def encoder_fault(snapshot: Snapshot, _limits: GuardLimits) -> Trip | None:
    """An encoder has an alarm, restarted, or a round stayed incomplete."""
    heard = snapshot.encoders
    return None if heard is None or heard.error is None else _reported(Guard.ENCODERS, heard)


def gauge_at_end(snapshot: Snapshot, _limits: GuardLimits) -> Trip | None:
    """A plunger has come to an end of its travel; one that was there from the beginning may leave it."""
    for gauge in snapshot.gauges:
        if isinstance(gauge.error, GaugeAtEnd) and gauge.value is not None:
            return _reported(Guard.GAUGE_END, gauge)
    return None


def device_faults(snapshot: Snapshot, _limits: GuardLimits) -> Trip | None:
    """Devices say themselves that something is wrong with them, or only nonsense; all are named."""
    trips = [
        _reported(Guard.DEVICE, heard)
        for heard in _all(snapshot)
        if heard.error is not None and not isinstance(heard.error, GaugeAtEnd) and _counts(heard)
    ]
    if not trips:
        return None
    problems = [trips[0].problem, *(f"{trip.device}: {trip.problem}" for trip in trips[1:])]
    actions = dict.fromkeys(trip.action for trip in trips)
    causes = tuple(cause for trip in trips for cause in trip.causes)
    return Trip(Guard.DEVICE, trips[0].device, "; ".join(problems), ". ".join(actions), causes)


def device_silent(snapshot: Snapshot, limits: GuardLimits) -> Trip | None:
    """A device has not answered for too long."""
    for heard in _all(snapshot):
        if heard.silent_s > limits.stale_s:
            return Trip(
                Guard.STALE,
                heard.device,
                f"has not answered for {heard.silent_s:.2g} s while it was needed",
                "Check its cable and supply, then resume",
            )
    return None


def ball_off_gauge(snapshot: Snapshot, limits: GuardLimits) -> Trip | None:
    """The ball is leaving the plate: farther off than allowed, and than it was in the beginning."""
    for gauge in snapshot.gauges:
        if gauge.value is None or gauge.first is None:
            continue
        margin = max(limits.plate_mm, abs(gauge.first.deviation_mm))
        if abs(gauge.value.deviation_mm) > margin:
            return Trip(
                Guard.PLATE,
                gauge.device,
                f"the ball is {gauge.value.deviation_mm:+.2f} mm from its reference along "
                f"{'xyz'[gauge.value.axis]}, farther than {margin:.2f} mm",
                "Look at gauge and ball, then resume: this point is measured again",
            )
    return None


def unexpected_motion(snapshot: Snapshot, limits: GuardLimits) -> Trip | None:
    """A slider moves although nothing was commanded."""
    heard = snapshot.encoders
    if limits.rest_mm is None or heard is None or heard.value is None or heard.first is None:
        return None
    moved = np.subtract(heard.value.positions_mm, heard.first.positions_mm)
    words = f"moved by {{:+.2f}} mm while the robot had to stand still (limit {limits.rest_mm:g} mm)"
    return _off(moved, limits.rest_mm, words)


RULES: tuple[Rule, ...] = (
    stop_requested,
    controller_not_ready,
    encoder_fault,
    gauge_at_end,
    ball_off_gauge,
    unexpected_motion,
    device_faults,
    device_silent,
)


def motion_forbidden(reason: str) -> Trip:
    """The stop line is pressed, for this reason."""
    return Trip(
        Guard.STOP_LINE,
        STOP_LINE,
        f"motion is forbidden: {reason}",
        "Release it when the robot may move, then resume",
    )


def following_error(commanded: Array, measured: Array, limit_mm: float) -> Trip | None:
    """At the end of a move: sliders (6,), mm, are where the controller was told to send them."""
    words = f"is {{:+.3f}} mm from where the controller was told to send it (limit {limit_mm:g} mm)"
    return _off(np.subtract(measured, commanded), limit_mm, words)


def stuck_gauge(gauge: str, shown: tuple[str, ...], expected_mm: float) -> Trip | None:
    """At the end of a move: a gauge that showed one value all the way, while its ball had to move."""
    if len(shown) < MAX_GARBLED or len(set(shown)) > 1 or abs(expected_mm) <= STUCK_GAUGE_MM:
        return None
    return Trip(
        Guard.STALE,
        gauge,
        f"shows {shown[0]} unchanged although the ball should have moved {expected_mm:+.2f} mm",
        "See whether its plunger is free and its display alive, then resume",
    )


def reference_drift(point: str, drift_mm: tuple[float, ...], limit_mm: float) -> Trip | None:
    """Back at a set's reference: the gauges show what they did."""
    if max(map(abs, drift_mm)) <= limit_mm:
        return None
    words = ", ".join(f"{axis} {value:+.3f}" for axis, value in zip("xyz", drift_mm, strict=True))
    return Trip(
        Guard.DRIFT,
        point,
        f"back at the reference the gauges show {words}, more than {limit_mm:g} mm",
        "A gauge slipped or the machine does not repeat; resume measures this point again",
    )


def low_disk_space(folder: str, free_bytes: int, limit_mb: float) -> Trip | None:
    """There is room for what will be written."""
    free_mb = free_bytes / 1e6
    if free_mb >= limit_mb:
        return None
    return Trip(
        Guard.DISK,
        folder,
        f"only {free_mb:.0f} MB are free where the run is kept, less than {limit_mb:g} MB",
        "Free some space, then resume",
    )


def _all(snapshot: Snapshot) -> Iterator[DeviceReport[object]]:
    for heard in (*snapshot.gauges, snapshot.encoders, snapshot.controller, snapshot.stop_input):
        if heard is not None:
            yield heard


def _counts(heard: DeviceReport[object]) -> bool:
    return heard.garbled_count == 0 or heard.garbled_count >= MAX_GARBLED


def _reported(guard: Guard, heard: DeviceReport[object]) -> Trip:
    assert heard.error is not None  # noqa: S101 - callers see to it
    error = heard.error
    action = error.action or "Check it, then resume"
    return Trip(guard, error.subject or heard.device, error.problem, action, (error,))


def _off(difference: Array, limit_mm: float, words: str) -> Trip | None:
    leg = int(np.argmax(np.abs(difference)))
    if abs(difference[leg]) <= limit_mm:
        return None
    return Trip(
        Guard.FOLLOWING,
        f"slider {leg + 1}",
        words.format(difference[leg]),
        "Look for what holds or moves that leg, and whether encoders and controller count alike",
    )


def free_bytes(folder: Path) -> int:
    """Free bytes on the file system of a folder that may not exist yet.

    Raises:
        FileError: nobody can tell.
    """
    there = next((path for path in (folder, *folder.parents) if path.exists()), folder)
    try:
        return shutil.disk_usage(there).free
    except OSError as error:
        raise atomic_files.os_error_to_file_error("its free space cannot be told", there, error) from error
