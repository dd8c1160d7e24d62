"""The geometry as it is written to the controller, and what must be taught anew because of it.

An identified geometry may be written in any frames that its parameters can express. Points, work frames and
tool frames were taught with an earlier geometry. The one written is in the frames in which the task poses
move least against that (:mod:`~hexacell.identification.diagnostics.frame_alignment`).
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.fields import Frozen
from hexacell.cell.measuring import AcceptanceSettings
from hexacell.cell.model import CellSettings
from hexacell.identification.diagnostics.frame_alignment import PoseErrors, choose_frames
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.kinematics.corrections import NONE, Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.results.absorbed_terms import absorbing
from hexacell.results.term_result import TermResult, corrections_for
from hexacell.robot.model import Robot


class TaskDisplacement(Frozen):
    """How far a new geometry moves taught points and frames: task poses at equal joint variables.

    Attributes:
        position_mm, orientation_deg: the largest of the task poses.
        poses: how many of these both geometries reach.
        is_within_limits: whether both are within the limits of the errors there, so that nothing need be
            taught anew.
    """

    position_mm: float
    orientation_deg: float
    poses: int
    is_within_limits: bool

    @classmethod
    def of(cls, moved: PoseErrors, limits: AcceptanceSettings) -> "TaskDisplacement | None":
        """Displacement over n poses; None without any."""
        if not len(moved.angles):
            return None
        distance, angle = moved.position_largest_mm, moved.orientation_largest_deg
        return cls(
            position_mm=distance,
            orientation_deg=angle,
            poses=len(moved.angles),
            is_within_limits=distance <= limits.position_mm and angle <= limits.orientation_deg,
        )


@dataclass(frozen=True, slots=True, eq=False)
class WrittenGeometry:
    """A geometry in the frames in which a controller gets it.

    ``displacement`` is None where no task pose shows it, or no frames were chosen; ``corrections`` are None
    where they stay as they are.
    """

    geometry: Geometry
    displacement: TaskDisplacement | None
    corrections: Corrections | None = None


def as_written(
    settings: CellSettings, robot: Robot, identified: Geometry, terms: Iterable[TermResult] = ()
) -> WrittenGeometry:
    """What the controller gets of an ``identified`` geometry in the mechanism's frame convention.

    With zeros alone it keeps its frames: other ones would change all its numbers. What of the ``terms`` it
    cannot correct, the geometry does as far as it can (:func:`.absorbing`).
    """
    if robot.identifies is not ParameterChoice.ALL:
        return WrittenGeometry(robot.for_controller(identified), None)
    corrections, left = corrections_for(terms, settings, robot.holds, robot.corrections)
    if left:
        identified = absorbing(settings, robot, identified, left)
    geometry, displacement = choose_frames(
        robot.mechanism,
        robot.branch,
        taught=robot.taught,
        new=identified,
        poses=robot.frames.inverse().poses(Task.of(settings, robot, robot.belief()).poses),
    )
    moved = TaskDisplacement.of(displacement, settings.acceptance)
    if corrections is not None and (corrections.play_mm, corrections.compliance_um_n) != (NONE, NONE):
        # Their weight is stated in the drawing's frames.
        drawn, own = (robot.mechanism.normalize_frames(one)[1] for one in (robot.drawing, geometry))
        x, y, z = (own.base.T @ drawn.base @ corrections.weight_direction).round(9).tolist()
        centre = corrections.weight_centre_mm
        if centre is not None:
            u, v, w = (own.platform.T @ drawn.platform @ centre).round(6).tolist()
            centre = u, v, w
        corrections = replace(corrections, weight_direction=(x, y, z), weight_centre_mm=centre)
    return WrittenGeometry(geometry, moved, corrections)
