"""Robots drawn within the bundled cell's tolerances, the records that they give, and how well one is known.

Poses are chosen in three ways: by this program, one after another; at random, commanded at the point
itself and kept where the gauges still show them; and at random over all tilts, aimed so that the gauges
show them with the true geometry, which nobody has before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.loader import Cell
from hexacell.errors import LimitError
from hexacell.identification.diagnostics.frame_alignment import FrameFit, pose_errors
from hexacell.kinematics import rotations
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import has_singularity_margin
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot, robot_of
from hexacell.study.data_sets import DataSet, unlimited_travel
from tests.benchmarks.machines import with_aligned_gauges
from tests.benchmarks.virtual_calibration import robot_that_reaches
from tests.records_within_travel import within_travel
from tests.simulated_campaign import SimulatedCampaign

SEED = 18
HELD_OUT = 100
HELD_OUT_TILT_DEG = 30.0
RANDOM_DEG, DRAWN = 5.0, 200
"""Each of three angles of random orientations, and how many are drawn at a point."""
ORIENTATIONS = 11
"""At each point, in whatever way poses are chosen."""


@dataclass(frozen=True)
class Records:
    """Measurements of one Hexaglide, mm and rad, in the frames of the paper's convention.

    Attributes:
        drawing: S (6, 3), B (6, 3) and l (6) in a row (42,), where every method starts.
        basis: (42, 35), from the free parameters of the convention to all.
        branch: (6,) of each leg, along its rail, -1 or 1.
        points: (n,) at which point a record was taken, from 0, ascending.
        joints: (n, 6) by the encoders.
        deviations: (n, 3) by the gauges.
        positions: (n, 3) of the ball as commanded, which close the drawing at the joints up to noise.
        rotations: (n, 3, 3) of the platform as commanded.
        full_positions: (n, 3) by an instrument that measures whole poses in the frames of the convention.
        full_rotations: (n, 3, 3) likewise.
        encoder_mm: noise of a joint, one standard deviation.
        gauge_mm: of a deviation.
    """

    drawing: Array
    basis: Array
    branch: Array
    points: NDArray[np.intp]
    joints: Array
    deviations: Array
    positions: Array
    rotations: Array
    full_positions: Array
    full_rotations: Array
    encoder_mm: float
    gauge_mm: float

    @property
    def free(self) -> Array:
        """The drawing's free parameters (35,)."""
        found: Array = np.linalg.lstsq(self.basis, self.drawing)[0]
        return found

    @property
    def first_positions(self) -> Array:
        """(m, 3) where the first record of each point was commanded."""
        return self.positions[np.unique(self.points, return_index=True)[1]]


Solve = Callable[[Records], Array]
"""A peer: the geometry (42,) that it identifies. It raises ``ArithmeticError`` where it finds none."""


