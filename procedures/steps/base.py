"""What every step and every event has.

Both are data: a step is journalled when it is decided, its event when it has been carried out. The key and
the kind of each are part of the journal.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import ClassVar

from hexacell.campaign.pilots import pilot_number
from hexacell.campaign.time_model import TimeKind
from hexacell.cell.fields import Frozen
from procedures.resources.run_resources import RunResources
from procedures.run.cancellation import in_thread
from procedures.run.keys import SetKey, SixNumbers
from procedures.run.state import RunState


class BaseEvent(Frozen):
    """Something that happened in a run.

    ``kept_as`` is the field of the state that keeps the latest event of the class, if it has one.
    """

    kind: str

    kept_as: ClassVar[str] = ""

    def applied_to(self, state: RunState) -> RunState:
        """The state after the event; one without a rule of its own is kept as the latest of its class."""
        others = {**state.others, type(self): self}
        return replace(state, **({self.kept_as: self} if self.kept_as else {"others": others}))

    def text(self, state: RunState) -> str | None:
        """What it reports, None if nothing; ``state`` includes the event."""
        return None


class EventOfSet(BaseEvent):
    """Something that happened in a set."""

    at: SetKey


class EventAtPose(EventOfSet):
    """Something that happened at one pose of a set; the first orientation is its reference."""

    orientation: int
    pose: SixNumbers


class BaseStep(Frozen, ABC):
    """A step of a run.

    Attributes:
        outcomes: the events that carrying it out may give.
        doing: what the run, the robot or a person does meanwhile, in a few words.
        moves_nothing: it neither moves the robot nor reads a device.
        is_reproducible: a replay can compute its failure again, unless a device or the disk caused it.
        takes: what its time is spent on.
    """

    kind: str

    outcomes: ClassVar[tuple[type[BaseEvent], ...]] = ()
    doing: ClassVar[str] = ""
    moves_nothing: ClassVar[bool] = False
    is_reproducible: ClassVar[bool] = False
    takes: ClassVar[TimeKind] = TimeKind.DECIDING

    @property
    def key(self) -> str:
        """Stable name of the step, such as ``P2/o07/sample``."""
        return self.kind

    @property
    def place(self) -> str:
        """Where its failures are counted."""
        return self.key

    @abstractmethod
    async def perform(self, run: RunResources, state: RunState) -> BaseEvent:
        """Carry it out and give the event that it caused; raises ``HexacellError``."""

    def begun_in(self, state: RunState) -> RunState:
        """The state once it is begun."""
        return state

    def activity(self) -> str | None:
        """What the run does from now on, in a few words; None where that does not change."""
        return None


class StepOfSet(BaseStep):
    """A step within a set; ``purpose`` is what for, in a few words, where a person is to know."""

    at: SetKey

    purpose: ClassVar[str] = ""

    @property
    def key(self) -> str:
        return f"{self.at}/{self.kind}"

    @property
    def place(self) -> str:
        return str(self.at)

    def activity(self) -> str | None:
        return f"{self.at.name}, {self.purpose}" if self.purpose else None


class StepAtPose(StepOfSet):
    """A step at one pose of a set; the first orientation is its reference.

    Pilot poses have orientations that no record has (:mod:`hexacell.campaign.pilots`).
    """

    orientation: int
    pose: SixNumbers

    @property
    def key(self) -> str:
        pilot = pilot_number(self.orientation)
        pose = f"o{self.orientation:02d}" if pilot is None else f"pilot{pilot:02d}"
        return f"{self.at}/{pose}/{self.kind}"

    def activity(self) -> str | None:
        return self.at.pose_name(self.orientation)


class StepWithoutMotion(BaseStep):
    """A step that moves nothing: it computes, asks, or changes the controller's config."""

    moves_nothing: ClassVar[bool] = True
    is_reproducible: ClassVar[bool] = True

    def activity(self) -> str:
        return self.doing


class Computation(StepWithoutMotion):
    """A step that only computes, in a thread; it writes files of the run folder and nothing else."""

    async def perform(self, run: RunResources, state: RunState) -> BaseEvent:
        return await in_thread(self.compute, run, state)

    @abstractmethod
    def compute(self, run: RunResources, state: RunState) -> BaseEvent:
        """Compute the event; raises ``HexacellError``."""
