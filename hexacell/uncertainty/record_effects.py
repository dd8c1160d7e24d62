"""What the stated effects of a machine may do to its records, for the tests of its model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.systematic_errors import MeasuredPoses, SystematicErrors
from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effects import Effect, Occurrence, Placement, Readings


@dataclass(frozen=True, slots=True, eq=False)
class RecordEffects:
    """The errors of records by effects, for the tests of an identification.

    Effects that the estimator has as unknowns of its own are left out.
    """

    effects: tuple[Effect, ...]

    def __call__(self, measured: MeasuredPoses, /) -> SystematicErrors:
        """Of n records at measured poses."""
        placement = Placement(measured.mechanism, measured.geometry, measured.poses, measured.joints)
        readings = Readings(measured.poses.rotations, measured.deviations, measured.gauges)
        common: list[Array] = [np.zeros((len(placement), 3, 0))]
        own = np.zeros((len(placement), 3, 3))
        for effect in self.effects:
            if not effect.size or effect.is_estimated or not effect.occurrence.is_in_records:
                continue
            errors = effect.size * errors_of_records(effect, placement, readings)
            if effect.occurrence is Occurrence.EVERY_STOP:
                own = own + errors @ np.swapaxes(errors, -1, -2)
            else:
                common.append(errors)
        return SystematicErrors(np.concatenate(common, axis=-1), own)


def errors_of_records(effect: Effect, placement: Placement, readings: Readings) -> Array:
    """Errors (n, 3, k), mm, of the records by one unit of each cause of an effect."""
    parts: list[Array] = [np.zeros((len(placement), 3, 0))]
    if effect.on_poses is not None:
        parts.append(effect.on_poses(placement)[:, :3])
    if effect.on_readings is not None:
        parts.append(effect.on_readings(readings))
    return np.concatenate(parts, axis=-1)
