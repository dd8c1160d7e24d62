"""Limits that look like metres or radians, and angles of task poses that look like radians.

A limit is taken for one in another unit if most stated poses exceed it and would not in that unit, or by
its digits: 0.785 is 45 deg to its last decimal, and angles are mostly stated as round ones.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hexacell.cell.limits import PassiveJointSettings
from hexacell.cell.loader import Cell
from hexacell.errors import FileError
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import JointUnit, ParameterUnit
from hexacell.kinematics.pose import AXES, PoseBatch
from hexacell.kinematics.rotations import Array
from hexacell.lengths import MM_PER_METRE
from hexacell.robot.model import Robot
from hexacell.storage.toml_document import KeyPath

MOST = 0.5
"""Share of the stated poses."""

DEG_PER_RAD = float(np.degrees(1.0))

SMALL_SHARE = 0.02
"""Share of the largest length of the drawing below which limits are not in millimetres."""

CHANCE_OF_RADIANS = 2e-3
"""Chance of angles that are degrees to be round ones if they were radians; of one limit it is larger."""

CHANCE_OF_ONE = 0.02

ROUND_DEG = (5.0, 1.0)
"""What angles are mostly multiples of."""


@dataclass(frozen=True, slots=True, eq=False)
class AskedOfLimit:
    """A stated limit, and what n stated poses ask of it.

    Attributes:
        path: of the limit in the cell file.
        stated: the limit as text.
        low, high: its ends, of all or of each leg.
        numbers: (n, k) what the poses ask.
        factor: by which it is too small if it is in metres or radians.
        is_small: whether it may be that, by its size or its digits.
        is_round: whether its digits alone prove it.
        ends: the stated numbers, by the fields that have them.
    """

    path: KeyPath
    stated: str
    low: Array | float
    high: Array | float
    numbers: Array
    factor: float
    is_small: bool
    ends: Mapping[str, float]
    is_round: bool = False

    def exceeded(self, factor: float = 1.0) -> float:
        """The share of the poses that exceed it, or exceed so many times as much."""
        at = self.numbers / factor
        return float(((at < self.low) | (at > self.high)).any(axis=-1).mean())

    @property
    def is_in_other_unit(self) -> bool:
        """Whether it is in metres or radians."""
        if self.is_round:
            return True
        exceeded = self.exceeded()
        return self.is_small and exceeded >= MOST and self.exceeded(self.factor) < 0.5 * exceeded

    def corrected_in(self, cell: Cell) -> Cell:
        """The cell with the limit in the right unit."""
        limits = cell.settings.limits
        values = {field: self.factor * value for field, value in self.ends.items()}
        if "axes" in self.path:
            ends = {str(self.path[-1]): (values["min"], values["max"])}
            return _with_limits(cell, axes=limits.axes.model_copy(update=ends))
        if "passive_joints" in self.path:
            return _with_limits(cell, passive_joints=limits.passive_joints.model_copy(update=values))
        return _with_limits(cell, **values)


def asked_of_limits(cell: Cell, robot: Robot, commands: PoseBatch) -> Iterator[AskedOfLimit]:
    """The limits that may be in metres or radians."""
    limits, size_mm = cell.settings.limits, size_mm_of(robot.drawing)

    def length_is_small(*ends: float) -> bool:
        return max(map(abs, ends)) < SMALL_SHARE * size_mm

    nothing = np.zeros(len(commands))  # what they ask of a cone is not known without its axes
    for path, asked in (
        (("limits", "tilt_deg"), commands.tilts()),
        (("limits", "turn_deg"), np.abs(commands.turns())),
        (("limits", "passive_joints", "base_cone_deg"), nothing),
        (("limits", "passive_joints", "platform_cone_deg"), nothing),
    ):
        field, section = path[-1], limits.passive_joints if "passive_joints" in path else limits
        largest = float(np.max(getattr(section, field)))
        small = largest <= np.pi
        is_round = small and _chance_of_radians([largest]) < CHANCE_OF_ONE
        numbers, stated, ends = np.degrees(asked)[:, None], f"{field} = {largest:g}", {field: largest}
        yield AskedOfLimit(path, stated, -np.inf, largest, numbers, DEG_PER_RAD, small, ends, is_round)
    joints = robot.mechanism.inverse(robot.commanding, robot.branch, robot.frames.poses(commands))
    joints = joints[np.isfinite(joints).all(axis=-1)]
    is_angle = robot.mechanism.words.joint_unit is JointUnit.DEG
    factor = DEG_PER_RAD if is_angle else MM_PER_METRE
    if len(joints):
        low, high = limits.joint_min, limits.joint_max
        small = max(-low, high) <= 2.0 * np.pi if is_angle else length_is_small(low, high)
        names = limits.key("joint_min"), limits.key("joint_max")
        stated = f"{names[0]} = {low:g} with {names[1]} = {high:g}"
        ends = {"joint_min": low, "joint_max": high}
        yield AskedOfLimit(("limits", names[1]), stated, low, high, joints, factor, small, ends)
    for n, (axis, of_axis) in enumerate(zip(AXES, limits.axes.ranges, strict=True)):
        if of_axis is not None:
            is_turn = n >= AXES.index("a")
            factor = DEG_PER_RAD if is_turn else MM_PER_METRE
            small = max(map(abs, of_axis)) <= np.pi if is_turn else length_is_small(*of_axis)
            numbers = commands.numbers()[:, [n]]
            path, stated = ("limits", "axes", axis), f"{axis} = [{of_axis[0]:g}, {of_axis[1]:g}]"
            ends = {"min": of_axis[0], "max": of_axis[1]}
            yield AskedOfLimit(path, stated, *of_axis, numbers, factor, small, ends)


def limit_in_other_unit(cell: Cell, asked: AskedOfLimit) -> FileError:
    """That a limit is in metres or radians."""
    unit, wanted = ("radians", "degrees") if asked.factor == DEG_PER_RAD else ("metres", "millimetres")
    evidence = ""
    if exceeded := asked.exceeded():
        then = asked.exceeded(asked.factor)
        evidence = f": {exceeded:.0%} of the stated poses exceed it, and {then:.0%} would if it were {unit}"
    return FileError(
        f"{asked.stated} looks like {unit}{evidence}",
        subject=cell.path,
        line=cell.document.line_of(asked.path),
        action=f"Write {wanted}",
    )


def size_mm_of(drawing: Geometry) -> float:
    """The largest length in a drawing, mm."""
    kinds = (kind for kind in drawing.parameters.kinds if kind.unit is ParameterUnit.MM)
    return max(float(np.abs(drawing[kind.symbol]).max()) for kind in kinds)


def _chance_of_radians(angles: Sequence[float]) -> float:
    """The chance of stated angles that are degrees to become round degrees if they are taken for radians.

    A number is known to half of its last decimal, the longest of all: 0.2618 is 15 deg within 0.003.
    """
    sizes = {abs(angle) for angle in angles if angle}
    if not sizes or max(sizes) > np.pi:
        return 1.0
    decimals = max(len(repr(size).partition(".")[2]) for size in sizes)
    within = max(DEG_PER_RAD * 0.5 * 10.0**-decimals, 1e-9)
    chances = [1.0]
    for step in ROUND_DEG:
        degrees = np.degrees(sorted(sizes))
        if (np.abs(degrees - step * np.round(degrees / step)) <= within).all():
            chances.append(min(1.0, 2.0 * within / step) ** len(sizes))
    return min(chances)


def task_in_radians(cell: Cell) -> FileError | None:
    """That the angles of the task poses are in radians, which no limit shows."""
    angles = [angle for pose in cell.settings.task.poses for angle in pose[3:] if angle]
    if not angles or _chance_of_radians(angles) >= CHANCE_OF_RADIANS:
        return None
    largest = max(angles, key=abs)
    return FileError(
        f"the angles of the task poses look like radians: {largest:g} would be "
        f"{np.degrees(largest):.4g} deg",
        subject=cell.path,
        line=cell.document.line_of(("task", "poses")),
        action="Write degrees",
    )


def _with_limits(cell: Cell, **limits: object) -> Cell:
    changed = cell.settings.limits.model_copy(update=limits)
    return replace(cell, settings=cell.settings.model_copy(update={"limits": changed}))


def without_leg_limits(cell: Cell) -> Cell:
    """Limits of legs and passive joints need a robot that reaches its points."""
    return _with_limits(cell, passive_joints=PassiveJointSettings(), leg_distance_mm=0.0)
