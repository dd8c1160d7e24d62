"""The events of a run, as the journal keeps them; everything else is derived from them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Union

from pydantic import Field

from procedures.steps import course, registry
from procedures.steps.accept import ResultAccepted
from procedures.steps.assess_noise import NoiseMeasured
from procedures.steps.base import BaseEvent
from procedures.steps.close import SetClosed
from procedures.steps.commit import Committed
from procedures.steps.course import (
    CommandRejected,
    Ended,
    Failed,
    Interrupted,
    Paused,
    RecordDiscarded,
    Resumed,
    RunRecalled,
    RunStarted,
    StepBegun,
    Tripped,
)
from procedures.steps.identify import Identified
from procedures.steps.judge import ConfirmationPlanned, ResultValidated
from procedures.steps.lend import ProvisionalApplied
from procedures.steps.locate import Located
from procedures.steps.move import Arrived, PoseExcluded
from procedures.steps.pilot import PilotTaken
from procedures.steps.place import GaugesPlaced
from procedures.steps.probe import GaugesProbed
from procedures.steps.propose import Proposed
from procedures.steps.repeat import ReferenceRepeated
from procedures.steps.revisit import ReferenceConfirmed, SetInvalidated
from procedures.steps.roll_back import RolledBack
from procedures.steps.sample import RecordRejected, RecordTaken
from procedures.steps.standstill import StandstillRead
from procedures.steps.take_back import ProvisionalReverted
from procedures.steps.try_gauges import GaugesTried

__all__ = [  # the namespace in which other packages name them
    "EVENTS",
    "Arrived",
    "CommandRejected",
    "Committed",
    "ConfirmationPlanned",
    "Ended",
    "Event",
    "Failed",
    "GaugesPlaced",
    "GaugesProbed",
    "GaugesTried",
    "Identified",
    "Interrupted",
    "Located",
    "NoiseMeasured",
    "Paused",
    "PilotTaken",
    "PoseExcluded",
    "Proposed",
    "ProvisionalApplied",
    "ProvisionalReverted",
    "RecordDiscarded",
    "RecordRejected",
    "RecordTaken",
    "ReferenceConfirmed",
    "ReferenceRepeated",
    "ResultAccepted",
    "ResultValidated",
    "Resumed",
    "RolledBack",
    "RunRecalled",
    "RunStarted",
    "SetClosed",
    "SetInvalidated",
    "StandstillRead",
    "StepBegun",
    "Tripped",
]

EVENTS: tuple[type[BaseEvent], ...] = tuple(
    dict.fromkeys([*course.COURSE, *(event for step in registry.STEPS for event in step.outcomes)])
)

if TYPE_CHECKING:
    Event = BaseEvent
else:  # what a file may have: exactly one of these, distinguished by its kind
    Event = Annotated[Union[EVENTS], Field(discriminator="kind")]  # noqa: UP007
