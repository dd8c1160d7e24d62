"""Whether a robot can have been built as its drawing allows.

A shop checks the coordinates of all joints in the frames of the drawing. An identification does not see
these frames: neither where the base's origin is, nor how the platform frame is turned, nor where the ball
was mounted. A geometry is therefore outside the tolerances only if there is no choice of frames, and no
offset of the ball, with which all of its parameters are inside, each widened by three sigma:

    minimize    sum of e_j / w_j
    subject to  |d + F c + B b|_j <= w_j + 3 sigma_j + e_j,    |b| <= ball tolerance,    e >= 0,

with the differences d from the drawing, the tolerances w, small changes of the frames c and the offset b.
This is a linear programme. A sum of absolute values is least, as a rule, with few of them different from
zero (Chen, Donoho and Saunders, Atomic Decomposition by Basis Pursuit, SIAM J. Sci. Comput. 20, 1998), and
these parameters are named. Of the many frames with the least sum, those with the largest margin to all the
other tolerances are taken, and all is repeated from these, until nothing is outside or they no longer
change. Small residuals prove nothing here: legs 13 mm too short can explain data perfectly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.problem.problem import Tolerances
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import FrameTransform, Mechanism
from hexacell.kinematics.rotations import Array

SIGNIFICANT_SIGMAS = 3.0

STEP = 1e-4
"""Of the derivatives by turns, rad, and by parameters, mm or mrad."""

LARGEST_TURN = 0.2
"""Between the drawing's frames and the machine's, rad; tolerances that allow more are no tolerances."""

SMALLEST_TURN = 1e-6
"""Where nothing is gained any more, rad."""

SMALLER = 0.25
LEAST_GAIN = 1e-3
"""Of the excess, by a step that counts."""

EXCESS_SHARE = 1e-5
"""Of a tolerance: less is rounding."""


@dataclass(frozen=True, slots=True)
class ToleranceViolation:
    """A parameter that is significantly outside its tolerance, in mm, or mrad of an angle.

    Attributes:
        change: from the drawing, in the frames and with the ball's offset that suit the robot best.
        unit: ``mm`` or ``mrad``.
    """

    name: str
    change: float
    tolerance: float
    sigma: float
    unit: str = "mm"


def tolerance_violations(
    found: GeometryEstimate, mechanism: Mechanism, drawing: Geometry, tolerances: Tolerances
) -> tuple[ToleranceViolation, ...]:
    """The parameters outside their tolerance in every choice of frames; none of a robot built as drawn.

    Where the estimate is not a number, all of them are outside.

    Args:
        found: the identified geometry, in the mechanism's frame convention.
        mechanism: of both.
        drawing: in the frames in which its tolerances hold.
        tolerances: of the drawing.
    """
    frames = mechanism.normalize_frames(drawing)[1].inverse()
    check = _Check(mechanism, drawing, tolerances, found.geometry, found.covariance)
    if not np.isfinite(found.geometry.vector).all():
        return check.violations(frames, np.zeros(3), np.full(len(drawing.vector), np.inf))
    return check.violations(*check.solve(frames))


@dataclass(frozen=True, eq=False)
class _Check:
    """An identified geometry with its covariance (P, P), beside a drawing."""

    mechanism: Mechanism
    drawing: Geometry
    tolerances: Tolerances
    geometry: Geometry
    covariance: Array

    def solve(self, frames: FrameTransform) -> tuple[FrameTransform, Array, Array]:
        """The best frames, from the convention's, offset of the ball (3,), mm, and excesses (P,).

        A step that does not lower the excess went farther than the linear programme is right: it is
        repeated within a smaller region.
        """
        ball: Array = np.zeros(3)
        excess, reach = self._excess(frames, ball), LARGEST_TURN
        while excess.any() and reach > SMALLEST_TURN:
            change, offset = self._programme(frames, reach)
            there = frames.then(_small_change(change))
            left = self._excess(there, offset)
            if np.sum(left / self._widths) < (1.0 - LEAST_GAIN) * np.sum(excess / self._widths):
                frames, ball, excess = there, offset, left
            else:
                reach *= SMALLER
        return frames, ball, excess

    def violations(
        self, frames: FrameTransform, ball: Array, excess: Array
    ) -> tuple[ToleranceViolation, ...]:
        """Of the parameters with an excess."""
        change = self._difference(frames) + ball @ self._ball_offset
        parameters = self.drawing.parameters
        sizes = np.array([change, self._widths, self._sigma(frames)]) / parameters.like_a_mm
        return tuple(
            ToleranceViolation(
                parameter.name,
                float(sizes[0, row]),
                float(sizes[1, row]),
                float(sizes[2, row]),
                parameter.kind.unit.shown,
            )
            for row, parameter in enumerate(parameters.parameters)
            if excess[row]
        )

    def _excess(self, frames: FrameTransform, ball: Array) -> Array:
        """How far the parameters (P,) are outside what is allowed; zero of those inside."""
        change = self._difference(frames) + ball @ self._ball_offset
        excess = np.abs(change) - self._allowed(frames)
        return np.where(excess > EXCESS_SHARE * self._widths, excess, 0.0)

    def _allowed(self, frames: FrameTransform) -> Array:
        """Largest differences (P,) from the drawing that are not significantly outside."""
        return self._widths + SIGNIFICANT_SIGMAS * self._sigma(frames)

    def _programme(self, frames: FrameTransform, reach: float) -> tuple[Array, Array]:
        """The best small change of frames (9,), and the best offset of the ball (3,), mm.

        First the least excess; then, with that allowed, the largest margin to all other tolerances. All
        parameters are in units of their tolerances.
        ``reach`` is the largest turn, rad; shifts are limited in proportion.
        """
        free = self.mechanism.frame_freedom.columns
        columns = np.hstack([self._frame_columns(frames)[:, free], self._ball_offset.T])
        columns /= self._widths[:, None]
        largest = np.concatenate([self._scales[free] * reach, np.full(3, self.tolerances.ball_mm)])
        difference, allowed = self._difference(frames) / self._widths, self._allowed(frames) / self._widths
        by_excess = np.diag(-np.ones_like(allowed)), np.ones_like(allowed)
        excess = _best(columns, difference, allowed, largest, *by_excess)[len(largest) :]
        is_inside = excess < EXCESS_SHARE
        by_margin = np.where(is_inside, 1.0, 0.0)[:, None], -np.ones(1)
        widened = allowed + excess + 0.1 * EXCESS_SHARE
        found = _best(columns, difference, widened, largest, *by_margin)
        change = np.zeros(9)
        change[free], ball = np.split(found[: len(largest)], [len(free)])
        return change, ball

    def _difference(self, frames: FrameTransform) -> Array:
        """From the drawing (P,), in some frames."""
        difference: Array = self._in(frames, self.geometry.vector) - self.drawing.vector
        return difference

    def _sigma(self, frames: FrameTransform) -> Array:
        """Standard deviations (P,) of the parameters in some frames."""
        here, steps = self.geometry.vector, STEP * np.diag(self.drawing.parameters.like_a_mm)
        ends = np.array([[self._in(frames, here + side * step) for step in steps] for side in (1.0, -1.0)])
        turned = (ends[0] - ends[1]) / (2.0 * np.diag(steps)[:, None])
        sigma: Array = np.sqrt(np.einsum("ij,ik,kj->j", turned, self.covariance, turned))
        return sigma

    def _frame_columns(self, frames: FrameTransform) -> Array:
        """Derivatives (P, 9) of the parameters by small changes of the frames."""
        there = Geometry(self.drawing.parameters, self._in(frames, self.geometry.vector))

        def changed(change: Array) -> Array:
            return self.mechanism.change_frames(there, _small_change(change)).vector

        steps = STEP * np.eye(9)
        columns: Array = np.array([changed(step) - changed(-step) for step in steps]).T / (2.0 * STEP)
        return columns

    def _in(self, frames: FrameTransform, vector: Array) -> Array:
        """Parameters (P,) in other frames."""
        geometry = Geometry(self.drawing.parameters, vector)
        return self.mechanism.change_frames(geometry, frames).vector

    @property
    def _ball_offset(self) -> Array:
        return self.drawing.parameters.ball_offset

    @property
    def _widths(self) -> Array:
        return self.tolerances.widths(self.drawing.parameters)

    @property
    def _scales(self) -> Array:
        """Of shifts, turns of the base and turns of the platform (9,): mm, rad and rad."""
        radius = float(self.mechanism.platform_radius(self.drawing))
        return np.repeat([radius / LARGEST_TURN, 1.0, 1.0], 3)


def _small_change(change: Array) -> FrameTransform:
    """A change of the frames by a shift, mm, a turn of the base and one of the platform, rad (9,)."""
    shift, base, platform = change.reshape(3, 3)
    return FrameTransform(rotations.from_vector(base), shift, rotations.from_vector(platform))


def _best(
    columns: Array, difference: Array, allowed: Array, largest: Array, slack: Array, cost: Array
) -> Array:
    """The x and s >= 0 with ``|difference + columns x| + slack s <= allowed`` and least ``cost . s``.

    ``largest`` limits the absolute values of x. The solution is x, then s.
    """
    from scipy.optimize import linprog  # noqa: PLC0415 - only where a geometry is checked

    solved = linprog(
        np.concatenate([np.zeros(columns.shape[1]), cost]),
        A_ub=np.vstack([np.hstack([sign * columns, slack]) for sign in (1.0, -1.0)]),
        b_ub=np.concatenate([allowed - difference, allowed + difference]),
        bounds=[*((-one, one) for one in largest), *[(0.0, None)] * len(cost)],
    )
    return np.asarray(solved.x)
