"""A cell with a real controller: the robot that it moves, and its gauges and encoders, are simulated."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from shutil import which

from drivers.simulated.following_physics import FollowingPhysics
from drivers.simulated.joint_source import JointSource
from drivers.simulated.kept_gauges import KeptGauges
from drivers.simulated.sensors import SimulatedSensors
from drivers.simulated.served_device import Closeable
from hexacell.cell.model import CellSettings
from hexacell.cell.simulation import SimulationSettings
from hexacell.clock import CellClock
from hexacell.config.layout import ConfigLayout
from hexacell.errors import UsageError
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.pose import Pose


class FollowedController(Closeable):
    """Serves gauges and encoders at the joints of ``[simulation] joints_command`` until it is closed.

    Raises:
        FileError: the controller's config cannot be read.
        ReachError: the first point of the cell is out of reach by its config or its true geometry.
        UsageError: faults are stated, or a clock that is not the real one; or there is no such command.
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
        _require_real(settings, simulation)
        clock = CellClock(1.0)
        home = Pose(*settings.identification.points[0])
        commanding, fixture = layout.read(*config), settings.length_check
        with ExitStack() as served:
            source = served.enter_context(JointSource(simulation.joints_command))
            kept = KeptGauges(config)
            self.physics = FollowingPhysics(
                source, kept, mechanism, simulation, clock, commanding, home, fixture
            )
            self.sensors = served.enter_context(
                SimulatedSensors(settings, simulation, self.physics, clock, other_processes=other_processes)
            )
            self._served = served.pop_all()
        self.settings = self.sensors.addressed(settings)

    def close(self) -> None:
        """Stop serving; twice is harmless."""
        self._served.close()


def _require_real(settings: CellSettings, simulation: SimulationSettings) -> None:
    if simulation.faults:
        problem, action = (
            "only a simulated controller has faults",
            "Remove [[simulation.faults]]",
        )
    elif settings.timing.clock_factor != 1.0:
        problem, action = "a real controller has no fast clock", "Remove timing.clock_factor"
    elif which(simulation.joints_command[0]) is None:
        problem = f"there is no program '{simulation.joints_command[0]}'"
        action = "Install it, or remove [simulation]"
    else:
        return
    raise UsageError(f"[simulation] names a joints_command, but {problem}", action=action)
