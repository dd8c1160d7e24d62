"""Address, passwords and timeouts of a linuxcncrsh server."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import Self

from hexacell.cell.controller import ControllerSettings
from hexacell.errors import UsageError


@dataclass(frozen=True, slots=True)
class Address:
    """A server and the passwords it was started with; they are sent in clear text.

    ``unit_mm`` is one unit of the positions that it tells, ``joint_unit_mm`` one of the joint variables.
    """

    host: str
    port: int
    connect_password: str = field(repr=False)
    enable_password: str = field(repr=False)
    unit_mm: float = 1.0
    joint_unit_mm: float = 1.0

    @classmethod
    def of(cls, settings: ControllerSettings) -> Self:
        """The address in a cell file.

        Raises:
            UsageError: It names no port.
        """
        if settings.port is None:
            raise UsageError("the cell file names no controller port", action="Set controller.port")
        connect, enable = settings.connect_password, settings.enable_password
        passwords = connect.get_secret_value(), enable.get_secret_value()
        return cls(settings.host, settings.port, *passwords, settings.unit_mm, settings.joint_unit_mm)

    @property
    def name(self) -> str:
        """The subject of error messages."""
        return f"controller {self.host}:{self.port}"


@dataclass(frozen=True, slots=True)
class Timeouts:
    """Longest waits, s of real time. A move may take twice its duration and ``beyond_move``.

    Measured on LinuxCNC 2.9: a query is answered in 1 ms, switching takes at most 0.4 s, an
    abort 0.6 s; a refusal of 2.10 comes together with its explanation. On a computer with five times the
    load that it can carry, a change of state was acknowledged after 5.3 s (``command``), or without effect.
    """

    connect: float = 3.0
    answer: float = 5.0
    command: float = 20.0
    explanation: float = 0.3
    poll: float = 0.05
    arrival: float = 1.0
    stop: float = 5.0
    switch: float = 5.0
    reload: float = 120.0
    reconnect: float = 60.0
    beyond_move: float = 10.0
    restore: float = 1.0


def loop_time() -> float:
    """The time of the running event loop, s."""
    return asyncio.get_running_loop().time()
