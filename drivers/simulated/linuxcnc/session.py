"""What a simulated controller keeps about one of its clients."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.simulated.linuxcnc.state import ControllerState


@dataclass(frozen=True, slots=True)
class ServerSettings:
    """The passwords, and what a client is told about the server."""

    connect_password: str
    enable_password: str
    server: str
    config: str


@dataclass(slots=True, eq=False)
class ClientSession:
    """One connection's own settings, beside the control that all share."""

    control: ControllerState
    access: ServerSettings
    greeted: bool = False
    echo: bool = True
    verbose: bool = False

    @property
    def has_control(self) -> bool:
        """Whether this is the one client that may give orders."""
        return self.control.commander is self
