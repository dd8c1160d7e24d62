"""The uncertainty budget of the errors at the task poses: a line for the noise, and one for each effect.

A line is the error that one standard deviation of an effect makes at the task pose where it is largest.
The lines are independent, so that their squares are added at each pose (JCGM 100). U is the 95 % quantile
of the largest error over all task poses (:mod:`~hexacell.uncertainty.statement`).

Where a length check measured the scale common to all encoders, what that makes at the task is known. The
check errs by the noise of the estimate and by the other effects as well: what these do at the task, and
what they do by the scale that is measured, is one line.

What terms of the model beside the geometry do at the task is known as well, less what the controller
corrects of it; what is not known of their coefficients is part of the noise, with that of the geometry.
"""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hexacell.kinematics.rotations import Array
from hexacell.uncertainty.effect_kinds import COMMON_SCALE, common_encoder_scale
from hexacell.uncertainty.effects import Effect, Occurrence
from hexacell.uncertainty.propagation import Propagation, ScaleObservation, compressed
from hexacell.uncertainty.statement import TaskErrors, covariance_factor

VISIBLE_SIGMAS = 4.0
"""Standard deviations by which an effect must raise the chi-square to be seen."""

OF_THE_MACHINE = (Occurrence.CONSTANT, Occurrence.EVERY_STOP, Occurrence.WITH_TOOL)

STOPS = Occurrence.STOPS_AT_WORK

HARMLESS_ERROR = 5.0
"""Times the error by the noise: an effect that is not seen before is one that no record shows."""


@dataclass(frozen=True, slots=True, eq=False)
class BudgetLine:
    """One systematic effect; lengths are position errors at the task pose where it is largest.

    Attributes:
        through_mm: through the result, as the records had the effect.
        direct_mm: by the effect itself at the task pose.
        combined_mm: of both, which partly cancel where the effect is the same.
        per_unit_mm: of both, by one unit of the effect.
        is_visible: whether a length check or the chi-square shows it while its error is harmless.
        columns: (t, 6, k) errors at the task poses by one standard deviation of each cause, mm and rad.
        parameter_columns: (p, k) errors of the free parameters by one unit of each cause; of an effect that
            is not in the records, no columns.
    """

    effect: Effect
    through_mm: float
    direct_mm: float
    combined_mm: float
    per_unit_mm: float
    is_visible: bool
    columns: Array
    parameter_columns: Array


