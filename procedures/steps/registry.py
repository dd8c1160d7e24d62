"""All steps. A line here is all that makes a class a step of the journal, of the engine and of a replay."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Union

from pydantic import Field

from procedures.steps.base import BaseStep
from procedures.steps.gauges import Place, Probe, Try
from procedures.steps.identify import Identify, Propose
from procedures.steps.judge import Accept, Judge
from procedures.steps.move import Locate, Move
from procedures.steps.noise import AssessNoise, Repeat, Standstill
from procedures.steps.provisional import Lend, TakeBack
from procedures.steps.reference import CloseSet, Revisit
from procedures.steps.sample import Pilot, Sample
from procedures.steps.write_back import Commit, RollBack

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
