"""Whether all reports of where the robot is agree: reported pose, reported joint variables, encoders.

A controller computes the pose that it reports from its joint variables. Under its own geometry the joint
variables of that pose are therefore those that it has, up to rounding; the encoders agree with both within
what their zeros may be off. If two of the three agree, the third is the odd one:

    pose - joints   joints - encoders   pose - encoders   odd
    differ          agree                                 the pose: another geometry than the one compared
                                                          with, or a forward kinematics that failed
    agree           differ                                the encoders
    differ          differ              agree             the joint variables
    differ          differ              differ            unknown

A pose that the encoders still agree with, but the joint variables do not, is that of a geometry which
differs a little: one that was edited, or not read again.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Branch, Mechanism
from hexacell.kinematics.pose import Pose, PoseBatch
from hexacell.kinematics.rotations import Array


class PositionSource(StrEnum):
    """A report of where the robot is."""

    POSE = "pose"
    JOINTS = "joints"
    ENCODERS = "encoders"


@dataclass(frozen=True, slots=True, eq=False)
class PositionReports:
    """Where the robot is by its controller and by its encoders, at one standstill.

    Attributes:
        pose: by the controller's forward kinematics.
        joints: the controller's joint variables (6,), mm; None where it reports none.
        encoders: joint variables (6,), mm, by the encoders.
    """

    pose: Pose
    joints: Array | None
    encoders: Array


@dataclass(frozen=True, slots=True)
class AgreementTolerances:
    """Differences up to which reports agree, mm.

    Attributes:
        position_mm: of a position that the controller reports.
        encoders: of an encoder from the controller's joint variable.
    """

    position_mm: float
    encoders: float


@dataclass(frozen=True, slots=True)
class PositionMismatch:
    """Reports that do not agree.

    Attributes:
        odd: the one that the two others contradict; None where no two agree.
        leg: the leg, counted from 1, with the largest difference.
        by_pose: its joint variable by the reported pose; None where a leg cannot reach that.
        joint: its joint variable by the controller, and ``encoder`` by its encoder.
        is_pose_near: whether the encoders agree with the reported pose.
    """

    odd: PositionSource | None
    leg: int
    by_pose: float | None
    joint: float | None
    encoder: float
    is_pose_near: bool


def position_mismatch(
    mechanism: Mechanism,
    geometry: Geometry,
    branch: Branch,
    reports: PositionReports,
    tolerances: AgreementTolerances,
) -> PositionMismatch | None:
    """How the reports of where the robot is disagree under the controller's geometry.

    Args:
        mechanism: of the robot.
        geometry: of the controller.
        branch: of each leg.
        reports: at one standstill.
        tolerances: differences up to which reports agree.

    Returns:
        The mismatch at the leg with the largest one; None where the reports agree.
    """
    by_pose, rounding = _joints_of(mechanism, geometry, branch, reports.pose, tolerances.position_mm)
    from_encoders = _excess(by_pose - reports.encoders, rounding + tolerances.encoders)
    odd: PositionSource | None = None
    excess = from_encoders
    if reports.joints is not None:
        from_joints = _excess(by_pose - reports.joints, rounding)
        between = _excess(reports.joints - reports.encoders, np.full(6, tolerances.encoders))
        if _agree(from_joints):
            odd, excess = PositionSource.ENCODERS, between
        elif _agree(between):
            odd, excess = PositionSource.POSE, from_joints
        else:
            odd, excess = PositionSource.JOINTS if _agree(from_encoders) else None, between
    if _agree(excess):
        return None
    leg = int(np.argmax(excess))
    return PositionMismatch(
        odd=odd,
        leg=leg + 1,
        by_pose=float(by_pose[leg]) if np.isfinite(by_pose[leg]) else None,
        joint=None if reports.joints is None else float(reports.joints[leg]),
        encoder=float(reports.encoders[leg]),
        is_pose_near=_agree(from_encoders),
    )


def _joints_of(
    mechanism: Mechanism, geometry: Geometry, branch: Branch, pose: Pose, position_mm: float
) -> tuple[Array, Array]:
    """Joint variables (6,), mm, of a pose, NaN if it is out of reach; what its tolerance does to them."""
    poses = PoseBatch.of([pose])
    joints = mechanism.inverse(geometry, branch, poses)
    derivatives = mechanism.derivatives(geometry, poses, np.nan_to_num(joints))
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = np.linalg.norm(derivatives.pose[0, :, :3], axis=-1) / np.abs(derivatives.joints[0])
    return joints[0], position_mm * np.maximum(1.0, np.nan_to_num(slopes, nan=1.0, posinf=1.0))


def _excess(differences: Array, tolerances: Array) -> Array:
    """Differences (6,) as multiples of their tolerances; infinite for a pose out of reach."""
    return np.nan_to_num(np.abs(differences), nan=np.inf) / tolerances


def _agree(excess: Array) -> bool:
    return bool(excess.max() <= 1.0)
