"""A plan before the run: what it would measure and give, and what a person has taken out of it so far."""

from __future__ import annotations

from dataclasses import dataclass, replace

from hexacell.campaign.removed_poses import (
    NOTHING_REMOVED,
    RemovedPose,
    RemovedPoses,
    removed_pose,
    require_enough,
)
from hexacell.cell.fields import Frozen, SixNumbers
from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.dry_run.campaign import VisitedPose
from hexacell.dry_run.checks import CheckTrial, QuickTrial, try_check, try_quick_level
from hexacell.errors import UsageError
from hexacell.kinematics.pose import Pose
from hexacell.services.offline import PlanTrial, try_plan
from hexacell.services.run.calibration_run import new_calibration
from procedures.calibration.workflow import Mode

ModeTrial = PlanTrial | CheckTrial | QuickTrial


class PlannedPose(Frozen):
    """A pose that a run would measure, in the controller's frames; orientation 1 is a point's reference."""

    point: int
    orientation: int
    pose: SixNumbers


class PlanPreview(Frozen):
    """What a plan would measure on one simulated robot, and what it gives on some.

    ``error_mm`` is one standard deviation at the worst task pose, ``expanded_mm`` its U; none where they
    are not known.
    """

    poses: tuple[PlannedPose, ...] = ()
    records: int = 0
    minutes: float = 0.0
    error_mm: float | None = None
    expanded_mm: float | None = None


def try_mode(cell: Cell, mode: Mode, removed: RemovedPoses = NOTHING_REMOVED) -> ModeTrial:
    """Carry out what a run of that mode would measure, on simulated robots; takes some seconds.

    Raises:
        UsageError: without what is removed too little is left, or the mode needs an accepted result.
        FileError: the config, or the list of poses, cannot be read.
    """
    if mode not in {Mode.CHECK, Mode.QUICK}:
        return try_plan(cell, removed)
    require_enough(removed, len(cell.settings.identification.points))
    calibration = new_calibration(cell, mode).without(removed)
    return try_check(calibration.check) if mode is Mode.CHECK else try_quick_level(calibration.quick)


def preview_of(trial: ModeTrial) -> PlanPreview:
    """The preview that a trial gives."""
    match trial:
        case PlanTrial(result=result):
            return PlanPreview(
                poses=_planned(result.visited),
                records=result.records,
                minutes=result.minutes,
                error_mm=result.worst_sigma_mm,
                expanded_mm=result.expanded_mm,
            )
        case CheckTrial(error_mm=error):
            pass
        case QuickTrial(accuracy=accuracy):
            error = None if accuracy is None else accuracy.error_mm
    return PlanPreview(
        poses=_planned(trial.visited), records=len(trial.visited), minutes=trial.minutes, error_mm=error
    )


def _planned(visited: tuple[VisitedPose, ...]) -> tuple[PlannedPose, ...]:
    return tuple(
        PlannedPose(point=point, orientation=orientation, pose=pose.as_tuple())
        for point, orientation, pose in visited
    )


@dataclass(frozen=True, slots=True)
class PlanDraft:
    """The plan of a cell with a choice of what is left out.

    Attributes:
        whole: the plan with everything.
        tried: the plan as it was tried last.
        removed: what is left out now; ``is_tried``: as in the plan that was tried.
    """

    settings: CellSettings
    whole: PlanPreview
    tried: PlanPreview
    removed: RemovedPoses = NOTHING_REMOVED
    is_tried: bool = True

    @property
    def points(self) -> tuple[int, ...]:
        """All points of the cell, those that are left out included."""
        return tuple(range(1, len(self.settings.identification.points) + 1))

    def poses_at(self, point: int) -> tuple[PlannedPose, ...]:
        """The poses at a point that are in the plan; those of the latest trial, as far as they are left."""
        if point in self.removed.points:
            return ()
        refused = self.removed.refused
        return tuple(one for one in self.tried.poses if one.point == point and refused.allows(one.pose))

    def removed_at(self, point: int) -> tuple[tuple[int, RemovedPose], ...]:
        """The poses at a point that are left out, each with its number among all of them, from 1."""
        every = enumerate(self.removed.poses, start=1)
        return tuple((number, one) for number, one in every if one.point == point)

    def toggled(self, name: str) -> PlanDraft:
        """The same with a point (``3``) or a pose (``3.2``) taken out, or put back.

        A pose that is left out is put back by its number among those, as ``r1``.

        Raises:
            UsageError: there is no such thing, or too little would be left.
        """
        removed = self._with_point(name) if name.isdecimal() else self._with_pose(name)
        require_enough(removed, len(self.points))
        return replace(self, removed=removed, is_tried=False)

    def after(self, tried: PlanPreview, removed: RemovedPoses) -> PlanDraft:
        """The same after the plan was tried without something, if that is still what is left out."""
        return replace(self, tried=tried, is_tried=True) if removed == self.removed else self

    def _with_point(self, name: str) -> RemovedPoses:
        point, removed = int(name), self.removed
        if point not in self.points:
            raise UsageError(f"there is no point {name}", action=f"The plan has {len(self.points)}")
        others = tuple(one for one in removed.points if one != point)
        points = others if point in removed.points else tuple(sorted((*others, point)))
        return removed.model_copy(update={"points": points})

    def _with_pose(self, name: str) -> RemovedPoses:
        numbered = {f"r{number}": one for number, one in enumerate(self.removed.poses, start=1)}
        kept = tuple(one for other, one in numbered.items() if other != name)
        poses = kept if name in numbered else (*kept, self._taken_out(name))
        return self.removed.model_copy(update={"poses": poses})

    def _taken_out(self, name: str) -> RemovedPose:
        every = (one for point in self.points for one in self.poses_at(point))
        found = [one for one in every if f"{one.point}.{one.orientation}" == name]
        if not found:
            raise UsageError(
                f"there is no {name} in the plan", action="Name a point like 3, or a pose of one like 3.2"
            )
        if found[0].orientation == 1:
            raise UsageError(
                f"{name} is the reference of point {found[0].point}, from which its gauges measure",
                action=f"Take out the whole point: {found[0].point}",
            )
        plan, held_out = self.settings.identification, self.settings.verification
        references = [one.pose for one in self.tried.poses if one.orientation == 1]
        stated = (*references, *plan.points, *held_out.points)
        return removed_pose(
            found[0].point,
            Pose(*found[0].pose),
            [Pose(*one) for one in stated],
            is_listed=plan.poses is not None,
        )
