"""A machine with systematic effects, moved by the forward kinematics of what it really is.

The effects change its geometry from pose to pose. Nothing here is propagated to first order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.uncertainty import UncertaintySettings
from hexacell.identification.diagnostics.frame_alignment import FrameFit, pose_errors
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.forward import forward_kinematics
from hexacell.kinematics.geometry import Geometry, GeometryBatch
from hexacell.kinematics.mechanisms.hexaglide import RAILS
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet, Record, deviation_of, joints_of
from hexacell.robot.model import Robot

UM, PPM = 1e-3, 1e-6
HALF_RANGE_MM = 800.0


@dataclass(frozen=True, eq=False)
class ImperfectMachine:
    """A Hexaglide and the causes of its effects, drawn once.

    Attributes:
        scales: (6,) relative errors of the encoders.
        directions: (2, rails) of the rails, rad, horizontally and vertically.
        phases: (2, 2, rails) of the short and the long waves, rad, in these directions.
        sag_mm: depth of the sag.
        ball_mm: (5,) departures from a sphere, by the spherical harmonics of degree 2.
        warmer_k: at work, and by the end of the measuring.
        force_n: (3,) at work.
    """

    robot: Robot
    truth: Geometry
    sizes: UncertaintySettings
    scales: Array
    directions: Array
    phases: Array
    sag_mm: float
    ball_mm: Array
    warmer_k: tuple[float, float]
    force_n: Array

    @classmethod
    def drawn(
        cls, robot: Robot, truth: Geometry, sizes: UncertaintySettings, random: np.random.Generator
    ) -> ImperfectMachine:
        """One machine of many with effects of these sizes."""
        normal = random.standard_normal
        common, each = sizes.common_encoder_scale_um_m, sizes.encoder_scale_um_m
        return cls(
            robot,
            truth,
            sizes,
            scales=PPM * (common * normal() + each * normal(6)),
            directions=1e-3 * sizes.rail_direction_mrad * normal((2, len(RAILS))),
            phases=random.uniform(0.0, 2.0 * np.pi, (2, 2, len(RAILS))),
            sag_mm=UM * sizes.rail_sag_um * float(normal()),
            ball_mm=UM * np.sqrt(1.5) * sizes.ball_roundness_um * normal(5),
            warmer_k=(
                sizes.temperature_at_work_k * float(normal()),
                sizes.temperature_measuring_k * float(normal()),
            ),
            force_n=sizes.load_n * normal(3),
        )

    def records(
        self, planned: MeasurementSet, near: PoseBatch, random: np.random.Generator
    ) -> MeasurementSet:
        """What is measured when the sliders stand as in some records, which are close to ``near``."""
        noise = self.robot.noise
        joints = np.array([record.joints for record in planned.records])
        warmer = self.warmer_k[1] * np.linspace(-0.5, 0.5, len(joints))
        poses = self._poses(joints, near, warmer, np.zeros(3), self._missed(len(joints), random))
        shown = poses.positions + self._oval(poses.rotations)
        shown = shown + noise.gauge_mm * random.standard_normal(shown.shape)
        read = joints + noise.encoder * random.standard_normal(joints.shape)
        zeros: dict[int, Array] = {}
        records: list[Record] = []
        for record, ball, sliders in zip(planned.records, shown, read, strict=True):
            deviation = deviation_of(ball - zeros.setdefault(record.point, ball))
            records.append(replace(record, joints=joints_of(sliders), deviation=deviation))
        return MeasurementSet(tuple(records))

    def largest_error(self, found: Identification, task: Task, random: np.random.Generator) -> float:
        """The largest position error over the task poses, mm, when commanded with what was found."""
        reached = task.reachable(self.robot.belief(found))
        workspace = self._commanded(found, reached.workspace, np.zeros((len(reached.workspace), 6)))
        at_task = self._commanded(found, reached.poses, self._missed(len(reached.poses), random))
        fit = FrameFit(reached.workspace, float(self.robot.mechanism.platform_radius(self.truth)))
        errors = pose_errors(fit.aligned(workspace, at_task), reached.poses)
        return float(np.linalg.norm(errors[:, :3], axis=-1).max())

    def _commanded(self, found: Identification, poses: PoseBatch, missed: Array) -> PoseBatch:
        joints = self.robot.mechanism.inverse(found.geometry, self.robot.branch, poses)
        return self._poses(joints, poses, np.full(len(poses), self.warmer_k[0]), self.force_n, missed)

    def _missed(self, stops: int, random: np.random.Generator) -> Array:
        return UM * self.sizes.stop_repeatability_um * random.standard_normal((stops, 6))

    def _poses(
        self, shown: Array, near: PoseBatch, warmer: Array, force: Array, missed: Array
    ) -> PoseBatch:
        """Where it stands when its encoders show (n, 6), so much warmer (n,), and under a force."""
        sizes, truth, count = self.sizes, self.truth, len(shown)
        base, platform, legs = (
            1.0 + PPM * expansion * warmer[:, None]
            for expansion in (
                sizes.expansion_base_um_m_k,
                sizes.expansion_platform_um_m_k,
                sizes.expansion_legs_um_m_k,
            )
        )
        joints = shown * (1.0 + self.scales) + missed
        sliders = np.repeat(truth["S"][None], count, axis=0)
        sliders[..., 1:] += self._across(sliders[..., 0] + joints)
        lengths = truth["l"] * legs + self._yield(shown, near, force)
        vectors = np.concatenate(
            [
                sliders.reshape(count, -1) * base,
                truth["B"].reshape(1, -1) * platform,
                lengths,
            ],
            axis=1,
        )
        geometry = GeometryBatch(truth.parameters, vectors)
        moved = forward_kinematics(self.robot.mechanism, geometry, joints * base, near)
        assert moved.found.all()
        return moved.poses

    def _across(self, along: Array) -> Array:
        """Displacements (n, 6, 2) of sliders at (n, 6), mm, horizontally and vertically."""
        sizes = self.sizes
        waves = (
            (UM * sizes.rail_wave_short_um, sizes.rail_wave_short_mm),
            (UM * sizes.rail_wave_long_um, sizes.rail_wave_long_mm),
        )
        rail_of = np.array([next(n for n, legs in enumerate(RAILS) if leg in legs) for leg in range(6)])
        across = along[..., None] * self.directions[:, rail_of].T
        for (amplitude, length), phases in zip(waves, self.phases, strict=True):
            across += amplitude * np.sin(2.0 * np.pi * along[..., None] / length + phases[:, rail_of].T)
        across[..., 1] += self.sag_mm * (along / HALF_RANGE_MM) ** 2
        return across

    def _yield(self, joints: Array, poses: PoseBatch, force: Array) -> Array:
        """Changes (n, 6) of the legs, mm, under the forces that hold the platform."""
        jacobian = self.robot.mechanism.residual_and_jacobian(self.truth, poses, joints)[1]
        wrench = np.tile(np.concatenate([force, np.zeros(3)])[:, None], (len(joints), 1, 1))
        holding = np.linalg.solve(np.swapaxes(jacobian, -1, -2), wrench)[..., 0]
        shortened: Array = UM * self.sizes.leg_compliance_um_n * holding
        return shortened

    def _oval(self, rotations: Array) -> Array:
        """Errors (n, 3) of readings, mm; plates touch where base x, y, z are on the platform."""
        x, y, z = np.moveaxis(rotations, -1, 0)
        harmonics = [x * y, y * z, z * x, 0.5 * (x * x - y * y), (3.0 * z * z - 1.0) / np.sqrt(12.0)]
        errors: Array = np.tensordot(self.ball_mm, np.array(harmonics), axes=1)
        return errors
