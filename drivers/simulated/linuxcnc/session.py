"""What a simulated controller keeps about one of its clients."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.simulated.linuxcnc.state import Control


@dataclass(frozen=True, slots=True)
class Access:
    """The passwords, and what a client is told about the server."""

    connect_password: str
    enable_password: str
    server: str
    config: str


@dataclass(slots=True, eq=False)
class Context:
    """One connection's own settings, beside the control that all share."""

    control: Control
    access: Access
    greeted: bool = False
    echo: bool = True
    verbose: bool = False

    @property
    def commands(self) -> bool:
        """Whether this is the one client that may give orders."""
        return self.control.commander is self
