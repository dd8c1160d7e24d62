"""Facts about a design as a whole: each is said once, not of every pose that it makes impossible.

Stated poses are those of the cell file: points, held-out points, task poses and seats. A limit that most
of them exceed, and that they would keep if it were in metres or radians, is such a fact. If most cannot be
taken for another reason, other designs are tried that differ in one thing: the branch, the order of the
joints on the platform, the unit of points or drawing. What lets the robot take nearly all poses is what is
said. Last come a design that is singular wherever it can go, and poses that are all out of reach.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import combinations, product
from typing import cast

import numpy as np

from hexacell.campaign.feasibility import broken_limits
from hexacell.campaign.pose_list import pose_list_of
from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.config.interface import ControllerGeometry
from hexacell.config.layout import controller_geometry
from hexacell.errors import FileError, HexacellError, ReachError, UsageError, joined
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.legs import Legs
from hexacell.kinematics.mechanism import Branch
from hexacell.kinematics.parameters import MachinePart, ParameterUnit, each_of
from hexacell.kinematics.pose import AXES, Pose, PoseBatch
from hexacell.kinematics.rotations import Array, Mask, from_angles
from hexacell.kinematics.sensitivity import has_singularity_margin, singularity_margin
from hexacell.lengths import MM_PER_METRE
from hexacell.robot.model import Robot, make_robot, robot_of
from hexacell.robot.same_robot import reordered
from hexacell.services import other_units
from hexacell.storage.toml_document import KeyPath

StatedPose = tuple[KeyPath, str, Pose]
"""Place of a pose in the cell file, its use, and the pose itself."""

NEARLY_ALL = 0.9
"""Share of the stated poses that a design without the mistake can take."""

POINTS_SHARE = 5e-3
"""Share of the largest length of the drawing below which all points are not in millimetres."""

SMALLEST_MACHINE_MM = 10.0
"""A drawing whose lengths are all smaller is not in millimetres."""

NEAR_TILT_DEG = 15.0
"""Tilts at which a design is tried that is singular at the stated poses."""

ALIKE_SHARE = 0.01
"""Share of the platform's size by which hexagons that are similar differ at most, and common joints."""

SHIFTS = 40
"""Shifts of all poses along an axis, either way, of a twentieth of the machine's size each."""


def stated_poses(settings: CellSettings, *, has_list: bool) -> Iterator[StatedPose]:
    """All poses that a cell file states; a list of poses takes the place of the identification points."""
    for n, point in enumerate(() if has_list else settings.identification.points):
        yield ("identification", "points", n), f"identification point {n + 1}", Pose(*point)
    for n, point in enumerate(settings.verification.points):
        yield ("verification", "points", n), f"verification point {n + 1}", Pose(*point)
    for n, pose in enumerate(settings.task.poses):
        yield ("task", "poses", n), f"task pose {n + 1}", Pose(*pose)
    if (fixture := settings.length_check) is not None:
        yield ("length_check", "first_seat"), "the first seat", Pose(*fixture.first_seat)
        yield ("length_check", "distance_mm"), "the second seat", Pose(*fixture.second_seat)


def require_design(cell: Cell) -> None:
    """Raise ``FileError`` for a design that is wrong as a whole, ``SeveralErrors`` if in several ways."""
    if facts := [*design_facts(cell)]:
        raise joined(f"{cell.path} has {len(facts)} mistakes", facts)


def design_facts(cell: Cell) -> Iterator[HexacellError]:
    """What is wrong with a design as a whole; raises ``FileError`` as ``robot_of`` does."""
    stated = stated_poses(cell.settings, has_list=pose_list_of(cell) is not None)
    commands = PoseBatch.of(pose for _, _, pose in stated)
    if (turned := other_units.task_in_radians(cell)) is not None:
        yield turned
    corrected = cell
    for asked in other_units.asked_of_limits(
        cell, robot_of(other_units.without_leg_limits(cell)), commands
    ):
        if asked.is_in_other_unit:
            corrected = asked.corrected_in(corrected)
            yield other_units.limit_in_other_unit(cell, asked)
    yield from _whole_design(corrected, commands)


