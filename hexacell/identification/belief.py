"""What is known of the robot at one moment, and the limits it must keep."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from hexacell.identification.problem.problem import Noise
from hexacell.kinematics.commanded_motion import CommandedRobot
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.rotations import Array


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits that every commanded pose keeps: mm and rad; the singularity margin is dimensionless."""

    gauge_travel_mm: float
    tilt: float
    joint_min_mm: float
    joint_max_mm: float
    singularity_margin: float


@dataclass(frozen=True, eq=False)
class RobotBelief:
    """The estimate and its covariance beside the geometry that the controller commands with.

    All geometries are in the mechanism's frame convention.

    Attributes:
        free: estimated free parameters (p,), mm.
        covariance: theirs (p, p), mm^2.
    """

    mechanism: Mechanism
    controller: Geometry
    branch: Branch
    free: Array
    covariance: Array
    noise: Noise
    limits: Limits

    @property
    def basis(self) -> Array:
        """(P, p), from free parameters to all of them."""
        return self.mechanism.convention.basis()

    @cached_property
    def estimate(self) -> Geometry:
        """The estimated geometry."""
        return self.mechanism.convention.geometry(self.free)

    @cached_property
    def commanded(self) -> CommandedRobot:
        """The estimated robot under its controller."""
        return CommandedRobot(self.mechanism, self.branch, self.controller, self.estimate)
