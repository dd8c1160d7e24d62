"""The limits of motion that a cell file states, as the mathematics uses them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hexacell.cell.limits import LimitSettings
from hexacell.cell.model import CellSettings
from hexacell.controller_config.interface import ControllerGeometry, JointRanges
from hexacell.errors import ReachError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.mechanism import Branch, FrameTransform, Mechanism
from hexacell.kinematics.pose import PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.limits.gauge_travel import GaugeTravel
from hexacell.limits.leg_limits import LegLimits
from hexacell.limits.limits import AxisLimits, Limits

NO_CONE_DEG = 180.0


def stated_limits(settings: CellSettings, controller: ControllerGeometry, frames: FrameTransform) -> Limits:
    """The limits of a cell; ``frames`` are from the controller's to the convention's.

    Joint ranges that the controller's config states hold as well.
    """
    limits = settings.limits
    lowest, highest = _joint_ranges(limits, controller.joint_ranges)
    return Limits(
        limits.gauge_travel_mm,
        float(np.radians(limits.tilt_deg)),
        lowest,
        highest,
        limits.singularity_margin,
        frames,
        float(np.radians(limits.turn_deg)),
        _axis_limits(limits),
        _leg_limits(settings, controller),
        gauge_travel_of(settings),
    )


def gauge_travel_of(settings: CellSettings) -> GaugeTravel:
    """The travels of a cell's gauges."""
    x, y, z = sorted(settings.gauges, key=lambda gauge: gauge.axis)
    return GaugeTravel(
        settings.limits.gauge_travel_mm,
        (x.travel_mm / 2.0, y.travel_mm / 2.0, z.travel_mm / 2.0),
        (x.middle_coordinate_mm, y.middle_coordinate_mm, z.middle_coordinate_mm),
        settings.stations.mounting_mm,
    )


def _joint_ranges(limits: LimitSettings, of_controller: JointRanges | None) -> tuple[Array, Array]:
    """The narrowest of the stated ranges: (6,) lowest and (6,) highest, in their unit."""
    lowest, highest = np.full(6, limits.joint_min), np.full(6, limits.joint_max)
    for ranges in (limits.joints, of_controller):
        if ranges is not None:
            low, high = np.transpose(ranges)
            lowest, highest = np.maximum(lowest, low), np.minimum(highest, high)
    return lowest, highest


def _axis_limits(limits: LimitSettings) -> AxisLimits:
    ranges = [(-np.inf, np.inf) if axis is None else axis for axis in limits.axes.ranges]
    lowest, highest = zip(*ranges, strict=True)
    return AxisLimits(lowest, highest)


def _leg_limits(settings: CellSettings, controller: ControllerGeometry) -> LegLimits | None:
    """What passive joints and legs allow; none if the cell states nothing of them."""
    stated, distance = settings.limits.passive_joints, settings.limits.leg_distance_mm
    if distance == 0.0 and min(stated.base_cones + stated.platform_cones) >= NO_CONE_DEG:
        return None
    mechanism = settings.mechanism
    drawing = Geometry.of(mechanism.parameters, settings.robot.nominal.model_dump())
    legs = _legs_in_the_middle(settings, mechanism, drawing, controller.branch)
    frames = mechanism.normalize_frames(drawing)[1]
    base = _unit(legs.directions_in_carriers[0] if stated.base_axes is None else stated.base_axes)
    platform = legs.directions_in_platform[0] if stated.platform_axes is None else stated.platform_axes
    return LegLimits(
        base @ frames.base.T if legs.carriers is None else base,
        _unit(platform) @ frames.platform.T,
        np.radians(stated.base_cones),
        np.radians(stated.platform_cones),
        distance,
    )


def _legs_in_the_middle(
    settings: CellSettings, mechanism: Mechanism, drawing: Geometry, branch: Branch
) -> Legs:
    """The legs of the untilted robot as drawn in the middle of its points and task poses within reach."""
    tasks = [pose[:3] for pose in settings.task.poses]
    points = np.array([*settings.identification.points, *settings.verification.points, *tasks])
    every = PoseBatch(points, np.broadcast_to(np.eye(3), (len(points), 3, 3)))
    reached = points[np.isfinite(mechanism.inverse(drawing, branch, every)).all(axis=-1)]
    if not len(reached):
        raise _no_axes("the robot as drawn reaches none of the points of this cell")
    # The median: one point that is far from the others hardly moves it.
    middle = PoseBatch.at(np.median(reached, axis=0), np.eye(3)[None])
    joints = mechanism.inverse(drawing, branch, middle)
    if np.isnan(joints).any():
        raise _no_axes(f"the robot as drawn cannot reach {middle.pose(0)}, the middle of all points")
    return mechanism.legs(drawing, middle, joints)


def _no_axes(problem: str) -> ReachError:
    return ReachError(
        f"the axes of the passive joints are not known: {problem}",
        subject="[limits.passive_joints]",
        action="State base_axes and platform_axes there, or correct the points",
    )


def _unit(vectors: ArrayLike) -> Array:
    given = np.asarray(vectors, dtype=float)
    unit: Array = given / np.linalg.norm(given, axis=-1, keepdims=True)
    return unit