def _whole_design(cell: Cell, commands: PoseBatch) -> Iterator[FileError]:
    """What is wrong with a design that cannot take most stated poses, limits in other units apart."""
    settings, controller = cell.settings, controller_geometry(cell)
    stands = _can_stand(settings, controller, commands)
    if (in_metres := _points_in_metres(cell, controller, commands)) is not None:
        yield in_metres
        return
    if stands.mean() > other_units.MOST:
        return
    robot = robot_of(other_units.without_leg_limits(cell))
    singular, is_explained = _singular_everywhere(cell, robot, commands)
    if singular is not None and is_explained:
        yield singular
        return
    count = f"{int(stands.sum())} of {len(stands)} stated poses"
    for fact, other_settings, other_controller in _others(cell, controller):
        better = _can_stand(other_settings, other_controller, commands)
        if better.mean() >= NEARLY_ALL:
            fact.problem = f"{fact.problem}: now the robot can take {count}, then {int(better.sum())}"
            yield fact
            return
    if singular is not None:
        yield singular
    elif not stands.any():
        pose = Pose(*commands[[0]].numbers()[0].tolist())
        reason = next(broken_limits(robot, pose), "a passive joint or a leg is beyond its limits")
        yield FileError(
            f"all {len(commands)} stated poses are out of reach; the first, {pose}: {reason}",
            subject=cell.path,
            line=cell.document.line_of(("identification", "points")),
            action=_way_into_reach(cell, robot, commands),
        )


def _points_in_metres(cell: Cell, controller: ControllerGeometry, commands: PoseBatch) -> FileError | None:
    """That the points are in metres: all are near the origin, and in millimetres the robot takes them."""
    far_mm = float(np.median(np.linalg.norm(commands.positions, axis=-1)))
    in_mm = PoseBatch(MM_PER_METRE * commands.positions, commands.rotations)
    if not 0.0 < far_mm < POINTS_SHARE * other_units.size_mm_of(cell.settings.drawing):
        return None
    if _can_stand(other_units.without_leg_limits(cell).settings, controller, in_mm).mean() < NEARLY_ALL:
        return None
    return FileError(
        f"the points look like metres: most are {far_mm:.3g} mm from the origin of the base",
        subject=cell.path,
        line=cell.document.line_of(("identification", "points")),
        action="Write millimetres",
    )


def _others(
    cell: Cell, controller: ControllerGeometry
) -> Iterator[tuple[FileError, CellSettings, ControllerGeometry]]:
    """What may be wrong, and the design without that."""
    settings, parameters = cell.settings, cell.settings.mechanism.parameters
    legs = settings.mechanism.joint_count
    for signs in cast("Iterable[Branch]", product((1, -1), repeat=legs) if controller.branch else ()):
        if signs != controller.branch:
            stated, other = (" ".join(map(str, one)) for one in (controller.branch, signs))
            fact = FileError(
                f"branch is {stated}, and with {other} the legs would be on their other sides",
                subject=cell.config_path,
                action="Correct branch in the controller's config",
            )
            yield fact, settings, replace(controller, branch=signs)
    on_platform = (kind for kind in parameters.kinds if kind.part is MachinePart.PLATFORM)
    of_platform = tuple(kind.symbol for kind in on_platform if kind.owners == each_of(legs))
    orders = [*product(range(legs), (1, -1))][1:] if of_platform else []
    for first, way in orders:  # begun elsewhere, or the other way round
        order = tuple((first + way * n) % legs for n in range(legs))
        fact = _of_drawing(
            cell,
            "the joints on the platform are in another order than the legs: they would fit in the order "
            + " ".join(str(leg + 1) for leg in order),
            "Leg 1 is the same leg in all lists, of the drawing and of the config: correct them",
        )
        drawn = reordered(settings.drawing, of_platform, order)
        commanding = replace(controller, geometry=reordered(controller.geometry, of_platform, order))
        yield fact, _drawn_as(settings, drawn), commanding
    if (size_mm := other_units.size_mm_of(settings.drawing)) < SMALLEST_MACHINE_MM:
        problem = f"the drawing looks like metres: {size_mm:g} is its largest length"
        lengths = parameters.by_kind(
            {one.symbol: MM_PER_METRE if one.unit is ParameterUnit.MM else 1.0 for one in parameters.kinds}
        )
        drawn = Geometry(parameters, lengths * settings.drawing.vector)
        in_config = Geometry(parameters, lengths * controller.geometry.vector)
        fact = _of_drawing(cell, problem, "Write millimetres, or state unit_mm in the config's options")
        yield fact, _drawn_as(settings, drawn), replace(controller, geometry=in_config)


def _drawn_as(settings: CellSettings, drawing: Geometry) -> CellSettings:
    nominal = type(settings.robot.nominal).model_validate(drawing.document(), strict=False)
    return settings.model_copy(update={"robot": settings.robot.model_copy(update={"nominal": nominal})})


