"""The measurement model linearized at an identified geometry, for the checks of the result."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.identification.problem.problem import Problem
from hexacell.identification.solver.measurement_model import record_covariance, record_weights
from hexacell.identification.solver.nuisance_parameters import NuisanceElimination, ReducedSystem
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import pose_sensitivity


@dataclass(frozen=True, slots=True, eq=False)
class LinearizedSolution:
    """The records, to first order in the parameters and in the noise.

    Attributes:
        problem: the records that were used.
        covariance: of the free parameters (p, p), mm^2.
        from_centre: the free parameters less the prior's centre (p,), mm.
        residuals: (n, 3), mm, not centred: they contain each point's unknown constant.
        jacobian: (n, 3, p) of the residuals by the free parameters.
        by_joints: (n, 3, 6) of the ball's position by the joint variables.
    """

    problem: Problem
    covariance: Array
    from_centre: Array
    residuals: Array
    jacobian: Array
    by_joints: Array

    @classmethod
    def at(cls, found: Identification) -> LinearizedSolution:
        """The model at the solution of an identification."""
        problem = found.problem
        sensitivity = pose_sensitivity(problem.mechanism, found.geometry, found.poses, problem.joints)
        return cls(
            problem=problem,
            covariance=found.free_covariance,
            from_centre=found.free - problem.mechanism.convention.free_parameters(problem.prior.centre),
            residuals=found.poses.positions - problem.deviations,
            jacobian=sensitivity.parameters[:, :3] @ problem.basis,
            by_joints=sensitivity.joints[:, :3],
        )

    @property
    def record_noise_mm(self) -> float:
        """Root mean square distance, mm, by which the stated noise displaces a record."""
        covariance = record_covariance(self.by_joints, self.problem.noise)
        return float(np.sqrt(np.mean(np.trace(covariance, axis1=-2, axis2=-1))))

    def weights(self, variances: Array | None = None) -> Array:
        """Inverse covariance (n, 3, 3) of each record, 1/mm^2.

        ``variances`` (2,), mm^2, of encoders and gauges, instead of the stated ones.
        """
        noise = self.problem.noise
        if variances is not None:
            encoder, gauge = np.sqrt(variances)
            noise = replace(noise, encoder_mm=float(encoder), gauge_mm=float(gauge))
        return record_weights(self.by_joints, noise)

    def system(self, centring: NuisanceElimination) -> ReducedSystem:
        """The linear problem under some weights."""
        return centring.system(self.residuals, self.jacobian)

    def active_prior(self) -> Array:
        """Precision (p, p), 1/mm^2, of the prior in the directions in which the fit used it.

        Where the prior's covariance is the identity, the precision of the result less the information
        of the data has only the eigenvalues 1 (used) and 0 (released), up to rounding.
        """
        information = self.system(NuisanceElimination(self.problem, self.weights())).information()
        factor = np.linalg.cholesky(self.problem.prior.covariance)
        share, directions = np.linalg.eigh(
            factor.T @ (np.linalg.inv(self.covariance) - information) @ factor
        )
        back = np.linalg.solve(factor.T, directions[:, share > 0.5])
        return back @ back.T
