"""What is calibrated, and what a run has learnt of it so far; which step comes next is decided elsewhere.

A check measures points until they decide, and nothing else (:mod:`~hexacell.checks.check`); the quick level
carries a check on to a geometry (:mod:`~hexacell.checks.quick_level`). A length check, of its own or before
the verdict on a calibration, measures two seats. Nothing here uses hardware or files, so a run, its
resumption and its replay compute alike.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property, lru_cache, partial

import numpy as np

from hexacell.campaign.decisions import CampaignState
from hexacell.campaign.planner import Plan
from hexacell.campaign.pose_list import PoseList
from hexacell.campaign.time_model import planned_records
from hexacell.cell.model import CellSettings
from hexacell.checks.check import Check, identified_before
from hexacell.checks.quick_level import QuickLevel
from hexacell.design.search_effort import USUAL_EFFORT, SearchEffort
from hexacell.errors import IdentifiabilityError
from hexacell.identification.estimator import identify
from hexacell.identification.identified_zeros import ParameterChoice
from hexacell.identification.problem.prior import IdentifiedBefore
from hexacell.identification.problem.random_walk import NO_WALK, GaugeWalk
from hexacell.identification.solver.result import Identification
from hexacell.identification.thermal_expansion import known_parts
from hexacell.kinematics.commanded_motion import RefusedCommands
from hexacell.kinematics.corrections import Corrections
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.pose import Pose
from hexacell.measurements.records import MeasurementSet
from hexacell.noise.allowances import Allowances
from hexacell.noise.measured_noise import MeasuredNoise, with_measured_noise
from hexacell.noise.repeats import SIGNIFICANCE, Repeats
from hexacell.results.result import AcceptedResult
from hexacell.results.term_result import known_terms
from hexacell.robot.model import Robot
from hexacell.robot.stated import noise_of, stated_effects
from hexacell.verdict.length_check import with_measured_scale
from procedures.calibration.repeatability import noise_again, repeated_readings
from procedures.run.keys import Phase, SetKey
from procedures.run.state import RunState


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
        accepted: the result from which anything but a calibration starts; None where that is the drawing.
        length_check: whether the length scale of a calibration is checked.
    """

    settings: CellSettings
    robot: Robot
    mode: Mode
    listed: PoseList | None = None
    accepted: AcceptedResult | None = None
    length_check: bool = False
    effort: SearchEffort = USUAL_EFFORT

    def __post_init__(self) -> None:
        # Checks, and the quick level that carries one on, have to do with all that may have drifted.
        if self.mode is not Mode.OPTIMISE and self.robot.identifies is not ParameterChoice.ALL:
            object.__setattr__(self, "robot", replace(self.robot, identifies=ParameterChoice.ALL))

    def known(self, state: RunState) -> "Knowledge":
        """What is known of the robot in a state of the run; one object as long as nothing new is learnt."""
        vector, lent, proposed = self.robot.mechanism.parameters.vector, state.provisional, state.proposed
        return self._knowledge(
            self.robot.refused | state.refused,
            None if state.noise is None else state.noise.noise,
            None if lent is None else tuple(vector(lent.geometry).tolist()),
            state.provisional_active,
            None if proposed is None else tuple(vector(proposed.written).tolist()),
            None if proposed is None else proposed.corrections,
            state.committed is not None,
            state.walk,
        )

    @cached_property
    def at_start(self) -> "Knowledge":
        """What is known before anything is measured."""
        return Knowledge(self, self.robot.refused)

    @cached_property
    def _knowledge(self) -> "Callable[..., Knowledge]":
        # What was searched and estimated for a step serves the next one; a run returns to what it knew when
        # a provisional geometry is taken back.
        return lru_cache(maxsize=4)(partial(Knowledge, self))

    @property
    def plan(self) -> Plan:
        """What is measured to identify the geometry, or to check it, as far as it is known at the start."""
        return self.at_start.plan

    def provisional_of(self, state: RunState) -> Geometry | None:
        """The provisional geometry of a run, in the mechanism's frame convention; None if it had none."""
        lent = state.provisional
        return None if lent is None else Geometry.of(self.robot.mechanism.parameters, lent.geometry)

    def robot_checked(self, robot: Robot) -> Robot:
        """A robot as the accepted result left it, with its drift since, before a length check."""
        assert self.accepted is not None  # noqa: S101 - without one no length check is begun
        return replace(self.as_known(robot), known=self.before(robot, self.accepted).prior(1.0))

    def as_known(self, robot: Robot) -> Robot:
        """A robot with the terms beside its geometry by the accepted result, if there is one."""
        if self.accepted is None:
            return robot
        return replace(robot, known_terms=known_terms(robot.terms, self.accepted.terms))

    def before(self, robot: Robot, accepted: AcceptedResult) -> IdentifiedBefore:
        """The geometry by an accepted result."""
        stated, drift = accepted.identified, self.settings.check.drift_per_parameter_mm
        identified = None if stated is None else Geometry.of(robot.mechanism.parameters, stated)
        return identified_before(robot, np.array(accepted.covariance), drift, identified)


