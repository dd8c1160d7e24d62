"""A device is silent for longer than allowed."""

from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import GuardLimits
from procedures.run.trips import Guard, Trip


def device_silent(devices: PolledDevices, limits: GuardLimits) -> Trip | None:
    for report in devices.all():
        if report.line.silent_s > limits.stale_s:
            problem = f"has not answered for {report.line.silent_s:.2g} s while it was needed"
            if report is devices.controller:  # one that was ended has closed its connection
                problem += ", although its connection is open: it is frozen, or its cable is out"
            return Trip(Guard.STALE, report.device, problem, "Check its cable and supply, then resume")
    return None
