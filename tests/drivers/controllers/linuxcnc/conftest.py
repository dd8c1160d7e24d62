"""A simulated LinuxCNC whose answers a test alters line by line, and the driver before it."""

from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import suppress
from enum import Enum, auto
from typing import Any

import pytest

from drivers.controllers.adapter.link import Timeouts
from drivers.controllers.linuxcnc import machine as orders
from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.controllers.linuxcnc.shell_protocol import Limits
from drivers.interfaces import StartupAction
from drivers.simulated.linuxcnc import server
from drivers.simulated.linuxcnc.state import ConnectionCut
from hexacell.cell.robot import ControllerSettings
from hexacell.kinematics.pose import Pose
from tests.drivers.conformance.test_controllers import MachineInTime

ALL = frozenset(StartupAction)
TARGET, AWAY, UNREACHABLE = (
    Pose(10.0, 20.0, 560.0, 5.0, -4.0, 3.0),
    Pose(5.0, 0.0, 550.0),
    Pose(0.0, 0.0, 2000.0),
)
MOVE_S, LONG_S = 0.02, 30.0
HELLO = "hello EMC hexacell 1.0"
LIMITS = Limits(answer=0.5, command=0.5, explanation=0.05, arrival=0.05, stop=0.3, rest=0.3)
TIMEOUTS = Timeouts(arrival=0.02, reconnect=0.3, beyond_move=0.3, stop=0.6, poll=0.005, closing=1.0)


class Then(Enum):
    """What a server can do beside sending bytes."""

    SAY_NOTHING = auto()
    HANG_UP = auto()


Said = bytes | Then | Callable[[], bytes | Then | None]


class _Client(server._Client):
    _server: "AlteredController"

    def _execute(self, line: str) -> None:
        if not line:
            return
        self._server.lines.append(line)
        said = self._server.says.get(line) or self._server.says.get(" ".join(line.split()[:2]))
        if callable(said):
            said = said()
        if said is None:
            super()._execute(line)
        elif said is Then.HANG_UP:
            raise ConnectionCut
        elif isinstance(said, bytes):
            self._greeted = True
            self._write(said)


class _Handler(server._Handler):
    server: "AlteredController"

    def handle(self) -> None:
        self.server.connections += 1
        client = _Client(self.server, self.request.sendall)
        with suppress(OSError, ConnectionCut):
            while data := self.request.recv(4096):
                client.receive(data)


class AlteredController(server.SimulatedController):
    """The simulated LinuxCNC, as far as ``says`` has no other answer to a line, or to its two first words.

    Attributes:
        lines: that it received, over all connections.
        connections: how many there were.
    """

    handler = _Handler

    def __init__(self, machine: MachineInTime, settings: ControllerSettings) -> None:
        self.says: dict[str, Said] = {}
        self.lines: list[str] = []
        self.connections = 0
        super().__init__(machine, settings)

    def count(self, line: str) -> int:
        """How often a line came that begins so."""
        return sum(one.startswith(line) for one in self.lines)


def once(answer: bytes | Then) -> Callable[[], bytes | Then | None]:
    """This answer to the first of several such lines."""
    left = [answer]
    return lambda: left.pop() if left else None


@pytest.fixture
def machine() -> MachineInTime:
    return MachineInTime()


@pytest.fixture
def controller(machine: MachineInTime, monkeypatch: pytest.MonkeyPatch) -> Iterator[AlteredController]:
    for limit in ("SWITCH_S", "MESSAGE_S"):
        monkeypatch.setattr(orders, limit, 0.1)
    with AlteredController(machine, ControllerSettings(config="folder/machine.ini")) as made:
        yield made


Make = Callable[..., LinuxcncrshController]


@pytest.fixture
async def make(controller: AlteredController) -> AsyncIterator[Make]:
    """Makes drivers before ``controller``; keywords are settings of it."""
    made: list[LinuxcncrshController] = []

    def driver(trace: Any = None, limits: Limits = LIMITS, **settings: object) -> LinuxcncrshController:
        values = ControllerSettings.model_validate({"config": "x", "port": controller.port, **settings})
        made.append(LinuxcncrshController(values, trace=trace, timeouts=TIMEOUTS, limits=limits))
        return made[-1]

    yield driver
    for one in made:
        await one.close()


@pytest.fixture
async def driver(make: Make) -> LinuxcncrshController:
    """A driver that is open."""
    made = make()
    await made.open()
    return made


@pytest.fixture
async def ready(driver: LinuxcncrshController) -> LinuxcncrshController:
    """A driver whose machine is ready to move."""
    await driver.prepare(ALL)
    return driver
