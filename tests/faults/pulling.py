"""Plugs of a simulated cell that are pulled out, and put back, while the program runs."""

from __future__ import annotations

from typing import Any

from drivers.simulated import cell as simulated_cell
from procedures.journal import journal
from procedures.steps import events
from tests.faults.steps import step_of

DEVICES = ("gauge x", "gauge y", "gauge z", "encoder 3", "all encoders", "controller")
"""A gauge of every protocol, one encoder, the cable that all of them are on, and the controller."""


def pull_out(device: str, step: str, back: str = "") -> None:
    """Pull a plug when a kind of step begins, put it back when an event of the kind ``back`` is told."""
    served: list[Any] = []
    told: list[events.Event] = []
    is_out = was_out = False

    class Cell(simulated_cell.SimulatedCell):
        def __init__(self, *settings: Any, **more: Any) -> None:
            super().__init__(*settings, **more)
            served.append(self)

    append = journal.Journal.append

    def pulling(self: journal.Journal, event: events.Event) -> None:
        nonlocal is_out, was_out
        append(self, event)
        told.append(event)
        if not was_out and isinstance(event, events.StepBegun) and step_of(told) == step:
            _set(served[0], device, out=True)
            is_out = was_out = True
        elif is_out and event.kind == back:
            _set(served[0], device, out=False)
            is_out = False

    simulated_cell.SimulatedCell = Cell  # type: ignore[misc]
    journal.Journal.append = pulling  # type: ignore[method-assign]


def _set(cell: Any, device: str, *, out: bool) -> None:
    names = [device.removeprefix("gauge ")]
    if device == "all encoders":
        names = [f"encoder {leg}" for leg in range(1, 7)]
    for name in names:
        (cell.faults.inject if out else cell.faults.clear)("unplugged", name)
