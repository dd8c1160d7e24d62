"""Devices report a fault, or only garbled answers; all of them are named."""

from drivers.errors import GaugeAtEnd
from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import MAX_GARBLED, GuardLimits, fault_trip
from procedures.run.trips import Guard, Trip


def device_faults(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
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
