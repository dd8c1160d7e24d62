"""The fault matrix: what was broken at which step, what came of it, and how often it was tried."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import astuple, dataclass

from procedures.run.keys import Phase
from procedures.steps import events
from procedures.steps.base import StepOfSet, StepWithoutMotion
from procedures.steps.locate import Locate
from procedures.steps.move import Move
from procedures.steps.pilot import Pilot
from procedures.steps.place import Place
from procedures.steps.probe import Probe
from procedures.steps.registry import Step
from procedures.steps.repeat import Repeat
from procedures.steps.revisit import Revisit
from procedures.steps.sample import Sample
from procedures.steps.standstill import Standstill
from procedures.steps.try_gauges import Try

PROPERTY = "fault-matrix"
STEPS = (
    "beginning",
    "locating",
    "revisiting",
    "to reference",
    "placing",
    "zeroing",
    "trying gauges",
    "to orientation",
    "sampling",
    "closing",
    "measuring noise",
    "lending",
    "taking back",
    "identifying",
    "held-out",
    "proposing",
    "committing",
    "after",
    "length",
    "judging",
    "rolling back",
    "ending",
)
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


@dataclass(frozen=True)
class Case:
    """One fault at one step, and what became of the run."""

    fault: str
    step: str
    outcome: str

    def to_json(self) -> str:
        return json.dumps(astuple(self))


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


def table(cases: Iterable[Case]) -> str:
    """A line for each fault and outcome: how many cases at which step."""
    counts = Counter(cases)
    used = [step for step in STEPS if any(case.step == step for case in counts)]
    used += sorted({case.step for case in counts} - set(STEPS))
    rows = sorted({(case.fault, case.outcome) for case in counts})
    width = max((len(fault) for fault, _ in rows), default=0)
    heads = [_short(step) for step in used]
    lines = [f"{'fault':{width}} {' '.join(f'{head:>6}' for head in heads)}    all  outcome"]
    for fault, outcome in rows:
        numbers = [counts[Case(fault, step, outcome)] for step in used]
        cells = " ".join(f"{number or '.':>6}" for number in numbers)
        lines.append(f"{fault:{width}} {cells} {sum(numbers):6}  {outcome}")
    lines.append(f"{counts.total()} cases")
    return "\n".join(lines)


def _short(step: str) -> str:
    shorter = {
        "beginning": "begin",
        "locating": "locate",
        "revisiting": "revist",
        "to reference": "to ref",
        "placing": "place",
        "zeroing": "zero",
        "trying gauges": "try",
        "to orientation": "move",
        "sampling": "sample",
        "closing": "close",
        "measuring noise": "noise",
        "lending": "lend",
        "taking back": "take b",
        "identifying": "identf",
        "held-out": "before",
        "proposing": "propos",
        "committing": "commit",
        "judging": "judge",
        "rolling back": "roll b",
        "ending": "end",
    }
    return shorter.get(step, step[:6])
