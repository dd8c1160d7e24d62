"""The decision on a stated error: a rule with a guard band of the expanded uncertainty.

    value + U <= limit           pass
    value <= limit < value + U   conditional pass
    value - U <= limit < value   conditional fail
    limit < value - U            fail

A limit below U can be failed, but not passed: then nothing is decided, as without evidence that the
model is right. Source: ILAC-G8:09/2019, Guidelines on decision rules and statements of conformity.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from math import isfinite

from hexacell.uncertainty.statement import LargestError, TaskErrors


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


def decide(error: LargestError, limit: float) -> Verdict:
    """The verdict on an error under a limit, both in the same unit; not a number is not evaluated."""
    value, expanded = error.value, error.expanded
    if value - expanded > limit:
        return Verdict.FAIL
    if not (expanded <= limit and isfinite(value)):
        return Verdict.NOT_EVALUATED
    if value + expanded <= limit:
        return Verdict.PASS
    return Verdict.CONDITIONAL_PASS if value <= limit else Verdict.CONDITIONAL_FAIL


def worst_verdict(verdicts: Iterable[Verdict]) -> Verdict:
    """The verdict of several together: the worst of them; not evaluated if there is none."""
    order = list(Verdict)
    return max(verdicts, key=order.index, default=Verdict.NOT_EVALUATED)


@dataclass(frozen=True, slots=True)
class ErrorLimits:
    """Limits of the largest position error, mm, and of the largest orientation error, deg."""

    position_mm: float
    orientation_deg: float

    def decide(self, errors: TaskErrors) -> Verdict:
        """The verdict on both errors together."""
        position = decide(errors.position, self.position_mm)
        return worst_verdict([position, decide(errors.orientation, self.orientation_deg)])
