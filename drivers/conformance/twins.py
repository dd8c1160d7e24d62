"""Simulated gauges on a pseudo-terminal and encoders on a bus or a line, as twins of conformance tests."""

from collections.abc import Mapping, Sequence

from drivers.simulated.cell import encoder_bank
from drivers.simulated.gauges.bank import InstrumentFactory, SimulatedGaugeBank
from drivers.simulated.served_device import Closeable, Switch
from hexacell.cell.devices import EncoderSettings, GaugeSettings
from hexacell.cell.simulation import FaultKind, SimulatedGauges
from hexacell.clock import CellClock

QUICKER = 100.0
"""Its answers are so much quicker than those of a real line."""
FAULTY_LEG = 3


class served_twin(Closeable):  # noqa: N801 - named as what a test writes behind ``with``
    """One simulated gauge on a pseudo-terminal, an instrument of one's own or that of the protocol.

    It shows the length that is set.
    """

    def __init__(self, settings: GaugeSettings, instrument: InstrumentFactory | None = None) -> None:
        self._mm = 0.0
        others = {} if instrument is None else {settings.protocol: instrument}
        plungers = {settings.name: lambda: self._mm}
        simulated = SimulatedGauges(flicker_mm=0.0)
        self._bank = SimulatedGaugeBank([settings], plungers, simulated, CellClock(QUICKER), others)
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


class served_encoder_twin(Closeable):  # noqa: N801
    """Six simulated encoders in this process, CiA 406 or what the settings describe.

    They stand where they are put.
    """

    def __init__(self, settings: EncoderSettings) -> None:
        self._joints: Sequence[float] = (0.0,) * 6
        self._bank = encoder_bank(settings, lambda: self._joints, CellClock(QUICKER))
        self.settings = settings.model_copy(update=self._bank.address)

    def stand_at(self, joints: Sequence[float]) -> None:
        """Move all joints at once, in the unit of the joint variables."""
        self._joints = tuple(joints)

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        """Switch a fault of leg 3 on or off."""
        self._bank.faults(FAULTY_LEG)[fault](on=on)

    def close(self) -> None:
        self._bank.close()
