"""Propose: the new config is prepared in the run folder, and the gates for writing it are evaluated."""

from typing import ClassVar, Literal

from hexacell.cell.fields import GeometryDocument
from hexacell.kinematics.corrections import Corrections
from hexacell.results.term_result import impossible_terms
from hexacell.results.written_geometry import TaskDisplacement, as_written
from hexacell.verdict.acceptance_gates import AcceptanceGate, gates
from procedures.resources.run_resources import RunResources
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, Computation


class Proposed(BaseEvent):
    """The new config was saved in the run folder, and the gates for writing it were evaluated.

    ``written`` is the geometry in it, ``corrections`` what the controller adds to that; ``displacement`` is
    how far the geometry moves the task poses.
    """

    kind: Literal["proposed"] = "proposed"
    gates: tuple[AcceptanceGate, ...]
    written: GeometryDocument
    displacement: TaskDisplacement | None = None
    corrections: Corrections | None = None

    kept_as: ClassVar[str] = "proposed"


class Propose(Computation):
    """Prepare the change of the controller's config."""

    kind: Literal["propose"] = "propose"

    outcomes: ClassVar = (Proposed,)
    doing: ClassVar[str] = "preparing the new config"

    def compute(self, run: RunResources, state: RunState) -> Proposed:
        """Save the change of the config and evaluate the gates; raises ``FileError``."""
        assert state.identified is not None  # noqa: S101 - decided only after the identification
        settings, robot, result = run.settings, run.calibration.robot, state.identified.result
        identified = result.estimate(robot.mechanism.parameters)
        started = state.started
        conditions = gates(
            identified,
            robot.tolerance_violations(identified),
            residuals=result.residuals,
            change_mm=robot.largest_change(identified.geometry),
            largest_change_mm=settings.acceptance.largest_change_mm,
            impossible=impossible_terms(robot.terms, result.terms),
            expired=started.expired if settings.certificates and started is not None else None,
        )
        written = as_written(settings, robot, identified.geometry, result.terms)
        change = run.config.change_to(written.geometry, state, written.corrections)
        change.save(run.folder.proposal, like=run.cell.config_path)
        return Proposed(
            gates=conditions,
            written=written.geometry.document(),
            displacement=written.displacement,
            corrections=change.corrections_after,
        )
