"""The verification of a result: is the model right, how accurate is the robot, and what is decided?

Three things that are kept apart. *Evidence*: tests of the model, each at a probability of 0.1 % to fail
although the model is right. *Accuracy*: the error that the written geometry makes at the task poses,
by an estimate that contains the held-out records as well, with its expanded uncertainty. *Decision*: the
verdict on that error under the limit, which needs the evidence. See ``docs/verdict.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from hexacell.campaign.task_accuracy import Task
from hexacell.cell.fields import Frozen
from hexacell.cell.model import CellSettings
from hexacell.identification.diagnostics.model_tests import update
from hexacell.identification.diagnostics.tolerance_check import SIGNIFICANT_SIGMAS
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.parameters import JointUnit
from hexacell.kinematics.rotations import Array
from hexacell.lengths import from_to
from hexacell.measurements.records import MeasurementSet
from hexacell.results.absorbed_terms import errors_of_geometry_alone
from hexacell.results.result import IdentificationResult, LengthResult, legs_at
from hexacell.robot.model import Robot
from hexacell.uncertainty.budget import UncertaintyBudget
from hexacell.uncertainty.length_records import JudgedGeometry
from hexacell.verdict import model_evidence
from hexacell.verdict.correction_evidence import correction_test
from hexacell.verdict.decision import Verdict, VerifiedAccuracy, worst_verdict
from hexacell.verdict.either_side import places_on_either_side
from hexacell.verdict.length_check import LengthMeasurements, LengthStatement, length_check, length_result


@dataclass(frozen=True, slots=True)
class DeviationStatistics:
    """Mean distance of the ball from its point's reference, mm, over poses with so many references."""

    mean_mm: float
    poses: int
    references: int = 1

    @classmethod
    def of(cls, deviations: ArrayLike, references: int = 1) -> DeviationStatistics | None:
        """Statistics of deviations (n, 3), mm, without the references, which as many poses have each.

        None without any, or if one is not finite.
        """
        distances = np.linalg.norm(np.asarray(deviations, dtype=float).reshape(-1, 3), axis=-1)
        if not len(distances) or not np.isfinite(distances).all():
            return None
        return cls(float(distances.mean()), len(distances), references)


def is_worse(before: DeviationStatistics, after: DeviationStatistics, noise: Noise) -> bool:
    """Whether the mean distance is significantly larger than before, at the same poses.

    A mean of n distances to p noisy references has at most 1/p of the variance of a record for the
    references, and 1/n for the poses.
    """
    record_mm = float(np.sqrt(noise.gauge_mm**2 + noise.encoder**2 + noise.stops**2))
    shares = [1.0 / one.references + 1.0 / one.poses for one in (before, after)]
    standard_error = record_mm * float(np.sqrt(sum(shares)))
    return after.mean_mm - before.mean_mm > SIGNIFICANT_SIGMAS * standard_error


class Verification(Frozen):
    """Evidence, accuracy and decision.

    Attributes:
        accuracy: None where the robot can reach no task pose, or no estimate was found.
        before_mm, after_mm: mean deviation at the held-out poses that were measured before and after.
    """

    verdict: Verdict
    tests: tuple[model_evidence.ModelTest, ...] = ()
    accuracy: VerifiedAccuracy | None = None
    before_mm: float | None = None
    after_mm: float | None = None
    is_worse: bool = False
    is_better: bool = False

    @property
    def is_kept(self) -> bool:
        """Whether the result stays: it passed, or it is better and only the machine's scatter is too large.

        The old geometry would scatter as much, and err more.
        """
        if self.verdict is Verdict.PASS:
            return True
        scatters = self.accuracy is not None and self.accuracy.of_geometry is not None
        holds = all(test.passed for test in self.tests) and self.is_better
        return scatters and holds and self.verdict is Verdict.NOT_EVALUATED

    @property
    def is_offered(self) -> bool:
        """Whether a person may keep the result: it does not stay, but it is not worse than before."""
        return not self.is_kept and self.after_mm is not None and not self.is_worse

    @property
    def needs_confirmation(self) -> bool:
        """Whether only confirming records can decide if the model is wrong, or chance made a test fail."""
        return model_evidence.fails_narrowly(self.tests) and self.accuracy is not None and not self.is_worse


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """What was measured at the held-out poses.

    Attributes:
        records: of both phases, for the identification; no point has the number of another.
        before: deviations (n, 3), mm, with the old geometry.
        after: with the new one, at the same poses.
        left_travel: whether the ball left the gauges' travel with the new geometry.
        length: what was measured with the new geometry in two seats; None without a length check.
        confirming: records at points of their own, measured because a test failed narrowly; else None.
        under_new: those ``records`` that were commanded with the new geometry, where encoders show what the
            controller sent.
    """

    records: MeasurementSet
    before: Sequence[tuple[float, float, float]]
    after: Sequence[tuple[float, float, float]]
    left_travel: bool = False
    length: LengthMeasurements | None = None
    confirming: MeasurementSet | None = None
    under_new: MeasurementSet = field(default_factory=lambda: MeasurementSet(()))


