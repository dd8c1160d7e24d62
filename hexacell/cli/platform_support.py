"""What a command needs of the operating system, and a plain refusal where that is missing.

``docs/platforms.md`` says what is tested where.
"""

from __future__ import annotations

import socket
from importlib.util import find_spec

from hexacell.errors import UsageError

ANYWHERE = {"completion.main"}
"""Commands that work on any system, by module and function."""

OVER_A_SOCKET = {"tui.main", "host.main"}
"""Commands that run, or reach, a run in another process."""


def require_platform(target: str) -> None:
    """Refuse a command that this operating system cannot carry out; imports nothing of it.

    Args:
        target: the command, by module and function in ``hexacell.cli.commands``.

    Raises:
        UsageError: it has no POSIX locks and terminals (Windows), or does not tell who is at the other end
            of a local socket as Linux does (macOS).
    """
    if target not in ANYWHERE and find_spec("fcntl") is None:
        raise UsageError(
            "this system has no POSIX file locks, terminals and signals, by which hexacell protects a cell",
            action="Use Linux; on Windows install it there with `wsl --install`",
        )
    if target in OVER_A_SOCKET and not hasattr(socket, "SO_PEERCRED"):
        raise UsageError(
            "this system does not tell as Linux does who is at the other end of a local socket, without "
            "which nobody may reach a run in another process",
            action="Use `hexacell run` at this terminal, or Linux",
        )
