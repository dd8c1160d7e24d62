"""A simulated gauge on a pseudo-terminal, as the twin of a conformance test."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from drivers.simulated.gauges.bank import InstrumentFactory, SimulatedGaugeBank
from drivers.simulated.served_device import Switch
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.simulation import FaultKind, SimulatedGauges
from hexacell.clock import CellClock

QUICKER = 100.0
"""Its answers are so much quicker than those of a real line."""


class ServedTwin:
    """One gauge of the simulation; it shows what it is told to."""

    def __init__(self, settings: GaugeSettings, instrument: InstrumentFactory | None) -> None:
        self._mm = 0.0
        others = {} if instrument is None else {settings.protocol: instrument}
        self._bank = SimulatedGaugeBank(
            [settings],
            {settings.name: lambda: self._mm},
            SimulatedGauges(flicker_mm=0.0),
            CellClock(QUICKER),
            others,
        )
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
        """Stop serving."""
        self._bank.close()


@contextmanager
def served_twin(
    settings: GaugeSettings, instrument: InstrumentFactory | None = None
) -> Iterator[ServedTwin]:
    """Serve a simulated gauge on a pseudo-terminal: an instrument of one's own, or that of the protocol."""
    twin = ServedTwin(settings, instrument)
    try:
        yield twin
    finally:
        twin.close()
