"""The steps that only compute: identify the geometry, propose it, judge it at the held-out points."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.acceptance.gates import gates
from hexacell.acceptance.validation import DeviationStatistics, Verdict, validate
from hexacell.cell.loader import Cell
from hexacell.measurements.csv_file import write_measurements
from hexacell.reporting.assessment import assess
from hexacell.reporting.documents import assessment_document, identification_document, outcome_line
from hexacell.runs.run_folder import RunFolder
from procedures.calibration.workflow import Calibration, Mode
from procedures.engine.config_transactions import ConfigTransactions
from procedures.run import events
from procedures.run.identified import IdentificationResult
from procedures.run.state import RunState
from procedures.run.steps import Phase


@dataclass(frozen=True, eq=False)
class Computations:
    """The computations of one run; they write files of the run folder and nothing else."""

    cell: Cell
    calibration: Calibration
    config: ConfigTransactions
    folder: RunFolder

    def identify(self, state: RunState) -> events.Identified:
        """Identify the geometry and choose the held-out poses; raises ``HexacellError``."""
        measurements = state.measurements()
        write_measurements(self.folder.measurements, measurements)
        identified = self.calibration.identification(state)
        assessed = assess(self.cell.settings, self.calibration.robot_of(state), measurements, identified)
        document = identification_document(identified)
        self.folder.write_result(document | assessment_document(identified, assessed))
        result = IdentificationResult.of(document)
        return events.Identified(result=result, held_out=self.calibration.held_out_poses(identified))

    def propose(self, state: RunState) -> events.Proposed:
        """Save the change of the config, and hold the geometry against the gates.

        Raises:
            FileError: the config is not the one that the run began with.
        """
        robot = self.calibration.robot
        identified = _identified(state).estimate(robot.mechanism.parameters)
        commanding, _ = robot.mechanism.normalize_frames(robot.controller)
        conditions = gates(
            identified,
            robot.drawing,
            robot.tolerances,
            largest_change_mm=self.cell.settings.acceptance.largest_change_mm,
            before=commanding,
        )
        self.config.change_to(identified.geometry, state).save(self.folder.proposal)
        return events.Proposed(gates=conditions)

    def judge(self, state: RunState) -> events.ResultValidated:
        """Compare the deviations at the held-out points with the limits."""
        before = DeviationStatistics.of(state.held_out(Phase.BEFORE))
        if self.calibration.mode is Mode.CHECK:
            verdict = self._verdict(before, before)
            return events.ResultValidated(verdict=verdict, line=self._check_line(before, verdict))
        after = DeviationStatistics.of(state.held_out(Phase.AFTER))
        verdict = Verdict.WORSE if state.refusals(Phase.AFTER) else self._verdict(before, after)
        line = outcome_line(self._counts(_identified(state)), before, after, self._limit_mm, verdict)
        return events.ResultValidated(verdict=verdict, line=line)

    def _counts(self, result: IdentificationResult) -> tuple[int, int, int]:
        free = self.calibration.robot.mechanism.convention.free_names()
        return len(free), result.records, result.points

    @property
    def _limit_mm(self) -> float:
        return self.cell.settings.acceptance.mean_deviation_mm

    def _verdict(self, before: DeviationStatistics | None, after: DeviationStatistics | None) -> Verdict:
        largest_mm = self.cell.settings.acceptance.max_deviation_mm
        return validate(before, after, mean_mm=self._limit_mm, largest_mm=largest_mm)

    def _check_line(self, found: DeviationStatistics | None, verdict: Verdict) -> str:
        if found is None:
            return f"held-out points: {verdict}"
        return (
            f"{found.poses} poses at held-out points; mean deviation {found.mean_mm:.3f} mm "
            f"(limit {self._limit_mm:g}): {verdict}"
        )


def _identified(state: RunState) -> IdentificationResult:
    assert state.identified is not None  # noqa: S101 - decided only after the identification
    return state.identified.result
