"""Propose: the new config is prepared in the run folder, and the gates for writing it are evaluated."""

from typing import ClassVar, Literal

from hexacell.cell.fields import GeometryDocument
from hexacell.kinematics.corrections import Corrections
from hexacell.results.written_geometry import TaskDisplacement, as_written
from hexacell.verdict.acceptance_gates import AcceptanceGate, gates_of_run
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
        started = state.started
        expired = started.expired if settings.certificates and started is not None else None
        identified = result.identified(robot.mechanism.parameters)
        written = as_written(settings, robot, identified, result.terms)
        change = run.config.change_to(written.geometry, state, written.corrections)
        change.save(run.folder.proposal, like=run.cell.config_path)
        return Proposed(
            gates=gates_of_run(settings, robot, result, expired),
            written=written.geometry.document(),
            displacement=written.displacement,
            corrections=change.corrections_after,
        )