@dataclass(frozen=True, eq=False)
class UncertaintyBudget:
    """All that is not known of the errors at t task poses.

    Attributes:
        jacobian: (t, 6, p) of the errors by the free parameters.
        noise: (t, 6, p) errors by the noise of the readings, mm and rad, one standard deviation a column.
        known: (t, 6) errors by the measured values of effects, mm and rad.
        has_held: whether ``noise`` contains what is not known of parameters that are not identified.
    """

    jacobian: Array
    noise: Array
    lines: tuple[BudgetLine, ...]
    known: Array
    has_held: bool = False

    @classmethod
    def of(
        cls, propagation: Propagation, effects: Iterable[Effect], scale: ScaleObservation | None = None
    ) -> "UncertaintyBudget":
        """The budget of an identification for the task of its propagation.

        An effect that the mechanism cannot have gets no line. A ``scale`` that a length check with the
        :attr:`parameter_columns` of this budget measured takes the place of the size stated for it.
        """
        found, zeros = propagation.found, propagation.zeros
        terms = found.terms if zeros is None else None
        taken_up = () if terms is None else [term.takes_up for term in terms.terms]
        effects = tuple(_measured(effect, scale) for effect in effects if effect.name not in taken_up)
        effects = (*effects, *propagation.reversals(terms))
        covariance = (zeros or found).free_covariance * found.goodness.noise_factor**2
        known: Array = np.zeros(propagation.jacobian.shape[:2])
        by_scale = None
        if scale is not None:
            by_scale = propagation.columns(common_encoder_scale(1.0)).combined[..., 0]
            known = scale.farther_um_m * by_scale
        for effect in effects:
            if effect.is_estimated:
                columns = effect.size * propagation.parameter_columns(effect)
                covariance = covariance - columns @ columns.T
            if effect.value:
                known = known + effect.value * propagation.columns(effect).combined.sum(axis=-1)
        if terms is None:
            factor = covariance_factor(covariance)
            noise = propagation.jacobian @ factor
        else:
            both = covariance_factor(terms.joint_covariance(covariance))
            factor, of_terms = np.split(both, [len(covariance)])
            by_terms = propagation.by_terms(terms)
            noise = propagation.jacobian @ factor + by_terms @ of_terms
            known = known + by_terms @ terms.left_by(propagation.belief.corrections)
        if scale is not None and by_scale is not None:
            noise = noise + by_scale[..., None] * (scale.by_parameters @ factor)
        significant = VISIBLE_SIGMAS * np.sqrt(2.0 * found.goodness.expected)
        visible = significant / (HARMLESS_ERROR * _largest(noise)) ** 2
        lines = (_line(propagation, effect, visible, scale, by_scale) for effect in effects)
        acting = tuple(line for line in lines if line.columns.shape[-1])
        return cls(propagation.jacobian, noise, acting, known, has_held=zeros is not None)

    def errors_of(self, difference: Array, *, of_geometry: bool = False) -> TaskErrors:
        """The errors of a geometry whose free parameters differ by (p,) from the estimate.

        They are estimated from that difference, and from effects that were measured, for one round of
        visits to the task poses; those ``of_geometry`` are without the scatter of the stops.
        """
        estimated = self.known - self.jacobian @ difference
        lines = [line for line in self.lines if not (of_geometry and line.effect.occurrence is STOPS)]
        stated = [line.columns for line in lines if np.isinf(line.effect.freedom)]
        columns = [self.noise, _joined(stated, self.noise.shape[:2])]
        freedoms = ((line.columns, line.effect.freedom) for line in lines)
        measured = tuple(one for one in freedoms if np.isfinite(one[1]))
        return TaskErrors(estimated, np.concatenate(columns, axis=-1), measured)

    @property
    def scatters(self) -> bool:
        """Whether the robot at work was measured, or stated, to stop elsewhere each time."""
        return any(line.effect.occurrence is STOPS and line.effect.size for line in self.lines)

    @property
    def parameter_columns(self) -> Mapping[str, Array]:
        """What one unit of each effect did to the estimate (p, k), by the names of the effects."""
        in_records = (line for line in self.lines if line.effect.occurrence.is_in_records)
        return {line.effect.name: line.parameter_columns for line in in_records}

    @cached_property
    def systematic(self) -> Array:
        """(t, 6, k) errors by one standard deviation of all systematic effects, at most 6 t columns."""
        return _joined([line.columns for line in self.lines], self.noise.shape[:2])

    @cached_property
    def not_in_covariance(self) -> Array:
        """Errors (t, 6, k) without the effects that the covariance of the estimate contains already."""
        columns = [line.columns for line in self.lines if not line.effect.is_estimated]
        return _joined(columns, self.noise.shape[:2])

    @property
    def noise_mm(self) -> float:
        """Standard uncertainty by the noise at the worst task pose."""
        return _largest(self.noise)

    @property
    def systematic_mm(self) -> float:
        """Standard uncertainty by the systematic effects at the worst task pose."""
        return _largest(self.systematic)

    @property
    def standard_mm(self) -> float:
        """Combined standard uncertainty at the worst task pose."""
        return _largest(np.concatenate([self.noise, self.systematic], axis=-1))

    @property
    def parts_mm(self) -> tuple[float, ...]:
        """Parts of ``standard_mm`` at its task pose, whose squares add up: by noise, then by each line."""
        parts = [self.noise, *(line.columns for line in self.lines)]
        squares = np.array([(part[:, :3] ** 2).sum(axis=(1, 2)) for part in parts])
        return tuple(np.sqrt(squares[:, squares.sum(axis=0).argmax()]).tolist())

    @property
    def expanded_mm(self) -> float:
        """U of the largest position error over the task poses, which is estimated as zero."""
        return self._unknown.position.expanded

    @property
    def expanded_deg(self) -> float:
        """U of the largest orientation error, deg."""
        return self._unknown.orientation.expanded

    def floor(self, measured: Container[str] = ()) -> TaskErrors:
        """What no number of records removes: effects but for what differs among those, or is estimated.

        Those that are ``measured`` otherwise do not count.
        """
        lines = (line for line in self.lines if line.combined_mm and line.effect.name not in measured)
        lasting = [line for line in lines if not line.effect.is_estimated]
        every = Occurrence.EVERY_STOP
        columns = [
            line.columns * (line.direct_mm / line.combined_mm if line.effect.occurrence is every else 1.0)
            for line in lasting
        ]
        return TaskErrors(np.zeros_like(self.known), _joined(columns, self.noise.shape[:2]))

    @property
    def unseen(self) -> tuple[BudgetLine, ...]:
        """Effects of the machine itself, not of its place of work, that no record can show."""
        hidden = (line for line in self.lines if not line.is_visible)
        return tuple(line for line in hidden if line.effect.occurrence in OF_THE_MACHINE)

    @cached_property
    def _unknown(self) -> TaskErrors:
        nothing = self.errors_of(np.zeros(self.jacobian.shape[-1]))
        return replace(nothing, estimated=np.zeros_like(self.known))


def _measured(effect: Effect, scale: ScaleObservation | None) -> Effect:
    """The effect with the size that is left once it is measured."""
    if scale is None or effect.name != COMMON_SCALE:
        return effect
    return replace(effect, size=scale.sigma_um_m, source="length check")


def _line(
    propagation: Propagation,
    effect: Effect,
    visible: float,
    scale: ScaleObservation | None,
    by_scale: Array | None,
) -> BudgetLine:
    """The line of an effect, which is seen if an error comes with a chi-square of ``visible``, 1/mm^2.

    ``by_scale`` (t, 6) are the errors by 1 um/m of the measured ``scale``.
    """
    task = propagation.columns(effect)
    combined, is_measured = task.combined, scale is not None and effect.name == COMMON_SCALE
    if scale is not None and by_scale is not None and not is_measured:
        # Less what of the effect the length check takes for a scale.
        combined = combined - by_scale[..., None] * scale.by_effect(effect, combined.shape[-1])
    per_unit = _largest(combined)
    return BudgetLine(
        effect=effect,
        through_mm=effect.size * _largest(task.through),
        direct_mm=effect.size * _largest(task.direct),
        combined_mm=effect.size * per_unit,
        per_unit_mm=per_unit,
        is_visible=is_measured or bool(propagation.chi_square(effect) >= visible * per_unit**2),
        columns=effect.size * combined,
        parameter_columns=propagation.parameter_columns(effect),
    )


def _largest(columns: Array) -> float:
    """Root mean square position error at the task pose where it is largest, by columns (t, 6, k)."""
    return float(np.sqrt((columns[:, :3] ** 2).sum(axis=(1, 2)).max()))


def _joined(parts: Sequence[Array], shape: tuple[int, ...]) -> Array:
    """The columns of all parts, or as many as rows with the same covariance."""
    rows = shape[0] * shape[1]
    flat = np.concatenate([np.zeros((rows, 0)), *(part.reshape(rows, -1) for part in parts)], axis=-1)
    return compressed(flat).reshape(*shape, min(flat.shape))
