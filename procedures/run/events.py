"""The events of a run, as the journal keeps them; everything else is derived from them.

Readings are raw and depend on no geometry: encoder counts, gauge answers, and the commanded pose.
``RunStarted`` has the geometry that commanded it.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field

from drivers.interfaces import DeviceIdentity
from hexacell.acceptance import AcceptanceGate
from hexacell.campaign.measured_noise import MeasuredNoise
from hexacell.campaign.teaching import TaskDisplacement
from hexacell.cell.fields import Frozen, GeometryDocument
from hexacell.cell.recovery import Action, FailureKind
from hexacell.decision import Verdict
from hexacell.kinematics.mechanism import Branch
from hexacell.reporting.check_result import CheckResult
from hexacell.reporting.length_statement import LengthStatement
from hexacell.reporting.result import AcceptedResult, ExpectedImprovement, IdentificationResult
from hexacell.reporting.verification import Verification
from procedures.run.steps import SetKey, SixNumbers, Step, ThreeNumbers
from procedures.run.trips import Guard, Trip


class RunStarted(Frozen):
    """The first event of a run.

    ``taught`` is the geometry with which the robot was taught last, in frames of its own. Without it the
    result is written in frames by the mechanism's convention. ``accepted`` is the result that a check or a
    length check starts from, if there is one. ``length_check`` is whether a calibration has one.
    ``joint_ranges`` are those of cell file and config together, mm; none in runs of older versions.
    """

    kind: Literal["started"] = "started"
    software: str
    cell: str
    cell_text: str
    mode: Literal["check", "optimise", "length"]
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


class StepBegun(Frozen):
    """A step was decided and is being executed."""

    kind: Literal["begun"] = "begun"
    step: Step


class Arrived(Frozen):
    """A move has ended at its pose."""

    kind: Literal["arrived"] = "arrived"
    at: SetKey
    orientation: int
    pose: SixNumbers


class PoseExcluded(Frozen):
    """The controller refused a pose and did not move; it is not commanded again in this run.

    ``axis`` is the axis beyond whose limit it is, the highest or the lowest; then no pose is commanded that
    is as far out. Without it the pose alone is left out. ``replacements`` are held-out poses that cannot be
    commanded now, each with the one that takes its place.
    """

    kind: Literal["excluded"] = "excluded"
    at: SetKey
    orientation: int
    pose: SixNumbers
    reason: str
    axis: Literal["x", "y", "z", "a", "b", "c"] | None = None
    is_highest: bool = True
    replacements: tuple[tuple[SixNumbers, SixNumbers], ...] = ()


class Located(Frozen):
    """Controller and encoders agree on where the robot is, after that had been unknown.

    Up to version 8 only the ``pose`` was read.
    """

    kind: Literal["located"] = "located"
    pose: SixNumbers
    joints_mm: SixNumbers | None = None
    encoders_mm: SixNumbers | None = None


class GaugesPlaced(Frozen):
    """The gauges are placed around the ball."""

    kind: Literal["placed"] = "placed"
    at: SetKey


class Temperature(Frozen):
    """The reading of a thermometer, deg C; without one, ``problem`` says why."""

    name: str
    celsius: float | None
    raw: str = ""
    problem: str = ""


class Reading(Frozen):
    """A settled window of readings.

    ``gauges_mm`` and ``spread_mm`` are mean and range along base x, y, z; ``joints_mm`` the mean
    slider positions. ``answers`` and ``counts`` are the raw readings behind them, in the order taken.
    ``temperatures`` are those of the cell's thermometers just afterwards.
    """

    gauges_mm: ThreeNumbers
    spread_mm: ThreeNumbers
    joints_mm: SixNumbers
    answers: tuple[tuple[str, ...], ...]
    counts: tuple[tuple[int, ...], ...]
    temperatures: tuple[Temperature, ...] = ()


class RecordTaken(Frozen):
    """A record was taken; ``deviation_mm`` is from the set's reference."""

    kind: Literal["sampled"] = "sampled"
    at: SetKey
    orientation: int
    pose: SixNumbers
    reading: Reading
    deviation_mm: ThreeNumbers


class RecordRejected(Frozen):
    """A record was rejected: the ball left the travel. Its orientation is chosen again.

    There is no ``reading`` if a plunger was at its end.
    """

    kind: Literal["refused"] = "refused"
    at: SetKey
    orientation: int
    reason: str
    reading: Reading | None = None


class RecordDiscarded(Frozen):
    """A record no longer counts and is taken again at the same pose. It stays in the journal."""

    kind: Literal["undone"] = "undone"
    at: SetKey
    orientation: int


class ReferenceConfirmed(Frozen):
    """The reference was read again after an interruption: ``change_mm`` is small, the set continues."""

    kind: Literal["confirmed"] = "confirmed"
    at: SetKey
    change_mm: ThreeNumbers
    reading: Reading | None = None


