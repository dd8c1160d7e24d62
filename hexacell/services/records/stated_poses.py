"""The poses that a cell file states, checked against what its controller's config can take."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from hexacell.campaign import feasibility
from hexacell.campaign.planner import Plan
from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.errors import FileError, HexacellError, joined
from hexacell.kinematics.pose import Pose
from hexacell.storage.toml_document import KeyPath

StatedPose = tuple[KeyPath, str, Pose]
"""Where a pose is in the cell file, what it is for, and the pose itself."""


def require_stated_poses(cell: Cell, plan: Plan) -> None:
    """Check that the controller can take every pose that a cell file states, within the limits.

    Raises:
        FileError: one is out of reach; with its line.
        SeveralErrors: more than one is.
    """
    stated = [*_points(cell.settings, plan), *_other_poses(cell.settings)]
    _require(cell, [*_failures(cell, plan, stated), *_list_failures(plan)])


def require_points(cell: Cell, plan: Plan) -> None:
    """The same for the poses at which the geometry is measured, alone."""
    _require(cell, [*_failures(cell, plan, _points(cell.settings, plan)), *_list_failures(plan)])


def _require(cell: Cell, failures: list[HexacellError]) -> None:
    if failures:
        raise joined(f"{cell.path} has {len(failures)} mistakes", failures)


def _points(settings: CellSettings, plan: Plan) -> Iterator[StatedPose]:
    """The identification points; a list of poses takes their place."""
    for n, point in enumerate(settings.identification.points if plan.pose_list is None else ()):
        yield ("identification", "points", n), f"identification point {n + 1}", Pose(*point)


def _other_poses(settings: CellSettings) -> Iterator[StatedPose]:
    for n, point in enumerate(settings.verification.points):
        yield ("verification", "points", n), f"verification point {n + 1}", Pose(*point)
    for n, pose in enumerate(settings.task.poses):
        yield ("task", "poses", n), f"task pose {n + 1}", Pose(*pose)
    if (fixture := settings.length_check) is not None:
        yield ("length_check", "first_seat"), "the first seat", Pose(*fixture.first_seat)
        yield ("length_check", "distance_mm"), "the second seat", Pose(*fixture.second_seat)


def _failures(cell: Cell, plan: Plan, stated: Iterable[StatedPose]) -> Iterator[HexacellError]:
    for path, name, pose in stated:
        for failure in feasibility.pose_failures(plan, name, pose):
            yield FileError(
                f"{name}: {failure.problem}",
                subject=cell.path,
                line=cell.document.line_of(path),
                action=failure.action or "Move it into the reach of the robot, or correct the limits",
            )


def _list_failures(plan: Plan) -> Iterator[HexacellError]:
    """Poses of a list, which is a file of its own."""
    if plan.pose_list is not None:
        yield from feasibility.reach_failures(plan)
