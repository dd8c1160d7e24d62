"""The next step of a calibration, decided from the state of the run and nothing else.

The points are measured (:mod:`~procedures.calibration.identification_steps`) and the geometry is
identified. The held-out points are measured (:mod:`~procedures.calibration.held_out_steps`), the geometry
is written to the controller, and the held-out points are measured again. A check measures points, until
they decide, and nothing else (:mod:`~hexacell.checks.check`); the quick level carries a check on to a
geometry (:mod:`~hexacell.checks.quick_level`). A length check, of its own or before the
verdict on a calibration, measures two seats (:mod:`~procedures.calibration.length_steps`). Nothing here
uses hardware or files, so a run, its resumption and its replay decide alike.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from hexacell.campaign.planner import Plan
from hexacell.campaign.pose_list import PoseList
from hexacell.cell.model import CellSettings
from hexacell.checks.check import Check, identified_before
from hexacell.checks.quick_level import QuickLevel
from hexacell.design.search_effort import USUAL_EFFORT, SearchEffort
from hexacell.errors import HexacellError
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.pose import Pose
from hexacell.kinematics.refused_commands import RefusedCommands
from hexacell.noise.measured_noise import MeasuredNoise, with_measured_noise
from hexacell.results.result import AcceptedResult
from hexacell.results.written_geometry import WrittenGeometry, as_written
from hexacell.robot.model import Robot
from hexacell.robot.stated_effects import stated_effects
from hexacell.verdict.decision import ErrorLimits, Verdict
from hexacell.verdict.length_check import with_measured_scale
from procedures.calibration.held_out_poses import PosesByPoint, replacements
from procedures.calibration.measuring import Measuring
from procedures.run import events
from procedures.run.state import RunState
from procedures.run.steps import Compute, Phase, SixNumbers, Step


class Mode(StrEnum):
    """What a run is for."""

    OPTIMISE = "optimise"
    CHECK = "check"
    QUICK = "quick"
    LENGTH = "length"


@dataclass(frozen=True, eq=False)
class Calibration:
    """The calibration or check of one cell.

    Attributes:
        listed: the poses to measure, if a file lists them.
        accepted: the result that the controller has, of which a check starts; none where that is the
            drawing. A length check and the quick level have one.
        measured_noise: what settings and robot contain of it; none before it is measured.
        length_check: whether the length scale of a calibration is checked.
        effort: of the search for poses.
    """

    settings: CellSettings
    robot: Robot
    mode: Mode
    listed: PoseList | None = None
    accepted: AcceptedResult | None = None
    measured_noise: MeasuredNoise | None = None
    length_check: bool = False
    effort: SearchEffort = USUAL_EFFORT

    def __post_init__(self) -> None:
        # Checks, and the quick level that carries one on, have to do with all that may have drifted.
        if self.mode is not Mode.OPTIMISE and self.robot.identifies is not ParameterChoice.ALL:
            object.__setattr__(self, "robot", replace(self.robot, identifies=ParameterChoice.ALL))

    @property
    def length_poses(self) -> tuple[tuple[str, Pose], ...]:
        """The poses of the length check with their names; none without one."""
        steps = self._at_start.length
        is_wanted = self.length_check or self.mode is Mode.LENGTH
        return steps.planned_poses() if is_wanted and steps is not None else ()

    @cached_property
    def robot_checked(self) -> Robot:
        """The robot as the accepted result left it, with its drift since, before a length check."""
        assert self.accepted is not None  # noqa: S101 - without one no length check is begun
        covariance, drift = np.array(self.accepted.covariance), self.settings.check.drift_per_parameter_mm
        before = identified_before(self.robot, covariance, drift)
        return replace(self.robot, known=before.prior(1.0))

    @property
    def plan(self) -> Plan:
        """What is measured to identify the geometry, or to check it."""
        return self._at_start.plan

    @cached_property
    def check(self) -> Check:
        """The check of the robot as it is now."""
        limits, wanted, accepted = self.settings.acceptance, self.settings.check, self.accepted
        before, robot = None, self._at_temperatures(self.robot)
        if accepted is not None:
            covariance = np.array(accepted.covariance)
            before = identified_before(robot, covariance, wanted.drift_per_parameter_mm)
        return Check(
            self.settings,
            robot,
            before,
            ErrorLimits.of(limits),
            wanted.budget_records,
            self.listed,
            robot.effects,
            {} if accepted is None else accepted.parameter_columns,
            self.effort,
        )

    @cached_property
    def quick(self) -> QuickLevel:
        """The quick level, from the accepted result on."""
        return QuickLevel(self.check, self.settings.quick.budget_records)

    def informed(self, state: RunState) -> Calibration:
        """The same with what the run has learnt: its noise, and poses that are not commanded."""
        known = self._with_measured_noise(state)
        refused = known.robot.refused | state.refused
        return known if known.robot.refused == refused else known._without(refused)

    def _without(self, refused: RefusedCommands) -> Calibration:
        """The same where some poses are not commanded."""
        if refused not in self._with_refusals:
            self._with_refusals.clear()  # a run only adds to them
            self._with_refusals[refused] = replace(self, robot=replace(self.robot, refused=refused))
        return self._with_refusals[refused]

    def _with_measured_noise(self, state: RunState) -> Calibration:
        if state.noise is None or self.measured_noise is not None:
            return self
        measured = state.noise.noise
        if measured not in self._with_noise:
            settings = with_measured_noise(self.settings, measured)
            robot = self.robot.with_errors_of(settings)
            informed = replace(self, settings=settings, robot=robot, measured_noise=measured)
            self._with_noise[measured] = informed
        return self._with_noise[measured]

    def next_step(self, state: RunState) -> Step | None:
        """The step to execute; None if the run is over.

        Raises:
            HexacellError: no step is possible.
        """
        informed = self.informed(state)
        if state.recalled is None or state.ended is not None or state.config_write_pending:
            return informed._next_step(state)
        return informed._way_back(state)

    def _next_step(self, state: RunState) -> Step | None:
        if state.ended is not None:
            return None
        if state.config_write_pending:
            return Compute(kind="take back")
        measuring = self._measuring(state)
        if self.mode is Mode.LENGTH:
            return None if state.judged else self._length_step(state) or Compute(kind="judge")
        if self.mode is Mode.CHECK:
            return None if state.judged else measuring.points.next_step(state) or Compute(kind="judge")
        if state.identified is None:
            step = measuring.points.next_step(state)
            return step or Compute(kind="take back" if state.provisional_active else "identify")
        return measuring.held_out.next_step(state, Phase.BEFORE) or self._write_back(state)

    def _way_back(self, state: RunState) -> Step | None:
        """The next move back to the reference of the set in which the robot is; none where it is there.

        Nor is there one where the robot is in no set, is lost, or finds no safe path.
        """
        keys = [key for key in state.open_sets if state.set(key).samples]
        at_reference = state.at_pose is not None and state.at_pose[1] == 1
        if not keys or at_reference or state.position_unknown or state.target is None:
            return None
        key, measuring = keys[-1] if state.at_pose is None else state.at_pose[0], self._measuring(state)
        steps = measuring.points if key.phase is Phase.IDENTIFY else measuring.held_out
        try:
            return steps.way_back(state, key) if key in keys else None
        except HexacellError:
            return None

    def robot_of(self, state: RunState) -> Robot:
        """The robot with all geometries that commanded the records of the identification."""
        informed = self.informed(state)
        if self.mode is Mode.QUICK:
            robot = informed.quick.robot_after(state.measurements())
        else:
            robot = informed._identifying(state).robot
        return informed._at_temperatures(robot, state.temperature_range_k)

    def as_written(self, identified: Geometry) -> WrittenGeometry:
        """What the controller gets of a geometry in the frame convention."""
        return as_written(self.settings, self.robot, identified)

    def written_robot(self, state: RunState) -> Robot:
        """The robot with the proposed geometry in its controller."""
        informed = self.informed(state)
        return informed._at_temperatures(
            informed._commanded_by(informed._written(state)).robot, state.temperature_range_k
        )

    def _at_temperatures(self, robot: Robot, range_k: float | None = None) -> Robot:
        """The robot with the effects of temperatures read while measuring, and a scale measured before."""
        effects = stated_effects(self.settings, range_k)
        length = None if self.accepted is None else self.accepted.length
        known = (
            {} if self.accepted is None or self.mode is not Mode.QUICK else self.accepted.parameter_columns
        )
        return replace(robot, effects=with_measured_scale(effects, length), known_effects=known)

    def provisional_geometry(self, state: RunState) -> Geometry:
        """The estimate by now, or the provisional geometry that the run applied before an interruption.

        A run has only one, because poses that were commanded with it are visited again.

        Raises:
            HexacellError: the records so far give no estimate.
        """
        if state.provisional is not None:
            return geometry_of(state.provisional, self.robot)
        return self.informed(state)._at_start.points.estimate(state)

    def held_out_poses(self, identified: Identification) -> PosesByPoint:
        """See :meth:`HeldOutPoses.before`."""
        return self._at_start.held_out_poses.before(identified)

    def held_out_poses_after(self, identified: Identification, before: PosesByPoint) -> PosesByPoint:
        """See :meth:`HeldOutPoses.after`."""
        zeros = self.robot.identified_zeros(identified)
        written = self._commanded_by(self.as_written((zeros or identified).geometry).geometry)
        return written.held_out_poses.after(identified, before)

    def confirming_poses(self, identified: Identification, state: RunState) -> PosesByPoint:
        """See :meth:`HeldOutPoses.confirming`."""
        found = state.identified
        assert found is not None  # noqa: S101 - callers have a result
        return self._measuring(state).held_out_poses.confirming(
            identified, found.held_out, found.held_out_after
        )

    def held_out_replacements(
        self, identified: Identification, state: RunState
    ) -> Iterator[tuple[SixNumbers, SixNumbers]]:
        """Held-out poses that the controller refuses, each with another one, in the controller's frames.

        Those that were measured before the write-back are not replaced after it: both are compared. A point
        with too few others keeps what is left of its own, and one whose reference is refused is left.
        """
        found = state.identified
        assert found is not None  # noqa: S101 - its poses are held out of an identification
        references = [poses[0] if poses else None for poses in found.held_out]
        if state.committed is None:
            others = self._at_start.held_out_poses.after(identified, found.held_out)
            yield from replacements(state.refused, references, found.held_out, others)
        if found.held_out_after:
            others = self.held_out_poses_after(identified, found.held_out)
            yield from replacements(state.refused, references, found.held_out_after, others)

    def _write_back(self, state: RunState) -> Step | None:
        if state.proposed is None:
            return Compute(kind="propose")
        if state.judged is None:
            if state.rolling_back:
                return Compute(kind="roll back")
            if state.committed is None:
                return Compute(kind="commit")
            return self._verifying(state) or Compute(kind="judge")
        return _after_verdict(state, state.judged)

    def _verifying(self, state: RunState) -> Step | None:
        """The next step of what the verdict on the written geometry needs; none if all is measured."""
        held_out = self._measuring(state).held_out
        after = held_out.next_step(state, Phase.AFTER)
        length = None if after or not self.length_check else self._length_step(state)
        if after or length or state.confirmation is None:
            return after or length
        return held_out.next_step(state, Phase.CONFIRM)

    def _length_step(self, state: RunState) -> Step | None:
        """The next step of the length check; none when it is done."""
        steps = self._measuring(state).length
        return None if steps is None else steps.next_step(state)

    def _measuring(self, state: RunState) -> Measuring:
        """The steps for the geometry that the controller has now, and for those that it had."""
        if state.committed is None:
            return self._identifying(state)
        return self._commanded_by(self._written(state))

    def _written(self, state: RunState) -> Geometry:
        """The proposed geometry; runs of before there was a choice of frames did not note it."""
        assert state.identified is not None  # noqa: S101 - only then there is a proposal
        parameters = self.robot.mechanism.parameters
        if state.proposed is None or state.proposed.written is None:
            return self.as_written(state.identified.result.identified(parameters)).geometry
        return Geometry.of(parameters, state.proposed.written)

    def _commanded_by(self, written: Geometry) -> Measuring:
        """The steps once the controller has a geometry."""
        key = written.vector.tobytes()
        if key not in self._with_result:
            robot = self.robot.with_controller(written)
            self._with_result[key] = Measuring(self._calibrating(robot))
        return self._with_result[key]

    def _identifying(self, state: RunState) -> Measuring:
        """The steps for the geometries that the controller has while the points are measured."""
        if state.provisional is None:
            return self._at_start
        if state.provisional_active not in self._with_provisional:
            geometry = geometry_of(state.provisional, self.robot)
            robot = self.robot.with_provisional(geometry, is_used=state.provisional_active)
            plan = self._calibrating(robot)
            self._with_provisional[state.provisional_active] = Measuring(plan)
        return self._with_provisional[state.provisional_active]

    @cached_property
    def _at_start(self) -> Measuring:
        if self.mode in {Mode.CHECK, Mode.QUICK}:
            return Measuring((self.check if self.mode is Mode.CHECK else self.quick).plan)
        return Measuring(self._calibrating(self.robot_checked if self.mode is Mode.LENGTH else self.robot))

    def _calibrating(self, robot: Robot) -> Plan:
        return Plan(self.settings, robot, self.listed, self.effort)

    @cached_property
    def _with_noise(self) -> dict[MeasuredNoise, Calibration]:
        """By the noise that was measured, once in a run."""
        return {}

    @cached_property
    def _with_refusals(self) -> dict[RefusedCommands, Calibration]:
        """By the poses that the controller refused so far."""
        return {}

    @cached_property
    def _with_provisional(self) -> dict[bool, Measuring]:
        """By whether the provisional geometry, one in a run, commands now."""
        return {}

    @cached_property
    def _with_result(self) -> dict[bytes, Measuring]:
        """By the geometry that is written."""
        return {}


def _after_verdict(state: RunState, judged: events.ResultValidated) -> Step | None:
    """What follows a verdict on a written geometry: it stays, or a person decides, or it is rolled back."""
    if judged.verdict is Verdict.PASS or state.rolled_back:
        return None
    is_offered = judged.verification is not None and judged.verification.is_offered
    if is_offered and state.accepted is None and not state.rolling_back:
        return Compute(kind="accept")
    is_kept = state.accepted is not None and state.accepted.by is not None
    return None if is_kept else Compute(kind="roll back")


def geometry_of(applied: events.ProvisionalApplied, robot: Robot) -> Geometry:
    """The provisional geometry, in the mechanism's frame convention."""
    return Geometry.of(robot.mechanism.parameters, applied.geometry)
