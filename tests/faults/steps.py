"""Kinds of steps, at each of which runs are broken."""

from collections.abc import Iterable
from typing import Any

from drivers.simulated import cell as simulated_cell
from procedures.journal import journal
from procedures.run.keys import Phase
from procedures.steps import events
from procedures.steps.base import StepOfSet, StepWithoutMotion
from procedures.steps.events import Step
from procedures.steps.locate import Locate
from procedures.steps.move import Move
from procedures.steps.pilot import Pilot
from procedures.steps.place import Place
from procedures.steps.probe import Probe
from procedures.steps.repeat import Repeat
from procedures.steps.revisit import Revisit
from procedures.steps.sample import Sample
from procedures.steps.standstill import Standstill
from procedures.steps.try_gauges import Try

STEPS = (
    "beginning", "locating", "revisiting", "to reference", "placing", "zeroing", "trying gauges",
    "to orientation", "sampling", "closing", "measuring noise", "lending", "taking back",
    "identifying", "held-out", "proposing", "committing", "after", "length", "judging", "rolling back",
    "ending",
)  # fmt: skip
"""Kinds of steps, in the order of a run; held-out points are measured before and after the commit."""
COMPUTING = {
    "assess noise": "measuring noise",
    "lend": "lending",
    "take back": "taking back",
    "identify": "identifying",
    "propose": "proposing",
    "commit": "committing",
    "judge": "judging",
    "accept": "judging",
    "roll back": "rolling back",
}


OF_PHASES = {Phase.BEFORE: "held-out", Phase.AFTER: "after", Phase.LENGTH: "length"}


def step_of(history: Iterable[events.Event]) -> str:
    """What a run that got so far was doing."""
    doing = "beginning"
    for event in history:
        match event:
            case events.StepBegun(step=step):
                doing = _name(step)
            case events.Ended():
                doing = "ending"
            case events.RunStarted():
                doing = "beginning"
    return doing


def _name(step: Step) -> str:
    match step:
        case Locate():
            return "locating"
        case StepWithoutMotion():
            return COMPUTING[step.kind]
        case StepOfSet(at=at) if at.phase is not Phase.IDENTIFY:
            return OF_PHASES[at.phase]
        case _:
            return _of_a_set(step)


def _of_a_set(step: Step) -> str:  # noqa: PLR0911 - a case a step
    match step:
        case Standstill() | Pilot() | Repeat():
            return "measuring noise"
        case Probe() | Try():
            return "trying gauges"
        case Move():
            return "to reference" if step.orientation == 1 else "to orientation"
        case Sample():
            return "zeroing" if step.orientation == 1 else "sampling"
        case Place():
            return "placing"
        case Revisit():
            return "revisiting"
        case _:
            return "closing"


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
