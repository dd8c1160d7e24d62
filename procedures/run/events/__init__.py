"""The events of a run, as the journal keeps them; everything else is derived from them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from procedures.run.events.course import (
    CommandRejected,
    Ended,
    Failed,
    Interrupted,
    Paused,
    Resumed,
    RunRecalled,
    RunStarted,
    StepBegun,
    Tripped,
)
from procedures.run.events.measuring import (
    Arrived,
    GaugesPlaced,
    GaugesProbed,
    GaugesTried,
    Located,
    NoiseMeasured,
    PilotTaken,
    PoseExcluded,
    Reading,
    RecordDiscarded,
    RecordRejected,
    RecordTaken,
    ReferenceConfirmed,
    ReferenceRepeated,
    SetClosed,
    SetInvalidated,
    StandstillRead,
    Temperature,
)
from procedures.run.events.results import (
    Committed,
    ConfirmationPlanned,
    Identified,
    Proposed,
    ProvisionalApplied,
    ProvisionalReverted,
    ResultAccepted,
    ResultValidated,
    RolledBack,
)

__all__ = [
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
    "Reading",
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
    "Temperature",
    "Tripped",
]

Event = Annotated[
    RunStarted
    | StepBegun
    | Arrived
    | PoseExcluded
    | Located
    | GaugesPlaced
    | RecordTaken
    | RecordRejected
    | RecordDiscarded
    | ReferenceConfirmed
    | StandstillRead
    | PilotTaken
    | ReferenceRepeated
    | GaugesProbed
    | GaugesTried
    | NoiseMeasured
    | SetClosed
    | SetInvalidated
    | ProvisionalApplied
    | ProvisionalReverted
    | Identified
    | Proposed
    | Committed
    | ConfirmationPlanned
    | ResultValidated
    | ResultAccepted
    | RolledBack
    | Paused
    | Resumed
    | RunRecalled
    | Failed
    | CommandRejected
    | Tripped
    | Interrupted
    | Ended,
    Field(discriminator="kind"),
]
