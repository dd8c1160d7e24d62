"""The gauge passes what every gauge must: the whole test of such a package."""

from contextlib import AbstractContextManager

from hexacell_counter import CounterGauge
from hexacell_counter_twin import Counter

from drivers.conformance import GaugeConformance, GaugeTwin, served_twin
from drivers.interfaces import Gauge
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings


class TestCounter(GaugeConformance):
    tolerance_mm = 0.000051

    def driver(self, settings: GaugeSettings, ports: SharedSerialPorts) -> Gauge:
        gauge: Gauge = CounterGauge(settings, ports)
        return gauge

    def twin(self) -> AbstractContextManager[GaugeTwin]:
        settings = GaugeSettings(name="x", axis="x", protocol="counter", timeout_s=1.0)
        return served_twin(settings, Counter)
