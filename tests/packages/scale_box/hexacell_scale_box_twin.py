"""The box as its test has it: a server of this process."""

import socketserver
import threading
from collections.abc import Sequence

from hexacell.cell.devices import LinearEncoderSettings
from hexacell.cell.simulation import FaultKind

TIMEOUT_S = 1.0


class ScaleBoxTwin(socketserver.ThreadingTCPServer):
    """Six scales of 1 um that stand where they are told to."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Connection)
        self.joints: Sequence[float] = (0.0,) * 6
        self.faults: set[FaultKind] = set()
        host, port = self.server_address[:2]
        self.settings = LinearEncoderSettings(
            protocol="scale-box", bus={"host": host, "port": port}, timeout_s=TIMEOUT_S
        )
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.01}).start()

    def stand_at(self, joints: Sequence[float]) -> None:
        """Move all joints at once, mm."""
        self.joints = tuple(joints)

    def inject(self, fault: FaultKind, *, on: bool) -> None:
        """Hang up on everybody, or answer nothing."""
        (self.faults.add if on else self.faults.discard)(fault)

    def answer(self, command: str) -> str:
        """The answer to a command."""
        if command == "NAME":
            return "SCALEBOX 7"
        return " ".join(str(round(1000 * joint)) for joint in self.joints)


class _Connection(socketserver.StreamRequestHandler):
    server: ScaleBoxTwin

    def handle(self) -> None:
        for line in self.rfile:
            if "unplugged" in self.server.faults:
                return
            number, _, command = line.decode("ascii").strip().partition(" ")
            if "silent" not in self.server.faults:
                self.wfile.write(f"{number} {self.server.answer(command)}\n".encode())
