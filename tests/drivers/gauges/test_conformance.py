"""Every gauge that hexacell announces passes the suite that a driver from elsewhere passes."""

from contextlib import AbstractContextManager
from typing import Any

from drivers.conformance import GaugeConformance, GaugeTwin, served_twin
from drivers.interfaces import Gauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.plugins import Group, load, names
from tests.drivers.simulated.gauges.served.cell import STREAM_DELAY_S, described

CHANNEL = 2

TOLERANCES_MM = {"visa": 1e-6}


class OfProtocol(GaugeConformance):
    """A gauge of this program, and its simulation."""

    protocol: str

    def driver(self, settings: GaugeSettings, ports: SharedSerialPorts) -> Gauge:
        gauge: Gauge = load(Group.GAUGES, self.protocol)(settings, ports)
        return gauge

    def twin(self) -> AbstractContextManager[GaugeTwin]:
        stated: dict[str, Any] = {"name": "x", "axis": "x", "protocol": self.protocol, "timeout_s": 1.5}
        stated |= {"channel": CHANNEL, "delay_s": STREAM_DELAY_S}
        return served_twin(GaugeSettings(**stated, **described(self.protocol, CHANNEL)))


for name in names(Group.GAUGES):
    tolerance_mm = TOLERANCES_MM.get(name, OfProtocol.tolerance_mm)
    members = {"protocol": name, "tolerance_mm": tolerance_mm}
    globals()[f"Test_{name.replace('-', '_')}"] = type(f"Test_{name}", (OfProtocol,), members)
