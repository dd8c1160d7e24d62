"""A machine that moves on a straight line in time, behind a simulated controller."""

import socket
import threading
from collections.abc import Callable, Iterator
from dataclasses import astuple

import pytest

from drivers.controllers.adapter.link import Timeouts
from drivers.controllers.linuxcnc.controller import LinuxcncrshController
from drivers.controllers.linuxcnc.shell_protocol import Limits
from drivers.simulated.linuxcnc.server import HOST, SimulatedController
from drivers.simulated.linuxcnc.state import MotionRefused
from hexacell.cell.robot import ControllerSettings
from hexacell.clock import CellClock
from hexacell.errors import FileError
from hexacell.kinematics.pose import Pose
from tests.waiting import wait_until

QUICK, HASTY = Timeouts(poll=0.005, arrival=0.05), Limits(arrival=0.05)


class FakeMachine:
    """Joints are the pose's coordinates plus ``geometry``, which is read when it is switched on."""

    def __init__(self) -> None:
        self.duration_s = 0.01
        self.config: float | None = 0.0
        self.events: list[str] = []
        self._geometry = 0.0
        self._joints: tuple[float, ...] = (0.0,) * 6
        self._stop = threading.Event()
        self._lock = threading.Lock()

    def move(self, pose: Pose, duration_s: float | None) -> None:
        if pose.z > 1000.0:
            raise MotionRefused("fails kinematicsInverse")
        self._stop.clear()
        self.events.append("move")
        start, clock = self._joints, CellClock()
        target = [value + self._geometry for value in astuple(pose)]
        share = 0.0
        while share < 1.0 and not self._stop.wait(0.001):
            share = min(1.0, clock.now() / self.duration_s)
            with self._lock:
                self._joints = tuple(a + share * (b - a) for a, b in zip(start, target, strict=True))

    def stop(self) -> None:
        self._stop.set()

    def wait_for(self, event: str) -> None:
        wait_until(lambda: event in self.events)

    def pose(self) -> Pose:
        return Pose(*(joint - self._geometry for joint in self.joints()))

    def joints(self) -> tuple[float, ...]:
        with self._lock:
            return self._joints

    def switch_on(self) -> None:
        if self.config is None:
            raise FileError("has no geometry", subject="machine.ini")
        self.events.append("on")
        self._geometry = self.config

    def home(self) -> None:
        self._stop.clear()
        self.events.append("home")
        self._stop.wait(self.duration_s)


class RawClient:
    """A TCP client that sends single lines and compares the received bytes."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection((HOST, port))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def expect(self, line: str, answer: bytes) -> None:
        """Expect ``answer`` and not a byte more or less."""
        self.send(line)
        assert self.receive(len(answer)) == answer

    def does(self, orders: str) -> None:
        """Each of the orders, separated by ``|``, is acknowledged."""
        for line in orders.split(" | "):
            self.expect(line, f"SET {line.split()[1].upper()} ACK\n\r".encode())

    def send(self, line: str) -> None:
        self._socket.sendall(line.encode() + b"\r\n")

    def receive(self, count: int) -> bytes:
        received = b""
        while len(received) < count and (data := self._socket.recv(count - len(received))):
            received += data
        return received

    def query(self, line: str) -> bytes:
        """The line that answers."""
        self.send(line)
        answer = b""
        while not answer.endswith(b"\n"):
            answer += self.receive(1)
        return answer

    def expect_silence(self) -> None:
        self._socket.settimeout(0.03)
        with pytest.raises(TimeoutError):
            self._socket.recv(1)
        self._socket.settimeout(None)

    def expect_end(self) -> None:
        assert self._socket.recv(1) == b""

    def greet(self) -> None:
        self.expect("hello EMC test 1.0", b"HELLO ACK EMCNETSVR 1.1\r\n")
        self.expect("set echo off", b"set echo off\r\n")
        self.does("set verbose on | set enable EMCTOO")

    def make_ready(self) -> None:
        self.greet()
        self.does("set set_wait done | set estop off | set machine on | set home -1")
        wait_until(lambda: b"NO" not in self.query("get joint_homed"))
        self.does("set mode mdi")

    def moves_slowly(self, machine: FakeMachine) -> None:
        machine.duration_s = 30.0
        self.send("set mdi G0 X100")
        machine.wait_for("move")

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def machine() -> FakeMachine:
    """The machine behind ``simulated``."""
    return FakeMachine()


@pytest.fixture
def simulated(machine: FakeMachine) -> Iterator[SimulatedController]:
    """A simulated controller on a free port."""
    with SimulatedController(machine, ControllerSettings(config="folder/machine.ini")) as server:
        yield server


@pytest.fixture
def client(simulated: SimulatedController) -> Iterator[Callable[[], RawClient]]:
    """Makes raw clients."""
    clients = []

    def connect() -> RawClient:
        clients.append(RawClient(simulated.port))
        return clients[-1]

    yield connect
    for made in clients:
        made.close()


@pytest.fixture
def greeted(client: Callable[[], RawClient]) -> RawClient:
    made = client()
    made.greet()
    return made


@pytest.fixture
def ready(client: Callable[[], RawClient]) -> RawClient:
    made = client()
    made.make_ready()
    return made


@pytest.fixture
def driver(simulated: SimulatedController) -> Callable[..., LinuxcncrshController]:
    """Makes drivers for ``simulated``; keywords are controller settings."""

    def make(limits: Limits = HASTY, **settings: object) -> LinuxcncrshController:
        values = {"config": "machine.ini", "port": simulated.port, **settings}
        return LinuxcncrshController(
            ControllerSettings.model_validate(values), timeouts=QUICK, limits=limits
        )

    return make
