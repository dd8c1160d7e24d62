"""What can be wrong with records: which of them, which gauge, in a plain sentence with the next action."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from hexacell.errors import IdentifiabilityError

GAUGES = "xyz"


class Kind(StrEnum):
    """What is wrong."""

    GROSS_ERROR = "gross error"
    EXCHANGED = "exchanged gauges"
    REVERSED = "reversed gauge"
    INCHES = "inches"
    SLIPPED_ZERO = "slipped zero"
    FOREIGN_JOINTS = "joint variables of another pose"
    SINGULAR = "next to a singularity"


@dataclass(frozen=True, slots=True)
class Anomaly:
    """Records that do not agree with the others, and why.

    Attributes:
        kind: what is wrong with them.
        point: at which point; none where it is every point.
        orientation: which record of the point; the first one after a slip; none where it is all.
        gauges: the gauges concerned, of ``xyz``; empty where no single one stands out.
        sentence: all that for people.
        action: the next thing to do.
    """

    kind: Kind
    point: int | None
    orientation: int | None
    gauges: str
    sentence: str
    action: str

    def __str__(self) -> str:
        return f"{self.sentence}. {self.action}."


class FalseReadings(IdentifiabilityError):
    """Readings that are wrong in a known way; a geometry fitted to them would be wrong too."""

    def __init__(self, anomaly: Anomaly) -> None:
        self.anomaly = anomaly
        super().__init__(anomaly.sentence, action=anomaly.action)
