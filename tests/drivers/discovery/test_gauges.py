"""The order of the questions on a serial line, and what comes of their answers."""

from __future__ import annotations

from typing import Any, ClassVar

from drivers.discovery.gauges import FoundGauge, search_port
from drivers.errors import GaugeSilent
from drivers.gauges.mux10 import Mux10Gauge
from drivers.gauges.protocol import Probe
from drivers.interfaces import DeviceIdentity, GaugeReading
from drivers.serial.shared_port import SharedSerialPorts
from hexacell.cell.devices import GaugeSettings

RATE = 38400
ABSENT = "/dev/nowhere"


class AtOneRate:
    """A gauge that hears nothing at another baud rate than its own."""

    name, channel = "x", None
    asked: ClassVar[list[Any]]

    def __init__(self, settings: GaugeSettings, _ports: SharedSerialPorts) -> None:
        self._baudrate = settings.serial.get("baudrate")
        self.asked.append(self._baudrate)

    async def open(self) -> DeviceIdentity:
        if self._baudrate != RATE:
            raise GaugeSilent("does not answer")
        return DeviceIdentity("x", "mux10", "a multiplexer")

    async def read_once(self) -> GaugeReading:
        return GaugeReading(1.25, "01A+0001.250")

    async def read(self) -> GaugeReading:
        return await self.read_once()

    async def check(self) -> None: ...

    async def close(self) -> None: ...


async def test_a_multiplexer_is_asked_at_other_baud_rates_once_nothing_answers() -> None:
    class Gauge(AtOneRate):
        asked: ClassVar[list[Any]] = []
        probe: ClassVar[Probe | None] = Mux10Gauge.probe

    found = await search_port(ABSENT, {"mux10": Gauge})
    assert found.gauges == (
        FoundGauge("mux10", ABSENT, "a multiplexer", None, "01A+0001.250", "", baudrate=RATE),
    )
    assert Gauge.probe is not None
    rates = Gauge.probe.other_baud_rates
    assert Gauge.asked == [None, *rates[: rates.index(RATE) + 1]]


async def test_other_protocols_are_asked_at_their_own_rate_alone() -> None:
    class Gauge(AtOneRate):
        asked: ClassVar[list[Any]] = []

    assert (await search_port(ABSENT, {"sylvac": Gauge})).gauges == ()
    assert Gauge.asked == [None]
