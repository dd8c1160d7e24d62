"""The decision on a stated error: a rule with a guard band w (``docs/verdict.md``).

    value + w <= limit           pass
    value <= limit < value + w   conditional pass
    value - w <= limit < value   conditional fail
    limit < value - w            fail

The guard band is the expanded uncertainty U times a factor. A limit below w can be failed, but not passed:
then nothing is decided. Source: ILAC-G8:09/2019, Guidelines on decision rules and statements of conformity.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import StrEnum
from functools import partial
from math import isfinite
from typing import TYPE_CHECKING, Literal, Self

from hexacell.cell.fields import Frozen, SixNumbers
from hexacell.cell.measuring import ErrorLimits
from hexacell.kinematics.parameters import JointUnit
from hexacell.lengths import ShownUnit, unit_of
from hexacell.results.result import LengthResult
from hexacell.uncertainty.statement import LargestError, TaskErrors
from hexacell.verdict.either_side import EitherSide

if TYPE_CHECKING:
    from hexacell.campaign.task_accuracy import Task
    from hexacell.cell.model import CellSettings
    from hexacell.robot.model import Robot


class Verdict(StrEnum):
    """What is decided, from the best to the worst."""

    PASS = "pass"  # noqa: S105 - a verdict, not a password
    CONDITIONAL_PASS = "conditional pass"  # noqa: S105
    NOT_EVALUATED = "not evaluated"
    CONDITIONAL_FAIL = "conditional fail"
    FAIL = "fail"

    @property
    def is_conditional(self) -> bool:
        """Whether the limit is within the uncertainty of the value."""
        return self in {Verdict.CONDITIONAL_PASS, Verdict.CONDITIONAL_FAIL}

    @property
    def is_final(self) -> bool:
        """Whether a check ends with it."""
        return self in {Verdict.PASS, Verdict.FAIL}


def decide(error: LargestError, limit: float, guard_band_factor: float = 1.0) -> Verdict:
    """The verdict on an error under a limit, both in the same unit; not a number is not evaluated."""
    value, guard_band = error.value, guard_band_factor * error.expanded
    if value - guard_band > limit:
        return Verdict.FAIL
    if not (guard_band <= limit and isfinite(value)):
        return Verdict.NOT_EVALUATED
    if value + guard_band <= limit:
        return Verdict.PASS
    return Verdict.CONDITIONAL_PASS if value <= limit else Verdict.CONDITIONAL_FAIL


class JudgedError(Frozen):
    """The largest error over the task poses, its expanded uncertainty and limit, mm or deg; the verdict.

    The guard band of the decision is ``guard_band_factor`` times the expanded uncertainty. That is None,
    and nothing decided, where the records contradict the model from which it would follow.
    """

    value: float
    expanded: float | None
    limit: float
    verdict: Verdict
    guard_band_factor: float = 1.0

    @classmethod
    def of(
        cls, error: LargestError, limit: float, guard_band_factor: float, *, is_evident: bool = True
    ) -> JudgedError:
        """The decision on an error; ``is_evident``: whether the evidence for the model holds."""
        return cls(
            value=error.value,
            expanded=error.expanded if is_evident else None,
            limit=limit,
            verdict=decide(error, limit, guard_band_factor) if is_evident else Verdict.NOT_EVALUATED,
            guard_band_factor=guard_band_factor,
        )

    @property
    def guard_band(self) -> str:
        """The guard band as a multiple of U, in words; empty where it is U, or the verdict is a pass."""
        factor = self.guard_band_factor
        is_named = factor != 1.0 and self.verdict is not Verdict.PASS and self.expanded is not None
        return f"{factor:g} U" if is_named else ""

    def shown_in(self, unit: str) -> ShownUnit:
        """The unit in which people read it; ``unit`` is that of its figures."""
        return unit_of(self.value, self.expanded, unit=unit)

    def rule(self, unit: str) -> str:
        """The limit, and the guard band where it is named, in words."""
        guard_band = f", safety margin {self.guard_band}" if self.guard_band else ""
        return f"limit {self.shown_in(unit).limit(self.limit)}{guard_band}"

    def sentence(self, unit: str) -> str:
        """The error +- its uncertainty with the rule, in words."""
        return f"{self.with_u(unit)} ({self.rule(unit)})"

    def with_u(self, unit: str) -> str:
        """The error and its uncertainty, or that this is not stated, in words."""
        shown = self.shown_in(unit)
        if self.expanded is None:
            return f"{shown.length(self.value)}, U not stated, as the evidence failed"
        return f"{shown.number(self.value)} +- {shown.length(self.expanded)}"


def worst_verdict(verdicts: Iterable[Verdict]) -> Verdict:
    """The verdict of several together: the worst of them; not evaluated without any."""
    return max(verdicts, key=list(Verdict).index, default=Verdict.NOT_EVALUATED)


def decide_both(position: LargestError, orientation: LargestError, limits: ErrorLimits) -> Verdict:
    """The verdict on the largest errors, mm and deg, together."""
    both = (position, limits.position_mm), (orientation, limits.orientation_deg)
    return worst_verdict(decide(error, limit, limits.guard_band_factor) for error, limit in both)


class GeometryErrors(Frozen):
    """The errors at the task poses that the geometry alone makes, without the scatter of the stops."""

    position: JudgedError
    orientation: JudgedError

    @classmethod
    def of(cls, errors: TaskErrors, limits: ErrorLimits, *, is_evident: bool) -> Self:
        """The decision on errors under limits, as far as the evidence for the model holds."""
        judged = partial(JudgedError.of, guard_band_factor=limits.guard_band_factor, is_evident=is_evident)
        return cls(
            position=judged(errors.position, limits.position_mm),
            orientation=judged(errors.orientation, limits.orientation_deg),
        )

    @property
    def verdict(self) -> Verdict:
        """The decision on both."""
        return worst_verdict([self.position.verdict, self.orientation.verdict])


class VerifiedAccuracy(Frozen):
    """The error of the written geometry in one round of visits to the task poses.

    Attributes:
        of_geometry: the errors without the scatter of the stops; None where the machine repeats as well as
            was stated, or measured.
        alone: the position error that the best geometry would leave if the controller corrected nothing
            else; None where it does not.
        poses: their number, and whether the cell file names them; else they span the workspace.
        worst: the pose with the largest position error, in the controller's frames.
        scale_of: what says how long a millimetre is: the encoders, or the drawing where these read angles.
        direction: in which every joint arrives at the stops that it holds for, 1 or -1; 0 for any.
        either_side: task poses at which legs may lie on either side of their play, the worst first.
    """

    position: JudgedError
    orientation: JudgedError
    poses: int
    task_named: bool
    worst: SixNumbers
    of_geometry: GeometryErrors | None = None
    alone: JudgedError | None = None
    length: LengthResult | None = None
    scale_of: Literal["encoders", "drawing"] = "encoders"
    direction: Literal[-1, 0, 1] = 0
    either_side: tuple[EitherSide, ...] = ()

    @classmethod
    def of(
        cls,
        errors: TaskErrors,
        settings: CellSettings,
        robot: Robot,
        task: Task,
        *,
        is_evident: bool,
        of_geometry: TaskErrors | None = None,
        alone: TaskErrors | None = None,
        length: LengthResult | None = None,
        either_side: tuple[EitherSide, ...] = (),
    ) -> VerifiedAccuracy:
        """The decision on errors at the poses of a ``task`` that the ``robot`` reaches.

        Where the evidence for the model failed it is not ``is_evident``, and no U is stated.
        """
        joint_unit = robot.mechanism.words.joint_unit
        judge = partial(GeometryErrors.of, limits=settings.acceptance, is_evident=is_evident)
        judged = judge(errors)
        return cls(
            position=judged.position,
            orientation=judged.orientation,
            poses=len(task.poses),
            task_named=bool(settings.task.poses),
            of_geometry=None if of_geometry is None else judge(of_geometry),
            alone=None if alone is None else judge(alone).position,
            worst=robot.to_command(task.poses.pose(errors.worst)).as_tuple(),
            length=length,
            scale_of="encoders" if joint_unit is JointUnit.MM else "drawing",
            direction=settings.motion.sign,
            either_side=either_side,
        )

    @property
    def approach(self) -> str:
        """How the stops that it holds for are reached, in words; empty for any way."""
        word = "positive" if self.direction > 0 else "negative"
        return f"for stops reached in the {word} direction of every joint" if self.direction else ""

    @property
    def errors(self) -> tuple[tuple[str, str, JudgedError], ...]:
        """Each error with its name and unit."""
        return ("position", "mm", self.position), ("orientation", "deg", self.orientation)
