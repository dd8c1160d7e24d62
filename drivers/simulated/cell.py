"""A complete simulated cell: gauges, encoders and controller, served over their own protocols."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

from drivers.simulated.fault_schedule import CellFaults, FaultSchedule
from drivers.simulated.linuxcnc.server import SimulatedController
from drivers.simulated.physics import RobotPhysics
from drivers.simulated.robot import SimulatedMachine
from drivers.simulated.sensors import SimulatedSensors
from drivers.simulated.served_device import Closeable
from hexacell.cell.model import CellSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.clock import CellClock
from hexacell.config.layout import ConfigLayout
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
        layout: ConfigLayout,
        config: tuple[Path, ...],
        *,
        other_processes: bool,
    ) -> None:
        clock = CellClock(settings.timing.clock_factor)
        home = Pose(*settings.identification.points[0])
        commanding, fixture = layout.read(*config), settings.length_check
        self.physics = RobotPhysics(mechanism, simulation, clock, commanding, home, fixture)
        soft_limits = simulation.soft_limits
        self.machine = SimulatedMachine(
            mechanism,
            layout,
            config,
            self.physics,
            clock,
            home,
            soft_limits,
            includes_zeros=settings.controller.joints_include_zeros,
        )
        with ExitStack() as served:
            stop_file = _stop_file(settings, served)
            sensors = served.enter_context(
                SimulatedSensors(settings, simulation, self.physics, clock, other_processes=other_processes)
            )
            self.gauges, self.encoders = sensors.gauges, sensors.encoders
            self.controller = served.enter_context(SimulatedController(self.machine, settings.controller))
            self.faults = CellFaults(self.gauges, self.encoders, self.controller, self.machine, stop_file)
            self.schedule = served.enter_context(FaultSchedule(self.faults, clock, simulation.faults))
            self.physics.on_motion_start = self.schedule.on_motion_start
            self._served = served.pop_all()
        self.settings = sensors.addressed(settings).model_copy(
            update={
                "controller": settings.controller.model_copy(
                    update={
                        "host": "127.0.0.1",
                        "port": self.controller.port,
                        "startup": simulation.startup,
                    }
                ),
                "guards": settings.guards.model_copy(update={"stop_file": str(stop_file)}),
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
