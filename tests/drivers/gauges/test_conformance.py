"""Every gauge that hexacell announces passes the suite that a driver from elsewhere passes."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

from drivers.conformance import GaugeConformance, GaugeTwin, served_twin
from drivers.interfaces import Gauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from hexacell.plugins import Group, load, names
from tests.drivers.gauges.test_request import ID_H
from tests.drivers.gauges.test_stream import RECEIVER

MORE: dict[str, dict[str, Any]] = {
    "request": {"request": ID_H},
    "uwave": {"channel": 2, "delay_s": 0.02},
    "stream": {"stream": RECEIVER, "delay_s": 0.02},
    "mitutoyo-id-h": {"channel": 7},
    "keyence-dl-rs1a": {"channel": 2},
    "visa": {"visa": {"ask": "MEAS:DIST?", "mm_per_unit": 1000.0}},
    # a pseudo-terminal refuses the parity of a port that is opened again
    "modbus": {"modbus": {"device": 3, "register": 100}},
}
"""What the cell file must say beside the protocol, or says to try a channel or to be quick."""

TOLERANCES_MM = {"visa": 1e-6}


class OfProtocol(GaugeConformance):
    """A gauge of this program, and its simulation."""

    protocol: str

    def driver(self, settings: GaugeSettings, ports: SharedSerialPorts) -> Gauge:
        gauge: Gauge = load(Group.GAUGES, self.protocol)(settings, ports)
        return gauge

    def twin(self) -> AbstractContextManager[GaugeTwin]:
        stated: dict[str, Any] = {"name": "x", "axis": "x", "protocol": self.protocol, "timeout_s": 0.4}
        return served_twin(GaugeSettings(**stated, **MORE.get(self.protocol, {})))


for name in names(Group.GAUGES):
    tolerance_mm = TOLERANCES_MM.get(name, OfProtocol.tolerance_mm)
    members = {"protocol": name, "tolerance_mm": tolerance_mm}
    globals()[f"Test_{name.replace('-', '_')}"] = type(f"Test_{name}", (OfProtocol,), members)
