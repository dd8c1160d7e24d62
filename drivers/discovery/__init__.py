"""Finds devices whose addresses nobody knows: only questions are sent, and every wait is bounded."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SearchTimeouts:
    """How long a search waits, s: on a busy computer adapters and first answers take their time.

    Attributes:
        gauge: for an answer of a gauge.
        visa: for the name of an instrument with VISA.
        adapter: for a CAN adapter, and for the first node on a bus.
        node: for each further node on a bus.
        listen: to what devices send unasked.
        controller: for the greeting of a controller.
    """

    gauge: float = 0.5
    visa: float = 2.0
    adapter: float = 2.0
    node: float = 0.5
    listen: float = 1.0
    controller: float = 2.0


USUAL = SearchTimeouts()
