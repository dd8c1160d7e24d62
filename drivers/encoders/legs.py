"""How an encoder is named: the leg it belongs to and the node id it answers under."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Leg:
    """One leg's encoder; ``number`` counts from 1, ``node`` is the CANopen node id (1 to 127)."""

    number: int
    node: int

    def __str__(self) -> str:
        return f"leg {self.number} (node {self.node})"


def subject_of(legs: Sequence[Leg]) -> str:
    """The words that begin an error message about one leg or several."""
    noun = "encoder of" if len(legs) == 1 else "encoders of"
    return f"{noun} {', '.join(str(leg) for leg in legs)}"
