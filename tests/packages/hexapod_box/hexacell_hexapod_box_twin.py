"""The box as its test has it: a server of this process."""

import socketserver
import threading
import time

from hexacell_hexapod_box import BoxOptions

from hexacell.cell.robot import ControllerSettings
from hexacell.cell.simulation import FaultKind
from hexacell.kinematics.pose import Pose

HIGHEST_MM, HOMING_S = 1000.0, 0.02


class HexapodBoxTwin(socketserver.ThreadingTCPServer):
    """A robot that goes straight, in the time that it is told."""

    daemon_threads = True
    target, out_of_reach = Pose(10.0, -20.0, 550.0, 5.0, -3.0, 8.0), Pose(0.0, 0.0, 2000.0)

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Connection)
        self.faults: set[FaultKind] = set()
        self.state = {"ESTOP"}
        self.start: tuple[float, ...] = (0.0, 0.0, 500.0, 0.0, 0.0, 0.0)
        self.end: tuple[float, ...] = self.start
        self.began_s = self.duration_s = 0.0
        self.lock = threading.Lock()
        host, port = self.server_address[:2]
        options = BoxOptions(robot="left", answer_s=0.5, poll_s=0.01)
        self.settings = ControllerSettings(
            config="box.toml", protocol="hexapod-box", host=str(host), port=port, options=options
        )
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.01}).start()

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        """Hang up on everybody, answer nothing, or press the emergency stop."""
        if fault == "emergency stop":
            self.rest()
            self.state = {"ESTOP", *(self.state & {"HOMED"})}
        else:
            (self.faults.add if on else self.faults.discard)(fault)

    @property
    def share(self) -> float:
        """How much of its way it has gone."""
        return min(1.0, (time.monotonic() - self.began_s) / self.duration_s) if self.duration_s else 1.0

    def pose(self) -> tuple[float, ...]:
        """Where it is."""
        share = self.share
        return tuple(a + share * (b - a) for a, b in zip(self.start, self.end, strict=True))

    def rest(self) -> None:
        """Stop where it is."""
        self.start = self.end = self.pose()
        self.duration_s = 0.0

    def answer(self, line: str) -> str:
        """The answer to a line."""
        command, *words = line.split()
        match command:
            case "ROBOT":
                return f"BOX 7 {words[0]}"
            case "STATE":
                return " ".join(sorted(self.state | ({"MOVING"} if self.share < 1.0 else set()))) or "OFF"
            case "POSE":
                return " ".join(f"{number:.6f}" for number in self.pose())
            case "MOVE":
                return self.move(*map(float, words))
            case "STOP":
                self.rest()
            case _:
                self.switch(command)
        return "OK"

    def switch(self, command: str) -> None:
        """Carry out another command."""
        if command == "HOME":
            self.began_s, self.duration_s = time.monotonic(), HOMING_S
        self.state |= {"ON": {"ON"}, "HOME": {"HOMED"}}.get(command, set())
        self.state -= {"RESET": {"ESTOP"}, "OFF": {"ON"}}.get(command, set())

    def move(self, *numbers: float) -> str:
        """Begin a motion, if it can be."""
        if "ON" not in self.state or numbers[2] > HIGHEST_MM:
            return "NO it is off, or that is out of reach"
        self.rest()
        self.end, self.duration_s, self.began_s = numbers[:6], numbers[6], time.monotonic()
        return "OK"


class _Connection(socketserver.StreamRequestHandler):
    server: HexapodBoxTwin

    def handle(self) -> None:
        for line in self.rfile:
            if "unplugged" in self.server.faults:
                return
            if "silent" not in self.server.faults:
                with self.server.lock:
                    self.wfile.write(f"{self.server.answer(line.decode('ascii'))}\n".encode())
