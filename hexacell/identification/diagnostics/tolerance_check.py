"""Whether a robot can have been built as its drawing allows, and which joint was not.

An identification does not see the frames of the drawing, nor where the ball was mounted. A geometry is
therefore outside the tolerances only if no robot within them, in any frames and with the ball anywhere
allowed, explains it. The robot that agrees best (:class:`ToleranceFitter`) is the solution of

    minimize    T = |C^-1/2 (d + F c + B b - x)|^2    over c, b and x
    subject to  |x|_j <= w_j,    |b| <= ball tolerance,

with the differences d of the identified geometry from the drawing and their covariance C, the errors x
with which the robot was built, the tolerances w, small changes of the frames c and an offset b of the
ball. As frames are linear in small turns alone, it is solved again from the best frames until T no longer
falls. All is in units of the tolerances. The limit of T, a quantile of a chi-square, and how a joint is
named are in ``docs/method.md`` (The solution).

Source: Cox and Shi, Simple Adaptive Size-Exact Testing for Full-Vector and Subvector Inference in Moment
Inequality Models, Review of Economic Studies 90, 2023.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hexacell.distributions import chi_square_limit
from hexacell.identification.problem.prior import Tolerances
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.kinematics import rotations
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import Mechanism
from hexacell.kinematics.parameters import ParameterKind
from hexacell.kinematics.pose import FrameTransform
from hexacell.kinematics.rotations import Array

SIGNIFICANT_SIGMAS = 3.0

MOST_TRIED = 12
"""Joints whose tolerances press most, of which each is tried without them."""

PROBABILITY = 1e-3
"""Probability of calling a robot outside that is within all its tolerances."""

STEP = 1e-4
"""Step of the derivatives by turns, rad, and by parameters, mm or mrad."""

LARGEST_TURN = 0.2
"""Largest turn between the drawing's frames and the machine's, rad; no tolerances allow more."""

SMALLEST_TURN = 1e-6
"""Turn, rad, by which nothing is gained any more."""

SMALLER = 0.25
"""Factor of the largest turn after a step that went too far."""

LEAST_GAIN = 1e-3
"""Share of T that a step must gain to count."""

NO_CONTRADICTION = 1.0
"""A value of T below any limit: better frames need not be looked for."""

ROUNDING = 1e-4
"""Share of a tolerance that no geometry is known better than."""

SMALLEST_ERRORS = 0.03
"""Weight of errors as large as their tolerances, in standard deviations: it only chooses among equals."""

Joint = tuple[ParameterKind, int]
"""The numbers of one kind of one leg, counted from 1."""


@dataclass(frozen=True, slots=True)
class ToleranceViolation:
    """A parameter that is outside its tolerance, in mm, or mrad of an angle.

    Attributes:
        change: from the drawing, in the frames and with the ball's offset that suit the robot best.
        instead: joints in text, such as "B3" or "leg 2 length", any of which out of its tolerance would
            explain the records as well.
    """

    name: str
    change: float
    tolerance: float
    sigma: float
    unit: str = "mm"
    instead: tuple[str, ...] = ()


def tolerance_violations(
    found: GeometryEstimate, mechanism: Mechanism, drawing: Geometry, tolerances: Tolerances
) -> tuple[ToleranceViolation, ...]:
    """The parameters outside their tolerance in every choice of frames; empty for a robot built as drawn.

    Where the estimate, in the frame convention, is not a number, all of them are outside. The drawing is in
    the frames in which its tolerances hold.
    """
    frames = mechanism.normalize_frames(drawing)[1].inverse()
    fitter = ToleranceFitter(mechanism, drawing, tolerances, found.geometry, found.covariance)
    if not np.isfinite(found.geometry.vector).all():
        return _violations(fitter, frames, np.full(len(drawing.vector), np.inf))
    # Joints without whose tolerances there is a robot, from the one that is within all of them.
    fit, faults, others = fitter.fit(frames), list[Joint](), list[Joint]()
    while fit.distance > fit.limit:  # no robot within the tolerances explains the identified geometry
        pressing = {joint: _rows(fitter, [*faults, joint]) for joint in _pressing(fitter, fit)}
        tried = {joint: fitter.fit(fit.frames, rows) for joint, rows in pressing.items()}
        best = min(tried, key=lambda joint: tried[joint].distance)
        as_well = tried[best].distance + SIGNIFICANT_SIGMAS**2
        others = [
            joint
            for joint, one in tried.items()
            if joint != best and not faults and one.distance <= one.limit and one.distance < as_well
        ]
        fit, faults = tried[best], [*faults, best]
    rows = _rows(fitter, faults)
    is_outside = np.zeros(len(fit.errors), dtype=bool)
    is_outside[rows] = np.abs(fit.errors[rows]) > 1.0
    instead = tuple(kind.display_name(leg, "") for kind, leg in others)
    return _violations(fitter, fit.frames, np.where(is_outside, fit.errors, 0.0), instead)


def _pressing(fitter: ToleranceFitter, fit: ToleranceFit) -> list[Joint]:
    """Joints whose tolerances hold the fit, those that hold most first."""
    pressures, parameters = dict[Joint, float](), fitter.drawing.parameters.parameters
    for parameter, pressure in zip(parameters, fit.pressure.tolist(), strict=True):
        joint = parameter.kind, parameter.leg
        pressures[joint] = float(np.hypot(pressures.get(joint, 0.0), pressure))
    held = [joint for joint, pressure in pressures.items() if pressure > 0.0]
    return sorted(held, key=lambda joint: -pressures[joint])[:MOST_TRIED]


def _rows(fitter: ToleranceFitter, joints: Sequence[Joint]) -> list[int]:
    parameters = fitter.drawing.parameters.parameters
    return [row for row, one in enumerate(parameters) if (one.kind, one.leg) in joints]


def _violations(
    fitter: ToleranceFitter, frames: FrameTransform, errors: Array, instead: tuple[str, ...] = ()
) -> tuple[ToleranceViolation, ...]:
    """The parameters whose ``errors`` (P,), in units of their tolerances, are not zero."""
    parameters = fitter.drawing.parameters
    sigma = np.sqrt(np.diag(fitter.covariance_in(frames))) * fitter.widths
    sizes = np.array([errors * fitter.widths, fitter.widths, sigma]) / parameters.like_a_mm
    return tuple(
        ToleranceViolation(
            name=parameter.name,
            change=float(sizes[0, row]),
            tolerance=float(sizes[1, row]),
            sigma=float(sizes[2, row]),
            unit=parameter.kind.unit.shown,
            instead=instead,
        )
        for row, parameter in enumerate(parameters.parameters)
        if errors[row]
    )


@dataclass(frozen=True, slots=True, eq=False)
class ToleranceFit:
    """The robot nearest to an identified geometry.

    Attributes:
        frames: from the convention's to those of the drawing.
        errors: (P,) of its parameters, in units of their tolerances.
        limit: which T exceeds with ``PROBABILITY`` if the robot is within its tolerances.
        pressure: (P,) how much T falls with more of a tolerance.
    """

    frames: FrameTransform
    errors: Array
    distance: float
    limit: float
    pressure: Array


@dataclass(frozen=True, eq=False)
class ToleranceFitter:
    """An identified geometry with its covariance (P, P), beside a drawing."""

    mechanism: Mechanism
    drawing: Geometry
    tolerances: Tolerances
    geometry: Geometry
    covariance: Array

    def fit(self, frames: FrameTransform, without: Sequence[int] = ()) -> ToleranceFit:
        """The nearest robot, looked for from some frames, ``without`` the tolerances of some parameters.

        A step that does not lower T went farther than small changes are right: it is repeated within a
        smaller region.
        """
        at, reach = _Step(self, frames, without), LARGEST_TURN
        values = at.start
        distance = at.distance(values)
        while distance > NO_CONTRADICTION and reach > SMALLEST_TURN:
            best = at.solve(reach)
            if not at.distance(best) < (1.0 - LEAST_GAIN) * distance:
                return at.result(best)
            change = np.zeros(9)
            change[self.mechanism.frame_freedom.columns] = best[: at.frame_count] * self.frame_scales
            there = _Step(self, at.frames.then(small_change(change)), without)
            moved = np.concatenate([np.zeros(at.frame_count), best[at.frame_count :]])
            if there.distance(moved) < (1.0 - LEAST_GAIN) * distance:
                at, values, distance = there, moved, there.distance(moved)
            else:
                reach *= SMALLER
        return at.result(values)

    @cached_property
    def widths(self) -> Array:
        """The tolerance (P,) of each parameter, in its unit."""
        return self.tolerances.widths(self.drawing.parameters)

    def covariance_in(self, frames: FrameTransform) -> Array:
        """(P, P) of the identified parameters in some frames, in units of the tolerances."""
        here, steps = self.geometry.vector, STEP * np.diag(self.drawing.parameters.like_a_mm)
        ends = np.array([[self._in(frames, here + side * step) for step in steps] for side in (1.0, -1.0)])
        turned = (ends[0] - ends[1]) / (2.0 * np.diag(steps)[:, None]) / self.widths
        return np.asarray(turned.T @ self.covariance @ turned)

    def difference(self, frames: FrameTransform) -> Array:
        """(P,) from the drawing, in some frames, in units of the tolerances."""
        return np.asarray((self._in(frames, self.geometry.vector) - self.drawing.vector) / self.widths)

    def by_frames(self, frames: FrameTransform) -> Array:
        """Derivatives (P, k) of that by the free small changes of the frames, in units of their scales."""
        there = Geometry(self.drawing.parameters, self._in(frames, self.geometry.vector))

        def changed(change: Array) -> Array:
            return self.mechanism.change_frames(there, small_change(change)).vector

        steps = STEP * np.eye(9)[self.mechanism.frame_freedom.columns]
        derivatives = np.array([changed(step) - changed(-step) for step in steps]).T / (2.0 * STEP)
        return np.asarray(derivatives * self.frame_scales / self.widths[:, None])

    @cached_property
    def frame_scales(self) -> Array:
        """(k,) shifts, mm, and turns, rad, that move the platform's joints by the same."""
        radius = float(self.mechanism.platform_radius(self.drawing))
        return np.repeat([radius, 1.0, 1.0], 3)[self.mechanism.frame_freedom.columns]

    def _in(self, frames: FrameTransform, vector: Array) -> Array:
        """Parameters (P,) in other frames."""
        return self.mechanism.change_frames(Geometry(self.drawing.parameters, vector), frames).vector


