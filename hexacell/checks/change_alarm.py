"""The alarm of a check: whether its first records contradict a robot that has not changed since.

It is no verdict: a robot may have changed and still be within its limit, and most changes that are not of a
single parameter are seen later. It says early that something happened, and probably to which leg.
"""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hexacell.cell.fields import Frozen
from hexacell.cell.model import CellSettings
from hexacell.checks.check import Check
from hexacell.drift.run_evidence import Causes, WhitenedRecords, whiten_records
from hexacell.drift.single_cause import SingleCauseTest, possible_groups, single_cause_test
from hexacell.identification.problem.prior import IdentifiedBefore
from hexacell.kinematics.mechanism import free_parameter_derivatives
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MEASURED_PARTS, MeasurementSet, Temperatures
from hexacell.robot.model import Robot
from hexacell.uncertainty.effects import Effect, Occurrence, errors_by_effects

FIRST_RECORDS = 8
"""Number of a check's first records that are tested, references included."""


class ChangeAlarm(Frozen):
    """Whether the first records of a check contradict a robot that has not changed since, by one parameter.

    Attributes:
        score: the largest of all parameters; each is standard normal for an unchanged robot.
        limit: what the largest exceeds in one of a hundred checks of unchanged robots.
        leg: the leg that changed, if one did, by all records of the check; its likeliest ``parameter``,
            the ``change`` of that and its standard deviation, if it alone changed.
    """

    records: int
    score: float
    limit: float
    leg: int
    parameter: str
    unit: str
    change: float
    sigma: float

    @property
    def is_raised(self) -> bool:
        """Whether an unchanged robot is contradicted."""
        return self.score > self.limit


def change_alarm(
    check: Check, measurements: MeasurementSet, before_c: Temperatures = ()
) -> ChangeAlarm | None:
    """Whether the first records raise an alarm, and which leg all of them name.

    Records that the others prove false are not tested. ``before_c`` are the temperatures, deg C, of legs
    and base at the result before. No test is possible where one that has a temperature now had none.
    """
    before, false = check.before, check.false_records(measurements)
    sound = [row for row, one in enumerate(measurements.records) if one.id not in false]
    if before is None or len(sound) < FIRST_RECORDS:
        return None
    reference = (*before_c, *(None,) * MEASURED_PARTS)[:MEASURED_PARTS]
    expansion = replace(check.robot.expansion, reference_c=reference)
    has_new_part = expansion.referred_to(measurements) != expansion
    if has_new_part or has_silent_leg(check.settings, measurements):
        return None
    check = replace(check, robot=replace(check.robot, expansion=expansion))
    first, _ = _single_causes(check, before, measurements, sound[:FIRST_RECORDS])
    every, legs = _single_causes(check, before, measurements, sound)
    leg = possible_groups(every.scores, every.sigmas, legs)[0]
    of_leg = np.flatnonzero(legs == leg)
    cause = possible_groups(every.scores[of_leg], every.sigmas[of_leg], of_leg)[0]
    parameter = check.robot.mechanism.parameters.parameters[cause]
    return ChangeAlarm(
        records=FIRST_RECORDS,
        score=float(np.abs(first.scores).max()),
        limit=first.limit,
        leg=leg,
        parameter=parameter.name,
        unit=parameter.kind.unit.value,
        change=float(every.changes[cause]),
        sigma=float(every.sigmas[cause]),
    )


def has_silent_leg(settings: CellSettings, measurements: MeasurementSet) -> bool:
    """Whether a leg with a thermometer has no temperature at any of some records."""
    shown = np.logical_or.reduce(np.isfinite(measurements.temperatures), axis=0)
    return not all(shown[leg - 1] for one in settings.thermometers for leg in one.legs)


def _single_causes(
    check: Check, before: IdentifiedBefore, measurements: MeasurementSet, rows: list[int]
) -> tuple[SingleCauseTest, NDArray[np.int_]]:
    """The test of a change of each parameter by some of the records, and the legs of the parameters."""
    robot = check.robot
    some = MeasurementSet(tuple(measurements.records[row] for row in rows))
    records = machine_records(robot, some, robot.free_parameters)
    causes = machine_causes(robot, len(records.state))
    covariance = _state_covariance(before.covariance, robot.effects, check.earlier, len(records.state))
    return single_cause_test(records, covariance, causes.by_state), causes.legs


def machine_records(robot: Robot, measurements: MeasurementSet, free: Array) -> WhitenedRecords:
    """The records of a run at the free parameters (p,), with what differs from run to run as noise."""
    own = tuple(one for one in robot.effects if one.occurrence is Occurrence.MEASURING)
    shared = tuple(one for one in robot.effects if one.occurrence is not Occurrence.MEASURING)
    problem = replace(robot.problem(measurements), systematic=partial(errors_by_effects, shared))
    return whiten_records(problem, free, of_this_run=partial(errors_by_effects, own))


def machine_causes(robot: Robot, states: int) -> Causes:
    """A change of each parameter of the machine, those that define the frames as well."""
    derivatives = free_parameter_derivatives(robot.mechanism, robot.commanding)
    free = derivatives.shape[1]
    legs = np.array([one.leg for one in robot.mechanism.parameters.parameters])
    return Causes(np.pad(derivatives, ((0, 0), (0, states - free))), legs, free)


def _state_covariance(
    covariance: Array, effects: tuple[Effect, ...], earlier: Mapping[str, Array], states: int
) -> Array:
    """The covariance of the truth about an estimate, whose noise is (p, p), and of the shared causes (k).

    A cause b that made the estimate err by ``K b`` is the same now: the truth is at ``-K b``.
    """
    free = len(covariance)
    shared = [one for one in effects if one.size and one.occurrence is Occurrence.CONSTANT]
    acting = [one for one in shared if not one.is_estimated and one.name in earlier]
    columns = [np.zeros((free, 0)), *(one.size * earlier[one.name] for one in acting)]
    moved = np.concatenate(columns, axis=1)
    if moved.shape[1] != states - free:  # the cell file states other effects now
        moved = np.zeros((free, states - free))
    return np.asarray(np.block([[covariance + moved @ moved.T, -moved], [-moved.T, np.eye(states - free)]]))
