"""What may be wrong with a machine whose residuals are too large, where no cause is proven.

Each cause adds columns Z to the residuals, and has the score statistic

    gain = r^T M Z (Z^T M Z)^-1 Z^T M r,

with M the weights less what stations and parameters absorb; a direction of Z that these absorb does not
count. A cause with many unknowns explains some of any residuals; therefore the mean squares per degree of
freedom are compared, s^2 before and after, and the share of the excess that is explained is
``(s0^2 - s1^2) / (s0^2 - 1)``. Several causes may explain the same residuals: the shares have no sum.

Sources: Rao 1948 (score test); Theil 1961 (adjusted coefficient of determination).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.data_faults import hypotheses
from hexacell.identification.data_faults.stepwise_selection import SHOWN_DECREASE
from hexacell.identification.placement import Weight, leg_forces
from hexacell.identification.solver.chi_square import ChiSquareTest
from hexacell.identification.solver.measurement_model import NuisanceElimination
from hexacell.identification.solver.result import Identification
from hexacell.kinematics.parameters import JointUnit, MachinePart
from hexacell.kinematics.rotations import Array, skew
from hexacell.uncertainty.effect_kinds import (
    ball_roundness,
    encoder_eccentricities,
    encoder_scales,
    load_at_work,
    own_weight,
    rail_directions,
    rail_waves,
)
from hexacell.uncertainty.effects import Effect, errors_of_records

SMALLEST_SHARE = 0.1
"""Share of the excess that a cause must explain to be listed."""

SMALLEST_REMAINDER = 1e-4
"""Share of the square of a direction of Z that stations and parameters must leave: less is rounding."""

MOST_STEPS = 100
"""Records from which on an encoder is tried to have lost its place."""

FALSE_STEPS = 1e-3
"""Probability that chance alone shows such a step: one of so many always explains something."""

WAVELENGTHS_MM = (600.0, 1500.0)
"""Waves of the rails that are longer than the travel of a slider at one point."""


TURNS = np.arange(8) * np.pi / 4
AROUND = np.stack([np.cos(TURNS), np.sin(TURNS), np.zeros(8)], axis=-1)
BESIDE = np.concatenate([share * AROUND for share in (0.1, 0.3, 0.6)])
"""Where a weight may act instead, (k, 3) by the radius of the platform."""


@dataclass(frozen=True, slots=True)
class PossibleCause:
    """A cause that would explain a share (0 to 1) of the excess of the residuals, named for people."""

    name: str
    share: float


def possible_causes(found: Identification) -> tuple[PossibleCause, ...]:
    """The causes that explain something of residuals that are too large, the largest share first."""
    test = ExcessTest(found)
    causes = [*_of_the_machine(test), *_of_the_records(test)]
    listed = [cause for cause in causes if cause.share >= SMALLEST_SHARE]
    return tuple(sorted(listed, key=lambda cause: -cause.share))


def _of_the_machine(test: ExcessTest) -> Iterator[PossibleCause]:
    unit = test.found.problem.mechanism.words.joint_unit
    of_encoders = encoder_scales(1.0) if unit is JointUnit.MM else encoder_eccentricities(1.0)
    waves = (rail_waves(1.0, length) for length in WAVELENGTHS_MM)
    columns = {
        "errors of the encoders": [*test.by_effects(of_encoders), *test.by_encoders()],
        "guides that are not straight or parallel": test.by_effects(rail_directions(1.0), *waves),
        "legs that yield under the load": test.by_effects(
            load_at_work(1.0, 1.0), own_weight(1.0, 1.0, Weight(test.down))
        ),
        "clearance in the legs that changes sides with the load": test.by_clearance(),
        "a temperature that changed while measuring": test.by_expansion(),
        "the gauges (scale, alignment, drift of the zero) or an oval ball": [
            *test.by_effects(ball_roundness(1.0)),
            *test.by_gauges(),
        ],
    }
    for name, parts in columns.items():
        gain = test.gain(np.concatenate([*parts], axis=-1))
        yield PossibleCause(name, test.share_of_gain(*gain))
    yield from _lost_place(test)
    yield from _weight_elsewhere(test)


def _weight_elsewhere(test: ExcessTest) -> Iterator[PossibleCause]:
    """The most likely place of a weight under which a term acts, if that is not where it is stated."""
    problem, placement = test.found.problem, test.found.placement
    radius = float(problem.mechanism.platform_radius(test.found.geometry))
    significant = chi_square_limit(2, FALSE_STEPS / (len(BESIDE) * max(1, len(problem.offered))))
    best, likely = 0.0, None
    for term in problem.offered:
        # Of a term that is linear in the forces another place does the same as the opposite one.
        if term.weight is None or term.of_weight is None or term.on_either_side is None:
            continue
        stated, unknowns = test.gain(term.pose_errors(placement, problem.directions)[:, :3])
        for beside in radius * BESIDE:
            moved = term.of_weight(replace(term.weight, beside_mm=beside))
            gain, _ = test.gain(moved.pose_errors(placement, problem.directions)[:, :3])
            if gain - stated > max(best, significant * max(1.0, test.found.noise_test.ratio) ** 2):
                best, likely = gain - stated, (beside, test.share_of_gain(gain, unknowns + 2))
    if likely is not None:
        (x, y, _), share = likely
        where = f"some {x:+.0f} mm in x, {y:+.0f} mm in y from own_weight_centre_mm"
        yield PossibleCause(f"a weight that acts {where}", share)


def _lost_place(test: ExcessTest) -> Iterator[PossibleCause]:
    """The most likely encoder that reads something else from some record on, if the records show one."""
    problem = test.found.problem
    starts = np.unique(np.linspace(1, problem.records - 1, MOST_STEPS).astype(int))
    later = np.arange(problem.records)[:, None] >= starts
    columns = np.einsum(
        "nil,nk->nilk", test.found.placement.by_joints(np.eye(problem.joints.shape[1])[None])[:, :3], later
    )
    gain, best = test.largest_gain(columns.reshape(problem.records, 3, -1))
    significant = chi_square_limit(1, FALSE_STEPS / columns[0, 0].size)
    if gain > significant * max(1.0, test.found.noise_test.ratio) ** 2:
        leg, start = divmod(best, len(starts))
        point, orientation = problem.labels[starts[start]].tolist()
        name = f"encoder {leg + 1} that lost its place before point {point}, orientation {orientation}"
        yield PossibleCause(name, test.share_of_gain(gain, 2))


def _of_the_records(test: ExcessTest) -> Iterator[PossibleCause]:
    """The most likely data fault of each kind, if it is significant and the records can show it."""
    kinds: set[type[hypotheses.FaultHypothesis]] = set()
    shown = (1.0 - 1.0 / SHOWN_DECREASE) * test.found.noise_test.chi2
    for hypothesis in hypotheses.rank_hypotheses(test.found.problem, test.found):
        if isinstance(hypothesis, hypotheses.GaugeFaultHypothesis) and hypothesis.gain < shown:
            continue
        if type(hypothesis) not in kinds:
            kinds.add(type(hypothesis))
            yield PossibleCause(_name(hypothesis), test.share_of_gain(hypothesis.gain, hypothesis.unknowns))


def _name(hypothesis: hypotheses.FaultHypothesis) -> str:
    match hypothesis:
        case hypotheses.OutlierHypothesis(records=((point, orientation), *_)):
            return f"a false reading at point {point}, orientation {orientation}"
        case hypotheses.ZeroShiftHypothesis(point=point, orientation=orientation):
            return f"a shift of the gauges' zero at point {point} before orientation {orientation}"
        case hypotheses.GaugeFaultHypothesis(gauge_fault=fault, point=point):
            where = "at every point" if point is None else f"at point {point}"
            return f"{fault.kind.value} ({', '.join(fault.gauges)}) {where}"
    raise TypeError(hypothesis)


@dataclass(frozen=True, eq=False)
class ExcessTest:
    """The score tests of columns (n, 3, k) beside the parameters of an identification."""

    found: Identification

    def share_of_gain(self, gain: float, unknowns: int) -> float:
        """The share (0 to 1) that a decrease of the chi-square by some unknowns explains."""
        before = self.found.noise_test
        after = ChiSquareTest(before.chi2 - gain, before.expected - unknowns)
        if before.ratio <= 1.0 or after.expected < 1.0:
            return 0.0
        return float(np.clip((before.ratio**2 - after.ratio**2) / (before.ratio**2 - 1.0), 0.0, 1.0))

    def by_effects(self, *effects: Effect) -> list[Array]:
        """What one unit of each cause of some effects does to the records."""
        return [errors_of_records(effect, self.found.placement) for effect in effects]

    @property
    def down(self) -> Array:
        """Where weights pull (3,): along the gauge z, in the convention's base frame."""
        return np.asarray(-self.found.problem.gauges[:, 2])

    def by_clearance(self) -> list[Array]:
        """Legs that are longer or shorter as the platform's weight pulls or pushes them."""
        placement = self.found.placement
        sides = np.sign(leg_forces(placement, Weight(self.down)))
        return [placement.by_legs(sides[..., None] * placement.each_leg)[:, :3]]

    def by_encoders(self) -> list[Array]:
        """Encoders whose scale changes along them."""
        joints = self.found.problem.joints
        bent = (joints - joints.mean(axis=0)) ** 2
        placement = self.found.placement
        return [placement.by_joints(bent[..., None] * placement.each_leg)[:, :3]]

    def by_gauges(self) -> list[Array]:
        """Readings that are a linear function of the deviation, stations turned, and zeros that drift."""
        problem = self.found.problem
        since = np.arange(problem.records) - problem.per_record(problem.first_rows.astype(float))
        linear = np.einsum("ij,nk->nijk", np.eye(3), problem.deviations)
        drift = since[:, None, None] * np.eye(3)
        return [
            linear.reshape(problem.records, 3, 9),
            self._at_each_point(skew(problem.deviations)),
            self._at_each_point(drift),
        ]

    def by_expansion(self) -> list[Array]:
        """Each part, and each leg, that expands evenly from the first record to the last."""
        placement = self.found.placement
        parameters, vector = placement.mechanism.parameters, placement.geometry.vector
        parts = ({one.symbol: float(one.part is part) for one in parameters.kinds} for part in MachinePart)
        changes = [parameters.by_kind(expands) * vector for expands in parts]
        progress = np.linspace(-0.5, 0.5, len(placement))[:, None, None]
        by_parts = placement.by_parameters(np.stack(changes, axis=-1))
        by_legs = placement.by_constraints[:, :3, : placement.joints.shape[1]]
        return [progress * by_parts[:, :3], progress * by_legs]

    def _at_each_point(self, columns: Array) -> Array:
        """Columns (n, 3, k) as unknowns of each point (n, 3, k m)."""
        problem = self.found.problem
        at_point = problem.per_record(np.eye(problem.points))
        return np.asarray(np.einsum("nij,nm->nijm", columns, at_point).reshape(problem.records, 3, -1))

    def largest_gain(self, columns: Array) -> tuple[float, int]:
        """The largest decrease of the chi-square by one of the columns alone, and which."""
        by_causes, remaining, values = self._beside_parameters(columns)
        squares = np.sum(by_causes * remaining, axis=0)
        gains = (remaining.T @ values) ** 2 / np.maximum(squares, 1e-300)
        gains = np.where(squares > SMALLEST_REMAINDER, gains, 0.0)
        best = int(np.argmax(gains))
        return float(gains[best]), best

    def gain(self, columns: Array) -> tuple[float, int]:
        """The decrease of the chi-square by all columns, and by how many unknowns."""
        by_causes, remaining, residuals = self._beside_parameters(columns)
        values, axes = np.linalg.eigh(by_causes.T @ remaining)
        seen = values > SMALLEST_REMAINDER
        scores = axes[:, seen].T @ (remaining.T @ residuals)
        return float(np.sum(scores**2 / values[seen])), int(np.count_nonzero(seen))

    def _beside_parameters(self, columns: Array) -> tuple[Array, Array, Array]:
        """Columns of length 1 without stations, what parameters leave of them, and the residuals."""
        prediction = self.found.prediction
        elimination = NuisanceElimination(self.found.problem, prediction.weights)
        both = np.concatenate([prediction.jacobian, columns], axis=-1)
        system = elimination.system(prediction.residuals, both)
        by_parameters, by_causes = np.split(system.rows, [prediction.jacobian.shape[-1]], axis=1)
        by_causes = by_causes / np.maximum(np.linalg.norm(by_causes, axis=0), 1e-300)
        absorbed = self.found.free_covariance @ (by_parameters.T @ by_causes)
        return by_causes, by_causes - by_parameters @ absorbed, system.values
