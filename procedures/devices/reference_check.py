"""Verification of a reference: whether the gauges still have the zero of its first reading."""

from __future__ import annotations

import numpy as np

from hexacell.kinematics.rotations import Array
from procedures.run import events
from procedures.run.steps import SetKey, ThreeNumbers


def check_reference(
    at: SetKey, before: events.Reading, now: events.Reading, limit_mm: float
) -> events.ReferenceConfirmed | events.SetInvalidated:
    """Whether gauges and sliders show at a set's reference what they showed before."""
    gauges = np.subtract(now.gauges_mm, before.gauges_mm)
    sliders = np.subtract(now.joints_mm, before.joints_mm)
    if np.abs(gauges).max() > limit_mm:
        reason = f"back at its reference the gauges show {in_words(gauges)}, more than {limit_mm:g} mm"
        return events.SetInvalidated(at=at, reason=reason, reading=now)
    if np.abs(sliders).max() > limit_mm:
        leg = int(np.abs(sliders).argmax())
        reason = f"back at its reference q{leg + 1} shows {sliders[leg]:+.3f}, more than {limit_mm:g} mm"
        return events.SetInvalidated(at=at, reason=reason, reading=now)
    return events.ReferenceConfirmed(at=at, change_mm=_three(gauges), reading=now)


def in_words(deviation: Array) -> str:
    """Three numbers along x, y and z, mm."""
    return ", ".join(f"{axis} {value:+.3f}" for axis, value in zip("xyz", deviation, strict=True))


def _three(values: Array) -> ThreeNumbers:
    x, y, z = (float(value) for value in values)
    return x, y, z
