"""Data that cannot identify a geometry, whatever they say: what is missing, and what would supply it."""

from __future__ import annotations

from hexacell.errors import IdentifiabilityError
from hexacell.identification.problem import Problem


def equations(problem: Problem) -> int:
    """Three a record, less three for each point's unknown reference."""
    return 3 * (problem.records - problem.points)


def is_enough(problem: Problem) -> bool:
    """Whether there are as many equations as parameters, from two points at least."""
    return problem.points >= 2 and equations(problem) >= len(problem.prior.covariance)


def refuse_too_little(problem: Problem) -> None:
    """Raise where the number of records or points alone shows that nothing can be identified.

    Raises:
        IdentifiabilityError: says what is missing.
    """
    parameters = len(problem.prior.covariance)
    if problem.points < 2:
        raise IdentifiabilityError(
            f"records at one point cannot determine the {parameters} parameters, however many they are",
            action="Measure at two points at least",
        )
    found = equations(problem)
    if found < parameters:
        missing = -(-(parameters - found) // 3)
        raise IdentifiabilityError(
            f"{problem.records} records at {problem.points} points give {found} equations for "
            f"{parameters} parameters",
            action=f"Measure {missing} more records at these points",
        )