def verify(settings: CellSettings, robot: Robot, found: Identification, held_out: HeldOut) -> Verification:
    """Verify an identified geometry that commands ``robot`` now, in the frames in which it was written.

    Raises:
        IdentifiabilityError: no geometry fits any held-out record, or those of the length check are of
            other poses.
    """
    points = max(1, len(held_out.records.counts) // 2)  # each in both phases
    before, after = (DeviationStatistics.of(one, points) for one in (held_out.before, held_out.after))
    if held_out.left_travel:
        return Verification(verdict=Verdict.FAIL, before_mm=before and before.mean_mm, is_worse=True)
    if before is None or after is None:
        return Verification(verdict=Verdict.NOT_EVALUATED)
    updated = update(found, robot.problem(held_out.records))
    tests = model_evidence.model_tests(found, updated)
    if held_out.confirming is not None:
        updated = update(updated, robot.problem(held_out.confirming))
        tests = model_evidence.confirmed(
            tests, updated, np.isin(updated.problem.labels[:, 0], held_out.confirming.points)
        )
    if settings.encoders.are_of_controller and settings.controller.joints_include_zeros:
        tests = model_evidence.with_zeros_doubted(tests)
    if (corrected := correction_test(robot, held_out.under_new)) is not None:
        tests = (*tests, corrected)
    belief = robot.belief(updated)
    task = Task.of(settings, robot, belief).reachable(belief)
    budget = task.budget(updated, belief, robot.effects, robot.known_effects)
    accuracy = None
    if budget is not None:
        about = settings, robot, updated, task, budget, held_out.length
        accuracy = _verified_accuracy(*about, is_evident=all(test.passed for test in tests))
    if accuracy is not None and (length := accuracy.length) is not None:
        sentence = "The records of the length check agree with each other."
        if not length.is_consistent:
            sentence = f"The length check says nothing: {length.reason}."
        test = model_evidence.ModelTest(name="length check", passed=length.is_consistent, sentence=sentence)
        tests = (*tests, test)
    noise = _noise_in_mm(robot, updated)
    worse = is_worse(before, after, noise)
    return Verification(
        verdict=_verdict(tests, accuracy, worse=worse),
        tests=tests,
        accuracy=accuracy,
        before_mm=before.mean_mm,
        after_mm=after.mean_mm,
        is_worse=worse,
        is_better=is_worse(after, before, noise) or (not worse and _errs_less(budget, robot, updated)),
    )


def _errs_less(budget: UncertaintyBudget | None, robot: Robot, updated: Identification) -> bool:
    """Whether the written geometry errs significantly less at the task poses than the one before it.

    By all records, which tell it where a few scattered deviations do not.
    """
    if budget is None or not robot.earlier:
        return False
    earlier = robot.mechanism.convention.free_parameters(robot.earlier[0].geometry)
    now, before = (
        budget.errors_of(free - updated.free, of_geometry=True).position
        for free in (robot.free_parameters, earlier)
    )
    return before.value - before.expanded > now.value + now.expanded


def _verified_accuracy(
    settings: CellSettings,
    robot: Robot,
    updated: Identification,
    task: Task,
    budget: UncertaintyBudget,
    measured: LengthMeasurements | None,
    *,
    is_evident: bool,
) -> VerifiedAccuracy:
    """The error that the geometry of ``robot`` makes at the task poses, by the updated estimate."""
    belief, length = robot.belief(updated), None
    if measured is not None:
        covariance = updated.free_covariance * updated.goodness.noise_factor**2
        judged = JudgedGeometry(covariance, budget.parameter_columns)
        check = length_check(settings, robot, updated.geometry, judged, measured, robot.effects)
        length = length_result(check, settings.uncertainty.common_scale_um_m)
        if length.replaces_stated:
            effects = robot.effects, robot.known_effects
            budget = task.budget(updated, belief, *effects, check.observation) or budget
    difference = robot.free_parameters - updated.free
    return VerifiedAccuracy.of(
        budget.errors_of(difference),
        settings,
        robot,
        task,
        is_evident=is_evident and (length is None or length.is_consistent),
        of_geometry=budget.errors_of(difference, of_geometry=True) if budget.scatters else None,
        alone=errors_of_geometry_alone(settings, robot, updated),
        length=length,
        either_side=places_on_either_side(robot, belief, task),
    )


def _noise_in_mm(robot: Robot, updated: Identification) -> Noise:
    """The noise of a record, with that of stops, and of encoders of angles, as the ball's motion by it."""
    by_joints, noise = updated.prediction.by_joints, robot.noise
    stops_mm = _rms(noise.stop_covariance(by_joints))
    if robot.mechanism.words.joint_unit is JointUnit.MM:
        return replace(noise, stops=stops_mm)
    return replace(noise, encoder=_rms(noise.encoder_covariance(by_joints)), stops=stops_mm)


def _rms(covariances: Array) -> float:
    """Root mean square along an axis, by covariances (n, 3, 3)."""
    return float(np.sqrt(np.mean(np.trace(covariances, axis1=1, axis2=2)) / 3.0))


def _verdict(
    tests: Sequence[model_evidence.ModelTest], accuracy: VerifiedAccuracy | None, *, worse: bool
) -> Verdict:
    if worse:
        return Verdict.FAIL
    if accuracy is None:
        return Verdict.NOT_EVALUATED
    evidence = Verdict.PASS if all(test.passed for test in tests) else Verdict.NOT_EVALUATED
    return worst_verdict([evidence, accuracy.position.verdict, accuracy.orientation.verdict])


def outcome_line(
    result: IdentificationResult, parameters: int, verified: Verification, unknowns: int | None = None
) -> str:
    """The outcome of a calibration in one line: what was used, before and after, the error, the verdict.

    ``unknowns``: how many of the parameters are identified, if not all.
    """
    what = f"{parameters} parameters"
    if result.identifies is not ParameterChoice.ALL:
        what = f"zeros only, {unknowns} of {what}"
    parts = [f"{what}, {result.records} records at {result.points} points"]
    if legs := legs_at(result.holds_at_c):
        parts.append(f"geometry of {legs}")
    if verified.before_mm is not None and verified.after_mm is not None:
        means = from_to(verified.before_mm, verified.after_mm, 2)
        parts.append(f"mean deviation at held-out poses {means}")
    return outcome_of(parts, verified.accuracy, verified.verdict, reason_of(verified))


def outcome_of(
    parts: Sequence[str], accuracy: VerifiedAccuracy | None, verdict: Verdict, reason: str
) -> str:
    """An outcome in one line: some parts, the error that decides, the verdict, and its reason if any.

    Where both errors decide it is that of the position.
    """
    parts = list(parts)
    if accuracy is not None:
        worst = worst_verdict(error.verdict for _, _, error in accuracy.errors)
        name, unit, error = next(one for one in accuracy.errors if one[2].verdict is worst)
        parts.append(f"{name} error at the task poses {error.sentence(unit)}")
    because = f" ({reason})" if reason else ""
    return f"{'; '.join(parts)}: {verdict}{because}"


def reason_of(verified: Verification) -> str:
    """Why a verdict is not that of the error shown; empty where it is."""
    failed = [test.sentence for test in verified.tests if not test.passed]
    if verified.is_worse:
        is_of_zeros = any(sentence.endswith(model_evidence.ZEROS_DOUBTED) for sentence in failed)
        doubt = f"; {model_evidence.ZEROS_DOUBTED.rstrip('.')}" if is_of_zeros else ""
        return f"worse than before{doubt}"
    if verified.verdict is Verdict.NOT_EVALUATED and failed:
        return failed[0].rstrip(".")
    if verified.is_kept and verified.verdict is not Verdict.PASS:
        return "the machine does not repeat well enough; the geometry is better, and stays"
    if verified.verdict is Verdict.NOT_EVALUATED and verified.accuracy is not None:
        return "U is above the limit"
    return ""


def scale_words(result: LengthResult) -> str:
    """The scale of the encoders with U, in words."""
    wrong_way = "long" if result.long_um_m >= 0.0 else "short"
    return f"encoders read {abs(result.long_um_m):.0f} +- {result.expanded_um_m:.0f} um/m {wrong_way}"


def length_line(stated: LengthStatement) -> str:
    """The outcome of a length check in one line."""
    result, error = stated.result, stated.error
    if not result.is_consistent:
        return f"length check: {stated.verdict} ({result.reason})"
    parts = [f"length check over {result.distance_mm:.3f} mm: {scale_words(result)}"]
    if error is not None:
        parts.append(f"position error by that {error.sentence('mm')}")
    return f"{'; '.join(parts)}: {stated.verdict}"
