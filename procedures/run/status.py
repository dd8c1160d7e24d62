"""The status of the engine: one word, derived from a few flags."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Status(StrEnum):
    """What an engine is doing, for screens."""

    IDLE = "idle"
    RUNNING = "running"
    PAUSING = "pausing"
    PAUSED = "paused"
    AWAITING_OPERATOR = "awaiting operator"
    STOPPING = "stopping"
    ENDED = "ended"
    FAULTED = "faulted"


@dataclass(frozen=True, slots=True)
class EngineFlags:
    """What is the case; several facts may hold at once.

    Attributes:
        fault: what failed, until it is decided how to continue.
        asking: a question waits for a person.
        pausing: a pause is wanted, ``at_once`` in mid-step; ``paused``: it has begun.
        stopping: why the run is to end; nothing where it is not.
    """

    begun: bool = False
    ended: bool = False
    fault: str | None = None
    asking: bool = False
    pausing: bool = False
    at_once: bool = False
    paused: bool = False
    stopping: str | None = None

    @property
    def status(self) -> Status:
        """The gravest fact decides; a fault stays until it is cleared, also after the end."""
        words = (
            (self.fault is not None, Status.FAULTED),
            (self.ended, Status.ENDED),
            (self.stopping is not None, Status.STOPPING),
            (self.paused, Status.PAUSED),
            (self.asking, Status.AWAITING_OPERATOR),
            (self.pausing, Status.PAUSING),
            (self.begun, Status.RUNNING),
        )
        return next((status for holds, status in words if holds), Status.IDLE)
