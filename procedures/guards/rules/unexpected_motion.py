"""A joint moved during standstill."""

import numpy as np

from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import GuardLimits, joint_trip
from procedures.run.trips import Trip


def unexpected_motion(devices: PolledDevices, limits: GuardLimits) -> Trip | None:
    report = devices.encoders
    if limits.rest is None or report is None or report.value is None or report.first is None:
        return None
    moved = np.subtract(report.value.positions, report.first.positions)
    unit = limits.words.joint_unit
    words = f"moved by {{:+.2f}} {unit} during standstill (limit {limits.rest:g} {unit})"
    return joint_trip(limits.words.joint, moved, limits.rest, words)
