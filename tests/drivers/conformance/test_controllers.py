"""Our own controllers pass what every driver of a controller must; the twins are for others too."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from drivers import conformance
from drivers.controllers.adapter.controller import AdapterController
from drivers.controllers.adapter.link import Timeouts as AdapterTimeouts
from drivers.controllers.adapter.options import AdapterOptions
from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.interfaces import Controller
from drivers.simulated.adapter import SimulatedAdapter
from drivers.simulated.linuxcnc.server import SimulatedController
from hexacell.cell.robot import ControllerSettings
from hexacell.cell.simulation import FaultKind
from hexacell.kinematics.pose import Pose
from tests.drivers.simulated.linuxcnc.conftest import HASTY, QUICK, FakeMachine

LEAST_S = 0.01


class MachineInTime(FakeMachine):
    """Its moves last as long as they are told to."""

    def move(self, pose: Pose, duration_s: float | None) -> None:
        self.duration_s = duration_s or LEAST_S
        super().move(pose, duration_s)

    def home(self) -> None:
        self.duration_s = LEAST_S
        super().home()


class LinuxcncTwin:
    """The simulated LinuxCNC."""

    target = Pose(100.0, -200.0, 550.0, 12.5, -3.0, 8.0)
    out_of_reach = Pose(0.0, 0.0, 2000.0)

    def __init__(self, server: SimulatedController) -> None:
        self.settings = ControllerSettings(config="machine.ini", port=server.port)
        self._server = server

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        match fault:
            case "unplugged":
                self._server.set_unplugged(on=on)
            case "silent":
                self._server.is_silent = on
            case _:
                self._server.state.set_estop(on=on)


class AdapterTwin(LinuxcncTwin):
    """The simulated controller behind the adapter protocol."""

    def __init__(self, server: SimulatedAdapter) -> None:
        super().__init__(server)
        options = AdapterOptions(address=f"127.0.0.1:{server.port}")
        self.settings = ControllerSettings(config="machine.toml", protocol="adapter", options=options)


class TestAdapter(conformance.ControllerConformance):
    def driver(self, settings: ControllerSettings) -> Controller:
        return AdapterController(settings, timeouts=AdapterTimeouts(connect=0.5, answer=0.5))

    @contextmanager
    def twin(self) -> Iterator[conformance.ControllerTwin]:
        with SimulatedAdapter(MachineInTime(), ControllerSettings(config="machine.toml")) as server:
            yield AdapterTwin(server)


class TestLinuxcncrsh(conformance.ControllerConformance):
    def driver(self, settings: ControllerSettings) -> Controller:
        return LinuxcncrshController(settings, timeouts=QUICK, limits=replace(HASTY, answer=0.5))

    @contextmanager
    def twin(self) -> Iterator[conformance.ControllerTwin]:
        with SimulatedController(MachineInTime(), ControllerSettings(config="machine.ini")) as server:
            yield LinuxcncTwin(server)
