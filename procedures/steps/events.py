"""All steps, and the events of a run, as the journal keeps them; everything else is derived from these.

A line in ``STEPS`` is all that makes a class a step of the journal, of the engine and of a replay. Here
are the events that are no outcome of a step: how a run begins, is interrupted, and ends. The others are
imported, so that this is the namespace in which other packages name all of them.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, Self, Union

from pydantic import Field

from drivers.interfaces import DeviceIdentity
from hexacell.cell.fields import GeometryDocument
from hexacell.cell.limits import NEAR_DEG, NEAR_MM
from hexacell.cell.recovery import Action, FailureKind
from hexacell.config.interface import ControllerLimits
from hexacell.kinematics.commanded_motion import RefusedCommand
from hexacell.kinematics.corrections import NO_CORRECTIONS, CorrectionKind, Corrections
from hexacell.kinematics.mechanism import Branch
from hexacell.results.result import AcceptedResult
from hexacell.results.written_geometry import TaskDisplacement
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState, place_of
from procedures.run.trips import Guard, Trip
from procedures.steps.accept import Accept, ResultAccepted
from procedures.steps.assess_noise import AssessNoise, NoiseMeasured
from procedures.steps.base import BaseEvent, BaseStep, EventOfSet
from procedures.steps.close import CloseSet, SetClosed
from procedures.steps.commit import Commit, Committed
from procedures.steps.identify import Identified, Identify
from procedures.steps.judge import ConfirmationPlanned, Judge, ResultValidated
from procedures.steps.lend import Lend, ProvisionalApplied
from procedures.steps.locate import Locate, Located
from procedures.steps.move import Arrived, Move, PoseExcluded
from procedures.steps.pilot import Pilot, PilotTaken
from procedures.steps.place import GaugesPlaced, Place
from procedures.steps.probe import GaugesProbed, Probe
from procedures.steps.propose import Propose, Proposed
from procedures.steps.repeat import ReferenceRepeated, Repeat
from procedures.steps.revisit import ReferenceConfirmed, Revisit, SetInvalidated
from procedures.steps.roll_back import RollBack, RolledBack
from procedures.steps.sample import RecordRejected, RecordTaken, Sample
from procedures.steps.standstill import Standstill, StandstillRead
from procedures.steps.take_back import ProvisionalReverted, TakeBack
from procedures.steps.try_gauges import GaugesTried, Try

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


class RunStarted(BaseEvent):
    """The first event of a run.

    ``taught`` is the geometry with which the robot was taught last, in frames of its own. ``accepted`` is
    the result that a check, the quick level or a length check starts from, if there is one.
    ``length_check`` is whether a calibration has one.
    ``joint_ranges`` are those of cell file and config together, mm; ``limits`` are what the controller's
    config and its INI file state. ``corrections`` are what the config had of these, and ``holds`` the kinds
    that it has a place for.
    ``expired`` are the instruments whose certificate had expired on the day it began.
    ``config`` is the controller's config or its first file, ``further_configs`` are the others, and
    ``config_sha256`` is the fingerprint of all.
    """

    kind: Literal["started"] = "started"
    software: str
    cell: str
    cell_text: str
    mode: Literal["check", "quick", "optimise", "length"]
    config: str
    config_sha256: str
    controller: GeometryDocument
    branch: Branch
    devices: tuple[DeviceIdentity, ...]
    pose_list: str | None = None
    taught: GeometryDocument
    accepted: AcceptedResult | None = None
    length_check: bool = False
    joint_ranges: tuple[tuple[float, float], ...]
    limits: ControllerLimits
    expired: tuple[str, ...] = ()
    further_configs: tuple[str, ...] = ()
    corrections: Corrections = NO_CORRECTIONS
    holds: tuple[CorrectionKind, ...] = ()

    @property
    def config_paths(self) -> tuple[Path, ...]:
        """All files of the config, where they were when it began."""
        return (Path(self.config), *map(Path, self.further_configs))

    def applied_to(self, state: RunState) -> RunState:
        return replace(state, started=self, position_unknown=True)


class StepBegun(BaseEvent):
    """A step was decided and is being executed."""

    kind: Literal["begun"] = "begun"
    step: Step

    def applied_to(self, state: RunState) -> RunState:
        return self.step.begun_in(state)


class Tripped(BaseEvent):
    """A guard stopped the robot, or kept it from moving: which, why, and the next action."""

    kind: Literal["tripped"] = "tripped"
    guard: Guard
    device: str
    problem: str
    action: str

    @classmethod
    def of(cls, trip: Trip) -> Self:
        """The event of a trip."""
        problem, action = trip.problem, trip.action
        if trip.stop_failure:
            problem = f"the robot could not be stopped: {trip.stop_failure}. Before that: {problem}"
            action = "Press the emergency stop"
        return cls(guard=trip.guard, device=trip.device, problem=problem, action=action)

    def applied_to(self, state: RunState) -> RunState:
        """An emergency stop lasts until the robot has moved again."""
        return replace(state, is_in_estop=True) if self.guard is Guard.EMERGENCY_STOP else state


class Paused(BaseEvent):
    """The run is paused; ``at_once``: motion was stopped in place, within a step."""

    kind: Literal["paused"] = "paused"
    at_once: bool = False

    def applied_to(self, state: RunState) -> RunState:
        """A robot that was stopped in place is somewhere, with its gauges."""
        return state.without_position().unverified() if self.at_once else state

    def text(self, state: RunState) -> str:
        return self.kind


class Resumed(BaseEvent):
    """The run continues after a pause."""

    kind: Literal["resumed"] = "resumed"

    def text(self, state: RunState) -> str:
        return self.kind


class RunRecalled(BaseEvent):
    """The run is to end at the reference of the set in which the robot is, and why."""

    kind: Literal["recalled"] = "recalled"
    reason: str

    def applied_to(self, state: RunState) -> RunState:
        return replace(state, recalled=self.reason)

    def text(self, state: RunState) -> str:
        return f"the run is to end: {self.reason}; back to the reference"


class RecordDiscarded(EventOfSet):
    """A record no longer counts and is taken again at the same pose. It stays in the journal."""

    kind: Literal["undone"] = "undone"
    orientation: int

    def applied_to(self, state: RunState) -> RunState:
        return state.with_set(self.at, state.set(self.at).without(self.orientation))

    def text(self, state: RunState) -> str:
        return f"{self.at.name}, orientation {self.orientation} is measured again"


class Failed(BaseEvent):
    """A step, or deciding on one, failed; motion was stopped.

    ``failure`` is its kind, ``attempt`` counts failures of this kind at this set or step since the
    run was begun or resumed, and ``action`` is the reaction. Where a person is asked there are two events:
    one when it fails, whose action is to ask, and one that is ``asked``, with the action chosen.
    """

    kind: Literal["failed"] = "failed"
    step: Step | None
    failure: FailureKind
    attempt: int
    reason: str
    action: Action
    asked: bool = False

    @property
    def is_of_a_question(self) -> bool:
        """Whether a person is asked, or was."""
        return self.asked or self.action is Action.ASK

    def applied_to(self, state: RunState) -> RunState:
        """A ball that left its plate on the way to a chosen pose is a rejected record.

        Nothing is decided while a person is asked.

        Where the whole set is measured again, nothing is measured near that pose: the estimate errs there.
        """
        if self.action is Action.ASK:
            return state
        where = (self.failure, place_of(self.step))
        counted = replace(state, failures={**state.failures, where: self.attempt}).without_position()
        is_redone, is_off_plate = self.action is Action.REDO_SET, self.failure is FailureKind.GAUGE_AT_END
        match self.step:
            case Move(at=at, pose=pose) if is_off_plate and is_redone and at.phase is Phase.IDENTIFY:
                near = RefusedCommand(pose, within_mm=NEAR_MM, within_deg=NEAR_DEG, may_be_passed=True)
                counted = replace(counted, off_plate=(*counted.off_plate, near))
            case Move(at=at, orientation=orientation) if is_off_plate and at.phase is Phase.IDENTIFY:
                counted = counted.with_set(at, counted.set(at).with_rejection(orientation))
        return counted.unverified() if self.action is Action.MEASURE_AGAIN else counted

    def text(self, state: RunState) -> str:
        reaction = "a person is asked" if self.action is Action.ASK else self.action.value
        return reaction if self.asked else f"{self.reason}\n  attempt {self.attempt}: {reaction}"


class CommandRejected(BaseEvent):
    """A command was refused, and why."""

    kind: Literal["declined"] = "declined"
    command: str
    reason: str

    def text(self, state: RunState) -> str:
        return f"{self.command}: {self.reason}"


class Interrupted(BaseEvent):
    """The run ended early: by a person, a failure, or because an answer is missing."""

    kind: Literal["interrupted"] = "interrupted"
    reason: str
    exit_code: int

    def applied_to(self, state: RunState) -> RunState:
        return replace(state, failures={}, recalled=None).without_position().unverified()


class Ended(BaseEvent):
    """The run is over; ``displacement`` is that of the new geometry, if it stays in the controller."""

    kind: Literal["ended"] = "ended"
    exit_code: int
    line: str
    displacement: TaskDisplacement | None = None

    kept_as: ClassVar[str] = "ended"


_COURSE: tuple[type[BaseEvent], ...] = (
    RunStarted,
    StepBegun,
    RecordDiscarded,
    Paused,
    Resumed,
    RunRecalled,
    Failed,
    CommandRejected,
    Tripped,
    Interrupted,
    Ended,
)
EVENTS = tuple(dict.fromkeys([*_COURSE, *(event for step in STEPS for event in step.outcomes)]))

if TYPE_CHECKING:
    Event = BaseEvent
else:  # what a file may have: exactly one of these, distinguished by its kind
    Event = Annotated[Union[EVENTS], Field(discriminator="kind")]  # noqa: UP007
