"""The controller answers, but always the same, although the joints move."""

from drivers.errors import ControllerFrozen
from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import GuardLimits, fault_trip
from procedures.run.trips import Guard, Trip


def controller_frozen(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    report = devices.controller
    if report is None or not isinstance(report.error, ControllerFrozen):
        return None
    return fault_trip(Guard.STALE, report)
