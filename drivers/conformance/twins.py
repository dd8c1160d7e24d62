"""Simulated gauges on a pseudo-terminal and encoders on a virtual bus, as twins of conformance tests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager

from drivers.simulated.encoders.bank import SimulatedEncoderBank
from drivers.simulated.gauges.bank import InstrumentFactory, SimulatedGaugeBank
from drivers.simulated.served_device import Switch
from hexacell.cell.devices import EncoderSettings, GaugeSettings
from hexacell.cell.simulation import FaultKind, SimulatedGauges
from hexacell.clock import CellClock

QUICKER = 100.0
"""Its answers are so much quicker than those of a real line."""


class ServedTwin:
    """One gauge of the simulation; it shows the length that is set."""

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
    with closing(ServedTwin(settings, instrument)) as twin:
        yield twin


FAULTY_LEG = 3


class ServedEncoderTwin:
    """The six CiA 406 encoders of the simulation; they stand where they are put."""

    def __init__(self, settings: EncoderSettings) -> None:
        self._joints: Sequence[float] = (0.0,) * 6
        self._bank = SimulatedEncoderBank(settings, lambda: self._joints, CellClock(QUICKER))
        self.settings = settings.model_copy(update={"bus": self._bank.bus_settings})

    def stand_at(self, joints: Sequence[float]) -> None:
        """Move all joints at once, in the unit of the joint variables."""
        self._joints = tuple(joints)

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        """Switch a fault of leg 3 on or off."""
        self._bank.faults(FAULTY_LEG)[fault](on=on)

    def close(self) -> None:
        """Stop serving."""
        self._bank.close()


@contextmanager
def served_encoder_twin(settings: EncoderSettings) -> Iterator[ServedEncoderTwin]:
    """Serve six simulated encoders on a virtual bus of this process."""
    with closing(ServedEncoderTwin(settings)) as twin:
        yield twin