class _Step:
    """The problem linearised in some frames.

    Its values are the changes of frames (k,), the ball's offset (3,) and the errors (P,).
    """

    def __init__(self, fitter: ToleranceFitter, frames: FrameTransform, without: Sequence[int]) -> None:
        self.fitter, self.frames = fitter, frames
        self.largest = np.ones(len(fitter.widths))
        self.largest[list(without)] = np.inf
        noise = fitter.covariance_in(frames) + ROUNDING**2 * np.eye(len(self.largest))
        self.root = np.linalg.cholesky(noise)
        drawing = fitter.drawing.parameters
        # By the ball's offset, in units of its tolerance and the parameters'.
        by_ball = fitter.tolerances.ball_mm * drawing.ball_offset.T / fitter.widths[:, None]
        self.moving = np.hstack([fitter.by_frames(frames), by_ball])
        self.columns = np.linalg.solve(self.root, np.hstack([self.moving, -np.eye(len(self.largest))]))
        self.constant = np.linalg.solve(self.root, fitter.difference(frames))
        self.frame_count = len(fitter.mechanism.frame_freedom.columns)

    @property
    def start(self) -> Array:
        """No change, and the errors as they are, as far as the tolerances allow."""
        moving = np.zeros(self.moving.shape[1])
        errors = np.clip(self.fitter.difference(self.frames), -self.largest, self.largest)
        return np.concatenate([moving, errors])

    def distance(self, values: Array) -> float:
        """T of some values."""
        return float(np.sum((self.constant + self.columns @ values) ** 2))

    def solve(self, reach: float) -> Array:
        """The best values; ``reach`` is the largest turn, rad, and limits shifts in proportion."""
        from scipy.optimize import lsq_linear  # noqa: PLC0415 - only where a geometry is checked

        choosing = SMALLEST_ERRORS * np.eye(self.columns.shape[1])[self.frame_count :]
        largest = np.concatenate([np.full(self.frame_count, reach), np.ones(3), self.largest])
        solved = lsq_linear(
            np.vstack([self.columns, choosing]),
            -np.concatenate([self.constant, np.zeros(len(choosing))]),
            bounds=(-largest, largest),
            method="bvls",
        )
        return np.asarray(solved.x)

    def result(self, values: Array) -> ToleranceFit:
        """The fit of the best values."""
        ball, errors = values[self.frame_count : self.frame_count + 3], values[self.frame_count + 3 :]
        is_held = np.abs(errors) >= self.largest
        gives_way = self.moving[:, [True] * self.frame_count + (np.abs(ball) < 1.0).tolist()][is_held]
        rank = int(np.linalg.matrix_rank(gives_way)) if gives_way.size else 0
        holding = int(is_held.sum()) - rank
        # T of a single tolerance exceeds its limit to one side only.
        probability = 2.0 * PROBABILITY if holding <= 1 else PROBABILITY
        residual = self.constant + self.columns @ values
        return ToleranceFit(
            frames=self.frames,
            errors=errors,
            distance=float(residual @ residual),
            limit=chi_square_limit(max(holding, 1), probability),
            pressure=np.where(is_held, np.abs(residual @ self.columns[:, -len(errors) :]), 0.0),
        )


def small_change(change: Array) -> FrameTransform:
    """A change of the frames by a shift, mm, a turn of the base and one of the platform, rad (9,)."""
    shift, base, platform = change.reshape(3, 3)
    return FrameTransform(rotations.from_vector(base), shift, rotations.from_vector(platform))
