"""Judge: the verdict of a run, or the confirming records that it needs first."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from statistics import fmean
from typing import ClassVar, Literal

from hexacell.cell.model import CellSettings
from hexacell.checks.check_result import CheckResult, check_line, check_result
from hexacell.identification.estimator import identify
from hexacell.measurements.csv_file import write_measurements
from hexacell.measurements.records import MeasurementSet, Record
from hexacell.verdict.decision import Verdict
from hexacell.verdict.length_check import LengthMeasurements, LengthStatement, length_statement
from hexacell.verdict.model_evidence import BEYOND_CHANCE
from hexacell.verdict.scatter_evidence import JudgedResult, verify_with_scatter
from hexacell.verdict.verification import HeldOut, Verification, length_line, outcome_line, reason_of
from procedures.calibration.calibration import Knowledge
from procedures.calibration.held_out_poses import confirming_poses
from procedures.resources.run_resources import RunResources
from procedures.run.keys import Phase, SixNumbers
from procedures.run.readings import temperatures_shown
from procedures.run.state import RunState
from procedures.steps.base import BaseEvent, Computation
from procedures.steps.sample import RecordTaken


class ConfirmationPlanned(BaseEvent):
    """A test of the model failed, perhaps by chance: confirming held-out poses were chosen, which decide.

    ``poses`` are those at each held-out point, its reference first; empty at a point that is left.
    """

    kind: Literal["confirmation planned"] = "confirmation planned"
    reason: str
    poses: tuple[tuple[SixNumbers, ...], ...]

    kept_as: ClassVar[str] = "confirmation"

    def text(self, state: RunState) -> str:
        return f"{self.reason}: {sum(map(len, self.poses))} new records show whether by chance"


class ResultValidated(BaseEvent):
    """The verdict of the run.

    That of a calibration is by its ``verification``, of a check by its result ``check``, of a length check
    of its own by ``length``.
    """

    kind: Literal["judged"] = "judged"
    verdict: Verdict
    line: str
    verification: Verification | None = None
    check: CheckResult | None = None
    length: LengthStatement | None = None

    kept_as: ClassVar[str] = "judged"


class Judge(Computation):
    """Verify the written geometry, or state what a check or a length check found.

    A test of the model that failed narrowly asks for confirming records once, where any can be taken.
    """

    kind: Literal["judge"] = "judge"

    outcomes: ClassVar = (ResultValidated, ConfirmationPlanned)
    doing: ClassVar[str] = "verifying the result"

    def compute(self, run: RunResources, state: RunState) -> ResultValidated | ConfirmationPlanned:
        match run.calibration.mode:
            case "check":
                return _checked(run, state)
            case "length":
                return _length_checked(run, state)
        known = run.calibration.known(state)
        result = _judged_result(known, state)
        beyond_chance = partial(_judged_result, replace(known, significance=BEYOND_CHANCE), state)
        held_out = _held_out(known.settings, state)
        verification = verify_with_scatter(known.settings, result, beyond_chance, held_out)
        if verification.needs_confirmation and state.confirmation is None:
            poses = confirming_poses(known, result.found, state)
            if any(poses):
                return ConfirmationPlanned(reason=reason_of(verification), poses=poses)
        assert state.identified is not None  # noqa: S101 - decided only after the identification
        parameters, unknowns = len(result.found.free), result.robot.unknowns
        line = outcome_line(state.identified.result, parameters, verification, unknowns)
        return ResultValidated(verdict=verification.verdict, line=line, verification=verification)


def _judged_result(known: Knowledge, state: RunState) -> JudgedResult:
    """What is verified, with the noise as the repeats show it at the significance of what is ``known``."""
    found = identify(known.robot_of(state).problem(state.measurements()))
    return JudgedResult(known.written_robot(state), found)


def _checked(run: RunResources, state: RunState) -> ResultValidated:
    measurements = state.measurements()
    write_measurements(run.folder.measurements, measurements)
    known, accepted = run.calibration.known(state), run.calibration.accepted
    found = check_result(known.check, measurements, accepted, known.robot_of(state).effects)
    return ResultValidated(verdict=found.verdict, line=check_line(found), check=found)


def _length_checked(run: RunResources, state: RunState) -> ResultValidated:
    calibration = run.calibration
    assert calibration.accepted is not None  # noqa: S101 - without one no length check is begun
    measured = _length_measurements(run.settings, state)
    stated = length_statement(
        run.settings, calibration.robot_checked(calibration.robot), calibration.accepted, measured
    )
    return ResultValidated(verdict=stated.verdict, line=length_line(stated), length=stated)


def _length_measurements(settings: CellSettings, state: RunState) -> LengthMeasurements:
    """What was measured in the two seats, and the fixture's temperature if it has a thermometer."""
    samples, fixture = state.samples(Phase.LENGTH), settings.length_check
    shown = temperatures_shown(sample.reading for sample in samples)
    celsius = shown.get(fixture.thermometer or "") if fixture else None
    records = MeasurementSet(tuple(sample.record for sample in samples))
    return LengthMeasurements(records, fmean(celsius) if celsius else None)


def _held_out(settings: CellSettings, state: RunState) -> HeldOut:
    """What was measured at the held-out points, each phase at points of its own, and in the two seats."""
    count = max(sample.at.point for sample in state.samples(Phase.IDENTIFY))
    records: list[Record] = []
    for phase in (Phase.BEFORE, Phase.AFTER):
        samples = state.samples(phase)
        records += _at_points_from(count, samples)
        count += max((sample.at.point for sample in samples), default=0)
    confirming = state.samples(Phase.CONFIRM)
    # A controller reports its joints without the backlash that it adds.
    after = () if settings.encoders.are_of_controller else _at_points_from(0, state.samples(Phase.AFTER))
    return HeldOut(
        records=MeasurementSet(tuple(records)),
        before=state.held_out(Phase.BEFORE),
        after=state.held_out(Phase.AFTER),
        left_travel=state.left_travel,
        length=_length_measurements(settings, state) if state.samples(Phase.LENGTH) else None,
        confirming=MeasurementSet(tuple(_at_points_from(count, confirming))) if confirming else None,
        under_new=MeasurementSet(tuple(after)),
    )


def _at_points_from(count: int, samples: Iterable[RecordTaken]) -> Iterator[Record]:
    """The records at points of their own, numbered after ``count`` others."""
    return (replace(sample.record, point=sample.at.point + count) for sample in samples)
