"""The state of one client of the simulated controller."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.simulated.linuxcnc.state import ControllerState


@dataclass(frozen=True, slots=True)
class ServerSettings:
    """The passwords, and the server's identification."""

    connect_password: str
    enable_password: str
    server: str
    config: str


@dataclass(slots=True, eq=False)
class ClientSession:
    """The settings of one connection, and the state that all of them share."""

    state: ControllerState
    settings: ServerSettings
    greeted: bool = False
    echo: bool = True
    verbose: bool = False

    @property
    def has_control(self) -> bool:
        """Whether this client has control."""
        return self.state.commander is self
