"""Six encoders with Modbus on a pseudo-terminal, and their driver."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from drivers.encoders.modbus import ModbusBank
from drivers.simulated.encoders.modbus_bank import SimulatedModbusBank
from drivers.wire_trace import TrafficDirection, WireTrace
from hexacell.cell.devices import LinearEncoderSettings
from hexacell.clock import CellClock

FAST = 100.0
ONE_DEVICE = {"registers": (100, 102, 104, 106, 108, 110)}
TWO_DEVICES = {"registers": (0, 2, 4, 0, 2, 4), "devices": (7, 7, 7, 8, 8, 8)}


def modbus_settings(timeout_s: float = 0.5, **modbus: Any) -> LinearEncoderSettings:
    return LinearEncoderSettings.model_validate(
        {"protocol": "modbus", "timeout_s": timeout_s, "modbus": {**ONE_DEVICE, **modbus}}
    )


class Simulated:
    """Six simulated encoders, at 10, 20 and so on mm, and their driver."""

    def __init__(
        self, changes: dict[str, Any], *, has_gaps: bool = True, timeout_s: float = 0.5, **modbus: Any
    ) -> None:
        self.positions: Sequence[float] = [10.0 * leg for leg in range(1, 7)]
        settings = modbus_settings(timeout_s, **modbus).model_copy(update=changes)
        assert settings.modbus is not None
        self.bank = SimulatedModbusBank(
            settings, settings.modbus, lambda: self.positions, CellClock(FAST), has_gaps=has_gaps
        )
        self.settings = settings.model_copy(update={"modbus": self.bank.described})
        self.trace = WireTrace()
        self.driver = ModbusBank(self.settings, self.trace)

    @property
    def requests(self) -> list[bytes]:
        """What was sent so far, without checksums."""
        return [
            entry.data[:-2] for entry in self.trace.entries() if entry.direction is TrafficDirection.SENT
        ]


@pytest.fixture
async def simulated():
    """Makes simulated encoders with a driver, by changes of ``[encoders]`` and keys of its ``modbus``."""
    made = []

    def make(changes: dict[str, Any] | None = None, **modbus: Any) -> Simulated:
        made.append(Simulated(changes or {}, **modbus))
        return made[-1]

    yield make
    for one in made:
        await one.driver.close()
        one.bank.close()