@dataclass(frozen=True, eq=False)
class StudiedRobot:
    """One robot, by its number."""

    cell: Cell
    robot: Robot
    truth: Geometry
    number: int

    @classmethod
    def drawn(cls, number: int) -> StudiedRobot:
        """One that can stand at all points as its controller sends it there.

        Its controller keeps the drawing while measuring, from which peers start.
        """
        cell = with_aligned_gauges()
        identification = cell.settings.identification.model_copy(update={"provisional": False})
        cell = replace(cell, settings=cell.settings.model_copy(update={"identification": identification}))
        robot = robot_of(cell)
        truth = robot_that_reaches(cell, robot, np.random.default_rng([SEED, number]))
        return cls(cell, robot, truth, number)

    def chosen(self) -> MeasurementSet:
        """Records of a whole campaign.

        Raises:
            HexacellError: it comes to no end.
        """
        random = np.random.default_rng([SEED, self.number, 1])
        campaign = SimulatedCampaign(self.cell.settings, self.robot, self.truth, random)
        campaign.carry_out()
        return campaign.measurements

    def random(self) -> MeasurementSet:
        """Records in random orientations that stay within the travel.

        Raises:
            HexacellError: too few poses can be reached.
        """
        random = np.random.default_rng([SEED, self.number, 2])
        amplitude = float(np.radians(RANDOM_DEG))
        drawn = unlimited_travel(self.robot, self.truth, self._points, DRAWN, amplitude, random)
        first = np.searchsorted(drawn.labels[:, 0], drawn.labels[:, 0])
        moved = np.abs(drawn.positions - drawn.positions[first]).max(axis=1)
        shown = np.flatnonzero(moved <= self.robot.limits.gauge_travel_mm)
        rows = [
            shown[drawn.labels[shown, 0] == point][:ORIENTATIONS] for point in np.unique(drawn.labels[:, 0])
        ]
        if min(map(len, rows)) < ORIENTATIONS:
            raise LimitError(f"fewer than {ORIENTATIONS} of {DRAWN} orientations stay within the travel")
        chosen = np.concatenate(rows)
        some = (drawn.labels[chosen], drawn.commands[chosen], drawn.joints[chosen], drawn.positions[chosen])
        return DataSet(*some).measured(self.robot.noise.gauge_mm, random)

    def aimed(self) -> MeasurementSet:
        """Records in random orientations over all tilts, aimed with the truth.

        Raises:
            HexacellError: too few poses can be reached.
        """
        random = np.random.default_rng([SEED, self.number, 5])
        tilt = self.robot.limits.tilt
        drawn = within_travel(self.robot, self.truth, self._points, ORIENTATIONS, tilt, random)
        return drawn.measured(self.robot.noise.gauge_mm, random)

    @property
    def _points(self) -> Array:
        return np.array(self.cell.settings.identification.points)

    def records(self, measured: MeasurementSet) -> Records:
        """Measurements as arrays, in the frames of the convention."""
        problem, robot = self.robot.problem(measured), self.robot
        sizes = np.diff([*problem.first_rows, problem.records])
        by_label = {record.id: record for record in measured.records}
        ordered = [by_label[point, turn] for point, turn in problem.labels.tolist()]
        poses = robot.from_commands(record.pose for record in ordered)
        actual = robot.commanded(self.truth).actual_poses(poses).poses
        random = np.random.default_rng([SEED, self.number, 3])
        mm = robot.noise.gauge_mm
        shifts, turns = mm * random.standard_normal((2, problem.records, 3))
        turns /= robot.mechanism.platform_radius(robot.drawing)
        return Records(
            drawing=problem.geometry(problem.prior.free).vector,
            basis=problem.basis,
            branch=np.asarray(robot.branch, dtype=float),
            points=np.repeat(np.arange(problem.points), sizes),
            joints=problem.joints,
            deviations=problem.deviations,
            positions=poses.positions,
            rotations=poses.rotations,
            full_positions=actual.positions + shifts,
            full_rotations=rotations.from_vector(turns) @ actual.rotations,
            encoder_mm=robot.noise.encoder,
            gauge_mm=mm,
        )

    def errors_mm(self, geometry: Array) -> Array:
        """Position errors (h,) at held-out poses that are commanded with a geometry (42,).

        The frames of both geometries are made to agree first, since they are conventions. Errors are
        infinite where a pose cannot be taken.
        """
        found = Geometry(self.robot.mechanism.parameters, geometry)
        workspace, held_out = self._reached(found, self._workspace), self._reached(found, self._held_out)
        if workspace is None or held_out is None:
            return np.full(HELD_OUT, np.inf)
        fit = FrameFit(self._workspace, float(self.robot.mechanism.platform_radius(self.truth)))
        errors = pose_errors(fit.aligned(workspace, held_out), self._held_out)
        lengths: Array = np.linalg.norm(errors[:, :3], axis=1)
        return lengths

    def _reached(self, found: Geometry, poses: PoseBatch) -> PoseBatch | None:
        """Where the robot goes when commanded to poses with a geometry; none where it cannot take one."""
        joints = self.robot.mechanism.inverse(found, self.robot.branch, poses)
        if not np.isfinite(joints).all():
            return None
        actual = forward_kinematics(self.robot.mechanism, self.truth, joints, poses)
        return actual.poses if actual.found.all() else None

    @cached_property
    def _workspace(self) -> PoseBatch:
        return self._with_margin(Task.of(self.cell.settings, self.robot, self.robot.belief()).workspace)

    @cached_property
    def _held_out(self) -> PoseBatch:
        """Poses between the points, turned at random."""
        random = np.random.default_rng([SEED, self.number, 4])
        positions = random.dirichlet(np.ones(len(self._points)), 20 * HELD_OUT) @ self._points
        tilt = np.radians(HELD_OUT_TILT_DEG)
        turns = rotations.from_vector(random.uniform(-tilt, tilt, (20 * HELD_OUT, 3)) / np.sqrt(3.0))
        return self._with_margin(self.robot.frames.poses(PoseBatch(positions, turns)))[:HELD_OUT]

    def _with_margin(self, poses: PoseBatch) -> PoseBatch:
        """Those that the robot can take, and keep away from singularities in."""
        mechanism = self.robot.mechanism
        joints = mechanism.inverse(self.truth, self.robot.branch, poses)
        rows = np.flatnonzero(np.isfinite(joints).all(axis=1))
        poses, joints = poses[rows], joints[rows]
        margin = self.robot.limits.singularity_margin
        return poses[np.flatnonzero(has_singularity_margin(mechanism, self.truth, poses, joints, margin))]
