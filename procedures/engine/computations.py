"""The steps that only compute: identify the geometry, propose it, judge it at the held-out points."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from statistics import fmean

from hexacell.cell.loader import Cell
from hexacell.cell.model import CellSettings
from hexacell.checks.check_result import check_line, check_result
from hexacell.errors import HexacellError, LimitError
from hexacell.identification.estimator import identify
from hexacell.measurements.csv_file import write_measurements
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.noise.noise_assessment import assess_noise
from hexacell.results.result import IdentificationResult
from hexacell.runs.run_folder import RunFolder
from hexacell.verdict.acceptance_gates import gates
from hexacell.verdict.assessment import Assessment, assess
from hexacell.verdict.findings import findings
from hexacell.verdict.fit_document import fit_document
from hexacell.verdict.length_check import LengthMeasurements, length_statement
from hexacell.verdict.outcome import length_line, outcome_line, reason_of
from hexacell.verdict.verification import HeldOut, verify
from procedures.calibration.held_out_poses import PosesByPoint
from procedures.calibration.noise_steps import noise_readings
from procedures.calibration.workflow import Calibration, Mode
from procedures.engine.config_transactions import ConfigTransactions
from procedures.run import events
from procedures.run.leg_temperatures import legs_warmer
from procedures.run.state import RunState, apply, record
from procedures.run.steps import Phase


@dataclass(frozen=True, eq=False)
class Computations:
    """The computations of one run; they write files of the run folder and nothing else."""

    cell: Cell
    calibration: Calibration
    config: ConfigTransactions
    folder: RunFolder

    def assess_noise(self, state: RunState) -> events.NoiseMeasured:
        """Evaluate what was read at the first reference."""
        assert state.at_pose is not None  # noqa: S101 - decided only at the reference
        key, _ = state.at_pose
        readings = noise_readings(state.set(key), self.cell.settings.encoders)
        return events.NoiseMeasured(at=key, noise=assess_noise(self.calibration.plan, readings))

    def identify(self, state: RunState) -> events.Identified:
        """Identify the geometry and choose the held-out poses; raises ``HexacellError``."""
        measurements = state.measurements()
        write_measurements(self.folder.measurements, measurements)
        calibration = self.calibration.informed(state)
        robot = calibration.robot_of(state)
        identified = identify(robot.problem(measurements))
        settings, noise = calibration.settings, calibration.measured_noise
        assessed = assess(settings, robot, measurements, identified, noise)
        self.folder.write_result(fit_document(assessed))
        result = IdentificationResult.of(identified, assessed.zeros)
        held_out = _held_out_poses(calibration, assessed)
        return events.Identified(
            result=result,
            held_out=held_out,
            held_out_after=calibration.held_out_poses_after(identified, held_out),
            improvement=assessed.improvement,
            quick=calibration.quick.accuracy(measurements) if calibration.mode is Mode.QUICK else None,
        )

    def with_replacements(self, refusal: events.PoseExcluded, state: RunState) -> events.PoseExcluded:
        """A refusal at a held-out point with others for the held-out poses that it leaves out."""
        if state.identified is None or refusal.at.phase not in {Phase.BEFORE, Phase.AFTER}:
            return refusal
        after = apply(state, refusal)
        calibration = self.calibration.informed(after)
        try:
            identified = identify(calibration.robot_of(after).problem(after.measurements()))
            pairs = tuple(calibration.held_out_replacements(identified, after))
        except HexacellError:  # then those that are left are measured
            return refusal
        return refusal.model_copy(update={"replacements": pairs})

    def propose(self, state: RunState) -> events.Proposed:
        """Save the change of the config and evaluate the gates; raises ``FileError``."""
        robot = self.calibration.robot
        result = _identified(state)
        identified = result.estimate(robot.mechanism.parameters)
        commanding, _ = robot.mechanism.normalize_frames(robot.controller)
        conditions = gates(
            identified,
            robot.tolerance_violations(identified),
            residuals=result.residuals,
            largest_change_mm=self.cell.settings.acceptance.largest_change_mm,
            before=commanding,
            expired=_expired(self.cell.settings, state),
        )
        written = self.calibration.as_written(identified.geometry)
        self.config.change_to(written.geometry, state).save(
            self.folder.proposal, like=self.config.cell.config_path
        )
        return events.Proposed(
            gates=conditions, written=written.geometry.document(), displacement=written.displacement
        )

    def judge(self, state: RunState) -> events.ResultValidated | events.ConfirmationPlanned:
        """Verify the written geometry, or state what a check found; raises ``HexacellError``.

        A test of the model that failed narrowly asks for confirming records once, where any can be taken.
        """
        if self.calibration.mode is Mode.CHECK:
            return self._judge_check(state)
        if self.calibration.mode is Mode.LENGTH:
            return self._judge_length(state)
        calibration = self.calibration.informed(state)
        found = identify(calibration.robot_of(state).problem(state.measurements()))
        written = calibration.written_robot(state)
        verification = verify(calibration.settings, written, found, _held_out(calibration.settings, state))
        if verification.needs_confirmation and state.confirmation is None:
            poses = calibration.confirming_poses(found, state)
            if any(poses):
                return events.ConfirmationPlanned(reason=reason_of(verification), poses=poses)
        line = outcome_line(_identified(state), len(found.free), verification, written.unknowns)
        return events.ResultValidated(verdict=verification.verdict, line=line, verification=verification)

    def _judge_check(self, state: RunState) -> events.ResultValidated:
        measurements = state.measurements()
        write_measurements(self.folder.measurements, measurements)
        calibration = self.calibration.informed(state)
        effects = calibration.robot_of(state).effects
        accepted, thermometers = calibration.accepted, self.cell.settings.thermometers
        before = () if accepted is None else accepted.leg_temperatures_c
        warmer = legs_warmer(thermometers, state.samples(Phase.IDENTIFY), before)
        found = check_result(calibration.check, measurements, accepted, effects, warmer)
        return events.ResultValidated(verdict=found.verdict, line=check_line(found), check=found)

    def _judge_length(self, state: RunState) -> events.ResultValidated:
        calibration = self.calibration
        assert calibration.accepted is not None  # noqa: S101 - without one no length check is begun
        measured = _length_measurements(self.cell.settings, state)
        stated = length_statement(
            self.cell.settings, calibration.robot_checked, calibration.accepted, measured
        )
        return events.ResultValidated(verdict=stated.verdict, line=length_line(stated), length=stated)


def _held_out_poses(calibration: Calibration, assessed: Assessment) -> PosesByPoint:
    """Those of an identification; the error states its verdict, as a wrong geometry may be the cause."""
    try:
        return calibration.held_out_poses(assessed.found)
    except LimitError as error:
        verdict, *_ = findings(assessed)
        raise LimitError(
            f"{verdict} With this geometry no held-out pose can be measured: {error.problem}",
            action=error.action,
        ) from error


def _expired(settings: CellSettings, state: RunState) -> tuple[str, ...] | None:
    """The instruments whose certificate had expired when the run began; none where none has one."""
    if not settings.certificates or state.started is None:
        return None
    return state.started.expired


def _length_measurements(settings: CellSettings, state: RunState) -> LengthMeasurements:
    """What was measured in the two seats, and the temperature of the fixture if a thermometer tells it."""
    samples = state.samples(Phase.LENGTH)
    named = settings.length_check and settings.length_check.thermometer
    shown = [
        one.celsius
        for sample in samples
        for one in sample.reading.temperatures
        if one.name == named and one.celsius is not None
    ]
    records = MeasurementSet(tuple(record(sample) for sample in samples))
    return LengthMeasurements(records, fmean(shown) if shown else None)


def _held_out(settings: CellSettings, state: RunState) -> HeldOut:
    """What was measured at the held-out points, each phase at points of its own, and in the two seats."""
    count = max(sample.at.point for sample in state.samples(Phase.IDENTIFY))
    records: list[Record] = []
    for phase in (Phase.BEFORE, Phase.AFTER):
        samples = state.samples(phase)
        records += _at_points_from(count, samples)
        count += max((sample.at.point for sample in samples), default=0)
    confirming = state.samples(Phase.CONFIRM)
    return HeldOut(
        records=MeasurementSet(tuple(records)),
        before=state.held_out(Phase.BEFORE),
        after=state.held_out(Phase.AFTER),
        left_travel=state.left_travel,
        length=_length_measurements(settings, state) if state.samples(Phase.LENGTH) else None,
        confirming=MeasurementSet(tuple(_at_points_from(count, confirming))) if confirming else None,
    )


def _at_points_from(count: int, samples: Iterable[events.RecordTaken]) -> Iterator[Record]:
    """The records at points of their own, numbered after ``count`` others."""
    return (replace(record(sample), point=sample.at.point + count) for sample in samples)


def _identified(state: RunState) -> IdentificationResult:
    assert state.identified is not None  # noqa: S101 - decided only after the identification
    return state.identified.result
