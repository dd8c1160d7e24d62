"""The steps that only compute: identify the geometry, propose it, judge it at the held-out points."""

from __future__ import annotations

from dataclasses import dataclass

from hexacell.acceptance import (
    DeviationStatistics,
    HeldOutVerdict,
    calibration_outcome,
    check_outcome,
    gates,
    validate,
)
from hexacell.cell.loader import Cell
from hexacell.identification.estimator import identify
from hexacell.measurements.csv_file import write_measurements
from hexacell.reporting.assessment import assess
from hexacell.reporting.documents import fit_document
from hexacell.reporting.result import IdentificationResult
from hexacell.runs.run_folder import RunFolder
from procedures.calibration.workflow import Calibration, Mode
from procedures.engine.config_transactions import ConfigTransactions
from procedures.run import events
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
        robot = self.calibration.robot_of(state)
        identified = identify(robot.problem(measurements))
        assessed = assess(
            self.cell.settings,
            robot,
            measurements,
            identified,
            temperature_range_k=state.temperature_range_k,
        )
        self.folder.write_result(fit_document(assessed))
        result = IdentificationResult.of(identified)
        return events.Identified(result=result, held_out=self.calibration.held_out_poses(identified))

    def propose(self, state: RunState) -> events.Proposed:
        """Save the change of the config and evaluate the gates; raises ``FileError``."""
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
            line = check_outcome(before, self._limit_mm, verdict)
            return events.ResultValidated(verdict=verdict, line=line)
        after = DeviationStatistics.of(state.held_out(Phase.AFTER))
        verdict = HeldOutVerdict.WORSE if state.rejections(Phase.AFTER) else self._verdict(before, after)
        counts = self._counts(_identified(state))
        line = calibration_outcome(counts, before, after, self._limit_mm, verdict)
        return events.ResultValidated(verdict=verdict, line=line)

    def _counts(self, result: IdentificationResult) -> tuple[int, int, int]:
        free = self.calibration.robot.mechanism.convention.free_names()
        return len(free), result.records, result.points

    @property
    def _limit_mm(self) -> float:
        return self.cell.settings.acceptance.mean_deviation_mm

    def _verdict(
        self, before: DeviationStatistics | None, after: DeviationStatistics | None
    ) -> HeldOutVerdict:
        largest_mm = self.cell.settings.acceptance.max_deviation_mm
        return validate(before, after, mean_mm=self._limit_mm, largest_mm=largest_mm)


def _identified(state: RunState) -> IdentificationResult:
    assert state.identified is not None  # noqa: S101 - decided only after the identification
    return state.identified.result
