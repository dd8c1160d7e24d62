"""Gauges and encoders of a simulated cell, served over their own protocols."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from typing import Any

from drivers.simulated.encoders.bank import SimulatedEncoderBank
from drivers.simulated.encoders.dbc_bank import SimulatedDbcBank
from drivers.simulated.encoders.modbus_bank import SimulatedModbusBank
from drivers.simulated.gauges.bank import SimulatedGaugeBank
from drivers.simulated.physics import RobotPhysics
from drivers.simulated.serial_line import PtyLine
from drivers.simulated.served_device import Closeable
from drivers.simulated.slcan import SlcanServer
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.model import CellSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.clock import CellClock


class SimulatedSensors(Closeable):
    """Serves what gauges and encoders show of a robot until it is closed.

    ``other_processes``: whether the encoders must be reachable from other processes.
    """

    def __init__(
        self,
        settings: CellSettings,
        simulation: SimulationSettings,
        physics: RobotPhysics,
        clock: CellClock,
        *,
        other_processes: bool,
    ) -> None:
        with ExitStack() as served:
            self.gauges = served.enter_context(_gauge_bank(settings, simulation, physics, clock))
            self.encoders = _encoder_bank(settings, simulation, physics, clock)
            served.enter_context(self.encoders)
            self._address: dict[str, Any] = {}
            if isinstance(self.encoders, SimulatedModbusBank):
                self._address = {"modbus": self.encoders.described}
            elif other_processes:
                adapter = served.enter_context(SlcanServer(self.encoders.channel, PtyLine("slcan")))
                self._address = {"bus": adapter.bus_settings}
            else:
                self._address = {"bus": self.encoders.bus_settings}
            self._served = served.pop_all()

    def addressed(self, settings: CellSettings) -> CellSettings:
        """The settings with the address of every sensor; nothing of them is simulated any more."""
        encoders = settings.encoders.model_copy(update=self._address)
        return settings.model_copy(
            update={"gauges": self.gauges.gauges, "encoders": encoders, "simulation": None}
        )

    def close(self) -> None:
        """Stop serving; twice is harmless."""
        self._served.close()


def _gauge_bank(
    settings: CellSettings, simulation: SimulationSettings, physics: RobotPhysics, clock: CellClock
) -> SimulatedGaugeBank:
    plungers = {gauge.name: partial(_plunger_position, physics, gauge) for gauge in settings.gauges}
    return SimulatedGaugeBank(settings.gauges, plungers, simulation.gauges, clock)


def _encoder_bank(
    settings: CellSettings, simulation: SimulationSettings, physics: RobotPhysics, clock: CellClock
) -> SimulatedEncoderBank | SimulatedDbcBank | SimulatedModbusBank:
    encoders, latency_s = settings.encoders, simulation.encoders.latency_s

    def positions() -> list[float]:
        found: list[float] = physics.encoder_positions().tolist()
        return found

    if encoders.modbus is not None:
        return SimulatedModbusBank(encoders, encoders.modbus, positions, clock, latency_s)
    if encoders.dbc is not None:
        return SimulatedDbcBank(encoders, encoders.dbc, positions)
    return SimulatedEncoderBank(encoders, positions, clock, latency_s=latency_s)


def _plunger_position(physics: RobotPhysics, gauge: GaugeSettings) -> float:
    """The position of one gauge's plunger, mm, in the instrument's own direction."""
    return gauge.mounting.reading(physics.gauge_displacement(gauge.axis))
