"""A robot of the mechanism under test, and poses in which it is tested."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexacell.identification.problem.prior import Tolerances
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism, with_coordinates
from hexacell.kinematics.pose import FrameTransform, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import singularity_margin

ROBOTS = 5
TURNS = 11
TRIES = 200
LEAST_MARGIN = 0.02
"""Least singularity margin: next to a singularity no derivative can be compared."""


@dataclass(frozen=True, eq=False)
class MechanismExample:
    """A robot as drawn, and where it works.

    Attributes:
        mechanism: under test.
        drawing: in any frames; its platform is untilted where the rotation is the identity.
        branch: of the robot; empty for a mechanism without.
        points: positions (m, 3) of the ball, mm, five or more of them, not all in one plane.
        tolerances: half-widths of the parameters by the symbols of their kinds, in their units.
        tilt_deg: the largest angles a, b, c.
    """

    mechanism: Mechanism
    drawing: Geometry
    branch: Branch
    points: Array
    tolerances: Mapping[str, float]
    tilt_deg: float = 20.0

    def __post_init__(self) -> None:
        with_coordinates(self.mechanism)

    @cached_property
    def widths(self) -> Tolerances:
        """The tolerances of the drawing."""
        return Tolerances(self.tolerances)

    def robots(self) -> Iterator[Geometry]:
        """The drawing, and robots built within its tolerances, in the drawing's frames."""
        yield self.drawing
        random, parameters = np.random.default_rng(1), self.mechanism.parameters
        widths = self.widths.widths(parameters)
        for _ in range(ROBOTS):
            yield Geometry(parameters, self.drawing.vector + random.uniform(-widths, widths))

    @cached_property
    def poses(self) -> PoseBatch:
        """Poses of the drawing's robot, the same number at each point, clear of singularities."""
        random = np.random.default_rng(2)
        return PoseBatch.joined([self._poses_at(point, random) for point in self.points])

    def joints(self, geometry: Geometry, poses: PoseBatch | None = None) -> Array:
        """Joint variables (n, J) of a robot at the poses."""
        at = self.poses if poses is None else poses
        return self.mechanism.inverse(geometry, self.branch, at)

    def robots_in_reach(self) -> Iterator[tuple[Geometry, PoseBatch, Array]]:
        """Each of the robots with the poses (n,) that it reaches, and its joint variables (n, J) there."""
        for geometry in self.robots():
            poses = self.mechanism.completed(geometry, self.poses)
            joints = self.joints(geometry, poses)
            reached = np.flatnonzero(np.isfinite(joints).all(axis=-1))
            yield geometry, poses[reached], joints[reached]

    def changes_of_frames(self) -> Iterator[FrameTransform]:
        """Changes that the mechanism's parameters can express: each axis alone, and all together."""
        columns = self.mechanism.frame_freedom.columns
        sizes = np.repeat([40.0, 0.3, 0.2], 3)
        for column in columns:
            yield _change(np.where(np.arange(9) == column, sizes, 0.0))
        yield _change(np.where(np.isin(np.arange(9), columns), sizes, 0.0))

    def _poses_at(self, point: Array, random: np.random.Generator) -> PoseBatch:
        """Level, then at random orientations."""
        limit = np.radians(self.tilt_deg)
        angles = np.concatenate([np.zeros((1, 3)), random.uniform(-limit, limit, (TRIES, 3))])
        drawn = PoseBatch.at(np.asarray(point, dtype=float), rotations.from_angles(angles))
        poses = self.mechanism.completed(self.drawing, drawn)
        poses = poses[np.flatnonzero(np.isfinite(self.joints(self.drawing, poses)).all(axis=-1))]
        margins = singularity_margin(self.mechanism, self.drawing, poses, self.joints(self.drawing, poses))
        clear = np.flatnonzero(margins > LEAST_MARGIN)[:TURNS]
        assert len(clear) == TURNS, f"the drawing's robot reaches too few orientations at the point {point}"
        return poses[clear]


def _change(parts: Array) -> FrameTransform:
    """A shift, mm, a turn of the base frame and one of the platform frame, rad (9,)."""
    return FrameTransform(rotations.from_vector(parts[3:6]), parts[:3], rotations.from_vector(parts[6:]))
