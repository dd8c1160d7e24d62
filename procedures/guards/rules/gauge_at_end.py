"""A plunger reached an end of its travel; one that started there may leave it."""

from drivers.errors import GaugeAtEnd
from procedures.guards.polling import PolledDevices
from procedures.guards.rules.base import GuardLimits, fault_trip
from procedures.run.trips import Guard, Trip


def gauge_at_end(devices: PolledDevices, _limits: GuardLimits) -> Trip | None:
    for gauge in devices.gauges:
        if isinstance(gauge.error, GaugeAtEnd) and gauge.value is not None:
            return fault_trip(Guard.GAUGE_END, gauge)
    return None
