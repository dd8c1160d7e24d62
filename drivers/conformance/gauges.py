"""The tests that every gauge's driver passes, against a twin of its instrument on a serial line."""

import asyncio
from abc import abstractmethod
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Protocol

from drivers.conformance.suite import FAULTS, TWIN_SPEED, Suite, against_twin, failure, require_named
from drivers.interfaces import Gauge
from drivers.serial.shared_port import SharedSerialPorts
from drivers.simulated.gauges.bank import InstrumentFactory, SimulatedGaugeBank
from drivers.simulated.served_device import Closeable, Switch
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.simulation import FaultKind, SimulatedGauges
from hexacell.clock import CellClock
from hexacell.errors import DeviceError

WORST_LATENCY_S = 0.2
VALUES_MM = (0.0, 1.5, -2.25, 4.0)
DAMAGED_READS = 10


class GaugeTwin(Protocol):
    """A simulated instrument: its address, what it shows, and its faults."""

    @property
    def settings(self) -> GaugeSettings:
        """The settings of the gauge, with the port on which the twin answers."""

    def show(self, mm: float) -> None:
        """Move the plunger, mm from the middle of its travel."""

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        """Switch ``unplugged``, ``silent`` or ``damaged`` on or off."""


class GaugeConformance(Suite[Gauge, GaugeTwin]):
    """Subclass it in a test file, name it ``Test...``, and say what is tested.

    A reading may differ by ``tolerance_mm`` from what the twin shows: half its last digit.
    """

    tolerance_mm: float = 0.00051

    @abstractmethod
    def driver(self, settings: GaugeSettings, ports: SharedSerialPorts) -> Gauge:
        """The driver under test."""

    @against_twin
    async def test_it_reads_what_the_instrument_shows(self, gauge: Gauge, twin: GaugeTwin) -> None:
        assert (await gauge.open()).name == gauge.name
        for mm in VALUES_MM:
            twin.show(mm)
            for read in (gauge.read, gauge.read_once):
                found = await read()
                assert abs(found.value_mm - mm) <= self.tolerance_mm, found

    @against_twin
    async def test_an_unchanged_instrument_passes_the_check(self, gauge: Gauge, twin: GaugeTwin) -> None:
        await gauge.open()
        await gauge.check()
        twin.show(1.0)
        await gauge.check()

    @against_twin
    async def test_closing_twice_is_harmless(self, gauge: Gauge, twin: GaugeTwin) -> None:
        await gauge.close()
        await gauge.open()
        await gauge.close()
        await gauge.close()
        for call in (gauge.read, gauge.read_once, gauge.check):
            require_named(await failure(call), gauge.name)

    @against_twin
    async def test_it_reopens_after_a_fault(self, gauge: Gauge, twin: GaugeTwin) -> None:
        for fault in FAULTS:
            await gauge.open()
            twin.inject(fault, on=True)
            require_named(await failure(gauge.read), gauge.name)
            require_named(await failure(gauge.check), gauge.name)
            twin.inject(fault, on=False)
            twin.show(2.0)
            await gauge.close()
            await gauge.open()
            assert abs((await gauge.read()).value_mm - 2.0) <= self.tolerance_mm

    @against_twin
    async def test_damaged_answers_are_not_read(self, gauge: Gauge, twin: GaugeTwin) -> None:
        twin.show(1.0)
        await gauge.open()
        twin.inject("damaged", on=True)
        agreement_mm = twin.settings.agreement_mm or 0.05
        for _ in range(DAMAGED_READS):
            try:
                found = await gauge.read()
            except DeviceError:
                continue
            assert abs(found.value_mm - 1.0) <= agreement_mm + self.tolerance_mm, found

    @against_twin
    async def test_a_cancelled_reading_leaves_the_line_in_step(self, gauge: Gauge, twin: GaugeTwin) -> None:
        await gauge.open()
        for mm in VALUES_MM:
            given_up = asyncio.create_task(gauge.read_once())
            await asyncio.sleep(0)
            given_up.cancel()
            await asyncio.gather(given_up, return_exceptions=True)
            twin.show(mm)
            assert abs((await gauge.read()).value_mm - mm) <= self.tolerance_mm

    def _driver_of(self, twin: GaugeTwin) -> Gauge:
        return self.driver(twin.settings, self._ports)

    @asynccontextmanager
    async def _closed_after(self, twin: GaugeTwin) -> AsyncIterator[Gauge]:
        self._ports = SharedSerialPorts(worst_latency_s=WORST_LATENCY_S)
        try:
            async with super()._closed_after(twin) as gauge:
                yield gauge
        finally:
            await self._ports.close()


class served_twin(Closeable):  # noqa: N801 - named as what a test writes behind ``with``
    """One simulated gauge on a pseudo-terminal, an instrument of one's own or that of the protocol.

    It shows the length that is set.
    """

    def __init__(self, settings: GaugeSettings, instrument: InstrumentFactory | None = None) -> None:
        self._mm = 0.0
        others = {} if instrument is None else {settings.protocol: instrument}
        plungers = {settings.name: lambda: self._mm}
        simulated = SimulatedGauges(flicker_mm=0.0)
        self._bank = SimulatedGaugeBank([settings], plungers, simulated, CellClock(TWIN_SPEED), others)
        [self.settings] = self._bank.gauges

    def show(self, mm: float) -> None:
        """Move the plunger, mm from the middle of its travel."""
        self._mm = mm

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        """Switch a fault on or off."""
        self.faults[fault](on=on)

    @property
    def faults(self) -> Mapping[FaultKind, Switch]:
        """Its faults by name."""
        return self._bank.faults(self.settings.name)

    def close(self) -> None:
        self._bank.close()
