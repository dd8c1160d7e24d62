"""A complete simulated cell: gauges, encoders and controller, served over their own protocols."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from drivers.simulated.encoders.bank import SimulatedEncoderBank
from drivers.simulated.fault_schedule import CellFaults, FaultSchedule
from drivers.simulated.gauges.bank import SimulatedGaugeBank
from drivers.simulated.linuxcnc.server import SimulatedController
from drivers.simulated.physics import RobotPhysics
from drivers.simulated.robot import SimulatedMachine
from drivers.simulated.serial_line import PtyLine
from drivers.simulated.served_device import Closeable
from drivers.simulated.slcan import SlcanServer
from hexacell.cell.devices import GaugeSettings
from hexacell.cell.model import CellSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.clock import CellClock
from hexacell.controller_config.interface import ConfigFormat
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import Pose


class SimulatedCell(Closeable):
    """The cell described by ``[simulation]`` of a cell file; serves until it is closed.

    ``faults`` injects faults at once, ``schedule`` at a later time. ``other_processes``: whether the
    encoders must be reachable from other processes.

    Raises:
        FileError: the controller's config cannot be read.
        ReachError: the first point of the cell is out of reach by its config or its true geometry.
    """

    def __init__(
        self,
        settings: CellSettings,
        simulation: SimulationSettings,
        mechanism: Mechanism,
        config_format: ConfigFormat,
        config: Path,
        *,
        other_processes: bool,
    ) -> None:
        clock = CellClock(settings.timing.clock_factor)
        home = Pose(*settings.identification.points[0])
        commanding, fixture = config_format.read(config), settings.length_check
        self.physics = RobotPhysics(mechanism, simulation, clock, commanding, home, fixture)
        soft_limits = simulation.soft_limits
        self.machine = SimulatedMachine(
            mechanism, config_format, config, self.physics, clock, home, soft_limits
        )
        with ExitStack() as served:
            stop_file = _stop_file(settings, served)
            self.gauges = served.enter_context(_gauge_bank(settings, simulation, self.physics, clock))
            self.encoders = served.enter_context(_encoder_bank(settings, simulation, self.physics, clock))
            bus: dict[str, Any] = self.encoders.bus_settings
            if other_processes:
                adapter = served.enter_context(SlcanServer(self.encoders.channel, PtyLine("slcan")))
                bus = adapter.bus_settings
            self.controller = served.enter_context(SimulatedController(self.machine, settings.controller))
            self.faults = CellFaults(self.gauges, self.encoders, self.controller, self.machine, stop_file)
            self.schedule = served.enter_context(FaultSchedule(self.faults, clock, simulation.faults))
            self.physics.on_motion_start = self.schedule.on_motion_start
            self._served = served.pop_all()
        self.settings = settings.model_copy(
            update={
                "gauges": self.gauges.gauges,
                "encoders": settings.encoders.model_copy(update={"bus": bus}),
                "controller": settings.controller.model_copy(
                    update={
                        "host": "127.0.0.1",
                        "port": self.controller.port,
                        "startup": simulation.startup,
                    }
                ),
                "guards": settings.guards.model_copy(update={"stop_file": str(stop_file)}),
                "simulation": None,
            }
        )

    def close(self) -> None:
        """Stop serving; twice is harmless."""
        self._served.close()


def _stop_file(settings: CellSettings, served: ExitStack) -> Path:
    """The stop file of the cell, or one in a temporary folder that is removed at the end."""
    if settings.guards.stop_file is not None:
        return Path(settings.guards.stop_file)
    return Path(served.enter_context(TemporaryDirectory(prefix="hexacell-"))) / "stop"


def _gauge_bank(
    settings: CellSettings, simulation: SimulationSettings, physics: RobotPhysics, clock: CellClock
) -> SimulatedGaugeBank:
    plungers = {gauge.name: partial(_plunger_position, physics, gauge) for gauge in settings.gauges}
    return SimulatedGaugeBank(settings.gauges, plungers, simulation.gauges, clock)


def _encoder_bank(
    settings: CellSettings, simulation: SimulationSettings, physics: RobotPhysics, clock: CellClock
) -> SimulatedEncoderBank:
    latency = simulation.encoders.latency_s
    return SimulatedEncoderBank(
        settings.encoders, lambda: physics.encoder_positions().tolist(), clock, latency_s=latency
    )


def _plunger_position(physics: RobotPhysics, gauge: GaugeSettings) -> float:
    """The position of one gauge's plunger, mm, in the instrument's own direction."""
    return gauge.mounting.reading(physics.gauge_displacement(gauge.axis))
