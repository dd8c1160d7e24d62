"""The length check: the machine's unit of length against a certified distance.

With the gauges mounted in two seats whose distance L is known, each record r has the place of its seat,

    P_r - d_r = z_seat + errors,

with P_r by the forward kinematics of the judged geometry at the joint variables shown. What ``|z_2 -
z_1|`` is longer than L shows the scale of the encoders. All errors, propagated to first order, give the
covariance of all records, and generalized least squares the places z. The weighted residuals have a
chi-square distribution with 3 n - 6 degrees of freedom: a fixture that moved, or gauges that were zeroed
in between, do not agree with it. ``docs/uncertainty.md`` (Length check) has more.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexacell.identification.problem.prior import Noise
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.kinematics.rotations import Array
from hexacell.kinematics.sensitivity import POSITION, free_sensitivity
from hexacell.uncertainty import length_records
from hexacell.uncertainty.effect_kinds import COMMON_SCALE, common_encoder_scale
from hexacell.uncertainty.effects import Effect
from hexacell.uncertainty.propagation import ScaleObservation, each_alone
from hexacell.uncertainty.statement import COVERAGE_FACTOR, covariance_factor

HARDLY_MM2 = 0.01
"""Sum of squared displacements below which the direction of a gauge is unknown."""


@dataclass(frozen=True, eq=False)
class LengthCheck:
    """A length by the robot, and all that is not known of it.

    Attributes:
        jacobian: (n, 3, p) of the ball's positions by the free parameters.
        noise: (n, 3, 3) covariance of each record by the noise of its readings, mm^2.
        errors: all other errors of the records.
        by_effects: (n, 3, k) errors of the places by one unit of each shared cause of an effect, by name.
        by_scale: (n, 3, 1) errors of the places by 1 um/m of the scale common to all encoders.
    """

    records: length_records.LengthRecords
    standard: length_records.LengthStandard
    jacobian: Array
    noise: Array
    errors: tuple[length_records.LengthError, ...]
    by_effects: Mapping[str, Array]
    by_scale: Array

    @classmethod
    def of(
        cls,
        records: length_records.LengthRecords,
        standard: length_records.LengthStandard,
        noise: Noise,
        judged: length_records.JudgedGeometry,
        effects: Iterable[Effect] = (),
    ) -> "LengthCheck":
        """The check of the geometry that the records have, of which is known what is ``judged``.

        Of the ``effects`` that the machine may have the scale common to all encoders does not count.
        """
        placement = records.placement
        mechanism, geometry = placement.mechanism, placement.geometry
        found = free_sensitivity(mechanism, geometry, placement.poses, placement.joints, POSITION)
        jacobian = found.free
        acting = [one for one in effects if one.occurrence.is_in_records and one.name != COMMON_SCALE]
        shared = {one.name: length_records.shared_errors(records, jacobian, judged, one) for one in acting}
        by_geometry = jacobian @ covariance_factor(judged.covariance)
        by_effect = (
            error
            for one in acting
            for error in length_records.errors_by_effect(records, one, shared[one.name])
        )
        errors = (
            length_records.LengthError("covariance of the geometry", by_geometry, is_shared=True),
            *length_records.errors_by_gauges(records, standard, noise),
            *by_effect,
        )
        scaled = judged.with_scale(mechanism, geometry)
        by_scale = length_records.shared_errors(records, jacobian, scaled, common_encoder_scale(1.0))
        noises = noise.record_covariance(found.joints)
        return cls(records, standard, jacobian, noises, errors, shared, by_scale)

    @property
    def length_mm(self) -> float:
        """Distance of the two places by the robot."""
        return float(np.linalg.norm(self._between))

    @property
    def encoders_long_um_m(self) -> float:
        """How much more than the certified length the encoders show, um/m."""
        return float(self._share(self.length_mm - self.standard.distance_mm))

    @property
    def expanded_um_m(self) -> float:
        """Expanded uncertainty U of the scale error, k = 2, um/m."""
        return COVERAGE_FACTOR * math.hypot(*self.lines.values())

    @cached_property
    def lines(self) -> Mapping[str, float]:
        """One standard deviation by each source, um/m."""
        lines = {**self._of_standard, "noise of the readings": self._of_noise}
        for error in self.errors:
            lines[error.name] = math.hypot(lines.get(error.name, 0.0), self._of(error))
        return lines

    @cached_property
    def agreement(self) -> ChiSquareTest:
        """Whether all records agree with two places."""
        residuals = (self.records.places - self._places[self.records.seats]).ravel()
        chi2 = float(residuals @ np.linalg.solve(self._covariance, residuals))
        return ChiSquareTest(chi2, float(len(residuals) - 6))

    @property
    def closure_mm(self) -> Array:
        """(3,) how far the first seat's place is, at its last mounting, from that at the first one."""
        return np.asarray(self._closing @ self.records.places)

    @property
    def closure(self) -> ChiSquareTest:
        """Whether the closure is as small as its sources explain; the geometry errs alike in both."""
        weights = np.kron(self._closing, np.eye(3))
        covariance = weights @ self._covariance @ weights.T
        return ChiSquareTest(float(self.closure_mm @ np.linalg.solve(covariance, self.closure_mm)), 3.0)

    @property
    def _closing(self) -> Array:
        """(n,) weights of the records in the difference of the last and the first mounting."""
        mountings = self.records.mountings
        last = mountings == mountings[self.records.seats == 0].max()
        first = mountings == 1
        return np.asarray(last / last.sum() - first / first.sum())

    def following(self) -> Mapping[int, Array]:
        """How far each gauge (3,) followed the ball, by mounting: 1 as far as it moved, -1 the other way.

        A gauge is not a number where the ball hardly moved.
        """
        placement, slopes = self.records.placement, {}
        for number in np.unique(self.records.mountings).tolist():
            rows = self.records.mountings == number
            moved = placement.poses.positions[rows] @ placement.gauges
            shown = placement.deviations[rows] @ placement.gauges
            moved, shown = moved - moved.mean(axis=0), shown - shown.mean(axis=0)
            squares, undefined = (moved**2).sum(axis=0), np.full(3, np.nan)
            products, is_known = (moved * shown).sum(axis=0), squares > HARDLY_MM2
            slopes[number] = np.divide(products, squares, out=undefined, where=is_known)
        return slopes

    @property
    def observation(self) -> ScaleObservation:
        """The error that the encoders have in common by this check, for an uncertainty budget."""
        alone = [self._of(error) for error in self.errors if not error.is_shared]
        alone += [*self._of_standard.values(), self._of_noise]
        shared = self.by_effects.items()
        return ScaleObservation(
            farther_um_m=-self.encoders_long_um_m,
            sigma_um_m=float(np.linalg.norm(alone)),
            by_parameters=-self._share(self._to_length(self.jacobian)),
            by_effects={name: -self._share(self._to_length(columns)) for name, columns in shared},
        )

    @property
    def _of_standard(self) -> dict[str, float]:
        standard = self.standard
        return {
            "certificate": float(self._share(standard.certificate_mm)),
            "temperature of the fixture": standard.temperature_um_m,
            "angle between the seats": float(self._share(standard.parallel * standard.height_mm)),
        }

    @cached_property
    def _of_noise(self) -> float:
        weights = self._weights
        return float(self._share(np.sqrt(np.einsum("na,nab,nb->", weights, self.noise, weights))))

    def _of(self, error: length_records.LengthError) -> float:
        """One standard deviation of the length by a source, um/m."""
        return float(np.linalg.norm(self._share(self._to_length(error.columns))))

    def _share(self, length_mm: Array | float) -> Array:
        """The scale error of the encoders, um/m, that would make an error of the length."""
        # The sliders move less than encoders that are 1 um/m too long show.
        return np.asarray(length_mm) / -float(self._to_length(self.by_scale)[0])

    def _to_length(self, columns: Array) -> Array:
        """Errors (k,) of the length by errors (n, 3, k) of the places, mm."""
        return np.asarray(np.tensordot(self._weights, columns, axes=2))

    @property
    def _between(self) -> Array:
        return np.asarray(self._places[1] - self._places[0])

    @cached_property
    def _weights(self) -> Array:
        """(n, 3) derivatives of the length by the places of the records."""
        direction = self._between / np.linalg.norm(self._between)
        return np.asarray(np.einsum("a,anb->nb", direction, self._gain[1] - self._gain[0]))

    @cached_property
    def _places(self) -> Array:
        """(2, 3) of the seats."""
        return np.asarray(np.einsum("sanb,nb->sa", self._gain, self.records.places))

    @cached_property
    def _gain(self) -> Array:
        """(2, 3, n, 3) from the places of the records to those of the seats."""
        design = np.zeros((len(self.records), 3, 2, 3))
        design[np.arange(len(self.records)), :, self.records.seats] = np.eye(3)
        rows = design.reshape(-1, 6)
        weighted = np.linalg.solve(self._covariance, rows)
        return np.asarray(np.linalg.solve(rows.T @ weighted, weighted.T).reshape(2, 3, -1, 3))

    @cached_property
    def _covariance(self) -> Array:
        """(3 n, 3 n) of the places of all records, mm^2."""
        size = 3 * len(self.records)
        together: Array = each_alone(self.noise).reshape(size, size)
        for error in self.errors:
            columns = error.columns.reshape(size, -1)
            together = together + columns @ columns.T
        return together
