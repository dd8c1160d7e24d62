"""Whether a robot can have been built as its drawing allows, and which joint was not.

A shop checks the coordinates of all joints in the frames of the drawing. An identification does not see
these frames: neither where the base's origin is, nor how the platform frame is turned, nor where the ball
was mounted. A geometry is therefore outside the tolerances only if no robot within them, in any frames and
with the ball anywhere allowed, explains it (:mod:`~hexacell.identification.diagnostics.tolerance_fit`).

The joint is named without whose tolerances a robot explains it best; where none alone does, another one is
added, and so on (forward selection). Joints of which each alone explains it as well are named beside it.
Small residuals prove nothing here: legs 13 mm too short can explain data perfectly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hexacell.identification.diagnostics.tolerance_fit import ToleranceFit, ToleranceFitter
from hexacell.identification.problem.problem import Tolerances
from hexacell.identification.solver.result import GeometryEstimate
from hexacell.kinematics.geometry import Geometry
from hexacell.kinematics.mechanism import FrameTransform, Mechanism
from hexacell.kinematics.parameters import ParameterKind
from hexacell.kinematics.rotations import Array

SIGNIFICANT_SIGMAS = 3.0

MOST_TRIED = 12
"""Joints whose tolerances press most, of which each is tried without them."""

Joint = tuple[ParameterKind, int]
"""The numbers of one kind of one leg, counted from 1."""


@dataclass(frozen=True, slots=True)
class ToleranceViolation:
    """A parameter that is outside its tolerance, in mm, or mrad of an angle.

    Attributes:
        change: from the drawing, in the frames and with the ball's offset that suit the robot best.
        unit: ``mm`` or ``mrad``.
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
    """The parameters outside their tolerance in every choice of frames; none of a robot built as drawn.

    Where the estimate is not a number, all of them are outside.

    Args:
        found: the identified geometry, in the mechanism's frame convention.
        mechanism: of both.
        drawing: in the frames in which its tolerances hold.
        tolerances: of the drawing.
    """
    frames = mechanism.normalize_frames(drawing)[1].inverse()
    fitter = ToleranceFitter(mechanism, drawing, tolerances, found.geometry, found.covariance)
    if not np.isfinite(found.geometry.vector).all():
        return _violations(fitter, frames, np.full(len(drawing.vector), np.inf))
    return _Search(fitter).named(fitter.fit(frames))


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """Which joints are out of their tolerances."""

    fitter: ToleranceFitter

    def named(self, inside: ToleranceFit) -> tuple[ToleranceViolation, ...]:
        """Those without whose tolerances there is a robot, ``inside`` being the one within all of them."""
        fit, faults, others = inside, list[Joint](), list[Joint]()
        while fit.is_contradicted:
            tried = {joint: self._without([*faults, joint], fit) for joint in self._pressing(fit)}
            best = min(tried, key=lambda joint: tried[joint].distance)
            others = [] if faults else [joint for joint in tried if joint != best]
            others = [joint for joint in others if _explains_as_well(tried[joint], tried[best])]
            fit, faults = tried[best], [*faults, best]
        rows = self._rows(faults)
        is_outside = np.zeros(len(fit.errors), dtype=bool)
        is_outside[rows] = np.abs(fit.errors[rows]) > 1.0
        instead = tuple(kind.display_name(leg, "") for kind, leg in others)
        return _violations(self.fitter, fit.frames, np.where(is_outside, fit.errors, 0.0), instead)

    def _pressing(self, fit: ToleranceFit) -> list[Joint]:
        """Joints whose tolerances hold the fit, those that hold most first."""
        pressures: dict[Joint, float] = {}
        for parameter, pressure in zip(
            self.fitter.drawing.parameters.parameters, fit.pressure.tolist(), strict=True
        ):
            joint = parameter.kind, parameter.leg
            pressures[joint] = float(np.hypot(pressures.get(joint, 0.0), pressure))
        held = [joint for joint, pressure in pressures.items() if pressure > 0.0]
        return sorted(held, key=lambda joint: -pressures[joint])[:MOST_TRIED]

    def _without(self, joints: list[Joint], near: ToleranceFit) -> ToleranceFit:
        return self.fitter.fit(near.frames, self._rows(joints))

    def _rows(self, joints: list[Joint]) -> list[int]:
        parameters = self.fitter.drawing.parameters.parameters
        return [row for row, one in enumerate(parameters) if (one.kind, one.leg) in joints]


def _explains_as_well(one: ToleranceFit, best: ToleranceFit) -> bool:
    return not one.is_contradicted and one.distance < best.distance + SIGNIFICANT_SIGMAS**2


def _violations(
    fitter: ToleranceFitter, frames: FrameTransform, errors: Array, instead: tuple[str, ...] = ()
) -> tuple[ToleranceViolation, ...]:
    """Of the parameters whose ``errors`` (P,), in units of their tolerances, are not zero."""
    parameters = fitter.drawing.parameters
    sizes = np.array([errors * fitter.widths, fitter.widths, fitter.sigma(frames)]) / parameters.like_a_mm
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
