"""The alarm of a check: whether its first records contradict a robot that has not changed since.

It is no verdict: a robot may have changed and still be within its limit, and most changes that are not of a
single parameter are seen later. It says early that something happened, and probably to which leg.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hexacell.drift.causes import Causes
from hexacell.drift.leg_evidence import likeliest_leg
from hexacell.drift.run_evidence import WhitenedRecords, whiten_records
from hexacell.drift.single_cause import SingleCauseTest, single_cause_test
from hexacell.kinematics.frame_derivatives import free_parameter_derivatives
from hexacell.kinematics.rotations import Array
from hexacell.measurements.records import MeasurementSet
from hexacell.robot.model import Robot
from hexacell.uncertainty.effects import Effect, Occurrence
from hexacell.uncertainty.geometry_drift import IdentifiedBefore
from hexacell.uncertainty.record_effects import RecordEffects

FIRST_RECORDS = 8
"""Of a check, references included."""


@dataclass(frozen=True, slots=True, eq=False)
class ChangeTest:
    """The test of single causes, and the leg that changed if one did.

    Attributes:
        cause: index of the likeliest parameter of that leg.
    """

    test: SingleCauseTest
    leg: int
    cause: int


def change_test(
    robot: Robot,
    before: IdentifiedBefore,
    measurements: MeasurementSet,
    earlier: Mapping[str, Array],
    expansion: Array | None = None,
) -> ChangeTest:
    """Test records of a robot that was identified before against its not having changed since.

    Args:
        robot: with the systematic effects, which act as they did then.
        before: the identification.
        measurements: some records.
        earlier: what the effects did to that identification, as in :class:`~hexacell.checks.check.Check`.
        expansion: (n, P), by how much the parameters differ at each record from those of then.
    """
    records = machine_records(robot, measurements, robot.free_parameters, expansion)
    causes = machine_causes(robot, len(records.state))
    covariance = _state_covariance(before.covariance, robot.effects, earlier, len(records.state))
    found = single_cause_test(records, covariance, causes.by_state)
    leg = likeliest_leg(found.scores, found.sigmas, causes.legs)
    of_leg = np.where(causes.legs == leg, np.abs(found.scores), -1.0)
    return ChangeTest(found, leg, int(of_leg.argmax()))


def machine_records(
    robot: Robot, measurements: MeasurementSet, free: Array, expansion: Array | None = None
) -> WhitenedRecords:
    """The records of a run at the free parameters (p,), with what differs from run to run as noise."""
    own = tuple(one for one in robot.effects if one.occurrence is Occurrence.MEASURING)
    shared = tuple(one for one in robot.effects if one.occurrence is not Occurrence.MEASURING)
    problem = replace(robot.problem(measurements), systematic=RecordEffects(shared))
    order = np.argsort(measurements.group, kind="stable")
    by_row = None if expansion is None else expansion[order]
    return whiten_records(problem, free, of_this_run=RecordEffects(own), expansion=by_row)


def machine_causes(robot: Robot, states: int) -> Causes:
    """A change of each parameter of the machine, those that define the frames as well."""
    derivatives = free_parameter_derivatives(robot.mechanism, robot.commanding)
    free = derivatives.shape[1]
    legs = np.array([one.leg for one in robot.mechanism.parameters.parameters])
    return Causes(np.pad(derivatives, ((0, 0), (0, states - free))), legs, free)


def _state_covariance(
    covariance: Array, effects: tuple[Effect, ...], earlier: Mapping[str, Array], states: int
) -> Array:
    """Of the truth about an estimate with a covariance (p, p) of noise, and of the shared causes (k).

    A cause b that made the estimate err by ``K b`` is the same now: the truth is at ``-K b``.
    """
    free = len(covariance)
    acting = [one for one in effects if _is_shared(one) and one.name in earlier]
    columns = [np.zeros((free, 0)), *(one.size * earlier[one.name] for one in acting)]
    moved = np.concatenate(columns, axis=1)
    if moved.shape[1] != states - free:  # the cell file states other effects now
        moved = np.zeros((free, states - free))
    causes = np.eye(states - free)
    both = np.block([[covariance + moved @ moved.T, -moved], [-moved.T, causes]])
    return np.asarray(both)


def _is_shared(effect: Effect) -> bool:
    return bool(effect.size) and not effect.is_estimated and effect.occurrence is Occurrence.CONSTANT