class StandstillRead(Frozen):
    """The devices were read again and again at a reference while nothing moved.

    ``gauges_mm`` along base x, y, z and ``joints_mm`` have an entry for each reading, ``answers`` and
    ``counts`` are the raw readings behind them.
    """

    kind: Literal["stood"] = "stood"
    at: SetKey
    gauges_mm: tuple[ThreeNumbers, ...]
    joints_mm: tuple[SixNumbers, ...]
    answers: tuple[tuple[str, ...], ...]
    counts: tuple[tuple[int, ...], ...]


class ReferenceRepeated(Frozen):
    """The reference was left, visited again from another direction, and read."""

    kind: Literal["repeated"] = "repeated"
    at: SetKey
    reading: Reading


class GaugesProbed(Frozen):
    """The ball was moved by a small known distance from a set's reference, and the gauges were read."""

    kind: Literal["probed"] = "probed"
    at: SetKey
    moved_mm: ThreeNumbers
    reading: Reading


class GaugesTried(Frozen):
    """The gauges of a set follow the ball, each on its axis, with its sign and scale.

    ``response`` is what the gauges x, y, z showed per length of a move along x, y, z.
    """

    kind: Literal["tried"] = "tried"
    at: SetKey
    response: tuple[ThreeNumbers, ThreeNumbers, ThreeNumbers]


class NoiseMeasured(Frozen):
    """The noise of gauges and encoders that the run counts with from now on.

    If records are the mean of several windows from now on, the set's reference is recorded again.
    """

    kind: Literal["noise measured"] = "noise measured"
    at: SetKey
    noise: MeasuredNoise


class SetClosed(Frozen):
    """The reference was read again; ``drift_mm`` is the change since it was zeroed."""

    kind: Literal["closed"] = "closed"
    at: SetKey
    drift_mm: ThreeNumbers
    reading: Reading | None = None


class SetInvalidated(Frozen):
    """The set does not count and is measured again. Its records stay in the journal.

    There is a ``reading`` if its reference was read again and had changed.
    """

    kind: Literal["voided"] = "voided"
    at: SetKey
    reason: str
    reading: Reading | None = None


class ProvisionalApplied(Frozen):
    """The controller commands with a provisional geometry while the points are measured.

    ``geometry`` is in the mechanism's frame convention. The earlier config is kept in ``folder``,
    a part of the run folder.
    """

    kind: Literal["lent"] = "lent"
    geometry: GeometryDocument
    folder: str


class ProvisionalReverted(Frozen):
    """The controller has read the config of before the provisional geometry."""

    kind: Literal["taken back"] = "taken back"


class Identified(Frozen):
    """The geometry was identified, and the held-out poses were chosen.

    ``held_out`` are measured at each point before and after, ``held_out_after`` only after: the robot
    cannot take them safely before it is calibrated. ``improvement`` is none where the robot can reach none
    of the task poses.
    """

    kind: Literal["identified"] = "identified"
    result: IdentificationResult
    held_out: tuple[tuple[SixNumbers, ...], ...]
    held_out_after: tuple[tuple[SixNumbers, ...], ...] = ()
    improvement: ExpectedImprovement | None = None


class Proposed(Frozen):
    """The new config was saved in the run folder, and the gates for writing it were evaluated.

    ``written`` is the geometry in it; ``displacement`` is how far that moves the task poses.
    """

    kind: Literal["proposed"] = "proposed"
    gates: tuple[AcceptanceGate, ...]
    written: GeometryDocument | None = None
    displacement: TaskDisplacement | None = None


class Committed(Frozen):
    """The controller has read a config with the new geometry."""

    kind: Literal["committed"] = "committed"
    approved_by: str


def _present_name(verdict: object) -> object:
    """The verdict for a word of versions 1 and 2."""
    return Verdict.FAIL if verdict in {"out of limits", "worse than before"} else verdict


class ResultValidated(Frozen):
    """The verdict of the run.

    That of a calibration is by its ``verification``, of a check by its result ``check``, of a length check
    of its own by ``length``. Versions 1 and 2 have none of them, checks of version 3 have no ``check``.
    """

    kind: Literal["judged"] = "judged"
    verdict: Annotated[Verdict, BeforeValidator(_present_name)]
    line: str
    verification: Verification | None = None
    check: CheckResult | None = None
    length: LengthStatement | None = None


class ResultAccepted(Frozen):
    """A person decided on a result that did not pass; ``by`` is who keeps it, null if nobody does.

    ``asked`` is whether there was somebody to ask.
    """

    kind: Literal["accepted"] = "accepted"
    by: str | None
    asked: bool = True


class RolledBack(Frozen):
    """The controller has read the config of before the run, bit for bit."""

    kind: Literal["rolled back"] = "rolled back"


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
    | ResultValidated
    | ResultAccepted
    | RolledBack
    | Paused
    | Resumed
    | Failed
    | CommandRejected
    | Tripped
    | Interrupted
    | Ended,
    Field(discriminator="kind"),
]
