"""The ball leaves the gauge plate: its deviation exceeds the limit and its first value."""

from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import GuardLimits
from procedures.run.trips import Guard, Trip


def ball_off_gauge(devices: PolledDevices, limits: GuardLimits) -> Trip | None:
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
