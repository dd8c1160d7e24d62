"""The simulated LinuxCNC behind a program that serves it by the adapter protocol, over TCP."""

import socket
import socketserver
import threading
from collections.abc import Callable

from drivers.controllers.adapter.local_program import serve_over
from drivers.controllers.linuxcnc.machine import Machine as ServedMachine
from drivers.controllers.linuxcnc.shell_access import ShellAccess
from drivers.controllers.linuxcnc.shell_protocol import Limits
from drivers.simulated.linuxcnc.server import HOST, SimulatedController
from drivers.simulated.linuxcnc.state import Machine
from drivers.wire_trace import LineRecord
from hexacell.cell.robot import ControllerSettings

LEFT_WITHIN_S = 1.0
"""How long a client that has just gone may still be noticed, s."""


class _Handler(socketserver.BaseRequestHandler):
    server: "_Program"
    request: socket.socket

    def handle(self) -> None:
        if self.server.in_use.acquire(timeout=LEFT_WITHIN_S):  # else it serves somebody already
            access = ShellAccess(self.server.settings, Limits(), LineRecord("simulated adapter", None))
            try:
                serve_over(self.request, ServedMachine(access), hears=self.server.hears)
            finally:
                access.close()
                self.server.in_use.release()


class _Program(socketserver.ThreadingTCPServer):
    def __init__(self, settings: ControllerSettings, hears: Callable[[], bool]) -> None:
        self.settings, self.hears, self.in_use = settings, hears, threading.Lock()
        super().__init__((HOST, 0), _Handler)


class SimulatedAdapter(SimulatedController):
    """Serves one client at a time until it is closed; ``port`` is that of the program."""

    def __init__(self, machine: Machine, settings: ControllerSettings) -> None:
        super().__init__(machine, settings)
        shell = settings.model_copy(update={"host": HOST, "port": self.port})
        self._program = _Program(shell, lambda: not self.is_silent)
        self.port = self._program.server_address[1]
        self._serving = threading.Thread(target=self._program.serve_forever, name="simulated adapter")
        self._serving.start()

    def hears(self) -> bool:
        """The shell does; what is silent is the program."""
        return True

    def close(self) -> None:
        """Stop serving: its connection to the controller is lost, at which the program ends those to it."""
        self._program.shutdown()
        super().close()
        self._program.server_close()
        self._serving.join()
