"""Our own gauges pass the suite that a driver from elsewhere passes."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

from drivers.conformance import GaugeConformance, GaugeTwin, served_twin
from drivers.gauges.cdi import CdiGauge
from drivers.gauges.described import RequestGauge, StreamGauge
from drivers.gauges.digimatic_usb import DigimaticUsbGauge
from drivers.gauges.heidenhain_nd import HeidenhainGauge
from drivers.gauges.keyence_dl_rs1a import KeyenceGauge
from drivers.gauges.mitutoyo_id_h import IdHGauge
from drivers.gauges.modbus import ModbusGauge
from drivers.gauges.mux10 import Mux10Gauge
from drivers.gauges.sylvac import SylvacGauge
from drivers.gauges.uwave import UwaveGauge
from drivers.gauges.visa import VisaGauge
from drivers.interfaces import Gauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings
from tests.drivers.gauges.test_request import ID_H
from tests.drivers.gauges.test_stream import RECEIVER


class OfProtocol(GaugeConformance):
    """A gauge of this program, and its simulation."""

    protocol: str
    factory: Any
    more: dict[str, Any] = {}  # noqa: RUF012 - not changed

    def driver(self, settings: GaugeSettings, ports: SharedSerialPorts) -> Gauge:
        gauge: Gauge = type(self).factory(settings, ports)
        return gauge

    def twin(self) -> AbstractContextManager[GaugeTwin]:
        stated: dict[str, Any] = {"name": "x", "axis": "x", "protocol": self.protocol, "timeout_s": 1.0}
        return served_twin(GaugeSettings(**stated, **self.more))


class TestSylvac(OfProtocol):
    protocol, factory = "sylvac", SylvacGauge


class TestMux10(OfProtocol):
    protocol, factory = "mux10", Mux10Gauge


class TestCdi(OfProtocol):
    protocol, factory = "cdi", CdiGauge


class TestByRequest(OfProtocol):
    protocol, factory = "request", RequestGauge
    more = {"request": ID_H}  # noqa: RUF012


class TestUwave(OfProtocol):
    protocol, factory = "uwave", UwaveGauge
    more = {"channel": 2, "delay_s": 0.02}  # noqa: RUF012


class TestStream(OfProtocol):
    protocol, factory = "stream", StreamGauge
    more = {"stream": RECEIVER, "delay_s": 0.02}  # noqa: RUF012


class TestIdH(OfProtocol):
    protocol, factory = "mitutoyo-id-h", IdHGauge
    more = {"channel": 7}  # noqa: RUF012


class TestHeidenhain(OfProtocol):
    protocol, factory = "heidenhain-nd", HeidenhainGauge


class TestKeyence(OfProtocol):
    protocol, factory = "keyence-dl-rs1a", KeyenceGauge
    more = {"channel": 2}  # noqa: RUF012


class TestDigimaticUsb(OfProtocol):
    protocol, factory = "digimatic-usb", DigimaticUsbGauge


class TestVisa(OfProtocol):
    tolerance_mm = 1e-6
    protocol, factory = "visa", VisaGauge
    more = {"visa": {"ask": "MEAS:DIST?", "mm_per_unit": 1000.0}}  # noqa: RUF012


class TestModbus(OfProtocol):
    protocol, factory = "modbus", ModbusGauge
    # a pseudo-terminal refuses the parity of a port that is opened again
    more = {"modbus": {"device": 3, "register": 100}}  # noqa: RUF012
