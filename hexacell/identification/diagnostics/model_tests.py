"""Tests of the model by records that it was not fitted to: held-out ones, and each point by the others.

By how much more records raise the least cost is, if the model is right, distributed as the chi-square of as
many degrees of freedom as they have measured coordinates, less the unknown constants of their points. Both
costs are linearized at the solution of all records (:class:`.LinearCosts`).

Sources: Gelb (ed.), Applied Optimal Estimation, 1974 (innovations); Cook and Weisberg 1982 (deletion).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hexacell.errors import IdentifiabilityError
from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.chi_square import SMALLEST_PROBABILITY, ChiSquareTest
from hexacell.identification.solver.fit import FINE, solve_around_singularities
from hexacell.identification.solver.linear_model import LinearCosts
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.rotations import Mask


def update(found: Identification, further: Problem) -> Identification:
    """Estimate by the records of an identification and further ones that have a pose under it.

    These are at other points. The prior, where it was not released, counts again.

    Raises:
        IdentifiabilityError: no geometry fits any of the further records; they would prove nothing.
    """
    used = found.problem.starting_at(found.free, found.poses)
    started = further.started_at(found.free)
    if found.terms is not None:
        started = started.with_terms(found.terms.terms, found.terms.values)
    kept, solution = solve_around_singularities(used.joined(started), found.active_prior, FINE)
    if not np.isin(kept.labels[:, 0], further.labels[:, 0]).any():
        raise IdentifiabilityError(
            "no geometry near the identified one has a pose at any held-out record",
            action="Check that the joint variables are those of these poses",
        )
    return replace(found, problem=kept, solution=solution)


def prediction_test(found: Identification, rows: Mask) -> ChiSquareTest:
    """The chi-square of some ``rows`` (n,) of the records, against what the others predict of them."""
    return _prediction_test(LinearCosts.at(found.problem, found.prediction), rows)


def leave_one_point_out(found: Identification) -> dict[int, ChiSquareTest]:
    """How well each point's records are predicted by the others, where those determine the geometry."""
    costs = LinearCosts.at(found.problem, found.prediction)
    points = found.problem.labels[:, 0]
    return {
        point: _prediction_test(costs, rows)
        for point, rows in ((int(point), points == point) for point in np.unique(points))
        if found.problem.subset(~rows).is_determined
    }


def contradicted_points(points: Mapping[int, ChiSquareTest]) -> dict[int, ChiSquareTest]:
    """The points whose records the others contradict; by chance any of them in 0.1 % of all cases."""
    least = SMALLEST_PROBABILITY / max(1, len(points))
    return {point: test for point, test in points.items() if test.probability < least}


def _prediction_test(costs: LinearCosts, rows: Mask) -> ChiSquareTest:
    every = np.ones(len(rows), dtype=bool)
    coordinates = costs.problem.subset(rows).coordinates
    chi2 = costs.least(every) - costs.least(~rows)
    return ChiSquareTest(chi2, coordinates, costs.problem.noise.freedom)