@dataclass(frozen=True, eq=False)
class Knowledge:
    """A calibration with what its run has learnt and done so far.

    Attributes:
        refused: what the cell file excludes and the controller refused.
        noise: what was measured of it; None before that, or where the cell file does not ask for it.
        provisional: parameters of the geometry that the controller was given for a while, in the
            mechanism's frame convention; ``is_lent``: it has it now.
        written: parameters of the proposed geometry, in the controller's frames, with the ``corrections``
            that are proposed beside it; ``is_committed``: the controller has it.
        walk: how the gauges drift.
        significance: the probability below which repeats show more noise than was measured.
    """

    calibration: Calibration
    refused: RefusedCommands
    noise: MeasuredNoise | None = None
    provisional: tuple[float, ...] | None = None
    is_lent: bool = False
    written: tuple[float, ...] | None = None
    corrections: Corrections | None = None
    is_committed: bool = False
    walk: GaugeWalk = NO_WALK
    significance: float = SIGNIFICANCE

    @cached_property
    def settings(self) -> CellSettings:
        """What the cell file states, with the measured noise."""
        settings, noise = self.calibration.settings, self.noise
        return settings if noise is None else with_measured_noise(settings, noise)

    @cached_property
    def robot(self) -> Robot:
        """The robot as its controller commanded it at the start, with the measured noise."""
        robot = replace(self.calibration.robot, refused=self.refused)
        robot = robot if self.noise is None else robot.with_errors_of(self.settings)
        return self._drifting(robot)

    @cached_property
    def plan(self) -> Plan:
        """The plan of what is measured first, for the geometry that the controller has at the start."""
        match self.calibration.mode:
            case Mode.QUICK:
                return self.quick.plan
            case Mode.CHECK:
                return self.check.plan
            case Mode.LENGTH:
                return self._plan_of(self.calibration.robot_checked(self.robot))
        return self._plan_of(self.robot)

    @cached_property
    def identifying(self) -> Plan:
        """The plan for the geometries that the controller has while the points are measured."""
        if (lent := self.provisional) is None:
            return self.plan
        geometry = Geometry(self.robot.mechanism.parameters, lent)
        return self._plan_of(self.robot.with_provisional(geometry, is_used=self.is_lent))

    @cached_property
    def measuring(self) -> Plan:
        """The plan for the geometry that the controller has now, and for those that it had."""
        if not self.is_committed:
            return self.identifying
        return self._plan_of(self.robot.with_controller(self._written, self.corrections))

    @cached_property
    def allowances(self) -> Allowances:
        """What may be off at a stop, and back at a reference."""
        return Allowances(self.calibration.settings, self.measuring.robot, self.noise is not None)

    @cached_property
    def check(self) -> Check:
        """The check of the robot as it is now."""
        calibration, wanted, accepted = self.calibration, self.settings.check, self.calibration.accepted
        robot = calibration.as_known(self._at_temperatures(self.robot, self.settings))
        before = None if accepted is None else calibration.before(robot, accepted)
        return Check(
            self.settings,
            robot,
            before,
            wanted.budget_records,
            calibration.listed,
            robot.effects,
            {} if accepted is None else accepted.parameter_columns,
            calibration.effort,
        )

    @cached_property
    def quick(self) -> QuickLevel:
        """The quick level, from the accepted result on."""
        return QuickLevel(self.check, self.settings.quick.budget_records)

    def robot_of(self, state: RunState) -> Robot:
        """The robot with all geometries that commanded the records of the identification."""
        if self.calibration.mode is Mode.QUICK:
            robot = self.quick.robot_after(state.measurements())
        else:
            robot = self.identifying.robot
        return self._measured(robot, state)

    def written_robot(self, state: RunState) -> Robot:
        """The robot with the proposed geometry in its controller."""
        return self._measured(self.robot.with_controller(self._written, self.corrections), state)

    def _measured(self, robot: Robot, state: RunState) -> Robot:
        """The robot with the noise that all repeats show, by the geometry that the records show.

        Those of a check do not show the geometry, which is known before.
        """
        first = self._as_measured(robot, state)
        if state.noise is None or self.calibration.mode is not Mode.OPTIMISE:
            return first
        try:
            found = identify(first.problem(state.measurements()))
        except IdentifiabilityError:  # too few by now
            return first
        measured = self._as_measured(robot, state, found)
        if self.walk.step_mm and not identify(measured.problem(state.measurements())).goodness.is_explained:
            # What does not repeat otherwise has seemed a drift.
            return replace(self, walk=NO_WALK)._measured(robot, state)
        return measured

    def _as_measured(self, robot: Robot, state: RunState, found: Identification | None = None) -> Robot:
        """The robot with the temperatures read while measuring, and the noise that all repeats show.

        They show it by the geometry that was ``found``, or by the one known before.
        """
        noise, settings = self.noise, self.settings
        if noise is not None and found is not None:
            noise = noise_again(self.calibration.plan, state, found, self.walk) or noise
            settings = with_measured_noise(self.calibration.settings, noise)
            robot = replace(robot, noise=noise_of(settings))
        robot = replace(robot, expansion=robot.expansion.referred_to(state.measurements()))
        samples = (one for phase in Phase for one in state.samples(phase))
        temperatures = (one.reading.part_temperatures for one in samples)
        known = known_parts(temperatures, self.robot.mechanism.joint_count)
        on_legs = [one.name for one in settings.thermometers if known and one.legs]
        robot = self._at_temperatures(robot, settings, state.temperature_range_k(on_legs), known)
        if noise is None:
            return robot
        robot = self._drifting(robot)
        identifying = replace(self.identifying.robot, noise=robot.noise)
        allowances = Allowances(self.calibration.settings, identifying, is_measured=True, found=found)
        changes = repeated_readings(state, self.calibration.plan, allowances)
        about = noise.approaches, [*changes], robot.noise, found
        return Repeats.of(*about, significance=self.significance).applied_to_robot(robot)

    def _drifting(self, robot: Robot) -> Robot:
        return replace(robot, noise=replace(robot.noise, walk=self.walk))

    def provisional_geometry(self, state: RunState) -> Geometry:
        """The estimate by now, or the provisional geometry that the run applied before an interruption.

        A run has only one, because poses that were commanded with it are visited again.
        """
        lent = self.calibration.provisional_of(state)
        return self.plan.estimate(campaign_state(state, None)).belief.estimate if lent is None else lent

    @property
    def _written(self) -> Geometry:
        assert self.written is not None  # noqa: S101 - only then there is a proposal
        return Geometry(self.robot.mechanism.parameters, self.written)

    def _plan_of(self, robot: Robot) -> Plan:
        calibration = self.calibration
        return Plan(self.settings, robot, calibration.listed, calibration.effort)

    def _at_temperatures(
        self,
        robot: Robot,
        settings: CellSettings,
        range_k: float | None = None,
        parts: Collection[MachinePart] = (),
    ) -> Robot:
        """The robot with the effects of temperatures read while measuring, and a scale measured before."""
        accepted = self.calibration.accepted
        effects = stated_effects(settings, range_k, parts)
        length = None if accepted is None else accepted.length
        is_carried_on = accepted is not None and self.calibration.mode is Mode.QUICK
        known = accepted.parameter_columns if accepted is not None and is_carried_on else {}
        return replace(robot, effects=with_measured_scale(effects, length), known_effects=known)


