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
from hexacell.checks.check import Check
from hexacell.drift.run_evidence import Causes, WhitenedRecords, whiten_records
from hexacell.drift.single_cause import SingleCauseTest, possible_legs, single_cause_test
from hexacell.identification.problem.prior import IdentifiedBefore
from hexacell.identification.thermal_expansion import ThermalExpansion
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import free_parameter_derivatives
from hexacell.kinematics.parameters import MachinePart
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot
from hexacell.uncertainty.effects import Effect, Occurrence, errors_by_effects

FIRST_RECORDS = 8
"""Number of a check's first records that are tested, references included."""

UM_PER_M = 1e-6
"""A relative expansion of 1 um/m."""


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
    check: Check, measurements: MeasurementSet, warmer: Array | None = None
) -> ChangeAlarm | None:
    """Whether the first records raise an alarm, and which leg all of them name.

    Records that the others prove false are not tested. ``warmer`` (n, 6), K, is how much warmer the legs
    were at each record than at the result before. Where that is not known (NaN) no test is possible.
    """
    before, false = check.before, check.false_records(measurements)
    sound = [row for row, one in enumerate(measurements.records) if one.id not in false]
    if before is None or len(sound) < FIRST_RECORDS:
        return None
    expansion = None
    if warmer is not None and warmer.any():
        if np.isnan(warmer).any():
            return None
        by_kelvin = check.settings.uncertainty.expansion_legs_um_m_k
        expansion = leg_expansion(check.robot.commanding, by_kelvin, warmer)
    first, _ = _single_causes(check, before, measurements, sound[:FIRST_RECORDS], expansion)
    every, legs = _single_causes(check, before, measurements, sound, expansion)
    leg = possible_legs(every.scores, every.sigmas, legs)[0]
    cause = int(np.where(legs == leg, np.abs(every.scores), -1.0).argmax())
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


def _single_causes(
    check: Check,
    before: IdentifiedBefore,
    measurements: MeasurementSet,
    rows: list[int],
    expansion: Array | None,
) -> tuple[SingleCauseTest, NDArray[np.int_]]:
    """The test of a change of each parameter by some of the records, and the legs of the parameters."""
    robot, by_row = check.robot, None if expansion is None else expansion[rows]
    some = MeasurementSet(tuple(measurements.records[row] for row in rows))
    records = machine_records(robot, some, robot.free_parameters, by_row)
    causes = machine_causes(robot, len(records.state))
    covariance = _state_covariance(before.covariance, robot.effects, check.earlier, len(records.state))
    return single_cause_test(records, covariance, causes.by_state), causes.legs


def machine_records(
    robot: Robot, measurements: MeasurementSet, free: Array, expansion: Array | None = None
) -> WhitenedRecords:
    """The records of a run at the free parameters (p,), with what differs from run to run as noise."""
    own = tuple(one for one in robot.effects if one.occurrence is Occurrence.MEASURING)
    shared = tuple(one for one in robot.effects if one.occurrence is not Occurrence.MEASURING)
    # What thermometers on legs show is in ``expansion``, and not in the joint variables as well.
    as_read = replace(robot, expansion=ThermalExpansion())
    problem = replace(as_read.problem(measurements), systematic=partial(errors_by_effects, shared))
    order = np.argsort(measurements.group, kind="stable")
    by_row = None if expansion is None else expansion[order]
    return whiten_records(problem, free, of_this_run=partial(errors_by_effects, own), expansion=by_row)


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
    causes = np.eye(states - free)
    both = np.block([[covariance + moved @ moved.T, -moved], [-moved.T, causes]])
    return np.asarray(both)


def leg_expansion(geometry: Geometry, um_per_m_k: float, warmer: Array) -> Array:
    """By how much the parameters (n, P) differ where legs are ``warmer`` (n, 6), K, than in a geometry."""
    parameters = geometry.parameters
    of_legs = np.array([one.kind.part is MachinePart.LEGS for one in parameters.parameters])
    legs = np.array([one.leg for one in parameters.parameters])
    by_kelvin = np.where(of_legs, UM_PER_M * um_per_m_k * geometry.vector, 0.0)
    return np.asarray(warmer[:, legs - 1] * by_kelvin)
