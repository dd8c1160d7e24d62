"""Identify: the geometry is identified from the records, and the held-out poses are chosen."""

from typing import ClassVar, Literal

from hexacell.checks.quick_level import QuickAccuracy
from hexacell.errors import LimitError
from hexacell.identification.estimator import identify
from hexacell.measurements.csv_file import write_measurements
from hexacell.noise.reversal import Reversal
from hexacell.noise.worsening import Worsening
from hexacell.results.result import ExpectedImprovement, IdentificationResult, RecordResidual
from hexacell.verdict.assessment import Assessment, assess
from hexacell.verdict.findings import findings
from hexacell.verdict.fit_document import fit_document
from procedures.calibration.calibration import Knowledge
from procedures.calibration.held_out_poses import PosesByPoint, poses_after, poses_before
from procedures.calibration.repeatability import reversal_by_repeats, worsening_by_repeats
from procedures.resources.run_resources import RunResources
from procedures.run.keys import SixNumbers
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, Computation


class Identified(BaseEvent):
    """The geometry was identified, and the held-out poses were chosen.

    ``held_out`` are measured at each point before and after, ``held_out_after`` only after: the robot
    cannot take them safely before it is calibrated. ``improvement`` is None where the robot can reach none
    of the task poses. ``quick`` is how well the quick level knows the robot; None in other runs.
    ``reversal`` is what repeated visits of the references showed; None of too few. ``worsening`` is how
    much worse the machine came back later; None unless significant. Older journals have no ``residuals``.
    """

    kind: Literal["identified"] = "identified"
    result: IdentificationResult
    held_out: tuple[tuple[SixNumbers, ...], ...]
    held_out_after: tuple[tuple[SixNumbers, ...], ...] = ()
    improvement: ExpectedImprovement | None = None
    quick: QuickAccuracy | None = None
    reversal: Reversal | None = None
    worsening: Worsening | None = None
    residuals: tuple[RecordResidual, ...] = ()

    kept_as: ClassVar[str] = "identified"


class Identify(Computation):
    """Identify the geometry."""

    kind: Literal["identify"] = "identify"

    outcomes: ClassVar = (Identified,)
    doing: ClassVar[str] = "identifying the geometry"

    def compute(self, run: RunResources, state: RunState) -> Identified:
        """Identify, assess, keep the fit in the run folder, and choose the held-out poses."""
        measurements = state.measurements()
        write_measurements(run.folder.measurements, measurements)
        known = run.calibration.known(state)
        robot = known.robot_of(state)
        identified = identify(robot.problem(measurements))
        assessed = assess(known.settings, robot, measurements, identified, known.noise)
        run.folder.write_result(fit_document(assessed))
        held_out = _held_out_poses(known, assessed)
        is_quick = run.calibration.mode == "quick"
        return Identified(
            result=IdentificationResult.of(identified, assessed.zeros),
            held_out=held_out,
            held_out_after=poses_after(known, identified, held_out),
            improvement=assessed.improvement,
            quick=known.quick.accuracy(measurements) if is_quick else None,
            reversal=reversal_by_repeats(known.plan, state, identified),
            worsening=worsening_by_repeats(known.plan, state, identified, robot.noise.walk),
            residuals=RecordResidual.of_records(identified),
        )


def _held_out_poses(known: Knowledge, assessed: Assessment) -> PosesByPoint:
    """Choose held-out poses; the error states the verdict, as a wrong geometry may be the cause."""
    try:
        return poses_before(known, assessed.found)
    except LimitError as error:
        verdict, *_ = findings(assessed)
        problem = f"{verdict} With this geometry no held-out pose can be measured: {error.problem}"
        raise LimitError(problem, action=error.action) from error