def _of_drawing(cell: Cell, problem: str, action: str) -> FileError:
    line = cell.document.line_of(("robot", "nominal"))
    return FileError(problem, subject=cell.path, line=line, action=action)


def _can_stand(settings: CellSettings, controller: ControllerGeometry, commands: PoseBatch) -> Mask:
    """Which of n commands a controller can take with its robot as drawn, within all limits."""
    nobody: Mask = np.zeros(len(commands), dtype=bool)
    try:
        robot = make_robot(settings, controller)
    except (ReachError, UsageError):
        return nobody
    poses = robot.frames.poses(commands)
    joints = robot.mechanism.inverse(robot.commanding, robot.branch, poses)
    stands = robot.limits.allow_commands(poses) & robot.limits.allow_joints(joints)
    arguments = robot.mechanism, robot.commanding, poses[stands], joints[stands]
    stands[stands] = has_singularity_margin(*arguments, robot.limits.singularity_margin)
    at, there = poses[stands], joints[stands]
    stands[stands] = robot.limits.allow_legs(robot.mechanism, robot.commanding, at, there)
    return stands


def _singular_everywhere(cell: Cell, robot: Robot, commands: PoseBatch) -> tuple[FileError | None, bool]:
    """That the robot is next to a singularity wherever it goes near the poses; whether it says why."""
    tilts = np.radians(NEAR_TILT_DEG) * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
    near = PoseBatch.joined(
        [PoseBatch(commands.positions, commands.rotations @ from_angles(tilt)) for tilt in tilts]
    )
    poses = robot.frames.poses(near)
    joints = robot.mechanism.inverse(robot.commanding, robot.branch, poses)
    reached = np.flatnonzero(np.isfinite(joints).all(axis=-1))
    if not len(reached):
        return None, False
    poses, joints = poses[reached], joints[reached]
    largest = float(singularity_margin(robot.mechanism, robot.commanding, poses, joints).max())
    limit = robot.limits.singularity_margin
    if largest >= limit:
        return None, False
    why = _cause_of_singularity(robot.mechanism.legs(robot.commanding, poses, joints))
    problem = f"the design is singular everywhere: {largest:.2g} is the largest margin, {limit:g} the least"
    action = "Change the joints in the drawing, or the design; no calibration helps"
    return _of_drawing(cell, f"{problem}{why}", action), bool(why)


def _cause_of_singularity(legs: Legs) -> str:
    """Why a design is singular, as the end of a sentence; empty if that is not known."""
    base, platform = legs.base_joints[0], legs.platform_joints[0]
    size = float(np.linalg.norm(platform - platform.mean(axis=0), axis=-1).max())
    for one, other in combinations(range(len(base)), 2):
        apart = np.linalg.norm([base[one] - base[other], platform[one] - platform[other]], axis=-1)
        if (apart < ALIKE_SHARE * size).all():
            return f"; legs {one + 1} and {other + 1} have both joints in common"
    is_similar = _similarity(base, platform) < ALIKE_SHARE
    return "; the hexagons of base and platform are similar" if is_similar else ""


def _similarity(base: Array, platform: Array) -> float:
    """How far joints (6, 3) are from the other part's once these are moved and scaled, as a share."""
    from scipy.linalg import orthogonal_procrustes  # noqa: PLC0415 - only of a design that is singular

    one, other = (part - part.mean(axis=0) for part in (base, platform))
    one *= np.linalg.norm(other) / np.linalg.norm(one)
    return float(np.abs(one @ orthogonal_procrustes(one, other)[0] - other).max() / np.abs(other).max())


def _way_into_reach(cell: Cell, robot: Robot, commands: PoseBatch) -> str:
    """What brings all poses into reach: other limits of legs, or the shortest way along an axis."""
    settings, controller = other_units.without_leg_limits(cell).settings, controller_geometry(cell)
    if _can_stand(settings, controller, commands).mean() >= NEARLY_ALL:
        return "Correct [limits.passive_joints] or leg_distance_mm: without them the robot takes them"
    step = other_units.size_mm_of(robot.drawing) / (SHIFTS / 2)
    ways = (number * sign * step for number in range(1, SHIFTS + 1) for sign in (1.0, -1.0))
    for way, axis in product(ways, (2, 1, 0)):
        moved = PoseBatch(commands.positions + way * np.eye(3)[axis], commands.rotations)
        if _can_stand(settings, controller, moved).mean() >= NEARLY_ALL:
            return f"Move them all by some {way:+.0f} mm along {AXES[axis]}: there the robot takes them"
    return "Correct points, drawing, or limits"
