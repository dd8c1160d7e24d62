"""A complete simulated cell: gauges, encoders and controller, served over their own protocols."""

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from drivers.controllers.adapter.options import AdapterOptions
from drivers.simulated.adapter import SimulatedAdapter
from drivers.simulated.encoders.bank import Positions, SimulatedDbcBank, SimulatedEncoderBank
from drivers.simulated.encoders.modbus_bank import SimulatedModbusBank
from drivers.simulated.fault_schedule import CellFaults, FaultSchedule
from drivers.simulated.gauges.bank import SimulatedGaugeBank
from drivers.simulated.linuxcnc.server import SimulatedController
from drivers.simulated.physics import USUAL_REACH_MM, RobotPhysics
from drivers.simulated.robot import SimulatedMachine
from drivers.simulated.serial_line import PtyLine
from drivers.simulated.served_device import ServedGroup
from drivers.simulated.slcan import SlcanServer
from drivers.simulated.thermometers import SimulatedThermometers
from hexacell.cell.devices import EncoderSettings, GaugeSettings
from hexacell.cell.model import CellSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.clock import CellClock
from hexacell.config.layout import ConfigLayout
from hexacell.kinematics.pose import Pose


def simulation_of(settings: CellSettings) -> SimulationSettings:
    """What the cell file states of the simulation: only cells that have it are simulated."""
    assert settings.simulation is not None  # noqa: S101
    return settings.simulation


class SimulatedSensors(ServedGroup):
    """Serves what gauges and encoders show of a robot until it is closed.

    ``other_processes``: whether the encoders must be reachable from other processes.
    """

    def __init__(
        self, settings: CellSettings, physics: RobotPhysics, clock: CellClock, *, other_processes: bool
    ) -> None:
        simulation = simulation_of(settings)
        with ExitStack() as served:
            plungers = {gauge.name: partial(_plunger_mm, physics, gauge) for gauge in settings.gauges}
            self.gauges = served.enter_context(
                SimulatedGaugeBank(settings.gauges, plungers, simulation.gauges, clock)
            )
            latency_s = simulation.encoders.latency_s
            self.encoders = encoder_bank(settings.encoders, physics.encoder_positions, clock, latency_s)
            served.enter_context(self.encoders)
            self._address = self.encoders.address
            if other_processes and not isinstance(self.encoders, SimulatedModbusBank):
                adapter = served.enter_context(SlcanServer(self.encoders.channel, PtyLine("slcan")))
                self._address = {"bus": adapter.bus_settings}
            self._served = served.pop_all()

    def addressed(self, settings: CellSettings) -> CellSettings:
        """The settings with the address of every sensor; nothing of them is simulated any more."""
        encoders = settings.encoders.model_copy(update=self._address)
        return settings.model_copy(
            update={"gauges": self.gauges.gauges, "encoders": encoders, "simulation": None}
        )


def encoder_bank(
    encoders: EncoderSettings, positions: Positions, clock: CellClock, latency_s: float = 0.0
) -> SimulatedEncoderBank | SimulatedDbcBank | SimulatedModbusBank:
    """The encoders that the settings describe, served; ``address`` is where a driver finds them."""
    if encoders.modbus is not None:
        return SimulatedModbusBank(encoders, encoders.modbus, positions, clock, latency_s)
    if encoders.dbc is not None:
        return SimulatedDbcBank(encoders, encoders.dbc, positions)
    return SimulatedEncoderBank(encoders, positions, clock, latency_s=latency_s)


TRIED_SHARE = 0.3
"""Share of the gauges' travel that the ball is moved by at most while they are tried, and some more."""


def _station_reach_mm(settings: CellSettings) -> float | None:
    """How far the ball may be from the gauges before they are moved to it.

    However small the machine is, they are moved from one point to the next, and not while they are tried.
    """
    if (stated := simulation_of(settings).station_reach_mm) is not None:
        return stated
    points = np.array([*settings.identification.points, *settings.verification.points])
    apart = np.linalg.norm(points[:, None] - points, axis=-1)
    nearest = np.min(apart, where=apart > 0.0, initial=np.inf)
    tried = TRIED_SHARE * min(gauge.travel_mm for gauge in settings.gauges)
    return min(USUAL_REACH_MM, max(tried, 0.5 * float(nearest)))


def _plunger_mm(physics: RobotPhysics, gauge: GaugeSettings) -> float:
    """The position of one gauge's plunger, mm, in the instrument's own direction."""
    return gauge.mounting.reading(physics.gauge_displacement(gauge.axis))


class SimulatedCell(ServedGroup):
    """The cell described by ``[simulation]`` of a cell file; serves until it is closed.

    ``faults`` injects faults at once, ``schedule`` at a later time. ``other_processes``: whether the
    encoders must be reachable from other processes. Raises ``FileError`` if the controller's config cannot
    be read, ``ReachError`` if the first point is out of reach by the config or by the true geometry.
    """

    def __init__(
        self, settings: CellSettings, config: tuple[Path, ...], *, other_processes: bool = False
    ) -> None:
        simulation, layout = simulation_of(settings), ConfigLayout.of(settings)
        clock = CellClock(settings.timing.clock_factor)
        home = Pose(*settings.identification.points[0])
        commanding, fixture = layout.read(*config), settings.length_check
        simulated = simulation.model_copy(update={"station_reach_mm": _station_reach_mm(settings)})
        mechanism = settings.mechanism
        self.physics = RobotPhysics(mechanism, simulated, clock, commanding, home, fixture)
        self.machine = SimulatedMachine(
            mechanism,
            layout,
            config,
            self.physics,
            clock,
            home,
            simulation.soft_limits,
            includes_zeros=settings.controller.joints_include_zeros,
        )
        with ExitStack() as served:
            if settings.guards.stop_file is not None:
                stop_file = Path(settings.guards.stop_file)
            else:  # one in a temporary folder that is removed at the end
                stop_file = Path(served.enter_context(TemporaryDirectory(prefix="hexacell-"))) / "stop"
            sensors = served.enter_context(
                SimulatedSensors(settings, self.physics, clock, other_processes=other_processes)
            )
            self.gauges, self.encoders = sensors.gauges, sensors.encoders
            options = settings.controller.options  # a program that is started finds LinuxCNC behind it
            is_adapter = isinstance(options, AdapterOptions) and options.address is not None
            kind = SimulatedAdapter if is_adapter else SimulatedController
            self.controller = served.enter_context(kind(self.machine, settings.controller))
            warmth = SimulatedThermometers(settings.thermometers, self.physics.celsius)
            served.enter_context(warmth)
            self.faults = CellFaults(self.gauges, self.encoders, self.controller, self.machine, stop_file)
            self.schedule = served.enter_context(FaultSchedule(self.faults, clock, simulation.faults))
            self.physics.on_motion_start = self.schedule.on_motion_start
            self._served = served.pop_all()
        address: dict[str, object] = {"host": "127.0.0.1", "port": self.controller.port}
        if is_adapter:
            address = {"options": AdapterOptions(address=f"127.0.0.1:{self.controller.port}")}
        address["startup"] = simulation.startup
        controller = settings.controller.model_copy(update=address)
        guards = settings.guards.model_copy(update={"stop_file": str(stop_file)})
        self.settings = sensors.addressed(settings).model_copy(
            update={"controller": controller, "guards": guards, "thermometers": warmth.thermometers}
        )
