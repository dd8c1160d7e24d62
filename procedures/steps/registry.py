"""All steps. A line here is all that makes a class a step of the journal, of the engine and of a replay."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Union

from pydantic import Field

from procedures.steps.accept import Accept
from procedures.steps.assess_noise import AssessNoise
from procedures.steps.base import BaseStep
from procedures.steps.close import CloseSet
from procedures.steps.commit import Commit
from procedures.steps.identify import Identify
from procedures.steps.judge import Judge
from procedures.steps.lend import Lend
from procedures.steps.locate import Locate
from procedures.steps.move import Move
from procedures.steps.pilot import Pilot
from procedures.steps.place import Place
from procedures.steps.probe import Probe
from procedures.steps.propose import Propose
from procedures.steps.repeat import Repeat
from procedures.steps.revisit import Revisit
from procedures.steps.roll_back import RollBack
from procedures.steps.sample import Sample
from procedures.steps.standstill import Standstill
from procedures.steps.take_back import TakeBack
from procedures.steps.try_gauges import Try

STEPS: tuple[type[BaseStep], ...] = (
    Locate,
    Move,
    Place,
    Sample,
    Revisit,
    CloseSet,
    Standstill,
    Pilot,
    Repeat,
    Probe,
    Try,
    AssessNoise,
    Lend,
    TakeBack,
    Identify,
    Propose,
    Commit,
    Judge,
    Accept,
    RollBack,
)

if TYPE_CHECKING:
    Step = BaseStep
else:  # what a file may have: exactly one of these, distinguished by its kind
    Step = Annotated[Union[STEPS], Field(discriminator="kind")]  # noqa: UP007
