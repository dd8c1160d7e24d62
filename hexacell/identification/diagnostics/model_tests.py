"""Tests of the model by records that it was not fitted to: held-out ones, and each point by the others.

An identification with its covariance is a prior for further records. Their weighted residuals and the
distance from that prior, both at the minimum of their sum, have the chi-square distribution of as many
degrees of freedom as there are measured coordinates, less the unknown constants of the points: it is the
chi-square of the records against their predicted covariance. At the same minimum the estimate contains
both. Source: Gelb (ed.), Applied Optimal Estimation, 1974 (innovations).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.estimator import estimate_online
from hexacell.identification.problem.data_requirements import is_determined
from hexacell.identification.problem.problem import Prior, Problem
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.levenberg_marquardt import FINE
from hexacell.identification.solver.regularized_fit import fit_regularized
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.rotations import Mask


@dataclass(frozen=True, slots=True)
class PointPrediction:
    """How well a point's records were predicted from those of all other points."""

    point: int
    test: ChiSquareTest


def update(found: Identification, further: Problem) -> Identification:
    """The estimate with further records; its covariance is that of both together.

    Raises:
        IdentifiabilityError: no geometry fits them.
    """
    prior = Prior(found.geometry, found.free, found.free_covariance)
    solved = further.solve_poses(found.free)
    start = replace(further, prior=prior).starting_at(found.free, solved.poses, solved.found)
    return estimate_online(start, FINE)


def prediction_test(updated: Identification) -> ChiSquareTest:
    """The chi-square of the further records of :func:`update` against what was predicted of them."""
    distance = updated.problem.prior.squared_distance(updated.free)
    return ChiSquareTest(updated.chi2 + distance, updated.problem.coordinates)


def leave_one_point_out(found: Identification) -> tuple[PointPrediction, ...]:
    """Each point's records predicted by the others, where those determine the geometry.

    Raises:
        IdentifiabilityError: no geometry fits some of the points.
    """
    points = found.problem.labels[:, 0]
    kept = ((int(point), points != point) for point in np.unique(points))
    return tuple(
        PointPrediction(point, prediction_test(_update_without(found, rows)))
        for point, rows in kept
        if is_determined(found.problem.subset(rows))
    )


def _update_without(found: Identification, rows: Mask) -> Identification:
    """The estimate from some records, updated with the others."""
    solved = found.problem.starting_at(found.free, found.poses)
    return update(fit_regularized(solved.subset(rows)), solved.subset(~rows))
