"""A first level of identification: the zeros of the encoders alone, all else as the controller has it.

The zeros z change the free parameters by ``D z``. All parameters are estimated as ever: by that estimate x
the data and the model are tested. Those zeros are taken with which the poses of the records err least:

    minimize  |J (x0 + D z - x)|,    x0 + D z = x0 + G (x - x0),    G = D (J D)^+ J,

with the controller's geometry x0, and the derivatives J of positions and turns (times the platform's
radius) by the parameters, less what changes of the frames explain. With the covariance C of x, and C0 of
the tolerances, which say how wrong the held parameters may be, the result errs by

    G C G^T + H C0 H^T + G C H^T + H C G^T,    H = 1 - G.

This is a Schmidt-Kalman filter with another gain (Jazwinski, Stochastic Processes and Filtering Theory,
1970). Least squares with all else held explain joints that are 2 mm off by zeros that are 18 mm off.
"""

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from hexacell.identification.diagnostics.frame_alignment import frame_derivatives
from hexacell.identification.solver.result import UNDETERMINED_RATIO, Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism, free_parameter_derivatives
from hexacell.kinematics.rotations import Array, Mask

SAME_CHANGE = 1e-6
"""Share of the largest singular value below which a common change of the zeros is one of the frames."""

UNSEEN = 1e-3
"""Share of the largest singular value below which a change of the zeros moves no pose."""


class ParameterChoice(StrEnum):
    """Which parameters are identified."""

    ALL = "all"
    ZEROS = "zeros"


def zero_columns(mechanism: Mechanism, geometry: Geometry) -> Array:
    """Changes (p, k) of the free parameters by the zeros: a basis of them, in the convention's frames.

    There are six zeros, and one less where a change of all together is one of the base frame only.
    """
    normal, _ = mechanism.normalize_frames(geometry)
    by_zeros = free_parameter_derivatives(mechanism, normal).T @ mechanism.encoder_zeros(normal)
    left, sizes, _ = np.linalg.svd(by_zeros, full_matrices=False)
    return np.asarray(left[:, sizes > SAME_CHANGE * sizes[0]])


@dataclass(frozen=True, eq=False)
class HeldParameters:
    """What is identified beside parameters that are held.

    ``columns`` (p, k) are changes of the free parameters by the zeros, ``tolerances`` (p, p) the covariance
    of all free parameters by the drawing, or by an earlier result.
    """

    columns: Array
    tolerances: Array

    def gain(self, errors: Array) -> Array:
        """G (p, p) with which some errors (m, p) by the free parameters are least."""
        return np.asarray(self.columns @ np.linalg.pinv(errors @ self.columns, rcond=UNSEEN) @ errors)

    def covariance(self, gain: Array, estimated: Array) -> Array:
        """Covariance of the result (p, p), by that of the estimate of all parameters."""
        held = np.eye(len(gain)) - gain
        crossing = gain @ estimated @ held.T
        total = gain @ estimated @ gain.T + held @ self.tolerances @ held.T + crossing + crossing.T
        # Where the prior was released, the estimate is a little worse than the tolerances alone say.
        units = np.sqrt(np.diag(self.tolerances))
        scaled = 0.5 * (total + total.T) / np.outer(units, units)
        variances, axes = np.linalg.eigh(scaled)
        return np.asarray(((axes * np.maximum(variances, 0.0)) @ axes.T) * np.outer(units, units))


@dataclass(frozen=True, eq=False)
class IdentifiedZeros:
    """The zeros by the records of an identification.

    Attributes:
        found: the estimate of all parameters, by the same records.
        held: free parameters (p,) that the controller has.
        kept: what is held, with the tolerances that the records were identified with.
    """

    found: Identification
    held: Array
    kept: HeldParameters

    @classmethod
    def of(cls, found: Identification, controller: Geometry) -> "IdentifiedZeros":
        """The zeros beside a controller's geometry in any frames."""
        mechanism = found.problem.mechanism
        normal, _ = mechanism.normalize_frames(controller)
        held = mechanism.convention.free_parameters(normal)
        columns = zero_columns(mechanism, normal)
        return cls(found, held, HeldParameters(columns, found.problem.prior.covariance))

    @cached_property
    def projector(self) -> Array:
        """G (p, p): what becomes of a change of the estimate of all parameters."""
        found = self.found
        radius = float(found.problem.mechanism.platform_radius(found.geometry))
        weights = np.repeat([1.0, radius], 3)[:, None]
        # Derivatives (6 n, p) of the records' poses, rotations times the radius, less those by the frames.
        columns = (weights * found.prediction.pose_jacobian).reshape(-1, len(found.free))
        frames, _ = np.linalg.qr((weights * frame_derivatives(found.poses)).reshape(-1, 9))
        return self.kept.gain(columns - frames @ (frames.T @ columns))

    @cached_property
    def free(self) -> Array:
        """The free parameters (p,) with these zeros."""
        return np.asarray(self.held + self.projector @ (self.found.free - self.held))

    @cached_property
    def free_covariance(self) -> Array:
        """Covariance (p, p) of the free parameters; of what is held it is that of the tolerances."""
        return self.kept.covariance(self.projector, self.found.free_covariance)

    @property
    def geometry(self) -> Geometry:
        """The geometry in the frame convention."""
        return self.found.problem.geometry(self.free)

    @property
    def covariance(self) -> Array:
        """Covariance (P, P) of all parameters."""
        basis = self.found.problem.basis
        return np.asarray(basis @ self.free_covariance @ basis.T)

    @property
    def sigma(self) -> Array:
        """Standard deviations (P,) of all parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters that the zeros change."""
        return self._named(np.abs(self.found.problem.basis @ self.kept.columns).max(axis=1) > SAME_CHANGE)

    @property
    def undetermined(self) -> tuple[str, ...]:
        """The zeros' parameters that the records determine hardly better than the drawing."""
        taken = self.found.problem.basis @ self.projector
        by_noise = np.sqrt(np.diag(taken @ self.found.free_covariance @ taken.T))
        unknown = self._named(by_noise > UNDETERMINED_RATIO * self.found.prior_sigma)
        return tuple(name for name in self.names if name in unknown)

    def _named(self, rows: Mask) -> tuple[str, ...]:
        names = self.found.geometry.parameters.names
        return tuple(names[row] for row in np.flatnonzero(rows))
