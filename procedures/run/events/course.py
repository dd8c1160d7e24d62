"""Events of the course of a run: its begin, steps, interruptions and end."""

from __future__ import annotations

from typing import Literal, Self

from drivers.interfaces import DeviceIdentity
from hexacell.cell.fields import Frozen, GeometryDocument
from hexacell.cell.recovery import Action, FailureKind
from hexacell.config.interface import ControllerLimits
from hexacell.kinematics.mechanism import Branch
from hexacell.results.result import AcceptedResult
from hexacell.results.written_geometry import TaskDisplacement
from procedures.run.steps import Step
from procedures.run.trips import Guard, Trip


class RunStarted(Frozen):
    """The first event of a run.

    ``taught`` is the geometry with which the robot was taught last, in frames of its own. Without it the
    result is written in frames by the mechanism's convention. ``accepted`` is the result that a check, the
    quick level or a length check starts from, if there is one. ``length_check`` is whether a calibration
    has one.
    ``joint_ranges`` are those of cell file and config together, mm; none in runs of older versions.
    ``limits`` are what the controller's config and its INI file state; none in runs of older versions, too.
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
    taught: GeometryDocument | None = None
    accepted: AcceptedResult | None = None
    length_check: bool = False
    joint_ranges: tuple[tuple[float, float], ...] | None = None
    limits: ControllerLimits | None = None
    expired: tuple[str, ...] = ()
    further_configs: tuple[str, ...] = ()


class StepBegun(Frozen):
    """A step was decided and is being executed."""

    kind: Literal["begun"] = "begun"
    step: Step


class Tripped(Frozen):
    """A guard stopped the robot, or kept it from moving: which, why, and the next action."""

    kind: Literal["tripped"] = "tripped"
    guard: Guard
    device: str
    problem: str
    action: str

    @classmethod
    def of(cls, trip: Trip) -> Self:
        """The event of a trip."""
        if trip.stop_failure:
            problem = f"the robot could not be stopped: {trip.stop_failure}. Before that: {trip.problem}"
            return cls(
                guard=trip.guard, device=trip.device, problem=problem, action="Press the emergency stop"
            )
        return cls(guard=trip.guard, device=trip.device, problem=trip.problem, action=trip.action)


class Paused(Frozen):
    """The run is paused; ``at_once``: motion was stopped in place, within a step."""

    kind: Literal["paused"] = "paused"
    at_once: bool = False


class Resumed(Frozen):
    """The run continues after a pause."""

    kind: Literal["resumed"] = "resumed"


class RunRecalled(Frozen):
    """The run is to end at the reference of the set in which the robot is, and why."""

    kind: Literal["recalled"] = "recalled"
    reason: str


class Failed(Frozen):
    """A step, or deciding on one, failed; motion was stopped.

    ``failure`` is its kind, ``attempt`` counts failures of this kind at this set or step since the
    run was begun or resumed, and ``action`` is the reaction; ``asked`` is whether a person chose it.
    """

    kind: Literal["failed"] = "failed"
    step: Step | None
    failure: FailureKind
    attempt: int
    reason: str
    action: Action
    asked: bool = False


class CommandRejected(Frozen):
    """A command was refused, and why."""

    kind: Literal["declined"] = "declined"
    command: str
    reason: str


class Interrupted(Frozen):
    """The run ended early: by a person, a failure, or because an answer is missing."""

    kind: Literal["interrupted"] = "interrupted"
    reason: str
    exit_code: int


class Ended(Frozen):
    """The run is over; ``displacement`` is that of the new geometry, if it stays in the controller."""

    kind: Literal["ended"] = "ended"
    exit_code: int
    line: str
    displacement: TaskDisplacement | None = None
