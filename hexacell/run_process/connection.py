"""A connection to a run, in another process or recorded."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Protocol

from hexacell.run_process.messages import HostMessage
from procedures.engine.commands import Command


class RunConnection(Protocol):
    """What a screen needs of a run.

    ``give``, ``take_control`` and ``leave`` return when the message is sent; what it causes comes as a
    message. All raise ``HexacellError`` where the run cannot be reached any more.
    """

    def messages(self) -> AsyncIterator[HostMessage]:
        """Everything that the run tells; ends when it is over and told whole. To be called once."""
        ...

    async def give(self, command: Command) -> None:
        """Give the engine a command. Refused with ``HostFailed`` where another client is in control."""
        ...

    async def take_control(self) -> None:
        """Become the one who gives commands; ``ControlChanged`` tells it."""
        ...

    async def leave(self, *, keep_running: bool) -> None:
        """Let the run go on without anybody, or have it stopped after its step; ends the messages."""
        ...