def expected_records(
    settings: CellSettings, mode: Mode, listed: PoseList | None = None, *, length_check: bool = False
) -> int:
    """The largest number of settled readings in a whole run, closings of sets included."""
    fixture = settings.length_check
    length = 0 if fixture is None else fixture.mountings * (fixture.orientations + 2)
    if mode is Mode.LENGTH:
        return length
    plan, held_out = settings.identification, settings.verification
    points = len(held_out.points)
    verification = points * (held_out.compared + 1 + held_out.afterwards + 1)
    if mode is Mode.CHECK:
        return settings.check.budget_records + len(plan.points)
    records = planned_records(settings) if listed is None else len(listed)
    budget = settings.quick.budget_records if mode is Mode.QUICK else plan.budget_records
    identification = min(records, budget or records) + len(plan.points)
    return identification + verification + (length if length_check else 0)


def campaign_state(state: RunState, key: SetKey | None) -> CampaignState:
    """The run as the campaign knows it, with an open set or none.

    Records are in the order in which their sets were measured.
    """
    sets = {at: measured for at, measured in state.sets.items() if at.phase is Phase.IDENTIFY}
    records = tuple(sample.record for measured in sets.values() for sample in measured.samples)
    closed = {at.point for at, measured in sets.items() if measured.closed}
    # Those whose reference the controller refuses cannot be measured.
    refused = {one.at for one in state.excluded if one.at.phase is Phase.IDENTIFY}
    return CampaignState(
        measurements=MeasurementSet(records),
        point=None if key is None else key.point,
        done=frozenset(closed | {at.point for at in refused if state.is_left(at)}),
        present=_present_pose(state, key),
        rejections=0 if key is None else state.set(key).rejections,
        zero_mm=None if key is None else state.zero_shown(key),
        pilots=state.pilots,
    )


def _present_pose(state: RunState, key: SetKey | None) -> Pose | None:
    """The pose that the robot was commanded to last, that of a rejected record included.

    None between points where somebody brought it there: it can be brought elsewhere, too.
    """
    if state.target is not None and (key is not None or state.at_pose is not None):
        return Pose(*state.target)
    if key is None:
        return None
    samples = state.set(key).samples
    return Pose(*samples[-1].pose) if samples else None
