"""An encoder has an alarm or restarted, or a sample is incomplete."""

from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import GuardLimits, fault_trip
from procedures.run.trips import Guard, Trip


def encoder_fault(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    report = devices.encoders
    return None if report is None or report.error is None else fault_trip(Guard.ENCODERS, report)
